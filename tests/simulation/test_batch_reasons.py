"""A run of a batch ends for the reason for which `simulate` of the same row ends, whichever way the batch takes."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn.simulation import Reason

STABLE = 2.785293563405282  # h |λ| up to which RK4 is stable for λ < 0: 1 − x + x²/2 − x³/6 + x⁴/24 = 1
INERTIA = 1 / 3  # of the pendulum about its pivot, in [kg m²]


def reasons_of(runs: rd.Rollouts) -> list[Reason]:
    """The reasons of the runs of a batch, after they were compared with those of `simulate`."""
    for run, ours in enumerate(runs.outcomes):
        theirs = rd.simulate(runs.setup_of(run)).outcome
        assert (ours.reason, ours.joint, ours.ending) == (theirs.reason, theirs.joint, theirs.ending), run
        assert ours.t == pytest.approx(theirs.t, rel=0.2)  # growth magnifies rounding: a few steps
    return [outcome.reason for outcome in runs.outcomes]


@pytest.mark.parametrize("period", [0.0, 0.004], ids=["continuous", "sampled"])
def test_gains_of_an_arm_from_stable_to_unstable_give_the_reasons_of_single_runs(period: float) -> None:
    arm, q0 = rd.load("ur5"), np.full(6, 0.3)
    law = rd.control.PD(rd.control.hold(q0 + 0.2), kp=1.0, kd=0.05, period_s=period)
    setup = rd.Setup(rd.Plant(arm), q0, duration_s=1.0, controller=law, method="RK4", step_s=2e-3)
    factors = np.geomspace(1.0, 1e5, 6)
    runs = rd.rollouts(setup, vary={"kp": factors, "kd": 0.05 * factors})
    reasons = reasons_of(runs)
    cause = Reason.CONTROL_LOOP_UNSTABLE if period else Reason.STEP_TOO_LONG
    assert reasons[0] is Reason.END and reasons[-1] is cause
    assert not any(before is cause and after is Reason.END for before, after in pairwise(reasons))


def test_steps_just_above_the_longest_stable_one_are_the_reason() -> None:
    """v̇ = −(kd/I) v: RK4 is stable up to h = 2.785 I/kd."""
    joint, step = rd.load("pendulum").with_(gravity=(0.0, 0.0, 0.0)), 0.01
    parts = np.array([0.9, 0.97, 1.03])
    law = rd.control.PD(rd.control.hold([0.0]), kp=0.0, kd=1.0)
    setup = rd.Setup(rd.Plant(joint), [0.1], [1.0], duration_s=5000 * step, controller=law, method="RK4", step_s=step)
    runs = rd.rollouts(setup, vary={"kd": STABLE * INERTIA / step * parts})
    assert reasons_of(runs) == [Reason.END, Reason.END, Reason.STEP_TOO_LONG]
    assert runs.diverged.tolist() == [False, False, True]
    assert runs.table()["reason"].tolist() == [str(outcome.reason) for outcome in runs.outcomes]


@pytest.mark.parametrize("engine", ["auto", "interpreted"])
def test_a_run_thrown_out_of_a_stiff_spring_is_implausibly_fast(engine: str) -> None:
    """A spring of 1e12 N m/rad that the steps do not resolve: energy from nowhere, at 1e4 rad/s and more."""
    arm, law = rd.load("planar_2r"), rd.control.PD(rd.control.hold([0.0, 0.0]), kp=40.0, kd=4.0)
    stops = rd.effects.joint_stops([-1.0, -1.0], [0.5, 1.0], 1e12)
    plant = rd.Plant(arm, [rd.effects.EffortLimit(30.0), *stops])
    setup = rd.Setup(plant, [0.4, -0.7], [3.0, 5.0], 0.2, law, "RK4", 2e-3)
    runs = rd.rollouts(setup, v0=[[0.0, 0.0], [3.0, 5.0]], engine=engine)
    assert reasons_of(runs)[0] is Reason.END and runs.diverged.tolist() == [False, True]


def test_the_reason_of_a_run_does_not_depend_on_its_neighbours(tmp_path) -> None:
    """Of many that diverge each is judged; files keep reason and numbers."""
    arm, q0 = rd.load("planar_2r"), [0.4, -0.7]
    law = rd.control.PD(rd.control.hold([0.0, 0.0]), kp=10.0, kd=1.0, period_s=0.01)
    setup = rd.Setup(rd.Plant(arm), q0, duration_s=3.0, controller=law, method="RK4", step_s=0.01)
    kd = np.full(70, 200.0)
    runs, alone = rd.rollouts(setup, vary={"kd": kd}), rd.rollouts(setup, vary={"kd": kd[:1]})
    assert set(map(str, runs.outcomes)) == {str(alone.outcome(0))}
    assert alone.outcome(0).reason is Reason.CONTROL_LOOP_UNSTABLE
    back = rd.read(runs.save(tmp_path / "runs"))
    assert back.outcomes == runs.outcomes
