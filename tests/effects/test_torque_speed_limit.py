"""Motors whose torque falls with speed: closed forms of a mass under a torque–speed line; its corners are events."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn.effects import TorqueSpeedLimit
from robot_dyn.foundations import EffectError
from tests.effects.test_effect_states import MASS, SLIDER, Ramp

PEAK, FLAT, FREE = 6.0, 1.5, 4.0  # [N], [m/s], [m/s]
DC = TorqueSpeedLimit([0.0, FREE], [PEAK, 0.0])
FLAT_TOP = TorqueSpeedLimit([FLAT, FREE], [PEAK, 0.0])
RATE = PEAK / MASS / FREE  # of the exponential of the line of a DC motor
ARM = rd.load("planar_2r")
BOTH = pytest.mark.parametrize("engine", ["interpreted", "compiled"])


def slide(limit: Any, control: Any, duration_s: float, v0: float = 0.0, **options: Any) -> rd.Trajectory:
    options = {"estimate_error": False, "record_every_s": duration_s / 4, "method": "DP8"} | options
    options = {"step_s": 0.002} | options
    return rd.simulate(rd.Plant(SLIDER, [limit]), [0.0], [v0], duration_s=duration_s, controller=control, **options)


@BOTH
@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize("period_s", [0.0, 0.05])
def test_a_mass_at_full_command_approaches_the_no_load_speed(engine: str, sign: int, period_s: float) -> None:
    """Of m v' = P (1 − v/v₀): v = v₀ (1 − exp(−P t / (m v₀))), between ticks as well; steps of order 8."""
    run = slide(DC, Ramp(sign * 3 * PEAK, 0.0, period_s), 1.0, engine=engine)
    np.testing.assert_allclose(run.v[:, 0], sign * FREE * (1 - np.exp(-RATE * run.t)), rtol=1e-12, atol=1e-14)
    np.testing.assert_allclose(run.u[1:, 0], sign * PEAK * np.exp(-RATE * run.t[1:]), rtol=1e-11)


@BOTH
def test_a_flat_top_ends_at_an_event(engine: str) -> None:
    """Speed P t / m up to the corner at ω₁, and v₀ − (v₀ − ω₁) exp(−P s / (m (v₀ − ω₁))) after it."""
    run = slide(FLAT_TOP, Ramp(2 * PEAK, 0.0), 1.0, engine=engine)
    at = MASS * FLAT / PEAK
    assert [(x.name, x.joint) for x in run.events] == [("torque–speed corner of slide passed", "slide")]
    assert run.events[0].t == pytest.approx(at, rel=1e-12)
    v = FREE - (FREE - FLAT) * np.exp(-PEAK * (1.0 - at) / MASS / (FREE - FLAT))
    assert run.v[-1, 0] == pytest.approx(v, rel=1e-12)


@BOTH
def test_a_growing_command_reaches_the_line_at_an_event(engine: str) -> None:
    """Root of c + d t = P (1 − v/v₀) with m v = c t + d t²/2: a parabola."""
    c, d = 1.0, 2.0
    run = slide(DC, Ramp(c, d), 1.5, engine=engine)
    at = np.roots([RATE * d / 2, d + RATE * c, c - PEAK]).max()
    assert [x.name for x in run.events] == ["upper effort limit of slide reached"]
    assert run.events[0].t == pytest.approx(at, rel=1e-11)
    v = (c * at + d * at**2 / 2) / MASS
    assert run.v[-1, 0] == pytest.approx(FREE - (FREE - v) * np.exp(-RATE * (1.5 - at)), rel=1e-11)


@BOTH
def test_a_motor_brakes_with_its_peak_and_gives_nothing_beyond_its_no_load_speed(engine: str) -> None:
    fast = slide(DC, Ramp(9.0, 0.0), 0.2, v0=1.5 * FREE, engine=engine)
    np.testing.assert_allclose(fast.v[:, 0], 1.5 * FREE, rtol=1e-12)
    braked = slide(DC, Ramp(-9.0, 0.0), 0.2, v0=1.5 * FREE, engine=engine)
    np.testing.assert_allclose(braked.v[:, 0], 1.5 * FREE - PEAK / MASS * braked.t, rtol=1e-12)


@BOTH
def test_a_sampled_controller_that_jumps_at_ticks_is_that_of_small_steps(engine: str) -> None:
    """Against RK4 with 20 000 steps that ignore the corners: their error at kinks is about h², 1e-8."""
    control = rd.control.PD(rd.control.hold([0.8]), kp=60.0, kd=6.0, period_s=0.02)
    run = slide(FLAT_TOP, control, 1.0, engine=engine)
    fine = slide(FLAT_TOP, control, 1.0, engine="compiled", method="RK4", events=(), step_s=5e-5)
    assert run.events
    np.testing.assert_allclose(run.q[-1], fine.q[-1], atol=1e-7)


def test_every_state_is_bounded_as_by_interpolation() -> None:
    """np.interp of each joint's polyline, for driving and braking, on its sides too; 30 roundings of the peak."""
    rng = np.random.default_rng(3)
    lines = {"joint_1": ([0.5, 2.0, 3.0, 5.0], [9.0, 7.0, 2.0, 0.0]), "joint_2": ([0.0, 4.0], [3.0, 0.0])}
    limit = TorqueSpeedLimit({k: x for k, (x, _) in lines.items()}, {k: y for k, (_, y) in lines.items()})
    plant = rd.Plant(ARM, [limit])
    u, v = rng.uniform(-12, 12, (400, 2)), rng.uniform(-6, 6, (400, 2))
    allowed = np.array([np.interp(abs(w), *line) for line, w in zip([*lines.values()] * 400, v.ravel(), strict=True)])
    peak = np.array([line[1][0] for line in lines.values()])
    most = np.where(u * v > 0, allowed.reshape(-1, 2), peak)
    np.testing.assert_allclose(plant.actuation(u, v), np.clip(u, -most, most), atol=1e-13)
    bound: Any = plant.effects[0]
    for row in range(40):
        sides = {
            x: 1 if (v[row, x.joint] if x.of_velocity else bound.limited(u[row], v[row])[x.joint]) > x.level else -1
            for x in bound.thresholds(2)
        }
        np.testing.assert_allclose(
            bound.on_side(2, sides).actuation(u[row], v[row]), plant.actuation(u, v)[row], atol=1e-13
        )


def test_joints_left_out_have_no_limit_and_values_at_the_motor_pass_the_gear() -> None:
    """Torque times N, speed over N, exactly for a power of 2."""
    at_joint = rd.Plant(ARM, [TorqueSpeedLimit({"joint_2": [1.0, 4.0]}, {"joint_2": [8.0, 0.0]})])
    at_motor = rd.Plant(
        ARM, [TorqueSpeedLimit({"joint_2": [64.0, 256.0]}, {"joint_2": [0.125, 0.0]}, at="motor", gear_ratio=64.0)]
    )
    u, v = np.array([[99.0, 9.0], [-99.0, -9.0]]), np.array([[9.0, 2.5], [9.0, 2.5]])
    np.testing.assert_array_equal(at_joint.actuation(u, v), [[99.0, 4.0], [-99.0, -8.0]])
    np.testing.assert_array_equal(at_motor.actuation(u, v), at_joint.actuation(u, v))
    rest = np.zeros(2)
    a = ARM.forward_dynamics(rest, v[0], np.array([99.0, 4.0]))
    np.testing.assert_allclose(rd.compiled(at_joint).forward_dynamics(rest, v[0], u[0], t=0.0), a, rtol=1e-12)
    np.testing.assert_allclose(at_joint.forward_dynamics(rest, v[0], u[0]), a, rtol=1e-12)


def test_runs_of_a_batch_are_those_of_simulate() -> None:
    """Lanes in lock step against single runs, to the order of the method."""
    plant = rd.Plant(ARM, [TorqueSpeedLimit([2.0, 6.0], [30.0, 0.0])])
    control = rd.control.PD(rd.control.hold([1.0, -0.5]), kp=200.0, kd=20.0)
    setup = rd.Setup(plant, [0.3, -0.2], duration_s=0.5, controller=control, method="DP8", step_s=1e-3)
    runs = rd.rollouts(setup, vary={"kp": [150.0, 200.0]})
    alone = rd.simulate(setup, engine="interpreted")
    assert alone.events
    np.testing.assert_allclose(runs[1].q[-1], alone.q[-1], rtol=1e-9)


def test_a_scene_reads_the_same_words(tmp_path: Path) -> None:
    scene = """robot = "planar_2r"
duration_s = 0.1
[[effect]]
kind = "torque_speed_limit"
at = "motor"
gear_ratio = {joint_1 = 2.0, joint_2 = 4.0}
speed_rad_s = {joint_1 = [4.0, 8.0], joint_2 = [0.0, 8.0]}
torque_N_m = {joint_1 = [3.0, 0.0], joint_2 = [2.0, 0.0]}
"""
    (tmp_path / "scene.toml").write_text(scene)
    limit: Any = rd.read_scene(tmp_path / "scene.toml").plant.effects[0]
    u = limit.actuation(np.array([9.0, 9.0]), np.array([3.0, 1.0]))
    np.testing.assert_allclose(u, [3.0, 4.0], rtol=1e-14)


@pytest.mark.parametrize(
    ("options", "remedy"),
    [
        ({"speed": [0.0, 4.0], "torque": [6.0, 1.0]}, "must end with 0, at the no-load speed"),
        ({"speed": [4.0, 0.0], "torque": [6.0, 0.0]}, "must increase from point to point"),
        ({"speed": [0.0, 1.0, 4.0], "torque": [6.0, 7.0, 0.0]}, "must not increase with speed"),
        ({"speed": [0.0, 4.0], "torque": [0.0, 0.0]}, "must begin with a positive value"),
        ({"speed": [0.0, 1.0, 4.0], "torque": [6.0, 0.0]}, "must have the same shape"),
        ({"speed": [0.0, 314.0], "torque": [6.0, 0.0]}, "set at to motor and give the gear ratio"),
        ({"speed": [0.0, 4.0], "torque": [6.0, 0.0], "at": "motor"}, "give gear_ratio, 1 without a gear"),
        ({"speed": [0.0, 4.0], "torque": [6.0, 0.0], "gear_ratio": 9.0}, "set at to motor, or remove gear_ratio"),
        ({"speed": [0.0, 4.0], "torque": [6.0, 0.0], "at": "shaft"}, "must be joint or motor"),
        ({"speed": {"joint_1": [0.0, 4.0]}, "torque": [6.0, 0.0]}, "by joint name or both be arrays"),
        ({"speed": {"joint_1": [0.0, 4.0]}, "torque": {"joint_2": [6.0, 0.0]}}, "have different joints"),
        ({"speed": {"elbow": [0.0, 4.0]}, "torque": {"elbow": [6.0, 0.0]}}, "no joint 'elbow'"),
        ({"speed": [[0.0, 4.0]] * 3, "torque": [[6.0, 0.0]] * 3}, "has rows for 3 joints"),
    ],
)
def test_a_wrong_line_is_one_error_with_its_remedy(options: dict[str, Any], remedy: str) -> None:
    with pytest.raises(EffectError, match=remedy):
        rd.Plant(ARM, [TorqueSpeedLimit(**options)])


def test_motors_behind_springs_are_refused() -> None:
    elastic = rd.effects.SeriesElastic(stiffness=100.0, damping=1.0, inertia=0.1)
    with pytest.raises(EffectError, match="remove one of the two"):
        rd.simulate(rd.Plant(ARM, [TorqueSpeedLimit([0.0, 4.0], [6.0, 0.0]), elastic]), [0.0, 0.0], duration_s=0.01)
