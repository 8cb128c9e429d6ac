"""Independent joint control: PD, PID and its states, and what every controller refuses."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import robot_dyn as rd
from robot_dyn.control import PD, PID, ComputedTorque, Controller, FeedForward, gains_from, hold, quintic
from robot_dyn.foundations import ControlError

NONE = np.zeros(0)  # no states
Q, V, T = np.array([0.4, -0.9, 1.3]), np.array([-0.7, 0.2, 1.1]), 0.6
MOTION = quintic([0.1, -0.2, 0.3], [1.0, -1.4, 2.0], 1.5)
KP, KI, KD = np.array([30.0, 20.0, 10.0]), np.array([12.0, 9.0, 4.0]), 5.0


def test_pd_is_a_spring_and_a_damper() -> None:
    q_d, v_d, _ = MOTION.at(T)
    np.testing.assert_allclose(
        PD(MOTION, kp=KP, kd=KD).torque(T, Q, V, NONE), KP * (q_d - Q) + KD * (v_d - V), rtol=1e-15
    )


def test_pid_below_its_limit_is_pd_and_the_integral_of_the_error() -> None:
    controller, z = PID(MOTION, kp=KP, ki=KI, kd=KD, effort_limit=1e3), np.array([0.3, -0.2, 0.9])
    q_d = MOTION.at(T)[0]
    expected = PD(MOTION, kp=KP, kd=KD).torque(T, Q, V, NONE) + z
    np.testing.assert_allclose(controller.torque(T, Q, V, z), expected, rtol=1e-15)
    np.testing.assert_allclose(controller.state_rate(T, Q, V, z), KI * (q_d - Q), rtol=1e-15)
    assert controller.state_size == 3


def test_pid_above_its_limit_gives_the_limit_and_lets_the_excess_flow_back() -> None:
    limit, z = np.array([2.0, 1.0, np.inf]), np.array([40.0, -50.0, 3.0])
    controller = PID(MOTION, kp=KP, ki=KI, kd=KD, effort_limit=limit, tracking_time_s=0.25)
    desired = PD(MOTION, kp=KP, kd=KD).torque(T, Q, V, NONE) + z
    np.testing.assert_allclose(controller.torque(T, Q, V, z), [2.0, -1.0, desired[2]], rtol=1e-15)
    expected = KI * (MOTION.at(T)[0] - Q) - np.array([desired[0] - 2, desired[1] + 1, 0]) / 0.25
    np.testing.assert_allclose(controller.state_rate(T, Q, V, z), expected, rtol=1e-14)


def test_gains_place_the_poles_of_a_joint() -> None:
    """M ë + kd ė + kp e = 0 has the poles ω (−ζ ± i √(1 − ζ²)); np.roots is good to 1e-14 of them."""
    kp, kd = gains_from([2.0, 0.3], [7.0, 30.0], 0.6)
    for M, kp_i, kd_i, omega in zip([2.0, 0.3], kp, kd, [7.0, 30.0], strict=True):
        np.testing.assert_allclose(
            np.sort(np.roots([M, kd_i, kp_i])), omega * np.array([-0.6 - 0.8j, -0.6 + 0.8j]), rtol=1e-14
        )
    assert gains_from(1.0, 10.0) == (100.0, 20.0)


MASS, PUSH = 0.8, 3.0  # [kg m²], [N m]


def one_joint(controller: Controller, until: float, *, push: float = PUSH, limit: float = np.inf, at=None):
    """Motion (t, q, v, z) of M a = τ + push from rest, with a drive that gives no more than its limit."""

    def rate(t: float, x: np.ndarray) -> np.ndarray:
        q, v, z = x[:1], x[1:2], x[2:]
        tau = np.clip(controller.torque(t, q, v, z), -limit, limit)
        return np.concatenate([v, (tau + push) / MASS, controller.state_rate(t, q, v, z)])

    x0 = np.zeros(2 + controller.state_size)
    run = solve_ivp(rate, (0, until), x0, method="DOP853", rtol=1e-10, atol=1e-12, t_eval=at)
    assert run.success
    return run.t, *run.y


def test_pid_removes_a_constant_disturbance_and_pd_does_not() -> None:
    """Closed form: M s³ + kd s² + kp s + ki = 0 gives e(t) = Σ c_i e^{s_i t}; PD is left with push/kp."""
    kp, ki, kd = 40.0, 60.0, 9.0
    t, q, _, z = one_joint(PID(hold([0.0]), kp=kp, ki=ki, kd=kd), 12.0, at=np.linspace(0, 12, 50))
    s = np.roots([MASS, kd, kp, ki])
    c = np.linalg.solve(np.vander(s, increasing=True).T, [0, 0, PUSH / MASS])  # q, v, a at t = 0
    np.testing.assert_allclose(q, (np.exp(np.outer(t, s)) @ c).real, atol=1e-9)  # 1e-10 a step, some hundred steps
    assert abs(q[-1]) < 1e-8
    np.testing.assert_allclose(z[-1], -PUSH, rtol=1e-6)  # the integral carries the push
    assert one_joint(PD(hold([0.0]), kp=kp, kd=kd), 12.0)[1][-1] == pytest.approx(PUSH / kp, rel=1e-8)


def test_the_integral_of_a_blocked_joint_settles() -> None:
    """At a held error z tends to L + T_t ki e − kp e as 1 − e^{−t/T_t}; unguarded it grows as ki e t."""
    limit, time, e = 5.0, 0.4, 2.0
    blocked = PID(hold([e]), kp=40.0, ki=60.0, kd=9.0, effort_limit=limit, tracking_time_s=time)
    free = PID(hold([e]), kp=40.0, ki=60.0, kd=9.0)
    still = np.zeros(1)
    for controller, expected in [
        (blocked, (limit + time * 60 * e - 40 * e) * (1 - np.exp(-3 / time))),
        (free, 60 * e * 3),
    ]:
        run = solve_ivp(
            lambda t, z, c=controller: c.state_rate(t, still, still, z), (0, 3), [0.0], rtol=1e-10, atol=1e-12
        )
        np.testing.assert_allclose(run.y[0, -1], expected, rtol=1e-8)


def test_anti_windup_bounds_the_integral_and_the_overshoot() -> None:
    """A step that saturates the drive: z ≤ L + kd v_max, and less than 10 % overshoot; above 50 % without a guard.

    While the error is positive z falls wherever z > L + T_t ki e − kp e + kd v, which kp ≥ T_t ki keeps below L + kd v.
    """
    kp, ki, kd, limit, step = 40.0, 30.0, 9.0, 5.0, 2.0
    guarded = PID(hold([step]), kp=kp, ki=ki, kd=kd, effort_limit=limit)
    assert guarded.tracking_time_s == pytest.approx(np.sqrt(kd / ki))
    assert kp >= np.sqrt(kd / ki) * ki
    _, q, v, z = one_joint(guarded, 8.0, push=0.0, limit=limit)
    q_free = one_joint(PID(hold([step]), kp=kp, ki=ki, kd=kd), 8.0, push=0.0, limit=limit)[1]
    assert z.max() <= limit + kd * v.max()
    assert q.max() < 1.1 * step
    assert q_free.max() > 1.5 * step
    assert abs(q[-1] - step) < 1e-3 * step


def test_sampled_states_tend_to_the_continuous_ones() -> None:
    """The rule z ← z + period · rate is of first order: a quarter of the period, a quarter of the error."""
    errors = []
    for period in (0.008, 0.002):
        controller, x, z = PID(hold([1.0]), kp=40.0, ki=60.0, kd=9.0, period_s=period), np.zeros(2), np.zeros(1)
        for k in range(round(0.8 / period)):
            q, v, t = x[:1], x[1:], k * period
            a = (controller.torque(t, q, v, z)[0] + PUSH) / MASS
            z = controller.next_state(t, q, v, z)
            x = x + period * np.array([x[1] + period * a / 2, a])  # exact for a held torque
        continuous = one_joint(PID(hold([1.0]), kp=40.0, ki=60.0, kd=9.0), 0.8)
        errors.append([x[0] - continuous[1][-1], z[0] - continuous[3][-1]])
    np.testing.assert_allclose(np.divide(*errors), 4, rtol=0.15)  # the next order: period · ω is some 5 %


def test_a_stateless_controller_has_no_states() -> None:
    controller = PD(MOTION, kp=1.0, kd=1.0, period_s=0.01)
    assert controller.state_size == 0
    assert controller.next_state(T, Q, V, NONE).shape == (0,)
    assert controller.n == 3


ROBOT = rd.load("planar_2r")


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: PD(MOTION, kp=-1.0, kd=1.0), "kp must not be negative"),
        (lambda: PD(MOTION, kp=1.0, kd=[1.0, 2.0]), r"kd must be one number or of shape \(3,\), got \(2,\)"),
        (lambda: PD(MOTION, kp="stiff", kd=1.0), "kp must be real numbers"),
        (lambda: PD(MOTION, kp=1.0, kd=np.inf), "kd must be finite"),
        # names of joints: a controller such as PD knows none, so that nothing could resolve them later
        *(
            (lambda gain=gain: PD(MOTION, kp=gain, kd=KD), "kp must be real numbers, one or of shape")
            for gain in ({"joint_1": 5.0}, "urdf", None)
        ),
        (lambda: PD(MOTION, kp=1.0, kd=1.0, period_s=-0.1), "period_s must be a positive number of seconds"),
        (lambda: PD([0.0], kp=1.0, kd=1.0), "reference must be a PiecewisePolynomial"),
        (lambda: PID(MOTION, kp=1.0, ki=-1.0, kd=1.0), "ki must not be negative"),
        (lambda: PID(MOTION, kp=1.0, ki=1.0, kd=1.0, effort_limit=0.0), "effort_limit must be positive"),
        (lambda: PID(MOTION, kp=1.0, ki=1.0, kd=1.0, effort_limit="no"), "effort_limit must be real numbers"),
        (lambda: PID(MOTION, kp=1.0, ki=1.0, kd=1.0, tracking_time_s=0.0), "tracking_time_s must be positive"),
        (lambda: ComputedTorque(ROBOT, MOTION, kp=1.0, kd=1.0), "the model has 2 joints, but the reference has 3"),
        (lambda: FeedForward(ROBOT, hold([0.0, 0.0]), kp=1.0, kd=[1.0]), r"kd must be one number or of shape \(2,\)"),
        (lambda: gains_from(0.0, 1.0), "inertia_diagonal must be positive"),
        (lambda: PD(MOTION, kp=1.0, kd=1.0, period_s=[]), r"period_s must be one number, got shape \(0,\)"),
        (lambda: gains_from([1.0, 2.0], [1.0, 2.0, 3.0]), "damping_ratio differ"),
    ],
)
def test_controllers_without_meaning_are_refused(make, message: str) -> None:
    with pytest.raises(ControlError, match=message):
        make()


@dataclass(frozen=True, eq=False)
class Averaging(rd.control.Controller):
    """A sampled law that defines `next_state` alone: z⁺ = (z + q)/2 and u = −z − 3 v."""

    period_s: float = 0.01
    n, state_size, thresholds = 2, 2, lambda self: ()

    def torque(self, t, q, v, z):
        return -z - 3.0 * v

    def next_state(self, t, q, v, z):
        return (z + q) / 2


@dataclass(frozen=True, eq=False)
class AveragingByRate(Averaging):
    """The same law by its rate, z⁺ = z + T ż."""

    def state_rate(self, t, q, v, z):
        return (q - z) / (2 * self.period_s)

    def next_state(self, t, q, v, z):
        return z + self.period_s * self.state_rate(t, q, v, z)


@pytest.mark.parametrize("engine", ["interpreted", "compiled"])
@pytest.mark.parametrize("in_loop", [False, True])
def test_a_sampled_law_is_defined_by_its_next_state_alone(engine: str, in_loop: bool) -> None:
    """Equal to the law by its rate, to rounding of z over 30 ticks."""
    arm, ends = rd.load("planar_2r"), []
    for law in (Averaging(), AveragingByRate()):
        controller = rd.control.Loop(law, actuation_delay_periods=0.5) if in_loop else law
        run = rd.simulate(arm, [0.1, 0.2], duration_s=0.3, controller=controller, engine=engine, estimate_error=False)
        ends.append(run.q[-1])
    np.testing.assert_allclose(*ends, rtol=1e-12)


def test_a_sampled_law_without_a_period_is_refused_with_the_remedy() -> None:
    with pytest.raises(ControlError) as refused:
        rd.simulate(rd.load("planar_2r"), [0.1, 0.2], duration_s=0.3, controller=Averaging(period_s=0.0))
    assert "period_s" in str(refused.value) and "next_state" in str(refused.value)


@dataclass(frozen=True, eq=False)
class Solving(rd.control.Stateless):
    """A law that calls a function of np.linalg."""

    model: rd.Robot
    function: str = "solve"
    n, thresholds = 2, lambda self: ()

    def torque(self, t, q, v, z):
        M, swap = self.model.M(q), np.array([[0.0, 1.0], [2.0, 0.0]])  # M is symmetric, the other needs a pivot
        if self.function == "solve":
            return np.linalg.solve(M, np.stack([v, q], axis=1))[:, 0] + np.linalg.solve(swap, v)
        return np.linalg.inv(M) @ v if self.function == "inv" else np.linalg.det(M) * v


@pytest.mark.parametrize("function", ["solve", "inv"])
def test_linear_systems_within_a_law_are_compiled(function: str) -> None:
    """Equal to LAPACK's in the interpreted engine, to rounding."""
    arm, options = rd.load("planar_2r"), {"v0": [1.0, -0.5], "duration_s": 0.1, "method": "RK4", "step_s": 1e-3}
    ends = [
        rd.simulate(arm, [0.1, 0.2], controller=Solving(arm, function), engine=engine, estimate_error=False, **options)
        for engine in ("interpreted", "compiled")
    ]
    np.testing.assert_allclose(ends[0].q, ends[1].q, atol=1e-13)


def test_other_functions_of_linear_algebra_are_named() -> None:
    arm = rd.load("planar_2r")
    with pytest.raises(rd.RobotDynError) as refused:
        rd.rollouts(arm, [[0.1, 0.2]], duration_s=0.1, method="RK4", controller=Solving(arm, "det"))
    assert "np.linalg.det" in str(refused.value) and "np.linalg.solve" in str(refused.value)
