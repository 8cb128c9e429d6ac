"""Positions and times that the numbers of an implementation round: refused where they are not told to 1e-3."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn.foundations import OverflowedError, midpoint
from tests.user_parts import Push

ARM = rd.load("ur5")
NEAR = np.array([0.3, -0.2, 0.5, 0.7, -0.4, 0.9])
NARROW = {"Lagrangian": rd.Lagrangian(ARM, np.float32), "machine code": rd.Compiled(ARM, dtype="float32")}
# what cannot be held, by what cannot hold it: the distance to the nearest number is 2⁻¹¹ and more
HIDDEN: dict[str, tuple[Any, Any]] = {
    "float64 in float32": (NARROW["Lagrangian"], NEAR + 1e12),
    "float64 in machine code of float32": (NARROW["machine code"], NEAR + 1e12),
    "longdouble in float64": (rd.Lagrangian(ARM), NEAR.astype(np.longdouble) + np.longdouble(2) ** 56),
    "longdouble in Pinocchio": (ARM, NEAR.astype(np.longdouble) + np.longdouble(2) ** 56),
    "integers in Pinocchio": (ARM, [10**17 + 1] * 6),
    "of a plant": (rd.Plant(NARROW["Lagrangian"]), NEAR + 1e12),
}


@pytest.mark.parametrize("case", HIDDEN)
def test_a_position_that_rounding_hides_is_refused(case: str) -> None:
    """M is a function of the angle; rounded by more than 1e-3 rad it is that of another configuration."""
    dynamics, q = HIDDEN[case]
    with pytest.raises(OverflowedError, match="q of joint 'shoulder_pan_joint' is so large that"):
        dynamics.M(q)


@pytest.mark.parametrize("name", NARROW)
def test_in_a_batch_the_row_that_rounding_hides_has_no_answer(name: str) -> None:
    q = np.tile(NEAR, (20, 1))
    q[7, 2] = 1e12 + 0.3
    answer = NARROW[name].M(q, errors="nan")
    assert np.isnan(answer[7]).all()
    assert np.array_equal(np.delete(answer, 7, axis=0), NARROW[name].M(np.delete(q, 7, axis=0)))
    with pytest.raises(OverflowedError, match="in row 7 of the batch"):
        NARROW[name].M(q)


@pytest.mark.parametrize("name", NARROW)
@pytest.mark.parametrize("far", [8e3, 1e12])
def test_a_float32_is_one_angle_however_large(name: str, far: float) -> None:
    """What float32 holds is not rounded: 64 u of float32 for M, whose terms are of one sign but for a few."""
    q = (NEAR + far).astype(np.float32)
    exact = midpoint(rd.Lagrangian(ARM, rd.accuracy.Ball(200)).M(q))
    for given in (q, q.astype(float)):
        difference = np.abs(NARROW[name].M(given) - exact).max()
        assert difference < 64 * np.finfo(np.float32).eps / 2 * np.abs(exact).max()


@pytest.mark.parametrize("rows", [0, 1, 20])
def test_a_time_that_rounding_hides_is_refused_by_machine_code(rows: int) -> None:
    """float32 tells 1e9 s to 64 s; what it holds, 2^30 s, it takes."""
    plant = rd.Compiled(rd.Plant(ARM, [Push(lambda t, q, v: 0 * v + t)]), dtype="float32")
    q = np.tile(NEAR, (rows, 1) if rows else 1).astype(np.float32)

    def torque(t: float) -> Any:
        return plant.torque(np.full(rows, t) if rows else t, q, 0 * q)

    with pytest.raises(OverflowedError, match="t is so large that float32 does not resolve"):
        torque(1e9 + 0.5)
    assert (torque(2.0**30) == np.float32(2**30)).all()
