"""Numbers far out: angles of 1e16 rad, velocities whose squares nearly overflow, denormals, NaN beside numbers.

What has a finite answer gets it, to 32 n u of the terms added (see test_conditioning); what has none is named.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn.arithmetic import midpoint
from robot_dyn.compiled.right_angles import completed
from robot_dyn.errors import NotFiniteError, RobotDynError
from robot_dyn.lagrange.magnitude import magnitudes
from robot_dyn.lagrange.scale import diagonal_scale, floored, scaled
from robot_dyn.model.quantity import INVERSE_DYNAMICS, M, N

U = 2.0**-53
UR5, _ = completed(rd.load("ur5"))  # as machine code has it
ROADS: dict[str, Any] = {"Pinocchio": UR5, "Lagrangian": rd.Lagrangian(UR5), "machine code": rd.Compiled(UR5)}
TRUTH = rd.Lagrangian(UR5, rd.Ball(300))
RNG = np.random.default_rng(23)
Q, V, A = RNG.uniform(0.5, 1.0, (3, UR5.n)) * RNG.choice([-1, 1], (3, UR5.n))


def errors(quantity: Any, state: dict[str, np.ndarray]) -> dict[str, float]:
    """Of each road, in units of n u of the terms added."""
    size = magnitudes(rd.Lagrangian(UR5).linkage, state["q"])
    x = midpoint(quantity.ask(TRUTH, state))
    absolute = {key: np.abs(value) for key, value in state.items()}
    scale = diagonal_scale(x) if quantity.definite else quantity.terms(size, absolute)
    return {
        road: float(scaled(quantity.ask(engine, state) - x, floored(np.asarray(scale))).max() / (UR5.n * U))
        for road, engine in ROADS.items()
    }


@pytest.mark.parametrize("far", [1e3, 1e5, 1e9, 1e16])
@pytest.mark.parametrize("quantity", [M, N], ids=lambda each: each.name)
def test_angles_of_any_size_are_reduced_exactly(quantity: Any, far: float) -> None:
    """A float of 1e16 rad is one angle, whose sine is known: none of its digits may be guessed."""
    assert max(errors(quantity, {"q": far * Q}).values()) <= 32


@pytest.mark.parametrize("fast", [5e-324, 1e-200, 1e-10, 1e75, 1e150])
def test_velocities_of_any_size_whose_squares_are_finite(fast: float) -> None:
    """Inverse dynamics, whose terms grow as v²."""
    assert max(errors(INVERSE_DYNAMICS, {"q": Q, "v": fast * V, "a": A}).values()) <= 32


@pytest.mark.parametrize("road", ROADS)
def test_what_overflows_is_named(road: str) -> None:
    with pytest.raises(RobotDynError, match=r"overflow|not finite"):
        ROADS[road].inverse_dynamics(Q, 1e160 * V, A)


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
@pytest.mark.parametrize("road", ROADS)
def test_a_row_without_an_answer_leaves_the_others_as_they_are(road: str, bad: float) -> None:
    """errors="nan": the other rows have the bits of the batch with a finite row in its place; else the row is named."""
    engine, q = ROADS[road], RNG.uniform(-1, 1, (19, UR5.n))
    v, spoilt = RNG.normal(size=(2, 19, UR5.n)), q.copy()
    spoilt[7, 2] = bad
    for name, rest in (("M", ()), ("inverse_dynamics", (v[0], v[1])), ("forward_dynamics", (v[0], 10 * v[1]))):
        ask = getattr(engine, name)
        whole, made = ask(q, *rest), ask(spoilt, *rest, errors="nan")
        assert np.isnan(made[7]).all()
        others = np.arange(19) != 7
        assert (made[others] == whole[others]).all(), name
        with pytest.raises(NotFiniteError, match="in row 7 of the batch"):
            ask(spoilt, *rest)
