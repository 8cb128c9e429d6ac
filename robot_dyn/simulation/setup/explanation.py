"""What a setup integrates, in words: the equation of motion with its control law, what acts, method and start."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from robot_dyn.control.controller import Controller
from robot_dyn.control.digital_loop.loop import SIGNALS, Loop
from robot_dyn.control.reference import Reference
from robot_dyn.effects.explanation import Explanation, as_they_act, edit_terms, explanation
from robot_dyn.queries.units import joint_units

if TYPE_CHECKING:
    from robot_dyn.simulation.setup.setup import Setup


def explanation_of(setup: Setup) -> Explanation:
    """The equation of motion of a setup, with its control, method and start."""
    plant, controller = explanation(setup.plant), setup.controller
    return replace(
        plant,
        equation=(*plant.equation, f"u = {'0' if controller is None else law(controller)}"),
        control=() if controller is None else tuple(_control(controller, setup.plant.dynamics)),
        method=tuple(_method(setup)),
    )


def law(controller: Controller) -> str:
    """The control law in short form."""
    return controller.term or f"{controller.name}(t, q, v, z)"


def pace(period_s: float) -> str:
    """How often a controller acts."""
    return f"every {period_s:g} s, constant between" if period_s else "continuously"


def _control(controller: Controller, dynamics: Any) -> Iterator[str]:
    inside = controller.controller if isinstance(controller, Loop) else controller
    yield f"control: {inside.name}, {pace(controller.period_s)}"
    yield from (f"  {text}" for text in as_they_act([inside], dynamics))
    if isinstance(controller, Loop):
        for name in ("measurement_delay", "actuation_delay"):
            yield f"  {name} = {getattr(controller, name):g} periods"
    for path, _, part in controller.parts:
        if part is not inside:
            line = path.removeprefix("controller.").partition(".")[0]
            texts = as_they_act([part], dynamics, SIGNALS.get(line, ""))
            yield f"  {line}: {'; '.join((f'{part.name}, {part.term}' if part.term else part.name, *texts))}"
    yield from model_lines(controller, dynamics)
    yield from (f"reference: {type(each).__name__}, {span(each)}" for each in controller.references.values())


def model_lines(controller: Controller, dynamics: Any) -> Iterator[str]:
    """The models of the arm that a controller has, each with the edits in which it differs from the plant."""
    for path, model in controller.models.items():
        more, less = (list(dict.fromkeys(x)) for x in _differing_edits(model, dynamics))
        differ = [*more, *(f"without {text}" for text in less)]
        where = "".join(f" of {part}" for part in [path.rpartition(".")[0]] if part)
        name = getattr(model, "name", type(model).__name__)
        yield f"model{where}: {', '.join([name, *(differ or ['as the plant'])])}"


def _differing_edits(model: Any, dynamics: Any) -> tuple[list[str], list[str]]:
    """Edits that the model has and the robot of the plant has not, and the reverse."""
    model, plant = (getattr(each, "robot", each) for each in (model, dynamics))
    if not (hasattr(model, "edits") and hasattr(plant, "edits")):
        return ([], []) if model is plant else (["not a robot of a file"], [])
    own, others = (
        [f"{term.kind} {text}" for term in edit_terms(each.edits) for text in term.coefficients]
        for each in (model, plant)
    )
    more, less = [x for x in own if x not in others], [x for x in others if x not in own]
    if model.description.source != plant.description.source:
        more.insert(0, "of another file")
    elif not more and not less and model.edits != plant.edits:
        more.append("other inertias")
    return more, less


def span(reference: Reference) -> str:
    """When a reference begins and ends, and its duration."""
    pieces = reference.polynomials.values()
    start, end = min(each.start for each in pieces), max(each.end for each in pieces)
    return f"{start:g} to {end:g} s, {end - start:g} s long" if end > start else "constant"


def shortened(setup: Setup) -> str:
    """The longest step that a method of fixed step takes, if that is not its own; else empty."""
    taken = setup.taken_step_s
    if taken >= setup.nominal_step_s * (1 - 1e-9):
        return ""
    return f", in fact {taken:.6g} at most: steps end at samples, ticks and switches"


def _method(setup: Setup) -> Iterator[str]:
    method: Any = setup.integrator
    name: str = method.name
    used: dict[str, Any] = {}
    if setup.accuracy is not None:
        name = f"chosen for an error of q of at most {setup.accuracy:g}"
    elif method.controls_error:
        used = {"rtol": method.rtol, "atol": method.atol}
    else:
        used = {"step_s": f"{setup.nominal_step_s}{shortened(setup)}"}
    yield f"method: {name}, {setup.duration_s:g} s"
    used |= {key: getattr(setup, key) for key in ("record_period_s", "estimate_error", "engine")}
    yield from (f"  {key} = {value}" for key, value in used.items())
    yield "start:"
    types = getattr(setup.plant.dynamics, "joint_types", (None,) * len(setup.q0))
    for key, values in (("q", setup.q0), ("v", setup.v0)):
        numbers = ", ".join(f"{x:.6g}" for x in values) if values.any() else "0"
        yield f"  {key} = {numbers} {joint_units(key, types)}"
