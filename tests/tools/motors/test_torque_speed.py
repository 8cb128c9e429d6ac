"""Motors whose torque falls with speed, in files and budgets, against independent formulas and runs with the effect."""

from __future__ import annotations

from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn.effects import TorqueSpeed
from robot_dyn.foundations import PlanError
from robot_dyn.simulation import RemarkKind
from tests.effects.test_effect_states import MASS, SLIDER

ARM = rd.load("planar_2r")
toppra = pytest.mark.skipif(find_spec("toppra") is None, reason="needs toppra")
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
    (remark,) = (x for x in run.remarks if x.kind == RemarkKind.LINE_REACHED)
    assert (remark.joint, remark.start_s, remark.at_s) == ("slide", 0.0, 1.0)
    assert remark.duration_s == pytest.approx(1.0, rel=1e-12)
    assert remark.value == pytest.approx(6 * (1 - run.v[-1, 0] / 4), rel=1e-12)
    joint = rd.tools.motors.budget(run, motors=motors).joints[0]
    assert joint.too_small == ("peak", "line")  # the control demanded more, at rest too
    assert joint.line["used"] == pytest.approx(1.0, abs=1e-9)
    assert joint.speed == pytest.approx(4 * (1 - np.exp(-6 / MASS / 4)), rel=1e-9)


def test_a_run_within_its_line_has_no_remark_and_other_joints_no_line() -> None:
    plant = rd.Plant(ARM, [rd.effects.TorqueSpeedLimit({"joint_1": [0.0, 9.0]}, {"joint_1": [90.0, 0.0]})])
    run = rd.simulate(plant, [0.1, 0.4], duration_s=0.1)
    assert all(remark.kind != RemarkKind.LINE_REACHED for remark in run.remarks)


def random_motors(arm: rd.Robot, rng: np.random.Generator) -> Any:
    """Flat tops and lines from rest, with up to two corners more, concave and convex."""
    lines = {}
    for name, effort in zip(arm.joint_names, arm.effort_limit, strict=True):
        peak, free, more = effort * rng.uniform(0.6, 1.0), 3.15 * rng.uniform(0.6, 1.4), int(rng.integers(0, 3))
        x = [rng.choice([0.0, rng.uniform(0.1, 0.6)]), *np.sort(rng.uniform(0.65, 0.95, more)), 1.0]
        y = [1.0, *np.sort(rng.uniform(0.1, 0.95, more))[::-1], 0.0]
        lines[name] = tuple((float(free * a), float(peak * b)) for a, b in zip(x, y, strict=True))
    peak, free = ({name: line[i][k] for name, line in lines.items()} for i, k in ((0, 1), (-1, 0)))
    return rd.tools.motors.Motors(peak=peak, continuous={}, speed=free, armature={}, line=lines)


def worst_use(plant: rd.Plant, motion: Any, motors: Any) -> float:
    """The largest use of torque and speed, by inverse dynamics and np.interp, at 20 000 times.

    The least λ with |τ|/λ ≤ ℓ(|v|/λ) is found by bisection, not by the formula of the library.
    """
    t = motion.start_s + (np.arange(20_000) + 0.5) / 20_000 * (motion.end_s - motion.start_s)
    q, v, a = motion.at(t)
    tau, most = np.abs(plant.inverse_dynamics(q, v, a, t=0.0)), 0.0
    drives = plant.inverse_dynamics(q, v, a, t=0.0) * v > 0
    for i, name in enumerate(plant.dynamics.joint_names):
        x, y = np.transpose(motors.line[name])
        most = max(most, (tau[:, i] / y[0]).max(), (np.abs(v[:, i]) / x[-1]).max())
        w, u = np.abs(v[drives[:, i], i]), tau[drives[:, i], i]
        low, high = np.zeros(len(u)), np.full(len(u), 10.0)
        for _ in range(40):
            middle = (low + high) / 2
            inside = u <= middle * np.interp(w / middle, x, y)
            low, high = np.where(inside, low, middle), np.where(inside, middle, high)
        most = max(most, high.max(initial=0.0))
    return most


@toppra
@pytest.mark.long
@pytest.mark.parametrize("seed", range(8))
def test_paths_at_their_limits_keep_random_lines(seed: int) -> None:
    """Within 1.001 of every line by own inverse dynamics, and at a limit for 98 % of the time."""
    rng, arm = np.random.default_rng(seed), rd.load("ur5")
    motors, points = random_motors(arm, rng), rng.uniform(-1.2, 1.2, (int(rng.integers(3, 6)), 6))
    effects = [rd.effects.ViscousFriction(0.05 * arm.effort_limit / arm.velocity_limit)] * (seed % 2)
    plan = rd.tools.motors.path(plant := rd.Plant(arm, effects), points, motors=motors)
    assert worst_use(plant, plan.reference, motors) <= 1.001
    assert plan.largest <= 1.001 and plan.at_limits >= 0.98


@toppra
@pytest.mark.long
def test_a_path_of_one_joint_is_that_of_the_closed_form() -> None:
    """A mass on P (1 − v/v₀) while driving and −P while braking, from rest to rest: the switch by a root.

    x(t) = v₀ (t − T (1 − exp(−t/T))) with T = m v₀/P, then v²/(2 P/m). Pieces of constant s̈ cost up to 0.3 %,
    and the tolerance of a limit gains up to 0.1 %.
    """
    peak, free, way = 6.0, 4.0, 2.0
    motors = rd.tools.motors.Motors(
        peak={"slide": peak}, continuous={}, speed={"slide": free}, armature={},
        line={"slide": ((0.0, peak), (free, 0.0))},
    )  # fmt: skip
    plan = rd.tools.motors.path(SLIDER, [[0.0], [way]], motors=motors)
    T = MASS * free / peak
    low, high, t, v = 0.0, 20.0, 0.0, 0.0
    for _ in range(60):
        t = (low + high) / 2
        v = free * (1 - np.exp(-t / T))
        gone = free * t - T * v + v**2 / (2 * peak / MASS)
        low, high = (t, high) if gone < way else (low, t)
    assert 0.999 <= plan.duration_s / (t + v / (peak / MASS)) <= 1.003


@toppra
@pytest.mark.parametrize("cliff", [((1.0, 0.8), (1.1, 0.4)), ((1.5, 0.8), (1.51, 0.5))])
def test_a_path_below_lines_with_a_cliff_is_within_limits(cliff: tuple[tuple[float, float], ...]) -> None:
    """The linearised line of the first alternates between both sides of the cliff, so its rounds end without 1e-4."""
    peak = {"joint_1": 70.0, "joint_2": 20.0}
    shape = ((0.0, 1.0), *cliff, (4.0, 0.0))
    lines = {name: tuple((v, y * torque) for v, y in shape) for name, torque in peak.items()}
    motors = rd.tools.motors.Motors(
        peak=peak, continuous={}, speed=dict.fromkeys(peak, 4.0), armature={}, line=lines
    )  # fmt: skip
    plan = rd.tools.motors.path(ARM, [[-1.2, 0.4], [-1.5, 0.8], [-2.4, -0.5]], motors=motors)
    assert worst_use(rd.Plant(ARM), plan.reference, motors) <= 1.001


@toppra
def test_the_fastest_motion_keeps_lines(motors: Any) -> None:
    """The same path faster, within its lines and continuous torques; another fraction takes longer."""
    motors = replace(motors, continuous={}, continuous_line={})
    slow = rd.control.quintic([0.1, 0.4], [1.2, -0.9], 2.5)
    budget = rd.tools.motors.budget(slow, ARM, motors=motors)
    fast = rd.tools.motors.fastest(budget)
    assert fast.budget.fits and fast.duration_s < 2.5
    assert worst_use(rd.Plant(ARM), fast.plan.reference, motors) <= 1.001
    assert max(x.line["used"] for x in fast.budget.joints) > 0.99
    assert rd.tools.motors.fastest(budget, 0.8).duration_s > fast.duration_s


@pytest.mark.parametrize(
    ("text", "remedy"),
    [(FILE.replace("8,0,", "8,1,"), "add the no-load speed"), ("joint,peak [N m]\na,1\n", "use an EffortLimit")],
)
def test_a_limit_of_a_run_needs_whole_lines(tmp_path: Path, text: str, remedy: str) -> None:
    (tmp_path / "motors.csv").write_text(text)
    with pytest.raises(PlanError, match=remedy):
        _ = rd.tools.motors.read_motors(tmp_path / "motors.csv").limit
