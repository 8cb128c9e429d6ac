"""The error estimate of a run, against errors known from references that agree among themselves."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn.cli import report
from robot_dyn.foundations import QueryError
from robot_dyn.simulation import Doubt, DoubtKind, ErrorEstimate, Run, Verdict, choose
from robot_dyn.simulation.estimate.estimate import estimate
from robot_dyn.simulation.results.error_estimate import no_estimate
from robot_dyn.simulation.run.recording import Path
from robot_dyn.simulation.run.runner import Runner
from tests.campaigns.estimates.switching import scene_of_all
from tests.campaigns.hard.nonsmooth_tutorials import twisting
from tests.long import long, stress, third

DOUBLE = rd.load("planar_2r")
PANDA = rd.load("panda").with_(lock={"panda_finger_joint1": 0.0})
READY = np.array([0.3, 0.6, -0.4, -1.2, 0.5, 1.1, 0.2])
REACH = rd.control.quintic(READY, READY + np.array([0.4, -0.3, 0.5, 0.2, -0.6, 0.3, 0.4]), 0.5)

# plant, controller, q0, v0, duration, step of RK4
SCENES = {
    "pendulum": (rd.Plant(rd.load("pendulum")), None, [2.5], [0.7], 2.0, 4e-3),
    "planar_2r with friction": (
        rd.Plant(DOUBLE, [rd.effects.ViscousFriction([0.4, 0.2])]), None, [0.4, -0.7], [0.3, 0.5], 1.0, 5e-3,
    ),
    "panda, free swing": (rd.Plant(PANDA), None, READY, np.zeros(7), 1.0, 2e-3),
    "panda, computed torque": (
        rd.Plant(PANDA), rd.control.ComputedTorque(PANDA, REACH, bandwidth_rad_s=8.0, damping_ratio=0.9),
        READY + 0.1, np.full(7, -0.2), 0.5, 5e-3,
    ),
    "cart_pole with spring": (
        rd.Plant(rd.load("cart_pole"), [rd.effects.Spring([30.0, 0.0], [0.2, 0.0])]), None, [0.1, 0.8], [0.3, -0.5],
        1.0, 5e-3,
    ),
}  # fmt: skip


def setup(plant, law, q0, v0, duration, step) -> rd.Setup:
    return rd.Setup(plant, q0=q0, v0=v0, duration_s=duration, controller=law, method="RK4", step_s=step)


def true_error(run: rd.Trajectory, reference: rd.Trajectory) -> np.ndarray:
    """Largest error of any joint up to each sample of a run."""
    np.testing.assert_allclose(run.t, reference.t, atol=1e-12)
    return np.maximum.accumulate(np.abs(run.q - reference.q).max(axis=1))


CASES = [pytest.param(scene, id=name) for name, scene in SCENES.items()]


@pytest.mark.parametrize("scene", [CASES[1], *third([CASES[0], *CASES[2:]])])
def test_estimate_is_within_a_factor_of_ten_of_the_true_error(scene) -> None:
    """At its end and at most times on the way; order 8 at half the step is exact to 1e-4 of that, and says so."""
    run = rd.simulate(setup(*scene))
    reference = rd.simulate(setup(*scene), method=rd.integrate.method("DP8"), step_s=scene[-1] / 2,
                            record_every_s=scene[-1], estimate_error=False)  # fmt: skip
    tight = rd.simulate(setup(*scene), method=rd.integrate.Adaptive(rtol=1e-13, atol=1e-14), estimate_error=False)
    error, estimate = true_error(run, reference), run.error
    assert estimate is not None
    assert np.abs(reference.q[-1] - tight.q[-1]).max() < 1e-3 * error[-1]  # the references agree
    assert estimate.until_s == scene[-2]
    assert estimate.note == ""
    assert 0.1 < estimate.largest / error[-1] < 10
    at = np.searchsorted(run.t, estimate.t - 1e-12)
    known = error[at] > 1e-11  # below it the floor of the estimate rules
    ratio = estimate.error[known] / error[at][known]
    assert ((ratio > 0.1) & (ratio < 10)).mean() > 0.95
    assert known.sum() > 20
    assert f"{estimate.largest:.1e}" in run.summary


SAMPLED = rd.control.PD(rd.control.quintic([0.4, -0.7], [0.9, 0.2], 0.5), kp=[60.0, 20.0], kd=[4.0, 1.0], period_s=0.05)


@pytest.mark.parametrize(
    ("method", "step", "law"),
    [
        *(("Midpoint", 2e-3, None), ("RK4", 5e-3, SAMPLED)),
        *long([("Rodas5PFixed", 4e-3, None), ("GaussLegendre4", 4e-3, None), ("Euler", 5e-4, None)]),
    ],
)
def test_estimate_holds_for_methods_of_every_order(method: str, step: float, law: rd.control.PD | None) -> None:
    """Also of sampled control: companions take longer steps, never fewer ticks, and order 4 shows at its jumps."""
    plant, _, q0, v0, duration, _ = SCENES["planar_2r with friction"]
    base = setup(plant, law, q0, v0, duration, step)
    run = rd.simulate(base, method=method)
    tight = rd.simulate(base, method=rd.integrate.Adaptive(rtol=1e-13, atol=1e-14), estimate_error=False)
    error = np.abs(run.q[-1] - tight.q[-1]).max()
    assert run.error is not None and run.error.note == ""
    assert run.error.until_s == duration
    assert error / 10 < run.error.largest < 10 * max(error, 1e-12)


@pytest.mark.parametrize("scene", [CASES[1], CASES[4], *third([CASES[0], *CASES[2:4]])])
def test_estimate_of_an_adaptive_run_is_near_its_error(scene) -> None:
    """A run of a tenth of the tolerance errs about eight times less, so the difference is the error to some 15 %."""
    run = rd.simulate(setup(*scene), method=rd.integrate.Adaptive())
    tight = rd.simulate(setup(*scene), method=rd.integrate.Adaptive(rtol=1e-13, atol=1e-14), estimate_error=False)
    error = np.abs(run.q - tight.q).max()
    assert run.error is not None
    assert 0.3 * error < run.error.largest < 3 * max(error, 2e-12)


@pytest.mark.parametrize("step", [0.05, *long([0.02])])
def test_chaos_at_a_coarse_step_is_not_resolved(step: float) -> None:
    """The double pendulum from 2.5 rad tumbles: errors grow e-fold in less than 1 s, up to the size of the motion."""
    chaos = setup(rd.Plant(DOUBLE), None, [2.5, 0.7], [0.3, 0.5], 20.0, step)
    run = rd.simulate(chaos)
    reference = rd.simulate(chaos, method="DP8", step_s=step / 10, record_every_s=step, estimate_error=False)
    error, estimate = true_error(run, reference), run.error
    assert error[-1] > 1.0  # the end of the run is fiction
    assert estimate is not None
    assert estimate.until_s < 20.0
    assert estimate.ends_early and estimate.ends_early.kind is DoubtKind.COMPANIONS_DIFFER
    assert estimate.ends_early.facts == {"limit": 0.1, "smaller_step_s": step / 4}
    assert f"up to t = {estimate.until_s:g} s" in run.summary
    assert estimate.note in run.summary
    before = error[run.t <= estimate.until_s]
    assert before[-1] < 0.1
    assert 0.1 < estimate.at(estimate.until_s) / before[-1] < 10 and estimate.largest == np.inf


def test_a_long_adaptive_run_of_chaos_is_not_resolved() -> None:
    chaos = setup(rd.Plant(DOUBLE), None, [2.5, 0.7], [0.3, 0.5], 20.0, 0.01)
    run = rd.simulate(chaos, method=rd.integrate.Adaptive(rtol=1e-4, atol=1e-6))
    assert run.error is not None
    assert run.error.until_s < 20.0
    assert run.error.ends_early and run.error.ends_early.facts["smaller_rtol"] == 1e-6
    assert run.error.at(run.error.until_s) <= 0.1 and run.error.largest == np.inf


def test_a_run_whose_estimate_ends_early_has_no_finite_error() -> None:
    """30 s of a chaotic arm: the estimate ends near 0.1 rad at 20 s, and the end of the run is off by radians."""
    run = rd.simulate(rd.load("planar_2r"), [-1.2, 2.0], [3.0, -2.0], duration_s=30.0)
    exact = rd.simulate(
        rd.load("planar_2r"), [-1.2, 2.0], [3.0, -2.0], duration_s=30.0,
        method=rd.integrate.Adaptive(rtol=1e-13, atol=1e-14), estimate_error=False,
    )  # fmt: skip
    assert run.error is not None and run.error.note
    assert np.abs(run.q[-1] - exact.q[-1]).max() > 1 > run.error.at(run.error.until_s)
    assert run.error.until_s < run.t[-1] and run.error.largest == np.inf == run.error.at(run.t[-1])
    assert report.run(run)["error_largest"] == np.inf


def test_the_estimate_at_a_time_is_the_largest_up_to_it() -> None:
    t, error = np.array([0.0, 0.1, 0.2, 0.3]), np.array([0.0, 1e-9, 1e-9, 4e-9])
    whole, early = ErrorEstimate(t, error, 0.3), ErrorEstimate(t, error, 0.2, Doubt(DoubtKind.COMPANIONS_DIFFER))
    assert whole.largest == whole.at(0.3) == 4e-9 and early.largest == np.inf
    np.testing.assert_array_equal(early.at([0.0, 0.05, 0.1, 0.15, 0.2, 0.21]), [0, 1e-9, 1e-9, 1e-9, 1e-9, np.inf])
    assert whole.at(3 * 0.1) == 4e-9  # one unit after 0.3
    assert np.isnan(whole.at([-0.1, np.nan])).all() and whole.at(np.zeros((2, 3))).shape == (2, 3)
    none = no_estimate(Doubt(DoubtKind.ENDED_AT_ONCE))
    assert none.largest == none.at(0.0) == np.inf
    with pytest.raises(QueryError, match="t must be a time in seconds"):
        whole.at(["soon"])


@pytest.mark.parametrize("index", [1, 3, 6, *long([2, 4]), *stress([0, 5, 7])])
def test_the_largest_error_is_finite_where_the_estimate_holds_to_the_end_of_the_run(index: int) -> None:
    run = rd.simulate(scene_of_all(5, index).setup)
    assert run.error is not None
    assert np.isfinite(run.error.largest) == (run.error.until_s >= run.t[-1] * (1 - 1e-12)), str(run.error)


def test_rounding_alone_is_not_an_error_of_the_method() -> None:
    """Free fall on a rail is exact in RK4: differences are rounding, no reason for doubt."""
    cart = rd.load("cart_pole").with_(lock={"hinge": 0.4}, gravity=(1.7, 0.0, -9.80665))
    run = rd.simulate(rd.Plant(cart), q0=[0.3], v0=[-0.8], duration_s=1.0)
    assert run.error is not None
    assert run.error.until_s == 1.0
    assert run.error.largest < 1e-11


@pytest.mark.parametrize("k", [3, *third([1, 6, 11])])
def test_rounding_that_the_motion_magnifies_is_in_the_estimate_of_an_adaptive_run(k: int) -> None:
    """Upright, q − π = (q₀ − π)(cosh ωt − 1) + v₀ sinh ωt / ω, and e^{ωT} = 2e8 times rounding of 4e-16 is 1e-7 rad.

    Halved steps alone differed by 1/10 to 1/70 of the error on these starts; (q − π)³/48 of sin is 8e-10
    rad at most.
    """
    arm, v0, T = rd.load("pendulum"), (k + 1) * 1e-11, 5.0
    omega = np.sqrt(rd.linearise(arm, [np.pi], [0.0], [0.0])[0][1, 0])
    tight = rd.integrate.Adaptive("DOP853", 1e-13, 1e-15)
    run = rd.simulate(arm, [np.pi], [v0], duration_s=T, method=tight, engine="interpreted")
    off = -1.2246467991473532e-16  # of the float nearest to π from π
    exact = off * (np.cosh(omega * T) - 1) + v0 * np.sinh(omega * T) / omega
    error = abs(run.q[-1, 0] - np.pi - exact)
    assert error > 1e-8
    assert run.error.at(run.error.until_s) >= 0.3 * error


@pytest.mark.parametrize("method", [rd.integrate.method("RK4"), rd.integrate.Adaptive(rtol=1e-10)])
def test_companions_that_end_before_their_first_shared_state_show_nothing(method, monkeypatch) -> None:
    step = {} if method.controls_error else {"step_s": 5e-3}
    of = rd.Setup(rd.Plant(DOUBLE), [0.4, -0.7], [0.3, 0.5], 0.2, None, method, engine="interpreted", **step)
    run = Run(of, choose(of)).record()
    nothing = Path(run.shared.key[:0], run.shared.t[:0], run.shared.y[:0])
    monkeypatch.setattr(Runner, "run", lambda *_: replace(run, shared=nothing))
    found = estimate(of, run, Runner(choose(of)))
    assert found.verdict is Verdict.NONE and found.largest == np.inf


@pytest.mark.long
def test_a_run_that_ends_where_events_accumulate_has_an_estimate_of_its_true_error() -> None:
    """Companions there take steps at rounding; one that Newton's iteration had made longer was tried for ever."""
    motion = twisting().motion
    run = rd.simulate(motion.setup, method="DOP853", record_every_s=0.1)
    assert run.outcome.reason == rd.simulation.Reason.EVENTS_ACCUMULATE
    assert np.abs(run.q - motion.exact(run.t)).max() <= 10 * run.error.largest <= 1e-6
