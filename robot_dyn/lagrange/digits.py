"""Correct digits of an answer: its distance from true values in balls, −log10(error).

An error is relative to the scale of the answer, in the units √M_ii of the joints (`lagrange.exact`). Before digits are
counted it is estimated, as 8 n u κ times the ratio of the terms of the answer to the answer (`lagrange.magnitude`).
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from math import log10
from typing import TYPE_CHECKING, Any

import numpy as np

from robot_dyn.foundations.errors import QueryError
from robot_dyn.foundations.validate import choice, shaped
from robot_dyn.lagrange.exact import RESOLUTION, Exact, entry_units
from robot_dyn.lagrange.lagrangian import Lagrangian
from robot_dyn.lagrange.magnitude import magnitudes
from robot_dyn.lagrange.scale import acceleration_norm, solved_norm, solved_tolerance
from robot_dyn.queries.dynamics import QUANTITIES as QUERIES
from robot_dyn.queries.quantity import MOST_DIGITS, Quantity

if TYPE_CHECKING:
    from robot_dyn.model.robot import Robot

QUANTITIES = {name: quantity for name, quantity in QUERIES.items() if quantity.digits}

_COUNTED = 64  # joints; balls of more take many seconds

_exact = lru_cache(maxsize=8)(Exact)
_lagrangian = lru_cache(maxsize=8)(Lagrangian)


@lru_cache(maxsize=8)
def _quiet(robot: Robot) -> Robot:
    """The robot without warnings."""
    return robot.warn_below(None)


def digits_of(error: float) -> float:
    """Decimal digits that an error leaves, from 0 to 20."""
    return min(max(-log10(max(error, RESOLUTION)), 0.0), float(MOST_DIGITS)) if error == error else 0.0


def digits(robot: Robot, quantity: str, state: tuple[Any, ...]) -> float:
    """See `Robot.digits`."""
    requested = QUANTITIES[choice("quantity", quantity, QUANTITIES)]
    if len(state) != len(requested.arguments):
        raise QueryError(f"digits of {requested.name} take {', '.join(requested.arguments)}; got {len(state)} of them")
    arrays = {
        name: np.array(shaped(name, x, robot.joint_names), float)
        for name, x in zip(requested.arguments, state, strict=True)
    }
    for name, x in arrays.items():
        if x.ndim != 1:
            raise QueryError(f"digits are counted at one state: {name} must have shape ({robot.n},), got {x.shape}")
    return _counted(_quiet(robot), requested, arrays)


def doubt(robot: Robot, quantity: str, state: Sequence[Any], answer: Any, least: float | None) -> str:
    """The warning about answers (..., *shape) that have fewer digits than `least`; "" if they have them.

    Digits are counted only where the estimate is below that, at the worst state; for more than 64 joints the estimate
    is reported.
    """
    requested, quiet = QUANTITIES.get(quantity), _quiet(robot)
    if requested is None or least is None:
        return ""
    answers = np.asarray(answer)
    arrays = {name: shaped(name, x, robot.joint_names) for name, x in zip(requested.arguments, state, strict=True)}
    batch = answers.shape[: answers.ndim - len(requested.axes)]
    rows = [
        ({name: np.broadcast_to(x, (*batch, robot.n))[k] for name, x in arrays.items()}, answers[k])
        for k in np.ndindex(batch)
    ]
    bounds = [_bound(quiet, requested, state, answer) if np.isfinite(answer).all() else 0.0 for state, answer in rows]
    if not bounds or digits_of(max(bounds)) >= least:
        return ""
    worst = int(np.argmax(bounds))
    counts = robot.n <= _COUNTED
    held = _counted(quiet, requested, rows[worst][0]) if counts else digits_of(bounds[worst])
    if held >= least:
        return ""
    where = f" in row {worst} of the batch" if batch else ""
    has = "has" if counts else "is only certain to have"
    return (
        f"{quantity} of {robot.name} {has} {held:.1f} digits{where}, fewer than {least:g}; use"
        " rd.Lagrangian(robot, np.longdouble), or rd.accuracy.Ball(bits) for digits that are proven"
    )


def _bound(robot: Robot, quantity: Quantity, state: dict[str, np.ndarray], answer: np.ndarray) -> float:
    """An estimate of the error from above."""
    inertia, least = robot.M(state["q"]), 8 * robot.n * float(np.finfo(float).eps) / 2
    if quantity.definite:
        return least
    absolute = {name: np.abs(x) for name, x in state.items()}
    terms = np.asarray(quantity.terms(magnitudes(_lagrangian(robot).linkage, state["q"]), absolute))
    if quantity.solves:
        torques = (state["tau"], robot.coriolis_torque(state["q"], state["v"]), robot.N(state["q"]))
        more = acceleration_norm(inertia, torques, terms) / max(float(solved_norm(inertia, torques)), 1e-300)
        return solved_tolerance(0.0, inertia) * more
    units = entry_units(quantity, inertia)
    return least * float(np.max(terms / units)) / max(float(np.max(np.abs(answer) / units)), 1e-300)


def _counted(robot: Robot, quantity: Quantity, state: dict[str, np.ndarray]) -> float:
    return digits_of(_exact(robot).at(quantity, state).error(quantity.ask(robot, state)))
