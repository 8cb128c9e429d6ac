"""Effort limits of continuous control: steps end where they are reached and left; orders: test_switched_orders."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn.foundations import EffectError
from robot_dyn.simulation import Verdict
from tests.effects.test_effect_states import MASS, SLIDER, Ramp

ARM = rd.load("planar_2r")
START = [0.3, -0.2]
LIMIT = [18.0, 5.0]
REFERENCE = rd.control.quintic([0.1, 0.2], [1.3, -0.7], 0.8)
BOTH = pytest.mark.parametrize("engine", ["interpreted", "compiled"])
TIGHT = rd.integrate.Adaptive(rtol=1e-12, atol=1e-12)


def slide(effects, control, duration_s: float, **options) -> rd.Trajectory:
    options = {"estimate_error": False, "record_every_s": duration_s} | options
    return rd.simulate(rd.Plant(SLIDER, effects), [0.0], duration_s=duration_s, controller=control, **options)


@BOTH
@pytest.mark.parametrize("method", ["RK4", "DP8", "DOP853", "Rodas5P"])
def test_a_growing_command_is_followed_up_to_the_limit(engine: str, method: str) -> None:
    """The command c + d t up to U: a cubic, and a parabola behind t = (U − c)/d; these methods are exact on both."""
    c, d, U, T = 0.3, 2.0, 1.1, 0.7
    run = slide([rd.effects.EffortLimit(U)], Ramp(c, d), T, method=method, engine=engine)
    (reached,) = run.events
    at = (U - c) / d
    assert (reached.name, reached.direction, reached.joint) == ("upper effort limit of slide reached", 1, "slide")
    assert reached.t == pytest.approx(at, abs=4 * np.spacing(at))
    v = (c * at + d * at**2 / 2) / MASS
    q = (c * at**2 / 2 + d * at**3 / 6) / MASS
    assert reached.q[0] == pytest.approx(q, rel=1e-13)
    assert run.v[-1, 0] == pytest.approx(v + U / MASS * (T - at), rel=1e-13)
    assert run.q[-1, 0] == pytest.approx(q + v * (T - at) + U / MASS * (T - at) ** 2 / 2, rel=1e-13)
    assert run.u[-1, 0] == U


@BOTH
@pytest.mark.parametrize("period_s", [0.0, 0.9])
def test_a_lag_that_reaches_the_limit_behind_it(engine: str, period_s: float) -> None:
    """u₀ (1 − exp(−t/T)) = U at t = −T ln(1 − U/u₀), also where the command is that of a sampled controller."""
    u0, U, T = 3.0, 1.2, 0.08
    effects = [rd.effects.ActuatorLag(T), rd.effects.EffortLimit(U)]
    run = slide(effects, Ramp(u0, 0.0, period_s), 0.4, method=TIGHT, engine=engine)
    (reached,) = run.events
    at = -T * np.log(1 - U / u0)
    assert reached.t == pytest.approx(at, abs=1e-12)
    v = (u0 * at - U * T) / MASS
    assert run.v[-1, 0] == pytest.approx(v + U / MASS * (0.4 - at), abs=1e-12)


@BOTH
def test_a_reference_that_jumps_passes_the_limit_at_its_break(engine: str) -> None:
    """From rest at 0 to 2 at t = 0.2: kp (2 − q) − kd v > U at once, and q = U t²/(2 m) until it is left."""
    there = rd.control.PiecewisePolynomial([0.0, 0.2, 1.0], [[[0.0]], [[2.0]]])
    run = slide([rd.effects.EffortLimit(1.5)], rd.control.PD(there, kp=10.0, kd=4.0), 0.6, method=TIGHT, engine=engine)
    assert [each.name for each in run.events] == ["upper effort limit of slide reached"]
    assert run.events[0].t == pytest.approx(0.2, abs=np.spacing(0.2))
    assert run.q[-1, 0] == pytest.approx(1.5 / MASS * 0.4**2 / 2, rel=1e-12)
    whole = slide(
        [rd.effects.EffortLimit(1.5)], rd.control.PD(there, kp=10.0, kd=4.0), 3.0, method=TIGHT, engine=engine
    )
    left = whole.events[1]
    assert left.name == "upper effort limit of slide left"
    assert 10.0 * (2.0 - left.q[0]) - 4.0 * left.v[0] == pytest.approx(1.5, abs=1e-13)


def control(kind: str) -> tuple[rd.control.Controller, list[rd.Effect]]:
    if kind == "pid":  # with back-calculation: ż has the torque that is cut away
        gains = {"kp": [120.0, 60.0], "ki": [300.0, 150.0], "kd": [20.0, 8.0]}
        return rd.control.PID(REFERENCE, **gains, effort_limit=LIMIT), []
    return rd.control.ComputedTorque(ARM, REFERENCE, bandwidth_rad_s=12.0), [rd.effects.EffortLimit(LIMIT)]


def saturated(kind: str, **options) -> rd.Trajectory:
    controller, effects = control(kind)
    options = {"estimate_error": False, "record_every_s": 1.0, "engine": "compiled"} | options
    return rd.simulate(rd.Plant(ARM, effects), START, duration_s=1.0, controller=controller, **options)


@pytest.mark.parametrize("kind", ["computed_torque", "pid"])
def test_both_engines_meet_the_same_limits(kind: str) -> None:
    one, other = (saturated(kind, engine=engine, method=TIGHT) for engine in ("interpreted", "compiled"))
    assert [each.name for each in one.events] == [each.name for each in other.events]
    np.testing.assert_allclose(one.q[-1], other.q[-1], atol=1e-11)


def test_the_estimate_sees_the_order_over_a_limit() -> None:
    """A kink that steps end at bounds nothing: the verdict is the order, and the estimate right within 0.3 … 30."""
    exact = saturated("computed_torque", method=rd.integrate.Adaptive(rtol=1e-13, atol=1e-13))
    run = saturated("computed_torque", method="RK4", step_s=1e-3, estimate_error=True)
    assert run.error is not None
    assert run.error.verdict is Verdict.ORDER
    assert 0.3 < run.error.largest / np.abs(run.q[-1] - exact.q[-1]).max() < 30


def test_limits_that_are_not_reached_change_no_step() -> None:
    controller, _ = control("computed_torque")
    options = {"duration_s": 1.0, "controller": controller, "estimate_error": False, "engine": "compiled"}
    bare = rd.simulate(rd.Plant(ARM), START, **options)
    far = rd.simulate(rd.Plant(ARM, [rd.effects.EffortLimit(1e4)]), START, **options)
    assert far.events == ()
    assert far.statistics.steps == bare.statistics.steps
    assert np.array_equal(far.q, bare.q)


@pytest.mark.parametrize("method", ["RK4", "DOP853"])
def test_what_is_held_between_ticks_is_not_cut(method: str) -> None:
    """The command is constant between ticks, and nothing switches there."""
    gains = rd.control.gains_from(1.0, 12.0)
    sampled = rd.control.ComputedTorque(ARM, REFERENCE, kp=gains[0], kd=gains[1], period_s=0.01)
    setup = rd.Setup(rd.Plant(ARM, [rd.effects.EffortLimit(LIMIT)]), START, controller=sampled, method=method)
    run = rd.simulate(setup, estimate_error=False)
    assert setup.finds_events is (method == "DOP853")
    assert run.events == ()
    assert np.abs(run.u[:, 0]).max() == LIMIT[0]


@dataclass(frozen=True, eq=False)
class Bang(rd.control.Stateless):
    """u = 3 on one side of the line q + 2 v = 0.5, and −3 on the other: a controller that switches by itself."""

    n: int = 1

    def torque(self, t, q, v, z):
        return np.where(q + 2.0 * v < 0.5, 3.0, -3.0)


@pytest.mark.parametrize(("method", "engine"), [("RK4", "interpreted"), ("DOP853", "compiled")])
def test_a_limit_that_chatters_is_named_and_does_not_hang(method: str, engine: str) -> None:
    """On either side of the line q + 2 v = 0.5 u drives back across it: the motion slides along it."""
    run = slide([rd.effects.EffortLimit(1.0)], Bang(), 0.4, method=method, engine=engine)
    assert run.outcome.ending == ("finished" if method == "RK4" else "diverged")  # no error control gets over it
    assert any("effort limit of slide" in each.name and "chatters" in each.name for each in run.events)


def test_what_is_held_stays_held_when_a_limit_is_no_longer_looked_for() -> None:
    """The limit of joint 1 chatters, and is dropped; dry friction holds joint 2 all the while, to the last bit."""
    arm = rd.load("planar_2r").with_(gravity=(0, 0, 0))

    def drive(t, q, v):
        return np.array([np.where(q[0] + 2.0 * v[0] < 0.5, 3.0, -3.0), 0.0])

    plant = rd.Plant(arm, [rd.effects.EffortLimit([1.0, np.inf]), rd.effects.DryFriction([0.0, 60.0])])
    run = rd.simulate(
        plant, [0.3, 0.7], duration_s=0.6, controller=drive, method="RK4", step_s=0.002,
        estimate_error=False,
    )  # fmt: skip
    assert any("chatters" in each.name for each in run.events)
    assert (run.q[:, 1] == 0.7).all()


def test_sweeps_of_the_limit_are_cut_as_single_runs_are() -> None:
    """A limit of none for the first, and two that are reached."""
    controller, _ = control("computed_torque")
    plant, options = rd.Plant(ARM, [rd.effects.EffortLimit(LIMIT)]), {"record_every_s": 0.25, "estimate_error": False}
    setup = rd.Setup(plant, START, None, 1.0, controller, **options)
    limits = np.array([[np.inf, np.inf], [18.0, 5.0], [25.0, 8.0]])
    runs = rd.rollouts(setup, vary={"effort_limit.limit": limits})
    for i, limit in enumerate(limits):
        alone = rd.simulate(setup, plant=rd.Plant(ARM, [rd.effects.EffortLimit(limit)]), engine="compiled")
        np.testing.assert_allclose(runs.q[i], alone.q, atol=1e-13)


def test_thresholds_of_the_actuation_are_for_bounds() -> None:
    @dataclass(frozen=True, eq=False)
    class Odd(rd.effects.Dissipative):
        def torque(self, dynamics, t, q, v):
            return -v

        def thresholds(self, n):
            return (rd.effects.Threshold(0, 1.0, "odd", "up", "down", of_actuation=True),)

    with pytest.raises(EffectError, match="odd: only bounds"):
        rd.simulate(rd.Plant(ARM, [Odd()]), START)
    with pytest.raises(EffectError, match="set at most one of"):
        rd.effects.Threshold(0, 1.0, "odd", "up", "down", of_actuation=True, of_velocity=True)
