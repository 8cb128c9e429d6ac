"""Explanation of a scene: its equation term by term, what is not simulated, and the source of each number."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from itertools import islice
from typing import Any

import numpy as np

from robot_dyn.coefficients import URDF
from robot_dyn.control.digital_loop.loop import LINES
from robot_dyn.effects.actuator import ActuatorLag, EffortLimit
from robot_dyn.effects.effect import Effect
from robot_dyn.errors import RobotDynError
from robot_dyn.integrate.adaptive import ADAPTIVE
from robot_dyn.queries.units import coefficient_texts
from robot_dyn.scene.control import BLOCKS, LAWS, Control
from robot_dyn.scene.declared import Declared
from robot_dyn.scene.effects import BY_KIND, Acting, Body, Edit
from robot_dyn.scene.scene import Scene
from robot_dyn.scene.schema import Part, kinds_of
from robot_dyn.simulation.dynamics.state_equation import StateEquation
from robot_dyn.simulation.results.provenance import edits_of_machine_code
from robot_dyn.simulation.setup.setup import Setup

_BOUNDS = [
    kind for kind, part in BY_KIND.items() if issubclass(part, Declared) and part.factory in (EffortLimit, ActuatorLag)
]
_NO_FORCES = [*_BOUNDS, *(kind for kind, part in BY_KIND.items() if issubclass(part, Edit | Body))]
_DELAYS = "measurement_delay_periods", "actuation_delay_periods"


def explain(scene: Scene, setup: Setup) -> Iterator[str]:
    """Yield the explanation, line by line."""
    named = {effect.kind for effect in scene.effect}
    forces = [kind for kind in BY_KIND if kind in named and kind not in _NO_FORCES]
    gravity = ["∂V/∂q"] if "gravity" in named else []
    N = " ".join([*gravity, *(f"− τ_{kind}" for kind in forces)]).removeprefix("− ") or "0"
    N = f"−{N}" if not gravity and forces else N
    n, names = setup.plant.dynamics.n, setup.plant.dynamics.joint_names
    yield f"{scene.robot}: {n} joint{'s' if n > 1 else ''}, {', '.join(names)}"
    yield ""
    yield "    M(q) a + C(q, v) v + N = u"
    yield f"    N = {N}"
    slow = "" if scene.control is None or scene.control.slow is None else " + u_slow"
    yield f"    u = {'0' if scene.control is None else LAWS[scene.control.kind].removeprefix('u = ')}{slow}"
    yield ""
    yield "effects:" if scene.effect else "effects: none"
    effects = iter(setup.plant.effects)
    for effect in scene.effect:
        yield f"  {effect.kind}: {BY_KIND[effect.kind].term}"
        yield from _numbers(effect, "    ")
        if isinstance(effect, Acting):
            yield from _as_it_acts(islice(effects, len(effect.build(setup.plant.dynamics))), setup)  # pyright: ignore
    yield ""
    yield "not simulated, since the scene does not name it:"
    yield f"  {', '.join(kind for kind in BY_KIND if kind not in named)}"
    if scene.control is not None and (ideal := _ideal(scene.control)):
        yield f"  of the control: {', '.join(ideal)}"
    if scene.control is not None:
        every = f"every {scene.control.period_s:g} s, constant between" if scene.control.period_s else "continuously"
        yield ""
        yield f"control: {scene.control.kind}, {every}"
        yield from _numbers(scene.control, "  ")
        yield from _blocks(scene.control)
        yield f"reference: {scene.reference.kind}"
        yield from _numbers(scene.reference, "  ")
    method, used = scene.method, ("rtol", "atol") if scene.method in ADAPTIVE else ("step_s",)
    if scene.accuracy is not None:
        method, used = f"chosen for an error of q of at most {scene.accuracy:g}", ("accuracy",)
    yield ""
    yield f"method: {method}, {scene.duration_s:g} s"
    for key in (*used, "record_period_s", "estimate_error", "engine"):
        yield f"  {key} = {getattr(scene, key)}  ({_source(scene, key)})"
    yield "start:"
    yield from _numbers(scene.start, "  ")
    yield from _machine_code(setup)
    if scene.control is not None and scene.control.period_s:
        yield from _of_tick(scene.control, setup)
    yield ""
    yield f"the file of the robot: {setup.plant.dynamics.description.source}"  # pyright: ignore[reportAttributeAccessIssue]


def _machine_code(setup: Setup) -> Iterator[str]:
    """Instructions of the compiled right-hand side, by effect."""
    from robot_dyn.codegen.plant import Compiled

    try:
        compiled: Any = Compiled(StateEquation(setup.plant, None).in_a_mode.plant)
        by_effect, which = compiled.instructions_by_effect, compiled.engine.traces["forward_dynamics"]
    except RobotDynError as error:
        yield ""
        yield f"machine code: none, {error}"
        return
    whole = which.counts[which.formulation]
    parts = ", ".join(f"{name} {count}" for name, count in by_effect.items()) or "none"
    yield ""
    yield f"machine code of the acceleration, by the {which.formulation}: {whole} instructions; of effects: {parts}"
    if edits := edits_of_machine_code(setup):
        yield f"  edited there: {edits['right_angles']}"


def _of_tick(control: Control, setup: Setup) -> Iterator[str]:
    """Instructions of a tick, and those of the first controller alone."""
    from robot_dyn.simulation.compiled.build import compiled_equation

    controller: Any = setup.controller
    inside: Any = controller.controller if control.loops else controller
    inside = inside if control.slow is None else inside.fast
    try:
        counts = [
            len(compiled_equation(StateEquation(setup.plant, each).in_a_mode, None).functions.programs["tick"])
            for each in dict.fromkeys((controller, inside))
        ]
    except RobotDynError:  # the reason is given with the acceleration, or the run is interpreted
        return
    more = f"; {control.kind} alone takes {counts[1]}" if len(counts) > 1 else ""
    yield f"machine code of a tick of the control: {counts[0]} instructions{more}"


def _ideal(control: Control) -> list[str]:
    """What a digital loop can have and this one does not."""
    delays = [key.removesuffix("_periods") for key in _DELAYS if not getattr(control, key)]
    named = {block.kind for _, block in control.blocks}
    kinds = dict.fromkeys(kind for parts in BLOCKS.values() for part in parts for kind in kinds_of(part))
    return [*delays, *(kind for kind in kinds if kind not in named)]


def _blocks(control: Control) -> Iterator[str]:
    """The blocks of the loop of a controller, line by line."""
    for line, block in control.blocks:
        yield f"  {line}: {block.kind}, {block.factory.term}"
        yield from _numbers(block, "    ")


def _as_it_acts(effects: Iterable[Effect], setup: Setup) -> Iterator[str]:
    """Coefficients of the parts of an effect as they act, with units."""
    dynamics: Any = setup.plant.dynamics
    values = {
        name: text for effect in effects for name, text in coefficient_texts(effect, dynamics.joint_types).items()
    }
    if values:
        yield f"    as it acts: {'; '.join(values.values())}"


def _numbers(part: Part, indent: str) -> Iterator[str]:
    unused = {*part.unused, *LINES} if isinstance(part, Control) else ()
    for key in type(part).model_fields:
        if key != "kind" and getattr(part, key) not in (None, ()) and key not in unused:
            yield f"{indent}{key} = {_shown(getattr(part, key))}  ({_source(part, key)})"


def _source(part: Part, key: str) -> str:
    if getattr(part, key) == URDF:
        return "the robot's file"
    return "scene" if key in part.model_fields_set else "default"


def _shown(value: Any) -> str:
    if isinstance(value, Part):
        stated = {key: getattr(value, key) for key in type(value).model_fields if getattr(value, key) is not None}
        return "{" + ", ".join(f"{key} = {_shown(each)}" for key, each in stated.items()) + "}"
    return np.array2string(value, precision=6) if isinstance(value, np.ndarray) else str(value)
