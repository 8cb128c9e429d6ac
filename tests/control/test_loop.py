"""Loops of real controllers: delays, quantisation, differences, filters, rate limits and two rates, each exactly."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import butter, lfilter, lfilter_zi

import robot_dyn as rd
from robot_dyn.accuracy.costs.step_cost import parts
from robot_dyn.foundations import ControlError, QueryError
from robot_dyn.simulation import RemarkKind, StateEquation, Verdict, machine_code
from robot_dyn.simulation.setup.schedule import cuts
from tests.long import long, third
from tests.loops import Q0, V0, Exact, exact, matrices, plant
from tests.two_rates import TwoRates

T, PERIODS = 0.03, 40
KP, KD, TARGET = np.array([60.0, 45.0]), np.array([5.0, 4.0]), np.array([0.5, 0.2])
PD = rd.control.PD(rd.control.hold(TARGET), kp=KP, kd=KD, period_s=T)
PLANT = plant()
NEAR = 1e-11  # rtol 1e-12 over 1.2 s, and rounding of the exponentials


def law(k: int, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """PD."""
    return KP * (TARGET - q) - KD * v


def run(
    controller: rd.control.Controller, engine: str = "interpreted", periods: int = PERIODS, **options: object
) -> rd.Trajectory:
    """A run with a sample at each quarter of a period, which is no tick."""
    setup = rd.Setup(
        PLANT, Q0, V0, periods * T, controller, rd.integrate.Adaptive("DOP853", 1e-12, 1e-14), record_every_s=T / 4,
        engine=engine, estimate_error=False,
    )  # fmt: skip
    return rd.simulate(setup, **options)  # type: ignore[arg-type]


def differences(made: rd.Trajectory, truth: Exact) -> float:
    """Largest difference of q, and of the torque that acts where it does not jump."""
    q = np.array([truth.at(t)[:2] for t in made.t])
    inside = np.array([np.abs(np.array([*truth.t[1:], made.t[-1]]) - t).min() > 1e-9 for t in made.t])
    u = np.array([truth.u[np.searchsorted(truth.t, t, side="right") - 1] for t in made.t])
    return max(np.abs(made.q - q).max(), np.abs(made.u - u)[inside].max() / 60)  # of the size of kp


@pytest.mark.parametrize("engine", ["interpreted", "compiled"])
@pytest.mark.parametrize(
    ("measured", "acts"),
    [(0.25, 0.75), (1.6, 2.45), *third([(0, 0), (0, 0.37), (0.37, 0), (1, 0.5), (0, 2), (2, 1)])],
)
def test_delays_are_those_of_the_definition(engine: str, measured: float, acts: float) -> None:
    loop = rd.control.Loop(PD, measurement_delay_periods=measured, actuation_delay_periods=acts)
    assert differences(run(loop, engine), exact(law, T, PERIODS, measured, acts)) < NEAR


def test_quantisation_of_position_and_torque() -> None:
    """Each sample is rounded by hand; no sample is nearer to the edge of a step than the error of the run."""
    encoder, converter, edges = 2e-3, 0.05, []

    def rounded(x: np.ndarray, step: float) -> np.ndarray:
        edges.append(np.abs((x / step) % 1 - 0.5).min() * step)
        return step * np.round(x / step)

    def by_hand(k: int, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        return rounded(law(k, rounded(q, encoder), v), converter)

    truth = exact(by_hand, T, PERIODS)
    loop = rd.control.Loop(
        PD, position=rd.control.Quantisation(encoder), actuation=[rd.control.Quantisation(converter)]
    )
    made = run(loop)
    assert min(edges) > 100 * NEAR
    assert differences(made, truth) < NEAR
    assert np.abs(made.u / converter - np.round(made.u / converter)).max() < 1e-9
    assert differences(made, exact(law, T, PERIODS)) > 1e-4  # it matters


@pytest.mark.parametrize("order", [1, 2])
def test_velocity_by_differences_of_a_quantised_position_through_a_filter(order: int) -> None:
    """The filter is SciPy's, run over all differences so far, from rest at the first."""
    cutoff, encoder = 40.0, 1e-5
    measured: list[np.ndarray] = []
    b, a = butter(order, cutoff / (2 * np.pi), fs=1 / T)

    def by_hand(k: int, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        measured.append(encoder * np.round(q / encoder))
        found = np.array(measured)
        rates = np.diff(found, axis=0, prepend=found[:1]) / T
        start = lfilter_zi(b, a)[:, None] * rates[0]
        return law(k, found[-1], lfilter(b, a, rates, axis=0, zi=start)[0][-1])

    loop = rd.control.Loop(
        PD,
        position=rd.control.Quantisation(encoder),
        velocity=[rd.control.Differences(), rd.control.LowPass(cutoff, order)],
    )
    assert differences(run(loop), exact(by_hand, T, PERIODS)) < NEAR


@pytest.mark.parametrize("order", [1, 2])
def test_a_filter_is_butterworths(order: int) -> None:
    """|H|² = 1/(1 + (tan(ω T/2) / tan(ω_c T/2))^(2 order)), and a constant signal passes from the first tick on."""
    block, period = rd.control.LowPass([70.0, 9.0], order), 0.01
    b, a = block._coefficients(period)
    for omega in (3.0, 70.0, 200.0):
        z = np.exp(-1j * omega * period * np.arange(3))
        H = sum(x * y for x, y in zip(b, z, strict=False)) / (1 + sum(x * y for x, y in zip(a, z[1:], strict=False)))
        ratio = np.tan(omega * period / 2) / np.tan(np.array([70.0, 9.0]) * period / 2)
        np.testing.assert_allclose(np.abs(H) ** 2, 1 / (1 + ratio ** (2 * order)), rtol=1e-11)
    x = np.array([0.3, -0.7])
    s = block.start(x, period)
    np.testing.assert_allclose(block.output(x, s, period), x, rtol=1e-13)
    np.testing.assert_allclose(block.next_state(x, s, period), s, rtol=1e-12)


def test_the_rate_limit_of_the_torque() -> None:
    """u_k = u_{k−1} + sat(·), from u = 0; it acts at the first ticks, and no longer near the end."""
    rate, before, limited = np.array([200.0, 90.0]), [np.zeros(2)], []

    def by_hand(k: int, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        step = law(k, q, v) - before[-1]
        limited.append(bool((np.abs(step) > rate * T).any()))
        before.append(before[-1] + np.clip(step, -rate * T, rate * T))
        return before[-1]

    loop = rd.control.Loop(PD, actuation=rd.control.RateLimit(rate), actuation_delay_periods=0.5)
    assert differences(run(loop), exact(by_hand, T, PERIODS, 0, 0.5)) < NEAR
    assert limited[0] and not limited[-1]


@pytest.mark.parametrize("engine", ["interpreted", "compiled"])
@pytest.mark.parametrize("late", [0.0, 1.25])
def test_two_rates(engine: str, late: float) -> None:
    """PD at each tick, a spring's torque at each fourth, held between; with delays around both."""
    both, kept = TwoRates(PD.reference, KP, KD, (0.1, -0.3), [9.0, 8.0], [0.5, 0.4], 4, T), []

    def by_hand(k: int, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        if k % 4 == 0:
            kept.append(np.array([9.0, 8.0]) * ([0.1, -0.3] - q) - np.array([0.5, 0.4]) * v)
        return law(k, q, v) + kept[-1]

    made = run(rd.control.Loop(both, measurement_delay_periods=late) if late else both, engine)
    assert differences(made, exact(by_hand, T, PERIODS, late)) < NEAR


def test_the_integral_of_a_pid_is_that_of_what_is_measured() -> None:
    """A controller with states in a loop."""
    ki, z = np.array([30.0, 20.0]), [np.zeros(2)]

    def by_hand(k: int, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        z.append(z[-1] + T * ki * (TARGET - q))
        return law(k, q, v) + z[-2]

    pid = rd.control.PID(rd.control.hold(TARGET), kp=KP, ki=ki, kd=KD, period_s=T)
    late = rd.control.Loop(pid, measurement_delay_periods=0.75)
    assert differences(run(late), exact(by_hand, T, PERIODS, 0.75)) < NEAR


EVERYTHING = rd.control.Loop(
    TwoRates(PD.reference, KP, KD, (0.5, 0.2), 3.0, 0.1, 2, T),
    position=[rd.control.Noise(1e-4), rd.control.Quantisation(1e-3)],
    velocity=[rd.control.Differences(), rd.control.LowPass(40.0)],
    actuation=[rd.control.Noise(0.1), rd.control.RateLimit(300.0), rd.control.Quantisation(0.02)],
    measurement_delay_periods=1.25, actuation_delay_periods=0.5,
    noise_seed=7,
)  # fmt: skip


@pytest.mark.long  # delays, two rates and noise are compared one by one in short
def test_machine_code_and_rollouts_run_the_same_loop() -> None:
    """To rounding: no sample is near the edge of a step. Steps of RK4 are alike in all three."""
    setup = rd.Setup(PLANT, Q0, V0, 20 * T, EVERYTHING, "RK4", T / 8, T, estimate_error=False, engine="interpreted")
    one, two = rd.simulate(setup), rd.simulate(setup, engine="compiled")
    many = rd.rollouts(setup, np.tile(Q0, (70, 1)), np.tile(V0, (70, 1)), record=("q", "v", "u"), threads=2)
    np.testing.assert_allclose(two.q, one.q, atol=1e-13)
    np.testing.assert_allclose(two.u, one.u, atol=1e-12)
    np.testing.assert_allclose(many.q[0], one.q, atol=1e-13)
    for run in (1, 69):  # of the setup with the noise of that run
        alone = rd.simulate(replace(setup, controller=replace(EVERYTHING, run=run)))
        np.testing.assert_allclose(many.q[run], alone.q, atol=1e-13)
        np.testing.assert_allclose(many.u[run], alone.u, atol=1e-12)
    assert np.abs(many.q[1] - many.q[0]).max() > 1e-6


def test_coefficients_of_blocks_are_swept_by_name() -> None:
    setup = rd.Setup(PLANT, Q0, V0, 10 * T, EVERYTHING, "RK4", T / 4, T, estimate_error=False)
    params = {
        "position.quantisation.resolution": [1e-3, 4e-3], "velocity.low_pass.cutoff_rad_s": [40.0, 20.0],
        "actuation.rate_limit.rate": [300.0, 50.0], "position.noise.deviation": [1e-4, 0.0], "kp": [9.0, 50.0],
        "actuation.noise.deviation": [0.0, 0.1],
    }  # fmt: skip
    many = rd.rollouts(setup, Q0, V0, vary=params)
    for run in range(2):
        own = replace(
            EVERYTHING, controller=replace(EVERYTHING.controller, kp=params["kp"][run]), run=run,
            position=(
                rd.control.Noise(params["position.noise.deviation"][run]), rd.control.Quantisation([1e-3, 4e-3][run])
            ),
            velocity=(rd.control.Differences(), rd.control.LowPass([40.0, 20.0][run])),
            actuation=(
                rd.control.Noise([0.0, 0.1][run]), rd.control.RateLimit([300.0, 50.0][run]),
                rd.control.Quantisation(0.02),
            ),
        )  # fmt: skip
        alone = rd.simulate(setup, controller=own)
        np.testing.assert_allclose(many.q[run], alone.q, atol=1e-13)
    with pytest.raises(ControlError, match="cutoff_rad_s must be less than"):
        rd.rollouts(setup, Q0, V0, vary={"velocity.low_pass.cutoff_rad_s": [40.0, 200.0]})


def test_two_periods_that_differ_in_their_ratio_share_no_machine_code() -> None:
    for ratio in (2, 3):
        both = TwoRates(PD.reference, KP, KD, (0.5, 0.2), 9.0, 0.5, ratio, T)
        made = [run(both, engine, 8) for engine in ("interpreted", "compiled")]
        np.testing.assert_allclose(made[0].q, made[1].q, atol=1e-12)


def test_a_loop_of_nothing_adds_no_instruction() -> None:
    """And a run without a controller, or with a bare one, has the instructions that it had."""
    counts = [
        {name: len(each) for name, each in machine_code(StateEquation(PLANT, x)).code.programs.items()}
        for x in (PD, rd.control.Loop(PD), rd.control.Loop(PD, actuation_delay_periods=0.5))
    ]
    assert counts[0] == counts[1]
    assert counts[0]["rate"] == counts[2]["rate"]  # what a loop does, it does at ticks
    assert counts[0]["tick"] < counts[2]["tick"]


def test_what_a_loop_costs_is_told_apart_from_its_controller() -> None:
    setup = rd.Setup(PLANT, Q0, V0, 1.0, rd.control.Loop(PD, actuation_delay_periods=0.5))
    assert dict(parts(setup))["loop"].controller is PD
    assert "loop" not in dict(parts(replace(setup, controller=PD)))


def test_states_that_wait_do_not_loosen_the_tolerance() -> None:
    """They do not change between ticks: the mean of squares of the local error is that of the others."""
    arm, free = rd.load("planar_2r"), rd.control.PD(rd.control.hold(Q0), kp=0.0, kd=0.0, period_s=1.0)
    made = [
        rd.simulate(arm, [0.9, -0.4], duration_s=3.0, controller=x, method="DOP853", estimate_error=False)
        for x in (free, rd.control.Loop(free, actuation_delay_periods=50))
    ]
    assert made[0].statistics.steps == made[1].statistics.steps
    np.testing.assert_allclose(made[0].q, made[1].q, atol=1e-12)  # an rtol that differs in its last bit


def test_the_last_torque_is_that_of_the_last_tick() -> None:
    """Where a run ends between two ticks."""
    for controller in (PD, rd.control.Loop(PD), rd.control.Loop(PD, actuation_delay_periods=0.75)):
        made = run(controller, periods=PERIODS - 0.5)  # type: ignore[arg-type]
        longer = run(controller)
        np.testing.assert_allclose(made.u[-1], longer.u[len(made.t) - 1], atol=1e-12)


@pytest.mark.parametrize("late", [0.05, *long([0.0])])
def test_chatter_is_seen_where_a_torque_acts_late(late: float) -> None:
    """Damping of 2.24/T reverses at each tick, whether there are one or two instants in a period."""
    M = np.linalg.inv(matrices()[1][2:])
    kd = 2.24 / T / np.abs(np.linalg.eigvals(np.linalg.inv(M))).max()
    loop = rd.control.Loop(
        rd.control.PD(rd.control.hold(TARGET), kp=0.0, kd=kd, period_s=T), actuation_delay_periods=late
    )
    for integrator in ("RK4", "DOP853"):
        for engine in ("interpreted", "compiled"):
            options = {"method": integrator, "engine": engine, "estimate_error": False, "duration_s": 50 * T}
            made = rd.simulate(PLANT, Q0, V0, controller=loop, record_every_s=T, **options)  # type: ignore[arg-type]
            assert RemarkKind.CHATTER in {remark.kind for remark in made.remarks}


def test_ticks_of_two_instants_a_period() -> None:
    made = cuts(1.0, 0.25, [0.3], (0.0, 0.6))
    assert [t for t, _ in made] == pytest.approx([0, 0.15, 0.25, 0.3, 0.4, 0.5, 0.65, 0.75, 0.9, 1.0], abs=1e-15)
    assert [tick for _, tick in made] == [True, True, True, False, True, True, True, True, True, True]


def test_what_is_rounded_shows_no_order() -> None:
    """A sample may be rounded the other way in the exact motion: its error is bounded by companions, not divided."""
    setup = rd.Setup(PLANT, Q0, V0, 10 * T, PD, "RK4", T / 8)
    assert rd.simulate(setup).error.verdict is Verdict.ORDER
    made = rd.simulate(setup, controller=rd.control.Loop(PD, position=rd.control.Quantisation(1e-4))).error
    assert made.verdict is Verdict.BOUND
    assert "rounded" in str(made)
    assert (
        rd.simulate(setup, controller=rd.control.Loop(PD, position=rd.control.Noise(1e-4))).error.verdict
        is Verdict.ORDER
    )


def test_loops_that_have_no_meaning_are_refused() -> None:
    block, hold = rd.control.Quantisation(1e-3), rd.control.hold(TARGET)
    wrong: list[tuple[object, str]] = [
        (lambda: rd.control.Loop(rd.control.PD(hold, kp=1.0, kd=1.0)), "is continuous"),
        (lambda: rd.control.Loop(rd.control.Loop(PD)), "must not be a Loop"),
        (lambda: rd.control.Loop(PD, position=rd.control.Differences()), "first block of velocity"),
        (lambda: rd.control.Loop(PD, velocity=[block, rd.control.Differences()]), "first block of velocity"),
        (lambda: rd.control.Loop(PD, velocity=[rd.control.LowPass(np.pi / T)]), "cutoff_rad_s must be less than"),
        (lambda: rd.control.Loop(PD, velocity=[rd.control.LowPass(1.0, 3)]), "order"),
        (lambda: rd.control.Loop(PD, position=[rd.control.Quantisation([1.0, 2.0, 3.0])]), r"shape \(2,\)"),
        (lambda: rd.control.Loop(PD, measurement_delay_periods=-0.5), "from 0 to 1000"),
        (
            lambda: rd.control.Loop(PD, measurement_delay_periods=0.5, actuation_delay_periods=0.5 + 1e-8),
            "two instants less than",
        ),
        (lambda: rd.control.Loop(PD, noise_seed=-1), "whole number"),
        (lambda: rd.control.Loop(PD, position=["noise"]), "must be blocks"),  # type: ignore[list-item]
    ]
    for make, words in wrong:
        with pytest.raises(ControlError, match=words):
            make()  # type: ignore[operator]
    with pytest.raises(QueryError, match="drives 2 joints, the plant has 1"):
        rd.Setup(rd.Plant(rd.load("pendulum")), [0.1], controller=rd.control.Loop(PD))
