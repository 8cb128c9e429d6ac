"""Every implementation against balls, on chains that cost digits.

    |x − x*| ≤ 32 n u · (Σ of the absolute values of the terms added),    ‖a − a*‖_M ≤ 8 n u κ · Σ ‖M⁻¹τ_k‖_M

u = 2⁻⁵³; the terms are those of `compare`. n links add n terms to an entry, each after products of n rotations of 3
terms and more: 32 n u is what such sums may lose. κ is that of M scaled to a unit diagonal, of which Cholesky's
solution loses n u κ. Where that leaves fewer than eight digits the answer says how many hold, or the robot that is
loaded says that few may; where rounding hides whether M is singular it is refused, by name.
[Higham, Accuracy and Stability of Numerical Algorithms, 2nd ed., 2002, sec. 3.1 and thm. 10.3]
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from functools import partial
from typing import Any, NamedTuple

import numpy as np

import robot_dyn as rd
from robot_dyn import PrecisionWarning
from robot_dyn.foundations import DescriptionError, SingularError, midpoint, radius
from robot_dyn.lagrange import (
    acceleration_norm,
    diagonal_scale,
    floored,
    magnitudes,
    mass_norm,
    scaled,
    unit_diagonal_condition,
)
from robot_dyn.queries import CORIOLIS_TORQUE, FORWARD_DYNAMICS, INVERSE_DYNAMICS, C, M, N, Quantity
from tests.campaigns.hard.case import Case, Row
from tests.campaigns.hard.chains import CHAINS, FOLDER, LONG, file_of

TITLE = "Conditioning"
U = 2.0**-53
BITS = 256
SUMS, SOLVED = 32, 8
COMPILED = {  # machine code takes seconds to make: one of each kind
    "planar, 2 joints", "spatial, 7 joints", "mass ratio 1e+08", "tip of 1e-06 kg",
    "axes 1e-07 rad apart, 0.001 kg between", "links of 1e-06 m", "from 1 km to 1 µm", "turning and sliding",
    "base 10000 m away", "base 5000000 m away",
}  # fmt: skip
QUERIES = (M, C, N, CORIOLIS_TORQUE, INVERSE_DYNAMICS)
FEW = 1e-8  # of forward dynamics: with a larger error it has fewer than eight digits


def states(n: int, seed: int) -> list[dict[str, np.ndarray]]:
    """A random one, and one that is stretched but for 1e-6."""
    rng = np.random.default_rng((17, seed))
    v, a, tau = rng.normal(size=(3, n))
    return [{"q": q, "v": v, "a": a, "tau": tau} for q in (rng.uniform(-1, 1, n), 1e-6 * rng.uniform(0.5, 1, n))]


def implementations(robot: rd.Robot, compiled: bool) -> dict[str, Any]:
    """What is held to the balls."""
    known: dict[str, Any] = {"Lagrangian": rd.Lagrangian(robot)}
    if not any("below 1e-12 kg" in each for each in robot.findings):
        known["Pinocchio"] = robot
    return known | ({"machine code": rd.compiled(robot)} if compiled else {})


class Error(NamedTuple):
    """What an implementation errs by in units of its law, n u or n u κ; absolutely; and what was said."""

    implementation: str
    quantity: str
    error: float
    relative: float
    said: str = ""


def errors(
    robot: rd.Robot, engines: dict[str, Any], at: list[dict[str, np.ndarray]], queries: tuple[Quantity, ...] = QUERIES
) -> Iterator[Error]:
    """Of each implementation and quantity at each state; of forward dynamics where an engine has it."""
    own, truth = rd.Lagrangian(robot), rd.Lagrangian(robot, rd.accuracy.Ball(BITS))
    for state in at:
        size, absolute = magnitudes(own.linkage, state["q"]), {key: np.abs(x) for key, x in state.items()}
        exact = {each.name: each.evaluate(truth, state) for each in QUERIES}
        for quantity in queries:
            x = midpoint(exact[quantity.name])
            assert np.max(radius(exact[quantity.name])) <= 1e-30 * max(1.0, np.max(np.abs(x)))
            scale = diagonal_scale(x) if quantity.definite else quantity.terms(size, absolute)
            for implementation, engine in engines.items():
                error = scaled(quantity.evaluate(engine, state) - x, floored(np.asarray(scale))).max()
                yield Error(implementation, quantity.name, float(error) / (robot.n * U), float(error))
        inertia = midpoint(exact["M"])
        a = midpoint(FORWARD_DYNAMICS.evaluate(truth, state))
        torques = state["tau"], midpoint(exact["coriolis_torque"]), midpoint(exact["N"])
        loss = robot.n * U * unit_diagonal_condition(inertia)
        whole = acceleration_norm(inertia, torques, FORWARD_DYNAMICS.terms(size, absolute))
        near = next((each for each in robot.findings if "nearly singular" in each), "")
        for implementation, engine in engines.items():
            if not hasattr(engine, FORWARD_DYNAMICS.name):
                continue
            with warnings.catch_warnings(record=True) as said:
                warnings.simplefilter("always", PrecisionWarning)
                try:
                    error = float(mass_norm(inertia, FORWARD_DYNAMICS.evaluate(engine, state) - a) / whole)
                except SingularError as refusal:
                    error, near = float("nan"), str(refusal) if SOLVED * loss > FEW else ""  # else it has no right to
            words = str(said[0].message) if said else near
            yield Error(implementation, FORWARD_DYNAMICS.name, error / loss, error, words)


def rows(case: str, robot: rd.Robot, engines: dict[str, Any], at: list[dict[str, np.ndarray]]) -> Iterator[Row]:
    """Of each implementation the worst of M, C, C v, N and inverse dynamics, and forward dynamics."""
    found = list(errors(robot, engines, at))
    for implementation in engines:
        own = [each for each in found if each.implementation == implementation]
        solved = [each for each in own if each.quantity == FORWARD_DYNAMICS.name]
        sums = max(each.error for each in own if each not in solved)
        yield Row(case, f"{implementation}: M, C, C v, N, ID, in n u", sums, SUMS)
        worst = max(solved, key=lambda each: np.nan_to_num(each.error, nan=np.inf))
        yield Row(
            case, f"{implementation}: FD, in n u κ", worst.error, SOLVED, worst.said if np.isnan(worst.error) else ""
        )
        if worst.relative > FEW:
            yield Row(case, f"{implementation}: FD, relative to its terms", worst.relative, FEW, worst.said)
    if "Pinocchio" not in engines:
        lost = next(each for each in robot.findings if "below 1e-12 kg" in each)
        yield Row(case, "Pinocchio: left out", float("nan"), SUMS, lost)


def _chain(name: str, seed: int) -> Iterator[Row]:
    try:
        robot = rd.load(file_of(name))
    except DescriptionError as refusal:
        yield Row(name, "refused", float("nan"), 0.0, str(refusal).replace(f"{FOLDER}/", "urdf/hard/"))
        return
    yield from rows(name, robot, implementations(robot, name in COMPILED), states(robot.n, seed))


CASES = [Case(name, partial(_chain, name), name in LONG) for name in CHAINS | LONG]
