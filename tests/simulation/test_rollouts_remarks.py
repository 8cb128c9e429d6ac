"""Remarks on batches: what `simulate` remarks on each run by itself is told of the batch, with the runs it is about."""

from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn.foundations import QueryError
from robot_dyn.simulation import RemarkKind, remark_lines
from robot_dyn.simulation.dynamics.stability import after, shown
from tests.long import long

COUNTED = (
    RemarkKind.CHATTER,
    RemarkKind.EFFORT_REACHED,
    RemarkKind.STOP_REACHED,
    RemarkKind.BEYOND,
    RemarkKind.JUMPS,
    RemarkKind.HELD,
)
CART = rd.load("cart_pole")  # 2 m, 5 m/s and 100 N are the limits of its slide
Q, V, B = np.array([0.1, 0.3]), np.array([0.2, -0.4]), 6
GOAL = rd.control.quintic(Q, np.array([1.9, 0.8]), 0.5)
DAMPED = rd.Plant(CART, [rd.effects.ViscousFriction([0.4, 0.05])])
LIMITED = rd.Plant(CART, [*DAMPED.effects, rd.effects.EffortLimit(90.0)])
STOPPED = rd.Plant(CART, [*DAMPED.effects, *rd.effects.joint_stops([-2.5, -4.0], [1.2, 4.0], 2e3, 1.0)])
HELD = rd.Plant(
    CART, [*DAMPED.effects, rd.effects.DryFriction([2.0, 0.01]), rd.effects.RigidStops([-2.5, -4.0], [1.2, 4.0])]
)
LATE = rd.control.Loop(rd.control.PD(GOAL, kp=500.0, kd=[60.0, 0.1], period_s=0.02), actuation_delay_periods=1.0)
SWEEP = np.linspace(0.2, 1.6, B)


def setup(plant: rd.Plant, controller: object, method: str = "RK4", **options) -> rd.Setup:
    own = {} if method == "DOP853" else {"step_s": 4e-3 if getattr(controller, "period_s", 0.0) else 5e-4}
    return rd.Setup(plant, Q, V, 0.8, controller, method=method, record_every_s=0.1, **own | options)


SCENES = {
    "late": (setup(LIMITED, LATE), {"kp": 500 * SWEEP, "effort_limit.limit": 150.0 * SWEEP}),
    "continuous": (setup(DAMPED, rd.control.PD(GOAL, kp=400.0, kd=20.0)), {"kp": 500 * SWEEP}),
    "chattering": (
        setup(LIMITED, rd.control.PD(GOAL, kp=10.0, kd=150.0, period_s=0.02)),
        {"effort_limit.limit": 100.0 * SWEEP},
    ),
    "canonical": (setup(DAMPED, rd.control.PD(GOAL, kp=400.0, kd=20.0), "GaussLegendre2"), {"kp": 500 * SWEEP}),
    "cut at stops": (
        setup(STOPPED, rd.control.PD(GOAL, kp=300.0, kd=20.0)),
        {"kp": 300 * SWEEP, "joint_stops.upper": 0.8 + SWEEP},
    ),
    "time stepping": (setup(HELD, rd.control.PD(GOAL, kp=400.0, kd=20.0), "MoreauJean"), {"kp": 400 * SWEEP}),
    "one by one": (
        setup(STOPPED, rd.control.PID(GOAL, kp=300.0, ki=30.0, kd=20.0, effort_limit=80.0), "DOP853"),
        {"effort_limit": 60 * SWEEP},
    ),
}


SPACING = 4e-3  # of the instants at which u is seen in lock step under continuous control: 8 of 1600 steps
LAGGING = rd.Plant(CART, [*DAMPED.effects, rd.effects.ActuatorLag([0.02, 0.01])])


@pytest.fixture(
    scope="module", params=[*(name for name in SCENES if name != "time stepping"), *long(["time stepping"])]
)
def batch(request) -> tuple[rd.Rollouts, list]:
    """A batch, and each of its runs by itself."""
    given, params = SCENES[request.param]
    q0 = Q + 0.2 * np.random.default_rng(4).normal(size=(B, 2))
    runs = rd.rollouts(given, q0, vary=params)
    return runs, [rd.simulate(runs.setup_of(i), estimate_error=False, engine="compiled") for i in range(B)]


def by_instants(runs: rd.Rollouts, about: tuple) -> bool:
    """Whether a remark is about an actuation that was seen at instants."""
    return about[2] == "u" and bool(runs.observed.instants.any())


def told(run) -> dict:
    """The remarks that are counted over a batch, by what they are about."""
    return {(each.kind, each.joint, each.quantity): each for each in run.remarks if each.kind in COUNTED}


def test_each_run_has_the_remarks_of_simulate(batch) -> None:
    """Times, values and limits, to rounding of two engines in a run that is cut at events; extremes of all steps.

    Where u is seen at instants, times are found to an instant at both ends, and a smooth peak within a part in 200;
    one at an impact, where u changes by up to 2500 N/s, within what it changes by between two instants.
    """
    runs, alone = batch
    assert any(told(each) for each in alone)
    for i, theirs in enumerate(map(told, alone)):
        ours = told(runs[i])
        assert ours.keys() == theirs.keys()
        for about, remark in theirs.items():
            numbers = [[x.start_s, x.duration_s, x.at_s, x.value, x.limit or 0.0] for x in (ours[about], remark)]
            if by_instants(runs, about):
                np.testing.assert_allclose(*np.array(numbers)[:, :3], rtol=0, atol=2 * SPACING)
                np.testing.assert_allclose(*np.array(numbers)[:, 3:], rtol=5e-3)
            else:
                np.testing.assert_allclose(*numbers, rtol=1e-6, atol=1e-9)
            assert ours[about].remedy == remark.remedy
        size = np.abs(alone[i].extremes).max()
        rows = 2 if runs.observed.instants.any() else 3
        np.testing.assert_allclose(runs[i].extremes[:rows], alone[i].extremes[:rows], rtol=0, atol=1e-7 * size)
        allowed = 2500.0 * SPACING if runs.setup.method.nonsmooth else 5e-3 * size
        np.testing.assert_allclose(runs[i].extremes, alone[i].extremes, rtol=0, atol=allowed)


def test_a_batch_tells_of_each_run_what_simulate_does(batch) -> None:
    """Kind, joint and quantity, run by run; the worst is the first, in its own words, and the line counts them."""
    runs, alone = batch
    for i, theirs in enumerate(map(told, alone)):
        assert {about for about, remark in told(runs).items() if i in remark.runs} == theirs.keys()
    for about, remark in told(runs).items():
        of = [told(alone[i])[about] for i in remark.runs]
        size = [x.duration_s if x.kind is RemarkKind.EFFORT_REACHED else abs(x.value - (x.limit or 0.0)) for x in of]
        seen = by_instants(runs, about)
        assert size[0] >= max(size) * (1 - (5e-3 if seen else 1e-9))
        assert remark.text.endswith(" (at samples and 200 instants)") if seen else remark.text == of[0].text
        assert remark.looked == B
        if remark.kind is RemarkKind.STOP_REACHED:  # how far beyond it, as runs are compared
            assert f" {remark.value:.4g} m (stop at {remark.limit:.4g}) " in remark.text
        assert f"{remark.text} (run {remark.runs[0]}; {len(of)} of {B} runs)" in "; ".join(remark_lines([remark]))
    assert all(line in runs.summary for line in remark_lines(runs.remarks))
    assert f"rd.simulate(runs.setup_of({runs.worst})) repeats it" in runs.summary
    assert "not observed" not in runs.summary


@pytest.mark.parametrize("sampled", [False, True], ids=["continuous", "sampled with a lag"])
def test_actuation_that_changes_between_ticks_is_seen_at_instants(sampled: bool) -> None:
    """Its extremes are those of a record of all steps, at each eighth and at samples; behind a lag at all of them."""
    of = setup(LAGGING, rd.control.PD(GOAL, kp=300.0, kd=20.0, period_s=0.02 if sampled else 0.0))
    of = replace(of, step_s=5e-4, record_every_s=0.0145)
    starts, record = Q + 0.3 * np.random.default_rng(5).normal(size=(B, 2)), ("u",)
    runs = rd.rollouts(of, starts, record=record)
    u = rd.rollouts(replace(of, record_every_s=0.0), starts, record=record).u
    every = np.arange(u.shape[1]) % (1 if sampled else 8) == 0
    every[np.rint(runs.t / 5e-4).astype(int)] = True
    expected = np.stack([u[:, every].min(axis=1), u[:, every].max(axis=1)], axis=1)
    np.testing.assert_allclose(runs.observed.extremes[:, 2], expected, rtol=1e-12)
    assert (runs.observed.instants == (0 if sampled else 200)).all()
    assert (expected[:, 0] > u.min(axis=1)).any() is not sampled  # a peak of which instants see less


def test_tracking_errors_are_those_of_simulate(batch) -> None:
    runs, alone = batch
    np.testing.assert_allclose(runs.rms_tracking_error, [each.rms_tracking_error for each in alone], rtol=1e-6)


def test_remarks_survive_files_and_slices(batch, tmp_path: Path) -> None:
    """A slice tells what a batch of its runs would; runs that were read tell it without their setup."""
    runs, _ = batch
    back = rd.read(runs.save(tmp_path / "runs"))
    assert back.remarks == runs.remarks and back.worst == runs.worst
    np.testing.assert_array_equal(back.rms_tracking_error, runs.rms_tracking_error)
    for some in (runs[1:4], back[1:4]):
        for i in range(3):
            about = {key for key, remark in told(runs).items() if i + 1 in remark.runs}
            assert {key for key, remark in told(some).items() if i in remark.runs} == about == told(some[i]).keys()
        np.testing.assert_array_equal(some.rms_tracking_error, runs.rms_tracking_error[1:4])
        assert all(each.looked in (1, 3) for each in some.remarks)
    for x, y in zip(told(back[1:4]).values(), told(runs[1:4]).values(), strict=True):
        assert x.text == y.text or x.text.endswith(", in another run")  # the reference is not in the file
    with pytest.raises(QueryError, match="runs that were read from a file have no setup"):
        back.setup_of(0)


def test_a_table_of_runs_has_a_row_for_each(batch, tmp_path: Path) -> None:
    """Parameters, outcomes, tracking errors, remarks and extremes, read back as text; another kind of file is kept."""
    runs, _ = batch
    path = runs.save(tmp_path / "table.csv")
    rows = [*csv.DictReader(path.read_text(encoding="utf-8").splitlines())]
    assert [row["run"] for row in rows] == [str(i) for i in range(B)]
    of_slide = [float(row["largest u slide [N]"]) for row in rows]
    np.testing.assert_array_equal(of_slide, runs.observed.extremes[:, 2, 1, 0])
    np.testing.assert_array_equal(
        [float(row["rms tracking error [m or rad]"]) for row in rows], runs.rms_tracking_error
    )
    for i, row in enumerate(rows):
        assert float(row["start q slide [m]"]) == runs.q0[i, 0]
        assert float(row["start v hinge [rad/s]"]) == runs.v0[i, 1]
        assert row["outcome"] == runs.outcome(i).ending and float(row["ended [s]"]) == runs.ended_s[i]
        about = {f"{kind} {quantity} {joint}" for kind, joint, quantity in told(runs[i])}
        assert about <= set(row["remarks"].split("; "))
    with pytest.raises(rd.RobotDynError, match=r"table\.csv"):
        runs[0].save(path)


def test_a_sampled_loop_is_linearised_in_the_worst_run() -> None:
    """The remark that `simulate` makes on that run, told of it alone."""
    given, params = SCENES["chattering"]
    runs = rd.rollouts(given, vary=params)
    remark, theirs = (
        next(each for each in of.remarks if each.kind is RemarkKind.UNSTABLE)
        for of in (runs, rd.simulate(runs.setup_of(runs.worst), estimate_error=False, engine="compiled"))
    )
    assert remark.runs == (runs.worst,) and remark.joint == theirs.joint
    assert remark.value == pytest.approx(theirs.value, rel=1e-6) and remark.remedy == theirs.remedy
    assert f"{remark.text} (run {runs.worst}; the only run examined)" in runs.summary


def test_tracking_errors_of_a_frame() -> None:
    """Distances of a frame from a line, those of `simulate`; a run that diverges counts up to its end."""
    arm = rd.load("planar_2r")
    q = np.array([0.4, 0.9])
    at = arm.placement(q, "tip")[:3, 3]
    law = rd.control.OperationalSpace(
        arm, "tip", rd.control.line(at, np.add(at, [0.1, 0, 0.1]), 0.2), kp=50.0, kd=10.0, rows=(0, 2)
    )
    given = rd.Setup(rd.Plant(arm), q, duration_s=0.2, controller=law, method="RK4", step_s=4e-3)
    runs = rd.rollouts(given, np.add(q, [[0.0, 0.1], [0.2, -0.1], [0.1, 0.3]]), [[0.1, 0.2], [0.3, 0.1], [1e5, 3e7]])
    assert list(runs.diverged) == [False, False, True]
    assert runs.worst == 2
    alone = [rd.simulate(runs.setup_of(i), estimate_error=False).rms_tracking_error for i in range(3)]
    np.testing.assert_allclose(runs.rms_tracking_error[:2], alone[:2], rtol=1e-9)
    assert {run.metadata["frame"] for run in runs} == {"tip"} and "tracking error of the frame [m]: " in runs.summary


def test_a_batch_of_one_speaks_of_a_run() -> None:
    """Its lines are those of the run: there is no other to count, nor one that was not looked at."""
    given, params = SCENES["chattering"]
    runs = rd.rollouts(given, vary={name: x[:1] for name, x in params.items()})
    alone = rd.simulate(runs.setup_of(0), estimate_error=False, engine="compiled")
    assert runs.summary.startswith("1 run of 9 samples to t = 0.8 s; 0 diverged, 0 stopped\n")
    theirs = remark_lines(each for each in alone.remarks if each.kind in (*COUNTED, RemarkKind.UNSTABLE))
    theirs += [line for line in alone.summary.splitlines() if line.startswith("tracking error of q [")]
    assert len(theirs) >= 3 and set(theirs) <= set(runs.summary.splitlines())


def test_a_limit_of_no_effort_is_reached_all_the_time_once() -> None:
    """Both sides of a limit of 0 are one: u = 0 is at it throughout, which is as long as the run, not twice that."""
    given = rd.Setup(
        rd.Plant(CART, [rd.effects.EffortLimit([0.0, 1.0])]),
        Q,
        V,
        0.2,
        rd.control.PD(GOAL, kp=40.0, kd=4.0, period_s=0.02),
    )
    runs = rd.rollouts(replace(given, method=rd.integrate.method("RK4")))
    for remarks in (runs.remarks, rd.simulate(given, estimate_error=False).remarks):
        (at,) = (each for each in remarks if each.kind is RemarkKind.EFFORT_REACHED and each.joint == "slide")
        assert at.duration_s == pytest.approx(0.2, rel=1e-9)


def test_growth_over_a_run_counts_its_periods() -> None:
    """0.3 s are three periods of 0.1 s, though floats divide to less. A run that diverges counts to its end."""
    arm, goal = rd.load("pendulum"), rd.control.hold([0.0])
    told, end = {}, {}
    for duration in (0.3, 60.0):
        setup = rd.Setup(
            rd.Plant(arm),
            [1e-3],
            None,
            duration,
            rd.control.PD(goal, kp=40.0, kd=100.0, period_s=0.1),
            estimate_error=False,
        )
        run = rd.simulate(setup)
        (told[duration],) = (remark for remark in run.remarks if remark.kind is RemarkKind.UNSTABLE)
        end[duration] = run.outcome.t
    assert f"by {told[0.3].value ** 3:.4g} over the run" in told[0.3].text
    assert 0.3 < end[60.0] < 5.0
    assert f"by {told[60.0].value ** int(end[60.0] / 0.1):.4g} over the run" in told[60.0].text
    assert shown(after(told[60.0].value, 600)) == "more than 1e+299"
