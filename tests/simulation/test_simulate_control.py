"""Runs under control: zero-order hold, ticks, controller states, effort limits; and what a run evaluates."""

from __future__ import annotations

from itertools import pairwise
from math import ceil

import numpy as np
import pytest

import robot_dyn as rd
from tests.long import long
from tests.user_parts import counted

DOUBLE = rd.load("planar_2r")
PLANT = rd.Plant(DOUBLE, [rd.effects.ViscousFriction([0.4, 0.2])])
START = {"q0": [0.4, -0.7], "v0": [0.3, 0.5]}
GOAL = rd.control.quintic([0.4, -0.7], [0.9, 0.2], 0.2)
METHODS = ["RK4", "GaussLegendre4", "DOP853"]


def controllers(period: float) -> list:
    """Every law of joint space, with gains that are not round."""
    kp, kd = rd.control.gains_from([3.0, 0.4], 9.0, 0.8)
    laws = [
        rd.control.PD(GOAL, kp=kp, kd=kd, period_s=period),
        rd.control.PID(GOAL, kp=kp, ki=40.0, kd=kd, effort_limit=[30.0, 12.0], period_s=period),
    ]
    laws += [
        law(DOUBLE, GOAL, kp=kp, kd=kd, period_s=period)
        for law in (rd.control.ComputedTorque, rd.control.PDGravity, rd.control.FeedForward)
    ]
    return laws


def stepped(method, step: float) -> dict:
    """A method and its step; an adaptive one has none."""
    return {"method": method} | ({} if method == "DOP853" else {"step_s": step})


@pytest.mark.parametrize("method", METHODS)
def test_torque_of_a_sampled_controller_is_held_between_its_ticks(method) -> None:
    """At a tick it is the law's, of the state there; up to the next one, the same to the last bit."""
    period, count = 0.012, 20
    law = rd.control.PDGravity(DOUBLE, GOAL, kp=[80.0, 20.0], kd=[9.0, 2.0], period_s=period)
    common = {**START, "duration_s": period * count, "controller": law, "record_every_s": 1e-4}
    run = rd.simulate(PLANT, **common, **stepped(method, 2e-3))
    ticks = np.searchsorted(run.t, period * np.arange(count + 1) - 1e-12)
    np.testing.assert_allclose(run.t[ticks], period * np.arange(count + 1), atol=1e-14)  # steps end there
    for tick, following in pairwise(ticks):
        assert following - tick >= 6
        np.testing.assert_array_equal(run.u[tick:following], np.tile(run.u[tick], (following - tick, 1)))
    for i in ticks:
        expected = law.torque(run.t[i], run.q[i], run.v[i], np.zeros(0))
        np.testing.assert_allclose(run.u[i], expected, rtol=1e-12, atol=1e-12)
    assert (np.abs(np.diff(run.u[ticks], axis=0)) > 1e-6).all(axis=1).sum() >= count - 1


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("step", [0.012, *long([1e-3])], ids=["a step a tick", "twelve steps a tick"])
def test_states_of_a_sampled_pid_advance_once_a_tick(method, step: float) -> None:
    """z⁺ = z + period · ż at the tick, z = 0 at the first: τ at each tick is that of the recursion, to rounding."""
    law = rd.control.PID(
        GOAL, kp=[80.0, 20.0], ki=[900.0, 400.0], kd=[9.0, 2.0], effort_limit=[25.0, 8.0], period_s=0.012
    )
    run = rd.simulate(PLANT, **START, duration_s=0.24, controller=law, **stepped(method, step))
    assert run.outcome.ending == "finished", run.outcome.text
    ticks = np.searchsorted(run.t, 0.012 * np.arange(21) - 1e-12)
    z = np.zeros(2)
    for i in ticks:
        t, q, v = run.t[i], run.q[i], run.v[i]
        np.testing.assert_allclose(run.u[i], law.torque(t, q, v, z), rtol=1e-11)
        z = z + 0.012 * law.state_rate(t, q, v, z)
    assert (np.abs(z) > 1.0).all()  # an integral that matters


@pytest.mark.parametrize("kind", range(5), ids=[type(law).__name__ for law in controllers(0.0)])
def test_continuous_control_is_the_limit_of_a_small_period(kind: int) -> None:
    """A hold is late by half a period: the difference is O(period), and halves with it, ± 10 %."""
    ends = {}
    for period in (0.0, 1e-3, 2e-3, 4e-3):
        law = controllers(period)[kind]
        run = rd.simulate(
            PLANT, **START, duration_s=0.2, controller=law, method="RK4", step_s=1e-3, estimate_error=False
        )
        ends[period] = run.q[-1]
    distance = [np.linalg.norm(ends[period] - ends[0.0]) for period in (1e-3, 2e-3, 4e-3)]
    assert 1e-7 < distance[0] < 1e-2
    np.testing.assert_allclose(np.divide(distance[1:], distance[:-1]), 2.0, rtol=0.1)


def test_exact_computed_torque_makes_each_joint_a_linear_oscillator() -> None:
    """ë + 2 ζ ω ė + ω² e = 0 from e(0), whatever the arm: the closed form within the 1e-10 of its estimate."""
    omega, zeta = 9.0, 0.6
    law = rd.control.ComputedTorque(DOUBLE, rd.control.hold([0.9, 0.2]), bandwidth_rad_s=omega, damping_ratio=zeta)
    run = rd.simulate(rd.Plant(DOUBLE), **START, duration_s=0.5, controller=law, method="RK4", step_s=5e-4)
    e0, de0, decay = np.array([0.5, 0.9]), -np.array(START["v0"]), zeta * omega
    damped, t = omega * np.sqrt(1 - zeta**2), run.t[:, None]
    wave = e0 * np.cos(damped * t) + (de0 + decay * e0) / damped * np.sin(damped * t)
    np.testing.assert_allclose([0.9, 0.2] - run.q, np.exp(-decay * t) * wave, atol=1e-10)
    assert run.desired is not None
    np.testing.assert_array_equal(run.desired, np.tile([0.9, 0.2], (len(run.t), 1)))
    rms = np.sqrt(np.mean((np.exp(-decay * t) * wave) ** 2))
    assert run.rms_tracking_error == pytest.approx(rms, rel=1e-8)


@pytest.mark.parametrize("period", [0.0, 0.01])
def test_recorded_torque_is_within_the_effort_limit(period: float) -> None:
    """What is recorded is what acts, cut at the limit where the law asks for more, and the motion is that of it."""
    limit = np.array([20.0, 3.0])
    law = rd.control.PD(GOAL, kp=[900.0, 300.0], kd=[20.0, 8.0], period_s=period)
    plant = rd.Plant(DOUBLE, [rd.effects.EffortLimit(limit)])
    run = rd.simulate(plant, **START, duration_s=0.3, controller=law, estimate_error=False)
    assert (np.abs(run.u) <= limit).all()
    assert (np.abs(run.u) == limit).any(axis=0).all()
    assert (np.abs(run.u) < limit).any(axis=0).all()
    if period == 0.0:
        asked = [law.torque(*state, np.zeros(0)) for state in zip(run.t, run.q, run.v, strict=True)]
        np.testing.assert_allclose(run.u, np.clip(asked, -limit, limit), atol=1e-12)
    expected = DOUBLE.forward_dynamics(run.q, run.v, run.u)
    np.testing.assert_allclose(run.a, expected, atol=1e-11 * np.abs(expected).max())
    np.testing.assert_allclose(run.power["control"], (run.u * run.v).sum(axis=1), atol=1e-12)


@pytest.mark.parametrize("edge", [0.3, 0.6, 0.7])
def test_a_switch_on_a_tick_is_one_cut(edge: float) -> None:
    """3 · 0.1 = 0.30000000000000004 is not 0.3: the two are one end of a step, and companions are not lost to it."""
    push = rd.effects.ExternalWrench("tip", [1.0, 0.0, -2.0, 0.0, -0.5, 0.0], start_s=0.1, end_s=edge)
    law = rd.control.PD(GOAL, kp=[8.0, 2.0], kd=[1.0, 0.2], period_s=0.1)  # slow enough for 10 Hz
    run = rd.simulate(rd.Plant(DOUBLE, [push]), **START, duration_s=0.9, controller=law, method="RK4", step_s=5e-3)
    assert np.diff(run.t).min() > 1e-3
    assert run.error is not None
    assert run.error.largest < 1e-6


@pytest.mark.parametrize("method", ["Euler", "SemiImplicitEuler", "Midpoint", "RK4", "DP8"])
def test_a_run_evaluates_what_its_method_declares_and_nothing_it_does_not_name(method: str) -> None:
    """48 steps; besides them an effect is asked at the two samples only, for their acceleration and power."""
    on, seen = counted()
    integrator = rd.integrate.method(method)
    run = rd.simulate(
        rd.Plant(DOUBLE, [on]), **START, duration_s=0.048, method=integrator, record_every_s=0.048,
        estimate_error=False,
    )  # fmt: skip
    assert integrator.evaluations_per_step is not None
    assert run.statistics.steps == 48
    assert run.statistics.evaluations == 48 * integrator.evaluations_per_step
    assert len(run.t) == 2
    # twice a sample, of which there are two, and at the start to see that it fits and that M is not singular there
    assert run.statistics.evaluations <= len(seen) <= run.statistics.evaluations + 2 * 2 + 2


@pytest.mark.parametrize("method", ["RK4", "GaussLegendre2", "DOP853"])
def test_companions_that_are_off_cost_nothing(method) -> None:
    """Of 2, 3 and 5 times the step: 1/2 + 1/3 + 1/5 of the steps more, and looks between them; the run is the same."""
    runs, calls = [], []
    for estimate in (False, True):
        effect, seen = counted()
        plant = rd.Plant(DOUBLE, [effect])
        runs.append(rd.simulate(plant, **START, duration_s=0.04, method=method, estimate_error=estimate))
        calls.append(len(seen))
    without, with_companions = runs
    assert without.error is None
    assert "not estimated" in without.summary
    assert without.statistics.companions_s == 0.0
    assert with_companions.error is not None
    assert np.array_equal(without.q, with_companions.q)
    assert without.statistics.evaluations == with_companions.statistics.evaluations
    more = calls[1] - calls[0]
    assert more > 0.3 * without.statistics.evaluations
    if method == "RK4":
        steps = without.statistics.steps
        looks = steps + 1 + 4000 // (steps + 1) * steps  # at the ends of steps and between them
        pushed = 4 * ceil(steps / 3)  # from a start moved by rounding
        samples = len(without.t)  # at which the run holds what its effects exerted
        assert more == 4 * (ceil(steps / 2) + ceil(steps / 3) + ceil(steps / 5)) + pushed + looks + samples
