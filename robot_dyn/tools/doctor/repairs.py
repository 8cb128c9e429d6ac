"""Candidate repairs of an inertia that no mass distribution within its shape can have.

Each candidate undoes one known mistake: two axes exchanged, a sign, the parallel-axis theorem forgotten, a power of ten
or a unit, the six numbers in another order. A candidate is plausible if the result obeys all bounds and lies near the
inertia of a uniform body of the shape. If exactly one candidate is plausible, it is the suspected mistake.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import permutations
from typing import final

import numpy as np

from robot_dyn.tools.doctor.inertia_bounds import Body, matrix

KEYS = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
UNITS = {1e3: "g m²", 1e4: "kg cm²", 1e6: "kg mm²", 1e7: "g cm²", 1e9: "g mm²"}
_SAME = 1e-3  # fraction of the largest moment: candidates this close are one
_POWERS = (-3, -2, -1, 1, 2, 3)
# Orders in which programs write six moments, as places in ixx, ixy, ixz, iyy, iyz, izz
_ORDERS = {
    "ixx, iyy, izz, ixy, ixz, iyz": (0, 3, 5, 1, 2, 4),
    "ixx, iyy, izz, iyz, ixz, ixy": (0, 3, 5, 4, 2, 1),
    "ixx, ixy, iyy, ixz, iyz, izz": (0, 1, 3, 2, 4, 5),
}
_AXES = "xyz"


@final
@dataclass(frozen=True)
class Repair:
    """A candidate: the mistake in words, and new texts of the six moments, or of the mass under the key "value"."""

    mistake: str
    texts: dict[str, str]


def repairs(body: Body, texts: dict[str, str], mass: str) -> tuple[Repair, ...]:
    """Return the plausible repairs of a body; `texts` are its six moments and `mass` its mass, as written."""
    result: list[Repair] = []
    results: list[np.ndarray] = []
    for repair in _candidates(body, texts, mass):
        numbers = {key: float(text) for key, text in (texts | {"value": mass} | repair.texts).items()}
        moments = matrix([numbers[key] for key in KEYS])
        size, new_mass = float(np.abs(moments).max()), numbers["value"]
        if size <= 0 or new_mass <= 0:
            continue
        signature = np.array([*(moments / size).ravel(), np.log(size), np.log(new_mass)])
        repeated = any(np.abs(signature - other).max() < _SAME for other in results)
        if not repeated and replace(body, mass=new_mass, moments=moments).plausible():
            result.append(repair)
            results.append(signature)
    return tuple(result)


def _candidates(body: Body, texts: dict[str, str], mass: str) -> Iterator[Repair]:
    yield from _axes(texts)
    yield from _signs(texts)
    yield from _parallel_axis(body)
    yield from _powers(texts, mass)
    yield from _orders(texts)


def _axes(texts: dict[str, str]) -> Iterator[Repair]:
    places = {(0, 0): "ixx", (0, 1): "ixy", (0, 2): "ixz", (1, 1): "iyy", (1, 2): "iyz", (2, 2): "izz"}
    orders = list(permutations(range(3)))[1:]
    for axes in sorted(orders, key=lambda axes: sum(i != axis for i, axis in enumerate(axes))):  # exchanges first
        fixed = [_AXES[i] for i in range(3) if axes[i] == i]
        turned = [_AXES[i] for i in range(3) if axes[i] != i]
        what = f"the axes {' and '.join(turned)} exchanged" if fixed else "the axes x, y and z in another order"
        moved = {key: texts[places[min(axes[i], axes[j]), max(axes[i], axes[j])]] for (i, j), key in places.items()}
        yield Repair(what, moved)


def _signs(texts: dict[str, str]) -> Iterator[Repair]:
    for key in ("ixy", "ixz", "iyz"):
        if float(texts[key]):
            text = texts[key].strip()
            yield Repair(f"a wrong sign of {key}", {key: text[1:] if text[0] == "-" else f"-{text.lstrip('+')}"})


def _parallel_axis(body: Body) -> Iterator[Repair]:
    d = body.origin
    if d.any():
        numbers = (body.moments - body.mass * (d @ d * np.eye(3) - np.outer(d, d)))[np.triu_indices(3)]
        what = "moments about the origin of the link instead of the centre of mass"
        yield Repair(what, {key: f"{x:.8g}" for key, x in zip(KEYS, numbers, strict=True)})


def _powers(texts: dict[str, str], mass: str) -> Iterator[Repair]:
    for power in (*_POWERS, -4, -6, -7, -9):
        unit = UNITS.get(10.0**-power)
        what = f"moments in {unit}" if unit else f"moments {_times(power)} too {_size(power)}"
        yield Repair(what, {key: scaled(texts[key], power) for key in KEYS})
    for power in _POWERS:
        what = "a mass in g" if power == -3 else f"a mass {_times(power)} too {_size(power)}"
        yield Repair(what, {"value": scaled(mass, power)})


def _times(power: int) -> str:
    return f"{10 ** abs(power)} times"


def _size(power: int) -> str:
    return "small" if power > 0 else "large"


def _orders(texts: dict[str, str]) -> Iterator[Repair]:
    for order, places in _ORDERS.items():
        moved = {KEYS[place]: texts[key] for place, key in zip(places, KEYS, strict=True)}
        yield Repair(f"moments written in the order {order}", moved)


def scaled(text: str, power: int) -> str:
    """Return a literal times a power of ten, digit by digit."""
    mantissa, _, exponent = text.strip().lower().partition("e")
    return f"{mantissa}e{int(exponent or 0) + power}"
