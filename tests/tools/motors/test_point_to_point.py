"""Motions from point to point: ruckig's own values, limits everywhere, no shorter closed form, no connection."""

from __future__ import annotations

import socket
from typing import Any

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn.foundations import PlanError

ARM = rd.load("ur5")


def random_case(rng: np.random.Generator, case: int) -> dict[str, Any]:
    q0, q1 = rng.uniform(-2, 2, (2, 6))
    v0, v1 = rng.uniform(-0.8, 0.8, (2, 6)) * (case % 3 > 0)
    jerk = np.full(6, np.inf) if case % 5 == 0 else rng.uniform(5, 80, 6)
    return {"q0": q0, "q1": q1, "acceleration": rng.uniform(1, 9, 6), "jerk": jerk, "v0": v0, "v1": v1}


def test_the_motion_is_that_of_ruckig() -> None:
    """Its own evaluation at 100 times of 40 motions, to 1e-12."""
    ruckig = pytest.importorskip("ruckig")
    rng = np.random.default_rng(0)
    for case in range(40):
        given = random_case(rng, case)
        plan = rd.tools.motors.point_to_point(ARM, **given, start_s=0.5)
        asked, trajectory = ruckig.InputParameter(6), ruckig.Trajectory(6)
        asked.current_position, asked.target_position = given["q0"], given["q1"]
        asked.current_velocity, asked.target_velocity = given["v0"], given["v1"]
        asked.max_velocity, asked.max_acceleration = ARM.velocity_limit, given["acceleration"]
        asked.max_jerk = given["jerk"]
        ruckig.Ruckig(6).calculate(asked, trajectory)
        assert abs(plan.duration_s - trajectory.duration) < 1e-12
        t = rng.uniform(0, trajectory.duration, 100)
        expected = np.array([trajectory.at_time(x)[:3] for x in t]).swapaxes(0, 1)
        for mine, its, tolerance in zip(plan.reference.at(0.5 + t), expected, (1e-12, 1e-12, 1e-11), strict=True):
            np.testing.assert_allclose(mine, its, atol=tolerance)  # 0.5 + t moves t by rounding, a by that times jerk


def test_limits_hold_at_ten_thousand_times_and_accelerations_are_continuous() -> None:
    pytest.importorskip("ruckig")
    rng = np.random.default_rng(1)
    for case in (1, 2, 4):
        given = random_case(rng, case)
        plan = rd.tools.motors.point_to_point(ARM, **given)
        t = np.linspace(plan.reference.start_s, plan.reference.end_s, 10_000)
        _, v, a = plan.reference.at(t)
        assert (np.abs(v) <= plan.limits["velocity"] * (1 + 1e-12)).all()
        assert (np.abs(a) <= plan.limits["acceleration"] * (1 + 1e-12)).all()
        assert (plan.peaks["jerk"] <= plan.limits["jerk"] * (1 + 1e-12)).all()
        h, c = np.diff(plan.reference.breaks)[:-1, None], plan.reference.coefficients
        before = 2 * c[:-1, 2] + 6 * c[:-1, 3] * h  # the acceleration at the end of each piece
        np.testing.assert_allclose(before, 2 * c[1:, 2], atol=1e-10)
        q0, v0, _ = plan.reference.at(plan.reference.start_s)
        q1, v1, _ = plan.reference.at(plan.reference.end_s)
        for got, key in ((q0, "q0"), (v0, "v0"), (q1, "q1"), (v1, "v1")):
            np.testing.assert_allclose(got, given[key], atol=1e-10)


def shortest(D: float, v: float, a: float, j: float) -> float:
    """Time from rest to rest over D with bounded v, a, j, as in Biagiotti, Melchiorri 2008, sec. 3.4."""
    if j == np.inf:
        return D / v + v / a if v * v / a <= D else 2 * np.sqrt(D / a)
    ramp = np.sqrt(v / j) if v * j < a * a else a / j  # of the acceleration, where the speed reaches its limit
    up = 2 * ramp if v * j < a * a else v / a + a / j
    if v * up <= D:
        return D / v + up
    if 2 * a**3 / j**2 <= D:
        return a / j + np.sqrt((a / j) ** 2 + 4 * D / a)
    return 4 * np.cbrt(D / (2 * j))


@pytest.mark.parametrize(
    ("D", "a", "j"), [(3.0, 5.0, 20.0), (0.4, 2.0, 30.0), (0.01, 5.0, 20.0), (3.0, 50.0, 9.0), (2.0, 3.0, np.inf)]
)
def test_of_one_joint_the_duration_is_that_of_the_closed_form(D: float, a: float, j: float) -> None:
    """Trapezoid and S-curve are optimal from rest to rest, so nothing is shorter; rounding of a cube root, 1e-9."""
    pytest.importorskip("ruckig")
    q0, q1 = np.full(6, 0.2), np.full(6, 0.2)
    q1[2] += D * 0.9
    plan = rd.tools.motors.point_to_point(ARM, q0, q1, acceleration=a, jerk=j)
    assert abs(plan.duration_s - shortest(0.9 * D, ARM.velocity_limit[2], a, j)) < 1e-9


def test_nothing_connects(monkeypatch: pytest.MonkeyPatch) -> None:
    """Ruckig would ask a service about way points."""
    pytest.importorskip("ruckig")

    def refuse(*arguments: object) -> None:
        raise AssertionError("it connects")

    for name in ("connect", "connect_ex"):
        monkeypatch.setattr(socket.socket, name, refuse)
    monkeypatch.setattr(socket, "create_connection", refuse)
    with pytest.raises(AssertionError, match="it connects"):
        socket.create_connection(("localhost", 9))
    assert rd.tools.motors.point_to_point(ARM, np.zeros(6), np.ones(6), acceleration=3.0, jerk=20.0).duration_s > 0


def test_a_run_follows_it() -> None:
    pytest.importorskip("ruckig")
    arm = rd.load("planar_2r")
    plan = rd.tools.motors.point_to_point(arm, [0.1, 0.2], [0.7, -0.3], velocity=1.0, acceleration=3.0, jerk=20.0)
    controller = rd.control.ComputedTorque(arm, plan.reference, kp=100.0, kd=20.0)
    run = rd.simulate(arm, q0=[0.1, 0.2], duration_s=plan.duration_s, controller=controller)
    np.testing.assert_allclose(run.q[-1], [0.7, -0.3], atol=1e-8)  # the exact model; the method's tolerance is 1e-10


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"q1": np.full(6, 7.0)}, "shoulder_pan_joint is at 7 rad at .* s, outside its limits -6.28319 to 6.28319"),
        ({"v0": np.full(6, 9.0)}, "v0: shoulder_pan_joint moves at 9 rad/s, beyond its limit 3.15"),
        ({"q1": np.zeros(6)}, "nothing moves"),
        ({"acceleration": np.inf}, "acceleration must be finite"),
        ({"jerk": 0.0}, "jerk must be positive, got 0"),
    ],
)
def test_what_cannot_be_planned_is_told(change: dict[str, Any], message: str) -> None:
    pytest.importorskip("ruckig")
    with pytest.raises(PlanError, match=message):
        rd.tools.motors.point_to_point(
            **{"arm": ARM, "q0": np.zeros(6), "q1": np.ones(6), "acceleration": 3.0, "jerk": 20.0} | change
        )
