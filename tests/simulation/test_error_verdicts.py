"""What an error estimate rests on is said, and no estimate is silent where it would mislead."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import flint
import numpy as np
import pytest
from scipy.integrate import solve_ivp

import robot_dyn as rd
from robot_dyn.effects import Active
from robot_dyn.foundations import QueryError, tanh
from robot_dyn.simulation import Doubt, DoubtKind, Verdict
from robot_dyn.simulation.results import provenance as origin
from tests.campaigns.estimates.judge import FAR, LEAST, MOST, judge
from tests.campaigns.estimates.layers import judge_layer, slide, slider_truth
from tests.campaigns.estimates.scenes import FAMILIES, arms
from tests.campaigns.estimates.switching import scene_of_all
from tests.campaigns.estimates.truth import truth
from tests.campaigns.hard.stiff_motion import stop
from tests.long import long, stress, third
from tests.own_method import OwnImplicit
from tests.user_parts import Push

RAIL = arms()["rail"].with_(gravity=(0.0, 0.0, 0.0))
TOSS = arms()["rail"]
PANDA = rd.load("panda").with_(lock={"panda_finger_joint1": 0.0})
SEED, SCENES = 20261121, 24
READY = np.array([0.3, 0.6, -0.4, -1.2, 0.5, 1.1, 0.2])


SMOOTH = [index for index in range(SCENES) if FAMILIES[index % len(FAMILIES)] == "smooth"]
SWITCHED = sorted(set(range(SCENES)) - set(SMOOTH))


@pytest.mark.parametrize("index", [*SWITCHED[:2], *long(SWITCHED[2:6]), *stress(SWITCHED[6:])])
def test_no_estimate_misleads_where_something_switches(index: int) -> None:
    """Against SciPy near rounding: an estimate that nothing warns of is at least 0.3 of the error."""
    judged = judge(SEED, index)
    assert not judged.misleads, str(judged)


@pytest.mark.parametrize(("indices", "least", "most"), [(SMOOTH[:3], 2, 0), *stress([(SMOOTH, 6, 1)])])
def test_estimates_of_smooth_runs_are_within_a_factor_of_three(indices: list[int], least: int, most: int) -> None:
    """None misleads, and all usable ones but one are between 0.3 and 3 of the error; `make stress` asks 95 % of 600."""
    judged = [judge(SEED, index) for index in indices]
    assert not [str(each) for each in judged if each.misleads]
    usable = [each for each in judged if each.usable]
    assert len(usable) >= least
    outside = [str(each) for each in usable if each.run.error.note or not LEAST <= each.ratio <= MOST]
    assert len(outside) <= most, outside


@pytest.mark.parametrize(("seed", "index"), [(1, 292), *long([(1, 460), (7, 239)])])
def test_steps_that_err_alike_at_a_tenth_of_the_tolerance_are_halved(seed: int, index: int) -> None:
    """Sampled control, whose every period is one step of DOP853 at any of the tolerances; a rail that force pushes."""
    judged = judge(seed, index)
    assert not judged.misleads, str(judged)
    assert judged.ratio == pytest.approx(1.0, rel=0.05)  # 1 − 2⁻⁸, where rounding is no part of it


def test_what_unstable_steps_make_of_rounding_is_no_error_of_shorter_ones() -> None:
    """LuGre friction on a rail: steps three times as long blow up, those of the run are right to 3e-12 rad."""
    judged = judge(68251469, 110)
    assert not judged.misleads and judged.run.error.verdict is Verdict.ORDER, str(judged)
    assert LEAST <= judged.ratio <= 10.0  # 2.7e7 where longer steps are believed


def test_halved_steps_are_shortened_where_they_are_still_in_a_stop_that_the_run_has_left() -> None:
    """A stop of 1e9 N m/rad for 57 µs, and steps of 3 ms behind it: a companion leaves it a little later."""
    motion = stop(1e9)
    setup = replace(motion.setup, duration_s=0.25, engine="interpreted")
    run = rd.simulate(setup, method=rd.integrate.Adaptive("Rodas5P", 1e-6, 1e-8))
    assert run.statistics.companion_evaluations < 3 * run.statistics.evaluations
    assert run.error.largest == pytest.approx(np.abs(run.q - motion.exact(run.t)).max(), rel=0.1)  # 1 − 2⁻⁴


def toss(gap: float, stiffness: float, speed: float = 10.0, **options) -> rd.Trajectory:
    """1 kg tossed up, a stop `gap` below its apex."""
    apex = speed**2 / (2 * 9.80665)
    plant = rd.Plant(TOSS, rd.effects.joint_stops([-50.0], [apex - gap], stiffness, 0.0))
    return rd.simulate(plant, q0=[0.0], v0=[speed], duration_s=2.0, **options)


def rebound(run: rd.Trajectory, gap: float, stiffness: float, speed: float = 10.0) -> float:
    """Largest error of a toss against the closed form: free flight, half an oscillation in the stop, free flight."""
    g = 9.80665
    stop, omega = speed**2 / (2 * g) - gap, np.sqrt(stiffness)
    v1 = np.sqrt(2 * g * gap)
    t1 = (speed - v1) / g
    sag = g / stiffness  # m = 1 kg: at rest in the stop, gravity pulls out of it
    # in contact x = stop − sag + A cos(ω s − φ), entered at s = 0 with x = stop and speed v1
    A, phi = np.hypot(sag, v1 / omega), np.arctan2(v1 / omega, sag)
    contact = 2 * phi / omega
    t = run.t
    free = speed * t - g * t**2 / 2
    inside = stop - sag + A * np.cos(omega * (t - t1) - phi)
    s = t - t1 - contact
    after = stop - v1 * s - g * s**2 / 2
    exact = np.where(t <= t1, free, np.where(t <= t1 + contact, inside, after))
    return float(np.abs(run.q[:, 0] - exact).max())


def test_a_graze_of_a_stop_is_not_stepped_over() -> None:
    """0.1 mm below the apex of a toss of 10 m/s: DOP853's own steps of 0.4 s would fly past, 78 mm wrong in silence."""
    run = toss(1e-4, 1e7, method=rd.integrate.Adaptive())
    error = rebound(run, 1e-4, 1e7)
    assert np.diff(run.t).max() <= 0.01
    assert error < 1e-6
    assert LEAST * error < run.error.largest


@pytest.mark.parametrize(("gap", "stiffness", "step"), [(0.5, 1e4, 0.01), *long([(0.5, 1e3, 0.02), (0.1, 1e3, 0.01)])])
def test_long_steps_that_miss_the_order_speak_of_no_run_that_has_it(gap: float, stiffness: float, step: float) -> None:
    """In a stop, ω h = 0.3 to 1 of order 8: steps of 2, 3 and 5 h err without order, by up to 8000 times too much."""
    run = toss(gap, stiffness, method="DP8", step_s=step, engine="interpreted")
    assert run.error.verdict is Verdict.ORDER
    assert run.error.note == ""
    assert run.error.largest == pytest.approx(rebound(run, gap, stiffness), rel=0.1)  # 1 − 2⁻⁸, and rounding


def test_a_switch_in_the_last_step_ends_the_estimate() -> None:
    """Touched 2.6 ms before the end, of which run and companions make one step: ω h = 2.6, and no order."""
    apex = 10.0**2 / (2 * 9.80665)
    plant = rd.Plant(TOSS, rd.effects.joint_stops([-50.0], [apex - 0.5], 1e6, 0.0))
    run = rd.simulate(plant, [0.0], [10.0], duration_s=0.703, method="DP8", step_s=0.01, engine="interpreted")
    exact = rebound(run, 0.5, 1e6)
    assert run.error.at(run.error.until_s) >= LEAST * exact or run.error.ends_early.kind is DoubtKind.SWITCHES_LAST
    assert exact > 1e3 * run.error.at(run.error.until_s)


@pytest.mark.parametrize(("seed", "index"), [(31, 32), *third([(20261126, 230), (20261128, 283), (31, 46), (41, 3)])])
def test_an_order_that_is_seen_is_that_of_the_run(seed: int, index: int) -> None:
    """A swing, bristles and stops; longer steps show another order, or by chance that one, or magnify rounding."""
    judged = judge(seed, index, scene_of_all)
    assert judged.run.error.verdict is Verdict.ORDER, str(judged)
    assert judged.run.error.ends_early is None or judged.run.error.ends_early.kind is not DoubtKind.ROUNDING
    assert LEAST <= judged.ratio <= FAR, str(judged)


@pytest.mark.parametrize(
    ("method", "step", "friction", "motion"),
    [
        ("RK4", 0.003, (10.6, 16.0, 0.0116), (-0.6, -1.5, 0.7, 50.0)),  # 0.011 of the error
        *long(
            [
                ("RK4", 0.001005, (4.44688, 11.37734, 0.01183), (-0.99752, -1.26294, 0.662, 89.49589)),  # 0.023
                ("Midpoint", 0.003249, (6.21, 14.05, 0.0075), (-0.344, -1.474, 0.41, 52.4)),  # 0.095
            ]
        ),
    ],
)
def test_a_layer_that_few_steps_cross_shows_no_order(method, step, friction, motion) -> None:
    """Stribeck's curve behind a reversal, crossed in a step or two: companions agree by chance on a false error."""
    run, ratio = slid(method, step, friction, motion)
    assert run.error.verdict is Verdict.BOUND
    assert ratio >= LEAST


def test_steps_that_resolve_a_layer_show_the_order_by_shorter_ones() -> None:
    """Five times as long steps cross the layer at once, and agreed by chance on 0.24 of the error."""
    judged = judge_layer(2, 40)
    assert judged.run.error.verdict is Verdict.ORDER
    assert judged.ratio == pytest.approx(1.0, rel=0.1)


@dataclass(frozen=True, eq=False)
class SoftStep(Active):
    """A force that rises over a short way, in a class of a user's own."""

    level: float
    width: float
    declares: bool

    def thresholds(self, n: int) -> tuple[rd.effects.Threshold, ...]:
        return ()

    def layers(self, n: int) -> tuple[rd.effects.Layer, ...]:
        return (rd.effects.Layer(0, self.width, self.level),) if self.declares else ()

    def torque(self, dynamics, t, q, v):
        return -(1 + tanh((q - self.level) / self.width))


@pytest.mark.parametrize("level", [0.337, *long([0.397])])
def test_an_effect_of_a_user_declares_its_layer(level: float) -> None:
    """1 kg at 1 m/s, and steps of 10 mm over a rise of 2 mm: undeclared, companions agree on less than the error."""
    width, found = 0.002, []
    for declares in (False, True):
        plant = rd.Plant(RAIL, [SoftStep(level, width, declares)])
        found.append(rd.simulate(plant, [0.0], [1.0], duration_s=0.9, method="RK4", step_s=0.01, engine="interpreted"))
    exact = solve_ivp(
        lambda t, y: [y[1], -(1 + np.tanh((y[0] - level) / width))],
        (0, 0.9), [0.0, 1.0], "DOP853", found[0].t, rtol=1e-13, atol=1e-15, max_step=1e-3,
    )  # fmt: skip
    error = np.abs(found[0].q[:, 0] - exact.y[0]).max()
    assert [run.error.verdict for run in found] == [Verdict.ORDER, Verdict.BOUND]
    assert found[0].error.largest < LEAST * error < found[1].error.largest
    assert found[1].error.no_order.kind is DoubtKind.LAYER_CROSSED


def slid(method: str, step: float, friction, motion) -> tuple[rd.Trajectory, float]:
    """The run of a block with Stribeck's friction, and its estimate over its true error."""
    level, static, speed = friction
    q, v, duration, stiffness = motion
    rubs = rd.effects.DryFriction(level, static=static, stribeck_velocity=speed)
    setup = slide(step, q, v, duration, stiffness, rubs, method)
    run = rd.simulate(setup)
    return run, run.error.largest / float(np.abs(run.q - slider_truth(setup, run.t)).max())


@pytest.mark.parametrize(
    "method",
    [
        rd.integrate.Adaptive(),
        *long(
            [
                rd.integrate.Adaptive(rtol=1e-6, atol=1e-8),
                rd.integrate.method("RK4"),
                rd.integrate.method("GaussLegendre4"),
            ]
        ),
    ],
)
def test_random_grazes_are_met_or_told(method) -> None:
    rng, met = np.random.default_rng(105), 0
    for _ in range(5):
        gap, stiffness, speed = 10 ** rng.uniform(-7, -3), 10 ** rng.uniform(5, 7.5), rng.uniform(5, 10)
        options = {} if isinstance(method, rd.integrate.Adaptive) else {"step_s": 0.02}
        run = toss(gap, stiffness, speed, method=method, **options)
        error = rebound(run, gap, stiffness, speed)
        silent = run.outcome.ending == "finished" and not run.error.note and not run.leak
        assert not silent or run.error.largest >= LEAST * error, (gap, stiffness, speed, error, str(run.error))
        met += silent
    assert met > 2 or not isinstance(method, rd.integrate.Adaptive)


def test_an_impulse_in_a_long_run_is_not_merged_away() -> None:
    """1 N s in 1 µs of 1000 s, 1e-9 of the run: v = 1 m/s from 333 s on; only the rounding of t and q is left."""
    start, length = 333.0, 1e-6
    push = rd.effects.ExternalWrench("block", [0, 0, 1 / length, 0, 0, 0], start_s=start, end_s=start + length)
    real = (start + length) - start  # as floats have it
    run = rd.simulate(rd.Plant(RAIL, [push]), q0=[0.0], duration_s=1000.0, method="RK4", step_s=0.1, record_every_s=1.0)
    v = real / length
    exact = v * (1000.0 - start - length) + v * real / 2
    assert abs(run.q[-1, 0] - exact) < 1e-9
    assert run.v[-1, 0] == pytest.approx(v, rel=1e-12)


def test_switches_closer_than_floats_can_tell_are_refused() -> None:
    start = 333.0
    push = rd.effects.ExternalWrench("block", np.ones(6), start_s=start, end_s=start + 2 * np.spacing(start))
    with pytest.raises(QueryError, match=r"switches at 333\.0 s and .* merge them, or move them apart"):
        rd.simulate(rd.Plant(RAIL, [push]), q0=[0.0], duration_s=1000.0)


def test_a_tick_within_rounding_of_a_switch_moves_onto_it() -> None:
    """3 · 0.1 is not 0.3: one end of a segment, at the switch, and the controller acts there."""
    push = rd.effects.ExternalWrench("block", np.ones(6), start_s=0.3, end_s=0.7)
    law = rd.control.PD(rd.control.hold([0.0]), kp=1.0, kd=1.0, period_s=0.1)
    segments = rd.Setup(rd.Plant(RAIL, [push]), [0.1], duration_s=1.0, controller=law).segments
    starts = [each.start for each in segments]
    assert len(starts) == 10
    assert 0.3 in starts
    assert 0.7 in starts
    assert all(each.tick for each in segments)


def test_control_at_the_default_step_is_estimated() -> None:
    """1 kHz control has one step a tick: only shorter steps can tell, and they do."""
    kp, kd = rd.control.gains_from(np.diag(PANDA.M(READY)), 10.0)
    law = rd.control.PD(rd.control.hold(READY), kp=kp, kd=kd, period_s=1e-3)
    setup = rd.Setup(rd.Plant(PANDA), READY + 0.1, duration_s=0.1, controller=law, method="Midpoint")
    run = rd.simulate(setup)
    error = np.abs(run.q - truth(setup, run.t)).max()
    assert run.error.note == ""
    assert LEAST * error < run.error.largest < MOST * error


def test_one_short_segment_leaves_the_estimate_of_the_others() -> None:
    arm = rd.load("planar_2r")
    push = rd.effects.ExternalWrench(arm.frame_names[-1], 0.1 * np.ones(6), start_s=0.2003, end_s=0.2004)
    setup = rd.Setup(rd.Plant(arm, [push]), [0.4, -0.7], [0.3, 0.5], 0.5, method=rd.integrate.method("Midpoint"))
    run = rd.simulate(setup)
    error = np.abs(run.q - truth(setup, run.t)).max()
    assert run.error.verdict is Verdict.ORDER
    assert run.error.note == ""
    assert LEAST * error < run.error.largest < MOST * error


def test_a_usable_run_with_stiff_friction_is_bounded_not_refused() -> None:
    """RK4 is near its stability limit, so that no order shows; the run is right to 1e-6 all the same."""
    plant = rd.Plant(PANDA, "urdf")
    kp, kd = rd.control.gains_from(np.diag(PANDA.M(READY)), 10.0)
    law = rd.control.PDGravity(PANDA, rd.control.quintic(READY, READY + 0.2, 0.2), kp=kp, kd=kd)
    run = rd.simulate(plant, q0=READY, duration_s=0.2, controller=law, method="RK4", step_s=2.5e-4, record_every_s=1e-3)
    tight = rd.simulate(
        plant, q0=READY, duration_s=0.2, controller=law, method=rd.integrate.Adaptive(rtol=1e-12, atol=1e-13),
        record_every_s=1e-3, estimate_error=False,
    )  # fmt: skip
    error = np.abs(run.q - tight.q).max()
    assert error < 1e-6
    assert run.error.note == ""
    assert LEAST * error < run.error.largest < 1e-3


@pytest.mark.parametrize("far", [1e13, *long([1e9, 1e16])])
def test_rounding_of_a_far_position_is_in_the_estimate(far: float) -> None:
    """Q += h v loses what is below half a unit of q's last place, in every step and every companion run alike."""
    run = rd.simulate(RAIL, [far], [0.7], duration_s=1.0, method="SemiImplicitEuler")
    error = abs(run.q[-1, 0] - (far + 0.7))
    assert run.error.at(run.error.until_s) >= LEAST * error or run.error.ends_early.kind is DoubtKind.ROUNDING
    assert (far == 1e9) == (run.error.note == "")


@pytest.mark.parametrize(
    ("start", "duration", "method"),
    [(np.pi - 1e-12, 8.0, "DP8"), *long([(np.pi, 12.0, "RK4"), (np.pi - 1e-10, 6.0, "RK4")])],
)
def test_rounding_that_the_motion_magnifies_is_in_the_estimate(start: float, duration: float, method: str) -> None:
    """Upright, a pendulum leaves its start as e^(3.8 t): a unit of rounding is a radian after 10 s."""
    plant = rd.Plant(rd.load("pendulum"))
    run = rd.simulate(plant, q0=[start], duration_s=duration, method=rd.integrate.method(method))
    exact = upright(start, run.t)
    known = run.t <= run.error.until_s
    error = np.abs(run.q[:, 0] - exact)[known].max()
    assert run.error.at(run.error.until_s) >= LEAST * error
    assert run.error.note or np.abs(run.q[-1, 0] - exact[-1]) < 1e-3


def upright(start: float, times: np.ndarray) -> np.ndarray:
    """The angle of the pendulum from rest at `start`: d = q − π obeys d'' = k sin d, from the exact d of the float."""
    arm = rd.load("pendulum")
    k = float(arm.N(np.array([0.5]))[0] / np.sin(0.5) / arm.M(np.zeros(1))[0, 0])
    with flint.ctx.workprec(200):
        d = float(flint.arb(start) - flint.arb.pi())
    solved = solve_ivp(
        lambda t, y: [y[1], k * np.sin(y[0])], (0, times[-1]), [d, 0.0], "DOP853", times, rtol=3e-14, atol=1e-30
    )
    return np.pi + solved.y[0]


def test_turns_that_no_step_can_see_have_no_estimate() -> None:
    """A whole turn in each step: gravity is sampled at one angle, in all companions alike."""
    run = rd.simulate(rd.load("pendulum"), [0.0], [400 * np.pi], duration_s=0.5, method="RK4", step_s=5e-3)
    assert run.error.verdict is Verdict.NONE
    assert run.error.ends_early.kind is DoubtKind.TURNS_TOO_FAR
    assert run.error.ends_early.facts["turn"] == pytest.approx(2 * np.pi, rel=1e-3)


@pytest.mark.parametrize("method", [OwnImplicit(), *long(["Rodas5PFixed"])])
def test_an_oscillation_that_a_method_damps_has_no_estimate(method: Any) -> None:
    """Of q = q₀ cos ω t with ω h = 17 each step leaves next to nothing of it, at any length near h."""
    bar = rd.load("pendulum").with_(gravity=(0.0, 0.0, 0.0))
    options = {"duration_s": 0.02, "method": method, "engine": "interpreted"}
    run = rd.simulate(rd.Plant(bar, [rd.effects.Spring(1e8)]), [1e-2], step_s=1e-3, **options)
    assert run.error.verdict is Verdict.NONE
    assert run.error.ends_early.kind is DoubtKind.OSCILLATION_DAMPED
    assert [run.error.ends_early.facts[name] for name in ("moving_joint", "source")] == ["pivot", "spring"]
    slow = rd.simulate(rd.Plant(bar, [rd.effects.Spring(1e4)]), [1e-2], step_s=1e-3, **options)  # ω h = 0.17
    exact = 1e-2 * np.cos(np.sqrt(3e4) * slow.t[:, None])
    assert slow.error.at(slow.error.until_s) >= LEAST * np.abs(slow.q - exact).max()


def test_a_record_that_meets_every_turning_point_accuses_no_run() -> None:
    """Samples at rest alone: the energy exchanged and the motion are those between them."""
    plant = rd.Plant(RAIL, [rd.effects.Spring(1.0)])
    period = 2 * np.pi  # of 1 kg on 1 N/m
    for method in (rd.integrate.method("RK4"), rd.integrate.Adaptive(rtol=1e-6, atol=1e-8)):
        run = rd.simulate(plant, q0=[1.0], duration_s=period, record_every_s=period, method=method)
        assert run.leak == ""
        assert run.error.note == ""
        assert run.error.largest >= LEAST * abs(run.q[-1, 0] - 1.0)


def test_a_setup_keeps_its_start() -> None:
    """The caller may go on with his own array."""
    q0 = np.array([0.5])
    setup = rd.Setup(rd.Plant(RAIL), q0)
    q0[0] = 9.0
    assert setup.q0 == [0.5]
    with pytest.raises(ValueError, match="read-only"):
        setup.q0[0] = 1.0


@pytest.mark.parametrize(
    "method",
    [
        rd.integrate.method("RK4"),
        rd.integrate.Adaptive(),
        *long([rd.integrate.method("GaussLegendre6"), rd.integrate.method("SemiImplicitEuler")]),
    ],
)
def test_code_that_acts_between_steps_is_looked_at_there(method) -> None:
    """A pulse of 1 ms inside steps of 10 ms, at no node: no method sees it."""
    options = {} if isinstance(method, rd.integrate.Adaptive) else {"step_s": 0.01}
    pulse = Push(lambda t, q, v: (1e3 if 0.5016 <= t < 0.5026 else 0.0) + 0 * v)
    run = rd.simulate(rd.Plant(RAIL, [pulse]), q0=[0.0], v0=[0.2], duration_s=2.0, method=method, **options)
    error = abs(run.q[-1, 0] - (0.4 + 1.0 * (2.0 - 0.5021)))
    assert run.error.note or run.error.largest >= LEAST * error


def test_the_summary_tells_an_estimate_from_a_bound_and_the_time_it_covers() -> None:
    from robot_dyn.simulation import ErrorEstimate

    t, error = np.array([0.0, 0.008]), np.array([0.0, 2e-9])
    assert str(ErrorEstimate(t, error, 0.008)) == "2.0e-09 (order seen)"
    cut = Doubt(DoubtKind.SATURATES)
    bounded = ErrorEstimate(t, error, 0.008, verdict=Verdict.BOUND, no_order=cut)
    assert str(bounded) == f"about 2.0e-09 (bounded: {cut.text})"
    differ = Doubt(DoubtKind.COMPANIONS_DIFFER, {"limit": 0.1, "smaller_step_s": 1e-4})
    early = ErrorEstimate(t, error, 0.008, differ)
    assert "use step_s = 1e-04" in early.note
    assert str(early) == f"2.0e-09 up to t = 0.008 s (order seen); after that none: {early.note}"


def test_a_ledger_that_contradicts_the_estimate_is_told() -> None:
    from dataclasses import replace

    run = rd.simulate(rd.Plant(PANDA), q0=READY, duration_s=0.2, method="RK4", step_s=2e-3)
    assert run.leak == ""
    drift = run.ledger.kinetic * (1 + 1e-6 * run.t)
    wrong = replace(run, ledger=replace(run.ledger, kinetic=drift))
    assert "do not trust the estimate" in wrong.summary


def test_times_of_compiling_running_and_estimating_are_told_apart() -> None:
    run = rd.simulate(rd.Plant(PANDA), q0=READY, duration_s=0.05, engine="compiled")
    s = run.statistics
    assert s.compile_s > 0
    assert s.companions_s > 0
    assert s.samples_s > 0
    assert (f"compile {s.compile_s:.2g} s" in run.summary) == (s.compile_s >= 0.01)  # less is not told


def test_metadata_of_packages_are_read_once(monkeypatch) -> None:
    origin.versions.cache_clear()
    asked = []
    monkeypatch.setattr(origin, "version_of", lambda name: asked.append(name) or "1")
    for _ in range(3):
        assert "robot-dyn 1" in rd.simulate(rd.Plant(RAIL), q0=[0.0], duration_s=0.01).metadata["versions"]
    assert len(asked) == len(set(asked)) > 0
    origin.versions.cache_clear()
