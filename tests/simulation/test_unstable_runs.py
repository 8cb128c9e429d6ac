"""Runs that are unstable because of their gains or their step report that, and their error is not estimated."""

from __future__ import annotations

from math import inf
from pathlib import Path

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn.simulation import Remark, RemarkKind
from tests.long import long, stress

INERTIA = 1 / 3  # of the pendulum about its pivot, in [kg m²]
STABLE = 2.785293563405282  # h |λ| up to which RK4 is stable for λ < 0: 1 − x + x²/2 − x³/6 + x⁴/24 = 1


@pytest.fixture(scope="module")
def joint() -> rd.Robot:
    """One joint of constant inertia, without gravity and limits: M v̇ = u."""
    return rd.load("pendulum").with_(gravity=(0.0, 0.0, 0.0))


def remark_of(run: rd.Trajectory, kind: RemarkKind) -> Remark:
    """The one remark of a kind."""
    (remark,) = (each for each in run.remarks if each.kind is kind)
    return remark


def test_gains_that_excite_an_elastic_gear_are_named_with_their_growth(joint: rd.Robot) -> None:
    """I q̈ = k δ, J θ̈ = u − k δ with δ = θ − q and u = −kp q − kd q̇: the largest Re λ of the four by four matrix."""
    k, J, kp, kd = 1000.0, 0.1, 500.0, 20.0

    def growth(s: float) -> float:
        A = [[0, 1, 0, 0], [0, 0, k / INERTIA, 0], [0, -1, 0, 1], [-s * kp / J, -s * kd / J, -k / J, 0]]
        return float(np.linalg.eigvals(A).real.max())

    law = rd.control.PD(rd.control.hold([0.0]), kp=kp, kd=kd)
    plant = rd.Plant(joint, [rd.effects.SeriesElastic(k, J)])
    run = rd.simulate(plant, [0.01], duration_s=60.0, controller=law)
    remark = remark_of(run, RemarkKind.UNSTABLE)
    assert run.outcome.ending == "diverged"
    assert run.outcome.text.startswith("control loop unstable")
    assert remark.value == pytest.approx(growth(1.0), rel=1e-4)  # derivatives by differences
    assert (remark.joint, remark.limit) == ("pivot", 0.0) and "kp = 500 N m/rad, kd = 20 N m s/rad" in remark.text
    assert run.error is not None and run.error.largest == inf and run.statistics.companion_runs == 0


def test_lower_gains_are_advised_only_where_they_are_stable(joint: rd.Robot) -> None:
    """With a viscous friction on the link, gains of a quarter are stable here, those of half are not."""
    k, J, b, kp, kd = 1000.0, 0.1, 4.0, 60.0, 2.0

    def growth(s: float) -> float:
        link = [0, -b / INERTIA, k / INERTIA, 0]
        return float(
            np.linalg.eigvals([[0, 1, 0, 0], link, [0, -1, 0, 1], [-s * kp / J, -s * kd / J, -k / J, 0]]).real.max()
        )

    s = next(0.5**i for i in range(1, 30) if growth(0.5**i) < 0)
    law = rd.control.PD(rd.control.hold([0.0]), kp=kp, kd=kd)
    plant = rd.Plant(joint, [rd.effects.SeriesElastic(k, J), rd.effects.ViscousFriction(b)])
    run = rd.simulate(plant, [0.01], duration_s=200.0, controller=law)
    assert growth(2 * s) > 0 and run.outcome.ending == "diverged"
    assert f"stable with {s:.3g} times these" in remark_of(run, RemarkKind.UNSTABLE).remedy


ARMS = ["ur5", *long(["xarm7"]), *stress(["ur10", "planar_2r", "kinova"])]


@pytest.mark.parametrize("name", ARMS)
def test_an_arm_with_gears_and_high_gains_is_reported_as_unstable_not_as_stiff(name: str) -> None:
    arm = rd.load(name)
    n, q0 = arm.n, np.full(arm.n, 0.3)
    gears = rd.effects.SeriesElastic(np.full(n, 2e4), np.full(n, 2e-4), ratio=np.full(n, 100.0), damping=5.0)
    law = rd.control.FeedForward(arm, rd.control.quintic(q0, q0 + 0.4, 1.0), kp=2e4, kd=800.0)
    run = rd.simulate(rd.Plant(arm, [gears]), q0, duration_s=2.0, controller=law)
    assert run.outcome.ending == "diverged"
    assert run.outcome.text.startswith("control loop unstable")
    assert remark_of(run, RemarkKind.UNSTABLE).joint in arm.joint_names
    assert run.error is not None and run.error.largest == inf and run.statistics.companion_runs == 0


@pytest.mark.parametrize("part", [0.97, 1.03])
def test_a_step_just_above_the_longest_stable_one_is_reported_with_that_one(joint: rd.Robot, part: float) -> None:
    """v̇ = −(kd/I) v: RK4 is stable up to h = 2.785 I/kd."""
    kd = 100.0
    limit = STABLE * INERTIA / kd
    law = rd.control.PD(rd.control.hold([0.0]), kp=0.0, kd=kd)
    run = rd.simulate(
        rd.Plant(joint), [0.1], [1.0], duration_s=5000 * limit * part, controller=law, method="RK4",
        step_s=limit * part,
    )  # fmt: skip
    if part < 1:
        assert run.outcome.ending == "finished"
        assert all(remark.kind is not RemarkKind.TOO_LONG for remark in run.remarks)
    else:
        assert run.outcome.ending == "diverged"
        remark = remark_of(run, RemarkKind.TOO_LONG)
        assert remark.limit == pytest.approx(limit, rel=1e-3)  # to which limits are searched
        assert remark.joint == "pivot" and "control" in remark.text
        assert run.error is not None and run.error.largest == inf


@pytest.mark.parametrize("part", [0.99, 1.01])
@pytest.mark.parametrize("stated", [0.5, None])
def test_no_companion_runs_past_a_hundred_times_the_velocity_limit(tmp_path: Path, stated, part: float) -> None:
    """A joint under a constant torque reaches v = u t/I; where its file states no limit, 100 rad/s is taken."""
    text = (Path(__file__).parents[2] / "urdf" / "pendulum.urdf").read_text(encoding="utf-8")
    if stated is not None:
        text = text.replace("<axis", f'<limit lower="-1e9" upper="1e9" velocity="{stated}" effort="1e9"/><axis', 1)
        text = text.replace('type="continuous"', 'type="revolute"')
    (tmp_path / "joint.urdf").write_text(text)
    arm = rd.load(tmp_path / "joint.urdf").with_(gravity=(0.0, 0.0, 0.0))
    v_end = part * 100.0 * (stated or 100.0)
    run = rd.simulate(rd.Plant(arm), [0.0], [v_end], duration_s=0.01)
    assert run.error is not None
    assert (run.statistics.companion_runs == 0, run.error.largest == inf) == (part > 1, part > 1)


def test_a_run_that_a_stop_throws_out_of_its_steps_has_not_finished() -> None:
    """A stop of 1e12 N m/rad, of which the steps know nothing until the joint is in it."""
    arm = rd.load("planar_2r")
    stops = np.atleast_1d(rd.effects.joint_stops([-1.0, -1.0], [0.5, 1.0], 1e12))
    law = rd.control.PD(rd.control.hold([0.0, 0.0]), kp=40.0, kd=4.0)
    run = rd.simulate(
        rd.Plant(arm, [rd.effects.EffortLimit(30.0), *stops]), [0.4, -0.7], [3.0, 5.0], duration_s=0.2, controller=law,
        method="RK4", step_s=2e-3,
    )  # fmt: skip
    assert run.outcome.ending == "diverged" and run.outcome.joint == "joint_2"
    assert max(event.t for event in run.events) <= run.outcome.t < 0.2, "an event was located after the end"


@pytest.mark.parametrize("kp", [1e10, 1e60, 1e150])
@pytest.mark.parametrize("engine", ["interpreted", "compiled"])
def test_no_event_of_states_that_overflow_is_after_the_end_of_the_run(kp: float, engine) -> None:
    """Explosive gains, with a stop and an effort limit that are passed in steps of which the end is no number."""
    arm = rd.load("pendulum")
    law = rd.control.PD(rd.control.hold([0.2]), kp=kp, kd=0.0)
    plant = rd.Plant(arm, [rd.effects.EffortLimit(1e300), *rd.effects.joint_stops([-1.0], [1.0], 1e4)])
    run = rd.simulate(plant, [0.3], [0.1], duration_s=0.05, controller=law, method="RK4", step_s=2e-3, engine=engine)
    assert run.outcome.ending == "diverged"
    assert max([0.0, run.t[-1], *(event.t for event in run.events)]) <= run.outcome.t <= 0.05
