"""Gears with losses: the torque of the motor against closed forms of one joint, and plans within the motor's torque."""

from __future__ import annotations

from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import brentq

import robot_dyn as rd
from robot_dyn.foundations import PlanError
from robot_dyn.tools.motors import Motors, read_motors

ROD = rd.load("simple_pendulum")
JOINT = ROD.joint_names[0]
ETA, J, PEAK = 0.7, 0.4, 60.0
MOTORS = Motors({JOINT: PEAK}, {JOINT: 20.0}, {JOINT: 9.0}, {JOINT: J}, efficiency={JOINT: ETA})
FREE = ROD.with_(gravity=(0.0, 0.0, 0.0))
INERTIA = float(FREE.M(np.array([0.3]))[0, 0])
toppra = pytest.mark.skipif(find_spec("toppra") is None, reason="needs toppra")


def motor_torque(through: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
    """A motor gives the rotor J a, and through/η where it drives, η through where it is driven back."""
    return J * a + np.where(through * v > 0, through / ETA, np.where(through * v < 0, ETA * through, through))


def test_a_stroke_without_gravity_takes_the_energy_of_the_load_over_eta() -> None:
    """From rest to v and back: ½ I v²/η + ½ J v² delivered, η ½ I v² + ½ J v² returned; v of a quintic is 15/8 Δ/T."""
    plan = rd.control.quintic([0.2], [1.4], 0.8)
    joint = rd.tools.motors.budget(plan, FREE, motors=MOTORS).joints[0]
    load, rotor = (0.5 * inertia * (15 / 8 * 1.2 / 0.8) ** 2 for inertia in (INERTIA, J))
    assert joint.energy == pytest.approx(load / ETA + rotor, rel=1e-9)  # the rule of integration is exact to rounding
    assert joint.regenerated == pytest.approx(load * ETA + rotor, rel=1e-9)
    a = 10 / np.sqrt(3) * 1.2 / 0.8**2  # largest acceleration of a quintic
    assert joint.peak == pytest.approx((INERTIA / ETA + J) * a, rel=1e-9)
    assert joint.of_peak["gear loss"] == pytest.approx(INERTIA * (1 / ETA - 1) * a, rel=1e-9)


def test_the_demand_of_a_motor_is_that_of_the_formula() -> None:
    """Lifting, lowering and reversals at 20 001 times; peaks between them are missed by O(h) at jumps, as are means."""
    plan = rd.control.from_samples(ROD, [[0.1], [1.3], [-0.8], [0.4]], time=[0.0, 0.7, 1.5, 2.0])
    joint = rd.tools.motors.budget(plan, ROD, motors=MOTORS).joints[0]
    t = np.linspace(0, 2.0, 20_001)
    q, v, a = plan.reference.at(t)
    tau = motor_torque(ROD.inverse_dynamics(q, v, a), v, a)[:, 0]
    assert joint.peak == pytest.approx(np.abs(tau).max(), rel=1e-4)
    assert joint.rms == pytest.approx(np.sqrt(np.trapezoid(tau**2, t) / 2.0), rel=1e-4)
    assert joint.energy == pytest.approx(np.trapezoid((tau * v[:, 0]).clip(0), t), rel=1e-4)
    assert sum(joint.of_peak.values()) == pytest.approx(np.copysign(joint.peak, sum(joint.of_peak.values())), rel=1e-12)


@pytest.mark.parametrize(("start", "end", "held_at_s"), [(1.2, 0.4, 0.0), (2.6, np.pi / 2, 20.0)])
def test_at_rest_the_motor_holds_the_whole_torque(start: float, end: float, held_at_s: float) -> None:
    """Lowered slowly, the gear bears a part, but not at the ends; rounding leaves velocities of 1e-16 rad/s there."""
    held = float(ROD.N(np.array([end if held_at_s else start]))[0])
    for plan in (
        rd.control.quintic([start], [end], 20.0),
        rd.control.from_samples(ROD, [[start], [end]], time=[0, 20.0]),
    ):
        joint = rd.tools.motors.budget(plan, ROD, motors=replace(MOTORS, armature={})).joints[0]
        # the deceleration of a stroke of 1 rad in 20 s adds 1e-5 of it; without the rest, 30 % would be missing
        assert (joint.peak, joint.peak_at_s) == (pytest.approx(held, rel=1e-4), pytest.approx(held_at_s, abs=0.1))
        assert joint.of_peak["gear loss"] == 0


def test_static_friction_of_the_joint_is_overcome_through_the_gear() -> None:
    """τ_b = J a + (I a + f_s)/η; the stroke begins with a = 0."""
    plant = rd.Plant(FREE, [rd.effects.DryFriction(3.0, 5.0)])
    joint = rd.tools.motors.budget(rd.control.quintic([0.2], [1.4], 0.8), plant, motors=MOTORS).joints[0]
    assert joint.breakaway == pytest.approx(5.0 / ETA, rel=1e-9)


def test_the_actuation_of_a_run_goes_through_the_gear() -> None:
    arm = ROD.with_(armature=J)
    reference = rd.control.quintic([0.2], [1.4], 0.8)
    law = rd.control.ComputedTorque(arm, reference, bandwidth_rad_s=20.0)
    run = rd.simulate(rd.Plant(arm), [0.2], duration_s=0.8, controller=law)
    joint = rd.tools.motors.budget(run, motors=MOTORS).joints[0]
    expected = motor_torque(run.u - J * run.a, run.v, run.a)
    assert joint.peak == pytest.approx(np.abs(expected).max(), rel=1e-12)
    assert joint.of_peak["gear loss"] != 0


@toppra
def test_a_path_is_within_the_torque_of_its_motors() -> None:
    """At 20 001 times by the formula. The limit η τ_max of a driving joint leaves (1 − η) J a of the rotor unused."""
    arm = ROD.with_(armature=J)
    plan = rd.tools.motors.path(arm, np.array([[0.1], [2.4], [-0.4]]), motors=MOTORS)
    q, v, a = plan.reference.at(np.linspace(0, plan.duration_s, 20_001)[1:-1])
    tau = motor_torque(arm.inverse_dynamics(q, v, a) - J * a, v, a)
    assert 0.9 <= np.abs(tau).max() / PEAK <= 1.001
    assert plan.largest <= 1.001
    without = rd.tools.motors.path(arm, np.array([[0.1], [2.4], [-0.4]]), motors=replace(MOTORS, efficiency={}))
    assert without.duration_s < plan.duration_s
    fast = rd.tools.motors.fastest(rd.tools.motors.budget(plan, arm, motors=replace(MOTORS, continuous={})))
    assert fast.budget.fits


@pytest.mark.parametrize(
    ("limit", "peak"),
    [("peak torque", 110.0), ("continuous torque", 999.0), ("break-away torque", 240.0), ("line", 130.0)],
)
def test_the_largest_payload_through_gears_is_the_mass_at_which_budgets_use_a_limit(limit: str, peak: float) -> None:
    """The root of largest share − 1, over budgets with payloads; peaks between times are refined to 1e-9."""
    arm = rd.load("planar_2r")
    plan = rd.control.via_points([0.0, 0.6, 1.3, 2.0], [[0.2, 0.4], [1.3, -0.9], [-0.5, 0.3], [0.1, 1.2]])
    plant = rd.Plant(arm, [rd.effects.DryFriction(4.0, 70.0)] if limit == "break-away torque" else [])
    first, second = arm.joint_names
    motors = Motors(
        peak={first: peak, second: peak}, continuous={first: 60.0} if limit == "continuous torque" else {},
        speed={first: 9.0, second: 9.0}, armature={first: 0.9, second: 0.3}, efficiency={first: 0.7, second: 0.8},
        line=dict.fromkeys((first, second), ((0.5, peak), (20.0, 0.0))) if limit == "line" else {},
    )  # fmt: skip
    link, com = arm.frame_names[-1], (0.1, 0.0, 0.0)

    def over(mass: float) -> float:
        loaded = rd.tools.motors.budget(plan, plant, motors=motors, payload=rd.Payload(link, mass, com))
        return max(used for joint in loaded.joints for used in joint.shares.values()) - 1

    most = rd.tools.motors.max_payload(rd.tools.motors.budget(plan, plant, motors=motors), link, com)
    assert most.mass == pytest.approx(brentq(over, 1e-3, 20.0), rel=1e-7)
    assert most.limit == ("peak torque" if limit == "line" else limit)
    assert most.largest_share == pytest.approx(1.0, abs=1e-9)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("joint,peak [N m],efficiency\na,1,0.8\n", "at the motor"),
        ("joint,peak [N m],efficiency,at,gear_ratio\na,1,80,motor,100\n", "percent"),
        ("joint,peak [N m],efficiency,at,gear_ratio\na,1,0,motor,100\n", "positive number"),
    ],
)
def test_an_efficiency_is_a_fraction_for_torques_at_the_motor(tmp_path: Path, text: str, said: str) -> None:
    (tmp_path / "motors.csv").write_text(text)
    with pytest.raises(PlanError, match=said):
        read_motors(tmp_path / "motors.csv")


def test_an_efficiency_of_a_file_may_be_in_percent(tmp_path: Path) -> None:
    (tmp_path / "motors.csv").write_text(
        "joint,peak [N m],efficiency [%],at,gear_ratio\na,1,80,motor,100\nb,2,,motor,1\n"
    )
    assert read_motors(tmp_path / "motors.csv").efficiency == {"a": pytest.approx(0.8)}
