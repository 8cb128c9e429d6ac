"""The momentum observer follows the external torque as a first-order filter, and thresholds keep their alarm rate."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
import pytest
from scipy.stats import beta

import robot_dyn as rd
from robot_dyn.control import AlarmThreshold, ExternalTorque, MomentumObserver, external_torque
from robot_dyn.foundations import ControlError

ARM = rd.load("planar_2r")
PUSH, K = np.array([3.0, -1.5]), 20.0
START = np.array([0.2, 0.3])
MOTION = rd.control.quintic(START, [1.0, -0.5], 0.5)
RUN = {"duration_s": 0.5, "engine": "interpreted", "method": "RK4", "step_s": 1e-3, "estimate_error": False}


@dataclass(frozen=True, eq=False)
class Push(rd.effects.Active):
    """A constant torque on the joints."""

    tau: np.ndarray
    term = "τ_ext"

    def torque(self, dynamics, t, q, v):
        return self.tau + 0 * v

    def thresholds(self, n: int) -> tuple:
        return ()


def observer(period_s: float, **options) -> MomentumObserver:
    law = rd.control.PDGravity(ARM, MOTION, kp=100.0, kd=20.0, period_s=period_s)
    return MomentumObserver(law, ARM, bandwidth_rad_s=K, **options)


@cache
def pushed(period_s: float) -> tuple[MomentumObserver, rd.Trajectory]:
    law = observer(period_s)
    plant = rd.Plant(ARM, [Push(PUSH)])
    return law, rd.simulate(plant, START, controller=law, record_every_s=period_s, **RUN)


def deviation(period_s: float) -> float:
    """Largest difference of r from (1 − exp(−K t)) τ_ext."""
    law, run = pushed(period_s)
    expected = (1 - np.exp(-K * run.t))[:, None] * PUSH
    return float(np.abs(law.recorded(run.t, run.controller_states).torque - expected).max())


def test_r_follows_a_constant_torque_in_closed_form() -> None:
    """Only the trapezoidal rule of Cᵀ v − N errs: by h² Δ(d(Cᵀ v − N)/dt)/(12 h) at most, a quarter at half of h."""
    coarse, fine = deviation(4e-3), deviation(2e-3)
    assert fine < 1e-4
    assert coarse / fine == pytest.approx(4, rel=0.05)


def test_tick_by_tick_and_over_the_log_are_equal() -> None:
    """Equal formulas on one machine's states; M v is a difference of terms of 20 N m, over h of 2 ms: 1e-11."""
    law, run = pushed(2e-3)
    log = external_torque(ARM, run.t, run.q, run.v, run.u, bandwidth_rad_s=K, zero_order_hold=True)
    np.testing.assert_allclose(log.torque, law.recorded(run.t, run.controller_states).torque, atol=1e-11)


@pytest.mark.long
def test_both_engines_give_the_same_r() -> None:
    """In a loop with an encoder, whose measurements the observer sees; machine code differs by rounding."""
    loop = rd.control.Loop(observer(5e-3), position=[rd.control.Quantisation(1e-4)], measurement_delay_periods=1)
    runs = [
        rd.simulate(ARM, START, controller=loop, record_every_s=5e-3, **(RUN | {"engine": engine}))
        for engine in ("interpreted", "compiled")
    ]
    assert [run.statistics.engine for run in runs] == ["interpreted", "compiled"]
    one, other = (loop.controller.recorded(run.t, run.controller_states).torque for run in runs)
    assert np.abs(one).max() > 1e-3
    np.testing.assert_allclose(one, other, atol=1e-9)


def test_the_observer_leaves_the_motion_as_it_is() -> None:
    law, run = pushed(2e-3)
    plain = rd.simulate(rd.Plant(ARM, [Push(PUSH)]), START, controller=law.controller, record_every_s=2e-3, **RUN)
    np.testing.assert_allclose(run.q, plain.q, atol=1e-9)


def smooth_log(effects: tuple = (), m: int = 1001) -> tuple[np.ndarray, ...]:
    """A log whose torques are those of the motion exactly, with samples of a signal."""
    t = np.linspace(0, 2, m)
    q = START + 0.5 * np.stack([1 - np.cos(3 * t), np.sin(2 * t) - 2 * t * np.cos(2 * t)], axis=1) / 2
    v = 0.25 * np.stack([3 * np.sin(3 * t), 4 * t * np.sin(2 * t)], axis=1)
    a = 0.25 * np.stack([9 * np.cos(3 * t), 4 * np.sin(2 * t) + 8 * t * np.cos(2 * t)], axis=1)
    return t, q, v, rd.Plant(ARM, effects).inverse_dynamics(q, v, a)


@pytest.mark.parametrize(
    "effects", [(), (rd.effects.ViscousFriction(0.8), rd.effects.RegularisedCoulombFriction(2.0, 0.05))]
)
def test_r_stays_0_with_an_exact_model(effects: tuple) -> None:
    """To the trapezoidal rule, which errs by h²: a quarter at half of h, with friction in the model too."""
    model = rd.Plant(ARM, effects).torque if effects else None
    coarse, fine = (
        np.abs(external_torque(ARM, *smooth_log(effects, m), bandwidth_rad_s=K, effects=model).torque).max()
        for m in (1001, 2001)
    )
    assert fine < 1e-3
    assert coarse / fine == pytest.approx(4, rel=0.3)


def test_friction_left_out_of_the_model_appears_as_an_external_torque() -> None:
    t, q, v, tau = smooth_log((rd.effects.ViscousFriction(0.8),))
    r = external_torque(ARM, t, q, v, tau, bandwidth_rad_s=200.0).torque
    late = t > 0.1  # 20 time constants; then r lags by one of them, and by half a sample
    np.testing.assert_allclose(r[late], -0.8 * v[late], atol=0.8 * np.abs(np.gradient(v, t, axis=0)).max() / 190)


def test_an_offset_at_rest_is_subtracted() -> None:
    """A sensor that reads 0.7 N m too much shows −0.7 N m of external torque at rest."""
    t = np.linspace(0, 1, 501)
    q, v = np.tile(START, (501, 1)), np.zeros((501, 2))
    r = external_torque(ARM, t, q, v, ARM.N(q) + np.array([0.7, -0.2]), bandwidth_rad_s=K, rest_s=(0.0, 0.5))
    np.testing.assert_allclose(r.offset, [-0.7, 0.2], atol=1e-10)
    np.testing.assert_allclose(r.torque, 0, atol=1e-10)


def noisy(blocks: int, seed: int, joints: int = 3) -> ExternalTorque:
    """White noise behind the filter of K, with another scale for each joint; 50 samples of 20 ms in each second."""
    from scipy.signal import lfilter

    decay = np.exp(-K * 0.02)
    white = np.random.default_rng(seed).normal(size=(50 * blocks + 1, joints)) * np.arange(1, joints + 1)
    names = tuple(f"j{i}" for i in range(joints))
    r = lfilter([1 - decay], [1, -decay], white, axis=0)
    t = 0.02 * np.arange(len(r))
    return ExternalTorque(names, ("revolute",) * joints, t, r, np.zeros(joints), np.full(joints, K))


def alarms(log: ExternalTorque, threshold: AlarmThreshold) -> int:
    return int((log.block_maxima(threshold.block_s) > threshold.torque).any(axis=1).sum())


@pytest.mark.parametrize("wanted", [None, 500.0])
def test_the_interval_contains_the_alarm_rate_of_fresh_logs(wanted: float | None) -> None:
    """At 95 %, at most 5 of 100 intervals miss; 11 and more of 100 have a probability of 1 %."""
    fresh, missed = noisy(7200, 999), 0
    for seed in range(100):
        threshold = noisy(100, seed).threshold(wanted)
        missed += not threshold.low <= alarms(fresh, threshold) / 2 <= threshold.high
        assert threshold.high <= (wanted or np.inf)
    assert missed <= 10


def test_a_log_has_the_contacts_of_its_own_threshold_where_it_exceeds_it() -> None:
    """The largest value is the threshold, and nothing exceeds it; one block exceeds the second largest."""
    log = noisy(60, 1)
    assert log.contacts(log.threshold()) == ()
    assert log.contacts(log.threshold(600.0))


def test_the_interval_is_that_of_order_statistics() -> None:
    """The upper end is the quantile of Beta(k + 1, B − k) exactly, the lower end is at most its other quantile."""
    log = noisy(60, 1)
    threshold = log.threshold(600.0)
    k = threshold.exceeded
    assert alarms(log, threshold) == k > 0 and threshold.alarms_per_hour == pytest.approx(60 * k)
    low, high = 3600 * beta(k + 1, 60 - k).ppf([0.025, 0.975])
    assert threshold.high == pytest.approx(high) and threshold.low <= low


def test_a_contact_is_found_with_its_time_joint_and_sign() -> None:
    law, run = pushed(2e-3)
    (contact,) = law.recorded(run.t, run.controller_states).contacts([1.0, 1.0])
    start = -np.log(1 - 1 / 3) / K  # 3 (1 − exp(−K t)) = 1
    assert start <= contact.start_s <= start + 2e-3 and contact.end_s == run.t[-1]
    assert contact.joint == ARM.joint_names[0] and contact.torque == pytest.approx(3, abs=1e-3)
    assert law.recorded(run.t, run.controller_states).contacts(4.0) == ()


def test_crossings_within_a_time_constant_are_one_contact() -> None:
    t, r = np.arange(0, 1, 0.01), np.zeros((100, 1))
    r[[10, 12, 60]] = -2.0
    log = ExternalTorque(("j",), ("revolute",), t, r, np.zeros(1), np.full(1, K))
    times = [t for contact in log.contacts(1.0) for t in (contact.start_s, contact.end_s)]
    assert times == pytest.approx([0.1, 0.12, 0.6, 0.6])


LOG = dict(zip(("t", "q", "v", "tau"), smooth_log(m=11), strict=True))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"arm": "ur5"}, "arm"),
        ({"t": LOG["t"][::-1]}, "t must have at least two increasing times"),
        ({"v": LOG["v"][1:]}, r"v must .* \(11, 2\)"),
        ({"bandwidth_rad_s": 0.0}, "bandwidth_rad_s must be above 0|bandwidth_rad_s"),
        ({"effects": 3.0}, "effects"),
        ({"effects": lambda q, v: -v[0]}, r"effects\(q, v\) must have shape \(11, 2\)"),
        ({"zero_order_hold": 1}, "zero_order_hold"),
        ({"rest_s": (5.0, 6.0)}, "rest_s: only 0 samples"),
        ({"rest_s": (0.0, 2.0)}, "rest_s: a joint moves by"),
    ],
)
def test_a_wrong_log_is_refused(change: dict, message: str) -> None:
    with pytest.raises(ControlError, match=message):
        external_torque(**{"arm": ARM, **LOG, "bandwidth_rad_s": K} | change)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: noisy(10, 0).threshold(10.0), r"needs a log of \d+ s without contact, got 10 s"),
        (lambda: noisy(10, 0).threshold(block_s=0.1), r"block_s must be from 5/K = 0.25 s to the 10 s"),
        (lambda: noisy(10, 0).threshold(block_s=11.0), r"block_s must be from 5/K"),
        (lambda: noisy(10, 0).threshold(level=1.0), "level must be between 0 and 1"),
        (lambda: noisy(10, 0).contacts(0.0), "threshold"),
        (lambda: pushed(2e-3)[0].recorded([0.0], [[1.0]]), "z has 1 states, but the observer has 9"),
        (lambda: observer(0.0), "is continuous"),
        (lambda: MomentumObserver(observer(1e-3), rd.load("ur5"), bandwidth_rad_s=K), "the model has 6 joints"),
        (lambda: MomentumObserver(observer(1e-3), ARM, bandwidth_rad_s=-1.0), "bandwidth_rad_s"),
    ],
)
def test_a_wrong_value_is_refused(call, message: str) -> None:
    with pytest.raises(ControlError, match=message):
        call()


def test_a_log_that_needs_a_length_suffices_at_this_length() -> None:
    """The length in the error is exact: 95 % of no alarm in B blocks."""
    needed = round(np.log(0.025) / np.log1p(-100 / 3600))
    assert noisy(needed + 1, 0).threshold(100.0).exceeded == 0
    with pytest.raises(ControlError, match=f"{needed} s"):
        noisy(needed - 2, 0).threshold(100.0)
