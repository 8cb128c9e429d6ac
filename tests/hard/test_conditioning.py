"""What rounding may cost: every road against balls, on chains that cost digits.

    |x − x*| ≤ 32 n u · (Σ of the absolute values of the terms added),    ‖a − a*‖_M ≤ 8 n u κ · Σ ‖M⁻¹τ_k‖_M

u = 2⁻⁵³; the terms are those of `compare`. n links add n terms to an entry, each after products of n rotations of 3
terms and more: 32 n u is what such sums may lose. κ is that of M scaled to a unit diagonal, of which Cholesky's
solution loses n u κ. [Higham, Accuracy and Stability of Numerical Algorithms, 2nd ed., 2002, sec. 3.1 and thm. 10.3]
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

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
from tests.hard.chains import CHAINS, LONG

U = 2.0**-53
BITS = 256
COMPILED = {  # machine code takes seconds to make: one of each kind
    "planar, 2 joints", "spatial, 7 joints", "mass ratio 1e+08", "tip of 1e-06 kg", "axes 1e-07 rad apart",
    "links of 1e-06 m", "from 1 km to 1 µm", "turning and sliding", "base 10000 m away",
}  # fmt: skip


def states(n: int) -> list[dict[str, np.ndarray]]:
    """A random one, and one that is stretched but for 1e-6."""
    rng = np.random.default_rng(17)
    v, a, tau = rng.normal(size=(3, n))
    return [{"q": q, "v": v, "a": a, "tau": tau} for q in (rng.uniform(-1, 1, n), 1e-6 * rng.uniform(0.5, 1, n))]


def roads(name: str, robot: rd.Robot) -> dict[str, Any]:
    """What is held to the balls."""
    known: dict[str, Any] = {"Lagrangian": rd.Lagrangian(robot)}
    if any("below 1e-12 kg" in each for each in robot.findings):  # Pinocchio takes 2e-16 kg for the mass of such sums
        return known
    known["Pinocchio"] = robot
    return known | ({"machine code": rd.Compiled(robot)} if name in COMPILED else {})


@pytest.mark.filterwarnings("ignore::robot_dyn.ModelWarning")
@pytest.mark.parametrize("name", [*CHAINS, *(pytest.param(each, marks=pytest.mark.stress) for each in LONG)])
def test_every_road_keeps_the_digits_that_rounding_leaves(name: str) -> None:
    robot = rd.Robot.from_text((CHAINS | LONG)[name])
    engines = roads(name, robot)
    own, truth = rd.Lagrangian(robot), rd.Lagrangian(robot, rd.Ball(BITS))
    for state in states(robot.n):
        size, absolute = magnitudes(own.linkage, state["q"]), {key: np.abs(x) for key, x in state.items()}
        exact = {each.name: each.ask(truth, state) for each in (M, C, N, CORIOLIS_TORQUE, INVERSE_DYNAMICS)}
        for quantity in (M, C, N, CORIOLIS_TORQUE, INVERSE_DYNAMICS):
            x = midpoint(exact[quantity.name])
            assert np.max(radius(exact[quantity.name])) <= 1e-30 * max(1.0, np.max(np.abs(x)))
            scale = diagonal_scale(x) if quantity.definite else quantity.terms(size, absolute)
            for road, engine in engines.items():
                error = scaled(quantity.ask(engine, state) - x, floored(np.asarray(scale))).max()
                assert error <= 32 * robot.n * U, (road, quantity.name, error / (robot.n * U))
        _forward(engines, state, exact, size, absolute, truth)


def _forward(engines: Any, state: Any, exact: Any, size: Any, absolute: Any, truth: Any) -> None:
    inertia = midpoint(exact["M"])
    a = midpoint(FORWARD_DYNAMICS.ask(truth, state))
    torques = state["tau"], midpoint(exact["coriolis_torque"]), midpoint(exact["N"])
    allowed = 8 * len(a) * U * unit_diagonal_condition(inertia)
    whole = acceleration_norm(inertia, torques, FORWARD_DYNAMICS.terms(size, absolute))
    for road, engine in engines.items():
        try:
            error = mass_norm(inertia, FORWARD_DYNAMICS.ask(engine, state) - a) / whole
        except SingularError:
            assert allowed > 1e-8, road  # what rounding hides is refused, and named
            continue
        assert error <= allowed, (road, "forward_dynamics", error / allowed)
