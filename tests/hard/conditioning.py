"""Every road against balls, on chains that cost digits.

    |x − x*| ≤ 32 n u · (Σ of the absolute values of the terms added),    ‖a − a*‖_M ≤ 8 n u κ · Σ ‖M⁻¹τ_k‖_M

u = 2⁻⁵³; the terms are those of `compare`. n links add n terms to an entry, each after products of n rotations of 3
terms and more: 32 n u is what such sums may lose. κ is that of M scaled to a unit diagonal, of which Cholesky's
solution loses n u κ. Where κ u exceeds 1e-8 forward dynamics may be refused, by name.
[Higham, Accuracy and Stability of Numerical Algorithms, 2nd ed., 2002, sec. 3.1 and thm. 10.3]
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np

import robot_dyn as rd
from robot_dyn.arithmetic import midpoint, radius
from robot_dyn.errors import SingularError
from robot_dyn.lagrange.magnitude import magnitudes
from robot_dyn.lagrange.scale import (
    acceleration_norm,
    diagonal_scale,
    floored,
    mass_norm,
    scaled,
    unit_diagonal_condition,
)
from robot_dyn.model.quantity import CORIOLIS_TORQUE, FORWARD_DYNAMICS, INVERSE_DYNAMICS, C, M, N
from tests.hard.case import Case, Row
from tests.hard.chains import CHAINS, LONG

TITLE = "Conditioning"
U = 2.0**-53
BITS = 256
SUMS, SOLVED = 32, 8
COMPILED = {  # machine code takes seconds to make: one of each kind
    "planar, 2 joints", "spatial, 7 joints", "mass ratio 1e+08", "tip of 1e-06 kg", "axes 1e-07 rad apart",
    "links of 1e-06 m", "from 1 km to 1 µm", "turning and sliding", "base 10000 m away", "base 5000000 m away",
}  # fmt: skip
QUERIES = (M, C, N, CORIOLIS_TORQUE, INVERSE_DYNAMICS)
NEAR_SINGULAR = 1e-8  # κ u beyond which fewer than eight digits are left


def states(n: int, seed: int) -> list[dict[str, np.ndarray]]:
    """A random one, and one that is stretched but for 1e-6."""
    rng = np.random.default_rng((17, seed))
    v, a, tau = rng.normal(size=(3, n))
    return [{"q": q, "v": v, "a": a, "tau": tau} for q in (rng.uniform(-1, 1, n), 1e-6 * rng.uniform(0.5, 1, n))]


def roads(robot: rd.Robot, compiled: bool) -> dict[str, Any]:
    """What is held to the balls."""
    known: dict[str, Any] = {"Lagrangian": rd.Lagrangian(robot)}
    if not any("below 1e-12 kg" in each for each in robot.findings):
        known["Pinocchio"] = robot
    return known | ({"machine code": rd.Compiled(robot)} if compiled else {})


def errors(robot: rd.Robot, engines: dict[str, Any], at: list[dict[str, np.ndarray]]) -> Iterator[tuple[str, ...] | Any]:
    """(road, quantity, error in units of what is allowed per SUMS or SOLVED, words of a refusal), at each state."""
    own, truth = rd.Lagrangian(robot), rd.Lagrangian(robot, rd.Ball(BITS))
    for state in at:
        size, absolute = magnitudes(own.linkage, state["q"]), {key: np.abs(x) for key, x in state.items()}
        exact = {each.name: each.ask(truth, state) for each in QUERIES}
        for quantity in QUERIES:
            x = midpoint(exact[quantity.name])
            assert np.max(radius(exact[quantity.name])) <= 1e-30 * max(1.0, np.max(np.abs(x)))
            scale = diagonal_scale(x) if quantity.definite else quantity.terms(size, absolute)
            for road, engine in engines.items():
                error = scaled(quantity.ask(engine, state) - x, floored(np.asarray(scale))).max()
                yield road, quantity.name, float(error) / (robot.n * U), ""
        inertia = midpoint(exact["M"])
        a = midpoint(FORWARD_DYNAMICS.ask(truth, state))
        torques = state["tau"], midpoint(exact["coriolis_torque"]), midpoint(exact["N"])
        loss = robot.n * U * unit_diagonal_condition(inertia)
        whole = acceleration_norm(inertia, torques, FORWARD_DYNAMICS.terms(size, absolute))
        for road, engine in engines.items():
            try:
                error = mass_norm(inertia, FORWARD_DYNAMICS.ask(engine, state) - a) / whole
            except SingularError as refusal:
                rounds = SOLVED * loss > NEAR_SINGULAR  # else it has no right to refuse
                yield road, FORWARD_DYNAMICS.name, float("nan"), str(refusal) if rounds else ""
                continue
            yield road, FORWARD_DYNAMICS.name, float(error / loss), ""


def rows(case: str, robot: rd.Robot, engines: dict[str, Any], at: list[dict[str, np.ndarray]]) -> Iterator[Row]:
    """Of each road the worst of M, C, C v, N and inverse dynamics, and forward dynamics."""
    found = list(errors(robot, engines, at))
    for road in engines:
        sums = [error for of, name, error, _ in found if of == road and name != FORWARD_DYNAMICS.name]
        yield Row(case, f"{road}: M, C, C v, N, ID, in n u", max(sums), SUMS)
        solved = [(error, said) for of, name, error, said in found if of == road and name == FORWARD_DYNAMICS.name]
        known = [error for error, said in solved if error == error]
        yield from (Row(case, f"{road}: FD", error, SOLVED, said) for error, said in solved if error != error)
        if known:
            yield Row(case, f"{road}: FD, in n u κ", max(known), SOLVED)
    if "Pinocchio" not in engines:
        lost = next(each for each in robot.findings if "below 1e-12 kg" in each)
        yield Row(case, "Pinocchio: left out", float("nan"), SUMS, lost)


def _chain(name: str, seed: int) -> Iterator[Row]:
    robot = rd.Robot.from_text((CHAINS | LONG)[name])
    yield from rows(name, robot, roads(robot, name in COMPILED), states(robot.n, seed))


CASES = [Case(name, partial(_chain, name), name in LONG) for name in CHAINS | LONG]
