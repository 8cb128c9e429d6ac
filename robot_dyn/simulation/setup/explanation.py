"""The control of a setup in words: law, parts, models and references."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from robot_dyn.control.controller import Controller
from robot_dyn.control.digital_loop.loop import SIGNALS, Loop
from robot_dyn.control.reference import Reference
from robot_dyn.effects.explanation import acting_coefficients, edit_terms
from robot_dyn.queries.dynamics import Dynamics


def law(controller: Controller) -> str:
    """Return the control law in short form."""
    return controller.term or f"{controller.name}(t, q, v, z)"


def pace(period_s: float) -> str:
    """Return the words for the period of a controller: continuous for 0 s."""
    return f"every {period_s:g} s, constant between" if period_s else "continuously"


def control_lines(controller: Controller, dynamics: Dynamics) -> Iterator[str]:
    """Yield the lines about a controller, its parts, its models and its references."""
    inside = controller.controller if isinstance(controller, Loop) else controller
    yield f"control: {inside.name}, {pace(controller.period_s)}"
    yield from (f"  {text}" for text in acting_coefficients([inside], dynamics))
    if isinstance(controller, Loop):
        for name in ("measurement_delay_periods", "actuation_delay_periods"):
            yield f"  {name} = {getattr(controller, name):g}"
    for path, _, part in controller.parts:
        if part is not inside:
            line = path.removeprefix("controller.").partition(".")[0]
            texts = acting_coefficients([part], dynamics, SIGNALS.get(line, ""))
            yield f"  {line}: {'; '.join((f'{part.name}, {part.term}' if part.term else part.name, *texts))}"
    yield from model_lines(controller, dynamics)
    yield from (f"reference: {type(x).__name__}, {span(x)}" for x in controller.references.values())


def model_lines(controller: Controller, dynamics: Dynamics) -> Iterator[str]:
    """Yield a line for each model of the arm in a controller, with the edits in which it differs from the plant."""
    for path, model in controller.models.items():
        more, less = (list(dict.fromkeys(x)) for x in _differing_edits(model, dynamics))
        differ = [*more, *(f"without {text}" for text in less)]
        where = "".join(f" of {part}" for part in [path.rpartition(".")[0]] if part)
        name = getattr(model, "name", type(model).__name__)
        yield f"model{where}: {', '.join([name, *(differ or ['as the plant'])])}"


def _differing_edits(model: Any, dynamics: Any) -> tuple[list[str], list[str]]:
    """Return the edits that only the model has, and those that only the robot of the plant has."""
    model, plant = (getattr(x, "robot", x) for x in (model, dynamics))
    if not (hasattr(model, "edits") and hasattr(plant, "edits")):
        return ([], []) if model is plant else (["not a robot of a file"], [])
    in_model, in_plant = (
        [f"{term.kind} {text}" for term in edit_terms(robot.edits) for text in term.coefficients]
        for robot in (model, plant)
    )
    more, less = [x for x in in_model if x not in in_plant], [x for x in in_plant if x not in in_model]
    if model.description.source != plant.description.source:
        more.insert(0, "of another file")
    elif not more and not less and model.edits != plant.edits:
        more.append("other inertias")
    return more, less


def span(reference: Reference) -> str:
    """Return the start, the end and the duration of a reference, in words."""
    pieces = reference.polynomials.values()
    start, end = min(piece.start_s for piece in pieces), max(piece.end_s for piece in pieces)
    return f"{start:g} to {end:g} s, {end - start:g} s long" if end > start else "constant"
