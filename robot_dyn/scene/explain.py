"""Explanations: the equation term by term, effects that are not simulated, and the source of each number of a scene."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from robot_dyn.control.digital_loop.loop import LINES, Loop
from robot_dyn.effects.explanation import (
    EDITED,
    Explanation,
    Number,
    Term,
    acting_coefficients,
    edit_terms,
    explanation,
    term_of,
)
from robot_dyn.effects.plant import Plant
from robot_dyn.foundations.coefficients import URDF
from robot_dyn.foundations.errors import RobotDynError
from robot_dyn.integrate.adaptive import ADAPTIVE
from robot_dyn.queries.dynamics import Dynamics
from robot_dyn.scene.control import BLOCKS, Control
from robot_dyn.scene.effects import BY_KIND, Acting, Edit
from robot_dyn.scene.scene import Scene, read_both
from robot_dyn.scene.schema import Part, kinds_of
from robot_dyn.simulation.dynamics.state_equation import StateEquation
from robot_dyn.simulation.results.provenance import edits_of_machine_code
from robot_dyn.simulation.setup.explanation import model_lines, pace, span
from robot_dyn.simulation.setup.setup import Setup, explanation_of, shortened

OF_FILE = "the robot's file"
_DELAYS = "measurement_delay_periods", "actuation_delay_periods"


def explain(system: Setup | Plant | Dynamics | str | Path) -> Explanation:
    """Explain the equation of motion: its terms, the effects with their coefficients, and effects not simulated.

    The `repr` of the result is the text that `robot-dyn explain` prints, and `to_json()` returns the document of
    `robot-dyn explain --json`. For a scene file both include the source of each number.

    Args:
        system: A setup, a plant, a robot, or the path of a scene file.

    Raises:
        SceneError: If the scene cannot be read.
        EffectError: If the argument is none of these.
    """
    if isinstance(system, str | Path):
        return of_scene(*read_both(system))
    if isinstance(system, Setup):
        return _complete(explanation_of(system), system.plant, system)
    plant = system if isinstance(system, Plant) else Plant(system)
    return _complete(explanation(plant.dynamics, plant.effects), plant, None)


def of_scene(scene: Scene, setup: Setup) -> Explanation:
    """Explain a scene, with the source of each number."""
    plain, control = explanation_of(setup), scene.control
    return replace(
        _complete(plain, setup.plant, setup, None if control is None else control.kind),
        robot=scene.robot,
        effects=tuple(_terms(scene, setup)),
        absent=_absent({effect.kind for effect in scene.effect}),
        absent_of_control=() if control is None else tuple(_ideal(control)),
        control=() if control is None else tuple(_control(scene, control, setup)),
        method=tuple(_method(scene, setup)),
    )


def _complete(plain: Explanation, plant: Plant, setup: Setup | None, kind: str | None = None) -> Explanation:
    """Add absent effects, and the instructions of machine code, to an explanation."""
    absent = _absent({effect.kind for effect in plain.effects})
    code = (*_machine_code(plant, setup), *(() if setup is None else _of_tick(setup, kind)))
    return replace(plain, absent=absent, machine_code=code)


def _absent(named: set[str]) -> tuple[str, ...]:
    return tuple(kind for kind in BY_KIND if kind not in named)


def _terms(scene: Scene, setup: Setup) -> Iterator[Term]:
    """Yield the edits and effects of a scene, in its order."""
    effects, robot = iter(setup.plant.effects), setup.plant.dynamics
    edited = {term.kind: term.coefficients for term in edit_terms(robot.edits)}  # pyright: ignore
    for effect in scene.effect:
        parts = list(islice(effects, len(effect.build(robot)))) if isinstance(effect, Acting) else []  # pyright: ignore
        numbers, acting = _numbers(effect), acting_coefficients(parts, robot)
        if isinstance(effect, Edit) and any(number.source == OF_FILE for number in numbers):
            acting = edited.get(effect.kind, ())
        yield Term(effect.kind, term_of(parts) if parts else EDITED[effect.kind], numbers, acting)


def _control(scene: Scene, control: Control, setup: Setup) -> Iterator[str]:
    yield f"control: {control.kind}, {pace(control.period_s)}"
    yield from _lines(control, "  ")
    for line, block in control.blocks:
        yield f"  {line}: {block.kind}, {block.factory.term}"
        yield from _lines(block, "    ")
    spans: list[str] = []
    if setup.controller is not None:
        yield from model_lines(setup.controller, setup.plant.dynamics)
        spans = [span(reference) for reference in setup.controller.references.values()]
    yield ", ".join([f"reference: {scene.reference.kind}", *dict.fromkeys(spans)])
    yield from _lines(scene.reference, "  ")


def _method(scene: Scene, setup: Setup) -> Iterator[str]:
    method, used = scene.method, ("rtol", "atol") if scene.method in ADAPTIVE else ("step_s",)
    if scene.accuracy is not None:
        method, used = f"chosen for an error of q of at most {scene.accuracy:g}", ("accuracy",)
    yield f"method: {method}, {scene.duration_s:g} s"
    for key in (*used, "record_every_s", "estimate_error", "engine"):
        note = shortened(setup) if key == "step_s" else ""
        yield f"  {key} = {getattr(scene, key)}  ({_source(scene, key)}){note}"
    yield "start:"
    yield from _lines(scene.start, "  ")


def _machine_code(plant: Plant, setup: Setup | None) -> Iterator[str]:
    """Yield lines on the instructions of the compiled right-hand side, by effect."""
    from robot_dyn.codegen.plant import compiled

    try:
        machine_code = compiled(StateEquation(plant, None).in_a_mode.plant)
        by_effect, trace = machine_code.instructions_by_effect, machine_code.engine.traces["forward_dynamics"]
    except RobotDynError as error:
        yield f"machine code: none, {error}"
        return
    whole = trace.counts[trace.formulation]
    parts = ", ".join(f"{name} {count}" for name, count in by_effect.items()) or "none"
    yield f"machine code of the acceleration, by the {trace.formulation}: {whole} instructions; of effects: {parts}"
    if setup is not None and (edits := edits_of_machine_code(setup)):
        yield f"  edited there: {edits['right_angles']}"


def _of_tick(setup: Setup, kind: str | None) -> Iterator[str]:
    """Yield a line on the instructions of a tick, and of the controller inside a loop."""
    from robot_dyn.simulation.compiled.cache import machine_code

    inside: Any = setup.controller
    if inside is None or not inside.period_s:
        return
    inside = inside.controller if isinstance(inside, Loop) else inside
    try:
        counts = [
            len(machine_code(StateEquation(setup.plant, controller)).code.programs["tick"])
            for controller in dict.fromkeys((setup.controller, inside))
        ]
    except RobotDynError:  # reported with the acceleration, or the run is interpreted
        return
    more = f"; {kind or inside.name} alone takes {counts[1]}" if len(counts) > 1 else ""
    yield f"machine code of a tick of the control: {counts[0]} instructions{more}"


def _ideal(control: Control) -> list[str]:
    """Return the features of a digital loop that this control does not have."""
    delays = [key for key in _DELAYS if not getattr(control, key)]
    named = {block.kind for _, block in control.blocks}
    kinds = dict.fromkeys(kind for parts in BLOCKS.values() for part in parts for kind in kinds_of(part))
    return [*delays, *(kind for kind in kinds if kind not in named)]


def _lines(part: Part, indent: str) -> Iterator[str]:
    return (f"{indent}{number.key} = {number.value}  ({number.source})" for number in _numbers(part))


def _numbers(part: Part) -> tuple[Number, ...]:
    unused = {*part.unused, *LINES} if isinstance(part, Control) else ()
    return tuple(
        Number(key, _shown(getattr(part, key)), _source(part, key))
        for key in type(part).model_fields
        if key != "kind" and getattr(part, key) not in (None, ()) and key not in unused
    )


def _source(part: Part, key: str) -> str:
    if getattr(part, key) == URDF:
        return OF_FILE
    return "scene" if key in part.model_fields_set else "default"


def _shown(value: Any) -> str:
    if isinstance(value, Part):
        stated = {key: getattr(value, key) for key in type(value).model_fields if getattr(value, key) is not None}
        return "{" + ", ".join(f"{key} = {_shown(x)}" for key, x in stated.items()) + "}"
    return np.array2string(value, precision=6) if isinstance(value, np.ndarray) else str(value)
