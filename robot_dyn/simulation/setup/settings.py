"""The settings of a run by name, as exact texts: effects and controller with their numbers, reference, method."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from robot_dyn.control.reference import PiecewisePolynomial, Reference
from robot_dyn.description.edits import Edits, Payload
from robot_dyn.foundations.coefficients import declared
from robot_dyn.integrate.adaptive import Adaptive
from robot_dyn.queries.units import coefficient_unit
from robot_dyn.simulation.setup.explanation import pace

if TYPE_CHECKING:
    from robot_dyn.control.controller import Controller
    from robot_dyn.simulation.setup.setup import Setup

_MOST = 64  # entries of the longest array that is written out; a longer one is written as a digest

Setting = tuple[str, str]  # name and value


def settings_of(setup: Setup) -> dict[str, str]:
    """Return the settings of a run by name, except its start; `float` restores each number exactly.

    Names are those of sweeps, for example "control.kp". If a name occurs several times, the later ones
    are numbered. The value of a part that is not a number, text or reference is its class.
    """
    settings: dict[str, str] = {}
    for name, value in _all(setup):
        number, unique = 1, name
        while unique in settings:
            number += 1
            unique = f"{name} ({number})"
        settings[unique] = value
    return settings


def _all(setup: Setup) -> Iterator[Setting]:
    robot = getattr(setup.plant.dynamics, "robot", setup.plant.dynamics)
    types = getattr(robot, "joint_types", (None,))
    yield from edits_by_name(robot)
    for effect in setup.plant.effects:
        yield effect.name, type(effect).__name__
        yield from _numbers(effect.name, effect, types)
    if setup.controller is not None:
        yield from _of_controller(setup.controller, types)
    method = setup.method
    yield "method", method.name
    if isinstance(method, Adaptive):
        yield from (("rtol", _number(method.rtol)), ("atol", _number(method.atol)))
    else:
        yield "step", f"{_number(setup.nominal_step_s)} s"
    yield from (("event", event.name) for event in setup.events)


def edits_by_name(robot: object) -> Iterator[Setting]:
    """Yield the edits of a robot; nothing if it has none."""
    edits: Edits | None = getattr(robot, "edits", None)
    if edits is None:
        return
    yield "gravity", f"{_text(np.array(edits.gravity))} m/s²"
    for payload in edits.payloads:
        yield f"payload on {payload.frame}", _payload(payload)
    yield "mass_scale", _text(edits.mass_scale)
    for key in ("lock", "armature", "mass_scales", "masses", "inertias"):
        yield from ((f"{key}.{name}", _text(np.array(value))) for name, value in getattr(edits, key))


def _of_controller(controller: Controller, types: Any) -> Iterator[Setting]:
    yield "control", f"{controller.name}, {pace(controller.period_s)}"
    yield from _numbers("control", controller, types)
    for path, _, part in controller.parts:
        yield f"control.{path}", part.name
        yield from _numbers(f"control.{path}", part, types)
    for path, model in controller.models.items():
        robot = getattr(model, "robot", model)
        yield f"control.{path}", getattr(robot, "name", type(robot).__name__)
        yield from ((f"control.{path}.{name}", value) for name, value in edits_by_name(robot))
    for path, reference in controller.references.items():
        yield path if path == "reference" else f"control.{path}", _motion(reference)


def _numbers(name: str, part: Any, types: Any) -> Iterator[Setting]:
    """Yield the numbers and texts of a part; declared coefficients with their units."""
    names = [field.name for field in fields(part)] if is_dataclass(part) else list(vars(part))
    coefficients = declared(type(part))
    for key in names:
        value = getattr(part, key)
        if isinstance(value, Payload):
            yield f"{name}.{key} on {value.frame}", _payload(value)
        if key.startswith("_") or key == "period_s" or not _is_plain(value):
            continue
        unit = coefficient_unit(coefficients[key], types) if key in coefficients and not isinstance(value, str) else ""
        yield f"{name}.{key}", f"{_text(value)} {unit}".rstrip()


def _payload(payload: Payload) -> str:
    inertia = np.array(payload.inertia)
    rotation = f", inertia {_text(inertia)} kg m²" if inertia.any() else ""
    place = f" at {', '.join(map(_number, payload.com))} m" if any(payload.com) else ""
    return f"{_number(payload.mass)} kg{place}{rotation}"


def _is_plain(value: Any) -> bool:
    """Return True for a text, a number, or a sequence of numbers."""
    if isinstance(value, tuple | list):
        return bool(value) and all(isinstance(x, float | int) for x in value)
    return isinstance(value, np.ndarray | np.number | float | int | str)


def _text(value: Any) -> str:
    """Format a text, a number or an array; equal entries of a vector are written once."""
    if isinstance(value, str | int):
        return str(value)
    numbers = np.asarray(value, dtype=float)
    entries = [_number(x) for x in numbers.flat]
    if numbers.ndim <= 1 and len(set(entries)) == 1:
        return entries[0]
    return ", ".join(entries) if len(entries) <= _MOST else f"{len(entries)} numbers, {_digest(numbers)}"


def _number(x: float) -> str:
    """Return the text that `float` reads as x, without a trailing ".0"."""
    return repr(float(x)).removesuffix(".0")


def _motion(reference: Reference) -> str:
    """Return the class of a reference, its end, and a digest of its numbers."""
    parts = reference.polynomials.values()
    attributes = [x for part in (reference, *parts) for x in vars(part).values()]
    numbers = [np.asarray(x, dtype=float) for x in attributes if isinstance(x, np.ndarray)]
    ends = [part.end_s for part in parts if isinstance(part, PiecewisePolynomial)]
    until = f", to {max(ends):g} s" if ends else ""
    return f"{type(reference).__name__}{until}, numbers {_digest(*numbers)}"


def _digest(*numbers: np.ndarray) -> str:
    return hashlib.sha256(b"".join(np.ascontiguousarray(x).tobytes() for x in numbers)).hexdigest()[:8]
