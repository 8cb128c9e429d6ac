"""Motors whose torque falls with speed, in files and budgets, against independent formulas and runs with the effect."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn.foundations import PlanError
from robot_dyn.tools.motors import TorqueSpeed
from tests.effects.test_effect_states import MASS, SLIDER

ARM = rd.load("planar_2r")
FILE = """joint,at,gear_ratio,speed [rad/s],peak [N m],continuous [N m]
joint_1,motor,50,0,1.2,0.6
joint_1,,,100,1.2,0.5
joint_1,,,300,0,0
joint_2,joint,,1.5,12,5
joint_2,joint,,8,0,
"""
PLAN = rd.control.quintic([0.1, 0.4], [1.2, -0.9], 0.9)


@pytest.fixture
def motors(tmp_path: Path) -> Any:
    (tmp_path / "motors.csv").write_text(FILE)
    return rd.tools.motors.read_motors(tmp_path / "motors.csv")


def test_lines_of_a_file_are_at_the_joint(motors: Any) -> None:
    assert motors.line == {"joint_1": ((0.0, 60.0), (2.0, 60.0), (6.0, 0.0)), "joint_2": ((1.5, 12.0), (8.0, 0.0))}
    assert motors.continuous_line == {"joint_1": ((0.0, 30.0), (2.0, 25.0), (6.0, 0.0)), "joint_2": ((1.5, 5.0),)}
    assert (motors.peak, motors.speed) == ({"joint_1": 60.0, "joint_2": 12.0}, {"joint_1": 6.0, "joint_2": 8.0})
    u, v = np.array([99.0, -99.0]), np.array([4.0, 4.0])
    np.testing.assert_allclose(rd.Plant(ARM, [motors.limit]).actuation(u, v), [30.0, -12.0], rtol=1e-14)


def test_the_used_fraction_scales_a_demand_onto_the_line() -> None:
    """(τ, v)/λ lies on the line: |τ|/λ = ℓ(|v|/λ), by np.interp, for concave and convex lines; 1e-12."""
    rng = np.random.default_rng(4)
    for _ in range(20):
        x = np.cumsum(rng.uniform(0.1, 2, (3, 4)), axis=1)
        y = np.sort(rng.uniform(0.1, 9, (3, 4)), axis=1)[:, ::-1] * [1, 1, 1, 0]
        lines = TorqueSpeed(x, y)
        tau, v = (rng.uniform(0.01, 20, (50, 3)) for _ in range(2))
        used = lines.used(tau, v)
        np.testing.assert_allclose(lines.at(v / used), tau / used, rtol=1e-10, atol=1e-12)
        assert np.array_equal(used > 1, tau > lines.at(v))
        np.testing.assert_allclose(lines.used(0 * v, v), v / x[:, -1], rtol=1e-14)


def test_the_budget_of_a_plan_is_that_of_its_inverse_dynamics(motors: Any) -> None:
    """The largest used fraction over 200 001 times, to their distance squared; driving only where τ v > 0."""
    budget = rd.tools.motors.budget(PLAN, ARM, motors=motors)
    q, v, a = PLAN.at(np.linspace(0, 0.9, 200_001))
    tau = ARM.inverse_dynamics(q, v, a)
    lines = TorqueSpeed.of_joints(motors.line, ARM.joint_names)
    assert lines is not None
    used = np.where(tau * v > 0, lines.used(tau, v), np.abs(tau) / [60.0, 12.0])
    assert [x.line["used"] for x in budget.joints] == pytest.approx(used.max(axis=0), rel=1e-7)
    for joint, mean in zip(budget.joints, np.abs(v).mean(axis=0), strict=True):
        points = motors.continuous_line[joint.joint]
        assert joint.continuous_limit == pytest.approx(np.interp(mean, *np.transpose(points).tolist()), rel=1e-4)
    assert budget.fits == all(x.shares[kind] <= 1.001 for x in budget.joints for kind in x.shares)


def test_the_largest_payload_uses_the_whole_line(motors: Any) -> None:
    """At the largest mass a limit is used to 1e-6, and 1 % more mass exceeds it."""
    motors = replace(motors, continuous={}, continuous_line={})
    bare = rd.tools.motors.budget(PLAN, ARM, motors=motors)
    most = rd.tools.motors.max_payload(bare, ARM.frame_names[-1])
    assert most.mass and most.largest_share == pytest.approx(1.0, abs=1e-6)
    more = rd.Payload(most.link, 1.01 * most.mass, most.com)
    assert not rd.tools.motors.budget(PLAN, ARM, motors=motors, payload=more).fits


def test_the_budget_of_a_run_at_its_line_uses_all_of_it(tmp_path: Path) -> None:
    """M v' = P (1 − v/v₀) at full command is the line itself at every time; to the rounding of the run."""
    (tmp_path / "m.csv").write_text("joint,peak [N],speed [m/s]\nslide,6,0\nslide,0,4\n")
    motors = rd.tools.motors.read_motors(tmp_path / "m.csv")
    run = rd.simulate(
        rd.Plant(SLIDER, [motors.limit]),
        [0.0],
        duration_s=1.0,
        controller=rd.control.PD(rd.control.hold([99.0]), kp=9.0, kd=0.0),
    )
    joint = rd.tools.motors.budget(run, motors=motors).joints[0]
    assert joint.line["used"] == pytest.approx(1.0, abs=1e-9)
    assert joint.speed == pytest.approx(4 * (1 - np.exp(-6 / MASS / 4)), rel=1e-9)


@pytest.mark.parametrize(
    ("text", "remedy"),
    [(FILE.replace("8,0,", "8,1,"), "add the no-load speed"), ("joint,peak [N m]\na,1\n", "use an EffortLimit")],
)
def test_a_limit_of_a_run_needs_whole_lines(tmp_path: Path, text: str, remedy: str) -> None:
    (tmp_path / "motors.csv").write_text(text)
    with pytest.raises(PlanError, match=remedy):
        _ = rd.tools.motors.read_motors(tmp_path / "motors.csv").limit
