"""Correct digits of an answer, −log10(error), counted against true values in balls.

An error is relative to the scale of the answer, in the units √M_ii of the joints (`lagrange.exact`). Before digits are
counted, the error is estimated as 8 n u κ times the ratio of the answer's terms to the answer (`lagrange.magnitude`).
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass, replace
from functools import lru_cache
from math import log10
from typing import final

import numpy as np
from numpy.typing import ArrayLike

from robot_dyn.foundations.errors import PrecisionWarning, QueryError
from robot_dyn.foundations.validate import choice, instance, number, shaped
from robot_dyn.lagrange.exact import RESOLUTION, Exact, entry_units
from robot_dyn.lagrange.lagrangian import Lagrangian
from robot_dyn.lagrange.magnitude import magnitudes
from robot_dyn.lagrange.scale import acceleration_norm, solved_norm, solved_tolerance
from robot_dyn.model.robot import Robot
from robot_dyn.queries.dynamics import QUANTITIES as QUERIES
from robot_dyn.queries.quantity import MAX_DIGITS, Quantity

QUANTITIES = {name: quantity for name, quantity in QUERIES.items() if quantity.digits}

_MAX_JOINTS = 64  # for a count; with more joints balls take many seconds

_exact = lru_cache(maxsize=8)(Exact)
_lagrangian = lru_cache(maxsize=8)(Lagrangian)


@lru_cache(maxsize=8)  # every query of a robot with a `DigitCheck` needs it
def _unchecked(robot: Robot) -> Robot:
    return replace(robot, answer_check=None)


def digits_of(error: float) -> float:
    """Return −log10 of an error, limited to 0…20; 0 for nan."""
    return min(max(-log10(max(error, RESOLUTION)), 0.0), float(MAX_DIGITS)) if error == error else 0.0


def digits(robot: Robot, quantity: str, *state: ArrayLike) -> float:
    """Count the correct decimal digits of the answer to a query.

        −log10(error),  from 0 to 20

    Errors are relative to √(M_ii M_jj) for M; for C, N and inverse dynamics to the largest entry in the units √M_ii of
    the joints; for forward dynamics to Σ ‖M⁻¹ τ_k‖ of τ, C v and N, in the norm of M. An answer whose terms nearly
    cancel has few digits. The decimals written in the file are taken as exact. A count takes milliseconds.

    Args:
        robot: The robot.
        quantity: "M", "C", "N", "inverse_dynamics" or "forward_dynamics".
        *state: Arguments of that query at one state, each of shape (n,).

    Raises:
        QueryError: If the quantity does not exist, or an argument is invalid.
        SingularError: If M is singular and the quantity is forward dynamics; names the joint.
    """
    robot = warn_below(robot, None)
    requested = QUANTITIES[choice("quantity", quantity, QUANTITIES)]
    if len(state) != len(requested.arguments):
        raise QueryError(
            f"digits of {requested.name} need the arguments {', '.join(requested.arguments)}, got {len(state)}"
            " arguments"
        )
    arrays = {
        name: np.array(shaped(name, x, robot.joint_names), float)
        for name, x in zip(requested.arguments, state, strict=True)
    }
    for name, x in arrays.items():
        if x.ndim != 1:
            raise QueryError(f"digits are counted at one state: {name} must have shape ({robot.n},), got {x.shape}")
    return _counted(robot, requested, arrays)


def warn_below(robot: Robot, digits: float | None) -> Robot:
    """Return a robot whose queries warn (`PrecisionWarning`) if their answers have fewer digits.

    M, C, N, inverse and forward dynamics are checked. Digits are first estimated from the error bound 8 n u κ of the
    terms; they are counted only if the estimate is below the limit, for up to 64 joints. A count takes milliseconds.
    Machine code of the robot does not warn. `rd.load` returns a nearly singular robot with a check of 8 digits.

    Args:
        robot: The robot.
        digits: Limit, above 0 and at most 20; None for a robot whose queries never warn.

    Raises:
        QueryError: If an argument is invalid.
    """
    robot = instance("robot", robot, Robot, "give a robot, for example rd.load('ur5')")
    if digits is None:
        return robot if robot.answer_check is None else replace(robot, answer_check=None)
    return replace(robot, answer_check=DigitCheck(digits))


@final
@dataclass(frozen=True)
class DigitCheck:
    """A check of answers that warns of too few correct digits.

    Attributes:
        digits: Number of digits below which it warns.
    """

    digits: float

    def __post_init__(self) -> None:
        digits = number("digits", self.digits, above=0)
        if digits > MAX_DIGITS:
            raise QueryError(f"digits must be at most {MAX_DIGITS}, got {digits:g}")
        object.__setattr__(self, "digits", digits)

    def __call__(self, robot: Robot, quantity: str, state: tuple[ArrayLike, ...], answer: ArrayLike) -> None:
        """Check the answer (..., *shape) to a query; nan is not checked.

        Digits are counted only where the estimate is below the limit, at the worst state; for more than 64 joints the
        estimate is reported.
        """
        requested, robot, answers = QUANTITIES.get(quantity), _unchecked(robot), np.asarray(answer)
        if requested is None:
            return
        arrays = {name: shaped(name, x, robot.joint_names) for name, x in zip(requested.arguments, state, strict=True)}
        batch = answers.shape[: answers.ndim - len(requested.axes)]
        rows = list(np.ndindex(batch))
        states = [{name: np.broadcast_to(x, (*batch, robot.n))[k] for name, x in arrays.items()} for k in rows]
        bounds = [
            _bound(robot, requested, at, answers[k]) if np.isfinite(answers[k]).all() else 0.0
            for k, at in zip(rows, states, strict=True)
        ]
        if not bounds or digits_of(max(bounds)) >= self.digits:
            return
        worst, counts = int(np.argmax(bounds)), robot.n <= _MAX_JOINTS
        correct = _counted(robot, requested, states[worst]) if counts else digits_of(bounds[worst])
        if correct < self.digits:
            has = "has" if counts else "is only certain to have"
            where = f" in row {worst} of the batch" if batch else ""
            message = (
                f"{quantity} of {robot.name} {has} {correct:.1f} digits{where}, fewer than {self.digits:g}; use"
                " rd.Lagrangian(robot, np.longdouble), or rd.accuracy.Ball(bits) for digits that are proven"
            )
            warnings.warn(message, PrecisionWarning, stacklevel=4)  # at the query


def _bound(robot: Robot, quantity: Quantity, state: dict[str, np.ndarray], answer: np.ndarray) -> float:
    """Return an upper estimate of the error of an answer."""
    inertia, least = robot.M(state["q"]), 8 * robot.n * float(np.finfo(float).eps) / 2
    if quantity.definite:
        return least
    absolute = {name: np.abs(x) for name, x in state.items()}
    terms = np.asarray(quantity.terms(magnitudes(_lagrangian(robot).linkage, state["q"]), absolute))
    if quantity.solves:
        torques = (state["tau"], robot.coriolis_torque(state["q"], state["v"]), robot.N(state["q"]))
        cancellation = acceleration_norm(inertia, torques, terms) / max(float(solved_norm(inertia, torques)), 1e-300)
        return solved_tolerance(0.0, inertia) * cancellation
    units = entry_units(quantity, inertia)
    return least * float(np.max(terms / units)) / max(float(np.max(np.abs(answer) / units)), 1e-300)


def _counted(robot: Robot, quantity: Quantity, state: dict[str, np.ndarray]) -> float:
    """Return the digits of one query, counted against its true value."""
    return digits_of(_exact(robot).at(quantity, state).error(quantity.evaluate(robot, state)))
