"""The control of a setup in words: its law, parts, models and references."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from robot_dyn.control.controller import Controller
from robot_dyn.control.digital_loop.loop import SIGNALS, Loop
from robot_dyn.control.reference import Reference
from robot_dyn.effects.explanation import as_they_act, edit_terms


def law(controller: Controller) -> str:
    """The control law in short form."""
    return controller.term or f"{controller.name}(t, q, v, z)"


def pace(period_s: float) -> str:
    """How often a controller acts."""
    return f"every {period_s:g} s, constant between" if period_s else "continuously"


def control_lines(controller: Controller, dynamics: Any) -> Iterator[str]:
    """A controller and its parts, line by line."""
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
