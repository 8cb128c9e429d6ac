"""Control with a model of the arm: exact, it linearises; wrong, it does not."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import robot_dyn as rd
from robot_dyn.control import PD, PID, ComputedTorque, FeedForward, PDGravity, gains_from, hold, quintic
from robot_dyn.foundations.errors import ControlError

NONE = np.zeros(0)  # no states
Q, V, T = np.array([0.4, -0.9, 1.3]), np.array([-0.7, 0.2, 1.1]), 0.6


def arm(name: str) -> rd.Robot:
    """Panda with its fingers held, or the robot of that name."""
    return rd.load(name).with_(lock={"panda_finger_joint1": 0.0} if name == "panda" else {})


def general_motion(n: int):
    """A reference without symmetries."""
    return quintic(np.linspace(-0.3, 0.5, n), np.linspace(0.9, -0.7, n), 1.3, v0=0.2, a1=-0.4)


@pytest.mark.parametrize("name", ["panda", "ur5", "mimic_chain"])
def test_computed_torque_with_the_exact_model_linearises_the_arm(name: str) -> None:
    """ë + kd ė + kp e = 0 at general states, the true arm answered by another algorithm (ABA): 1e-12 of |a| · cond."""
    robot = arm(name)
    n, rng = robot.n, np.random.default_rng(4)
    reference, (kp, kd) = general_motion(n), gains_from(1.0, rng.uniform(3, 12, n), 0.7)
    controller = ComputedTorque(robot, reference, kp=kp, kd=kd)
    for t, q, v in zip([0.2, 0.7, 1.2], *rng.normal(size=(2, 3, n)), strict=True):
        q_d, v_d, a_d = reference.at(t)
        a = robot.forward_dynamics(q, v, controller.torque(t, q, v, NONE))
        M, scale = robot.M(q), np.abs(kp * (q_d - q)).max() + np.abs(kd * (v_d - v)).max()
        D = 1 / np.sqrt(np.diag(M))
        allowed = 1e-12 * scale * max(1.0, np.linalg.cond(M * np.outer(D, D)) / 10)
        np.testing.assert_allclose((a_d - a) + kd * (v_d - v) + kp * (q_d - q), 0, atol=allowed)


def test_computed_torque_with_a_wrong_model_does_not() -> None:
    """A load the controller does not know: the error equation is driven by far more than rounding."""
    robot = arm("ur5")
    loaded = robot.with_(payload=rd.Payload("tool0", 3.0))
    reference, q, v = general_motion(6), Q.repeat(2), V.repeat(2)
    q_d, v_d, a_d = reference.at(T)
    a = loaded.forward_dynamics(q, v, ComputedTorque(robot, reference, kp=50.0, kd=10.0).torque(T, q, v, NONE))
    assert np.abs((a_d - a) + 10 * (v_d - v) + 50 * (q_d - q)).max() > 1.0


def test_computed_torque_tracks_from_a_wrong_start() -> None:
    """Critically damped, ω = 8 rad/s, e(0) = e₀ at rest: e = e₀ (1 + ω t) e^{−ω t}; integrated at 1e-9 a step."""
    robot, omega, e0 = rd.load("planar_2r"), 8.0, np.array([0.3, -0.2])
    reference = quintic([0.4, -0.5], [1.2, 0.9], 1.0)
    controller = ComputedTorque(robot, reference, bandwidth_rad_s=omega)

    def rate(t: float, x: np.ndarray) -> np.ndarray:
        return np.concatenate([x[2:], robot.forward_dynamics(x[:2], x[2:], controller.torque(t, x[:2], x[2:], NONE))])

    x0 = np.concatenate([reference.at(0.0)[0] - e0, np.zeros(2)])
    run = solve_ivp(rate, (0, 1), x0, rtol=1e-9, atol=1e-11, method="DOP853", t_eval=np.linspace(0, 1, 20))
    expected = e0 * ((1 + omega * run.t) * np.exp(-omega * run.t))[:, None]
    np.testing.assert_allclose(reference.at(run.t)[0] - run.y[:2].T, expected, atol=1e-7)


def test_gains_of_computed_torque_follow_from_bandwidth_and_damping_ratio() -> None:
    """For each joint kp = ω² and kd = 2 ζ ω; ζ is 1 by default. Copies with other gains keep the reference."""
    robot, omega, zeta = rd.load("planar_2r"), np.array([7.0, 30.0]), np.array([0.6, 0.2])
    reference = hold([0.1, 0.2])
    law = ComputedTorque(robot, reference, bandwidth_rad_s=omega, damping_ratio=zeta, period_s=0.01)
    np.testing.assert_allclose(law.kp, omega**2, rtol=1e-15)
    np.testing.assert_allclose(law.kd, 2 * zeta * omega, rtol=1e-15)
    critical = ComputedTorque(robot, reference, bandwidth_rad_s=8.0)
    assert (float(critical.kp), float(critical.kd)) == (64.0, 16.0)
    stiffer = replace(law, kp=100.0)
    assert float(stiffer.kp) == 100.0 and np.array_equal(stiffer.kd, law.kd) and stiffer.period_s == 0.01


@pytest.mark.parametrize(
    "gains",
    [
        {},
        {"kp": 1.0},
        {"kd": 1.0},
        {"damping_ratio": 1.0},
        {"bandwidth_rad_s": 1.0, "kp": 1.0},
        {"bandwidth_rad_s": 1.0, "kp": 1.0, "kd": 1.0},
        {"kp": 1.0, "kd": 1.0, "damping_ratio": 1.0},
        {"bandwidth_rad_s": 0.0},
        {"bandwidth_rad_s": [1.0, 2.0, 3.0]},
        {"bandwidth_rad_s": 1.0, "damping_ratio": -0.1},
    ],
)
def test_computed_torque_takes_either_gains_or_bandwidth(gains: dict[str, Any]) -> None:
    with pytest.raises(ControlError):
        ComputedTorque(rd.load("planar_2r"), hold([0.1, 0.2]), **gains)


def test_gains_are_passed_by_keyword() -> None:
    """Their order and units differ between laws."""
    robot, reference = rd.load("planar_2r"), hold([0.1, 0.2])
    laws: list[Any] = [PD, PID, *(partial(law, robot) for law in (PDGravity, FeedForward, ComputedTorque))]
    for law in laws:
        with pytest.raises(TypeError, match="positional"):
            law(reference, 1.0, 1.0, 1.0)


@pytest.mark.parametrize("name", ["panda", "mimic_chain"])
def test_gravity_compensation_rests_anywhere_it_is_told(name: str) -> None:
    """At q = q_d, v = 0 the torque is N(q) and the arm stays: 1e-10 of an acceleration, N cancelled by ABA."""
    robot = arm(name)
    q = np.linspace(0.5, -0.8, robot.n)
    controller = PDGravity(robot, hold(q), kp=100.0, kd=20.0)
    tau = controller.torque(3.0, q, 0 * q, NONE)
    np.testing.assert_allclose(robot.forward_dynamics(q, 0 * q, tau), 0, atol=1e-10)
    away, v = q + 0.1, q * 0.3
    np.testing.assert_allclose(controller.torque(3.0, away, v, NONE), robot.N(away) - 10 - 20 * v, rtol=1e-13)


def test_feed_forward_is_inverse_dynamics_along_the_reference_and_pd() -> None:
    """On the reference itself the exact model keeps the arm there (a = a_d); beside it, PD is added."""
    robot, reference = arm("ur5"), general_motion(6)
    q_d, v_d, a_d = reference.at(T)
    controller = FeedForward(robot, reference, kp=30.0, kd=4.0)
    on = controller.torque(T, q_d, v_d, NONE)
    np.testing.assert_allclose(robot.forward_dynamics(q_d, v_d, on), a_d, rtol=1e-11, atol=1e-11)
    beside = controller.torque(T, q_d - 0.1, v_d + 0.2, NONE)
    np.testing.assert_allclose(beside - on, 30 * 0.1 - 4 * 0.2, rtol=1e-11)


def test_joint_controllers_run_in_longdouble() -> None:
    """The same lines in another arithmetic: what comes out is of its kind and agrees to float64's rounding."""
    wide = rd.Lagrangian(rd.load("planar_2r"), dtype=np.longdouble)
    reference, q, v, z = general_motion(2), Q[:2], V[:2], np.array([0.3, 0.4])
    for make in [
        lambda model: PD(reference, kp=30.0, kd=4.0),
        lambda model: PID(reference, kp=30.0, ki=3.0, kd=4.0, effort_limit=2.0),
        lambda model: ComputedTorque(model, reference, kp=30.0, kd=4.0),
        lambda model: PDGravity(model, reference, kp=30.0, kd=4.0),
        lambda model: FeedForward(model, reference, kp=30.0, kd=4.0),
    ]:
        got = make(wide).torque(T, q.astype(np.longdouble), v.astype(np.longdouble), z.astype(np.longdouble))
        assert got.dtype == np.longdouble
        np.testing.assert_allclose(
            got.astype(float), make(rd.load("planar_2r")).torque(T, q, v, z), rtol=1e-12, atol=1e-12
        )
