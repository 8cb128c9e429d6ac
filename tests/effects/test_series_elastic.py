"""Series-elastic joints: matrix exponential, an independent integration of a 2R, limits, ledger, backlash, engines."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

import robot_dyn as rd
from tests.effects.test_effect_states import MASS, SLIDER, Ramp
from tests.long import long

ARM = rd.load("planar_2r")
Q = np.array([0.3, -0.5])
TIGHT = rd.integrate.Adaptive("DOP853", 1e-12, 1e-14)
BOTH = pytest.mark.parametrize("engine", ["interpreted", "compiled"])
K, J, RATIO, D, B = 80.0, 0.002, 9.0, 0.4, 0.3  # of the slider, in [N/m], [kg], 1, [N s/m], [N s/m]
REFLECTED = RATIO**2 * J
OFTEN = {"method": TIGHT, "record_every_s": 0.01, "estimate_error": False}


def slide(effect: rd.effects.SeriesElastic, engine: str = "interpreted", **options) -> rd.Trajectory:
    options = {"method": TIGHT, "record_every_s": 0.05, "duration_s": 2.0, "estimate_error": False} | options
    return rd.simulate(rd.Plant(SLIDER, [effect]), [0.2], [0.5], engine=engine, **options)


@pytest.mark.parametrize(
    "method", [TIGHT, *long(["GaussLegendre6", rd.integrate.Adaptive("Rodas5P", 1e-11, 1e-13), "DP8"])], ids=str
)
@BOTH
def test_two_masses_and_a_spring_move_by_the_matrix_exponential(method, engine: str) -> None:
    """q, q̇, δ, θ̇ under a constant force on the motor; dense output of Rodas5P, of order 4, leaves 1e-10."""
    F = 1.7
    options = {"step_s": 2e-3} if isinstance(method, str) else {}
    options |= {"controller": Ramp(F), "method": method, "duration_s": 0.5}
    run = slide(rd.effects.SeriesElastic(K, J, RATIO, D, B), engine, **options)
    A = np.array(
        [
            [0, 1, 0, 0, 0],
            [0, -D / MASS, K / MASS, D / MASS, 0],
            [0, -1, 0, 1, 0],
            [0, D / REFLECTED, -K / REFLECTED, -(D + B) / REFLECTED, F / REFLECTED],
            [0, 0, 0, 0, 0],
        ]
    )
    exact = np.array([expm(A * t) @ [0.2, 0.5, 0.0, 0.5, 1.0] for t in run.t])
    states = np.hstack([run.q, run.v, run.effect_states["series_elastic"]])
    np.testing.assert_allclose(states, exact[:, :4], atol=2e-10)
    np.testing.assert_allclose(run.a[:, 0], (exact @ A.T)[:, 1], atol=2e-9)
    np.testing.assert_array_equal(run.u, F)
    assert np.abs(run.ledger.residual).max() < 1e-9


def test_without_damping_it_swings_at_the_frequency_of_the_reduced_mass() -> None:
    """√(k/μ), 1/μ = 1/m + 1/(n² J), and what motors and springs store comes back."""
    omega = np.sqrt(K * (1 / MASS + 1 / REFLECTED))
    run = slide(rd.effects.SeriesElastic(K, J, RATIO), controller=Ramp(1.0))
    deflection = run.effect_states["series_elastic"][:, 0]
    still = 1.0 / REFLECTED / omega**2  # δ̈ = F/B − ω² δ
    np.testing.assert_allclose(deflection, still * (1 - np.cos(omega * run.t)), atol=1e-12)
    ledger = run.ledger
    E = ledger.energy + ledger.stored["series_elastic"] - ledger.work["control"]
    np.testing.assert_allclose(E, E[0], rtol=1e-12)


def test_springs_and_motors_only_take_energy() -> None:
    """Work of its torque less that on its motors, plus what they store, never grows: dampers and friction take it."""
    run = slide(rd.effects.SeriesElastic(K, J, RATIO, D, B), controller=Ramp(1.7), record_every_s=0.01)
    lost = run.ledger.work["series_elastic"] + run.ledger.stored["series_elastic"]
    assert np.diff(lost).max() < 1e-12 and lost[-1] - lost[0] < -0.1


def two_r(t: float, x: np.ndarray, u: np.ndarray, k: float, d: float, b: float, inertia: float) -> np.ndarray:
    """Rates of q, v, θ₂, θ₂' of the 2R with an elastic second joint, from the lengths and masses of its bars."""
    (q1, q2, v1, v2, angle, speed), g = x, 9.80665
    m1, l1, I1, m2, l2, I2 = 2.0, 1.0, 2.0 * (1 + 0.0025) / 12, 1.5, 0.8, 1.5 * (0.64 + 0.0025) / 12
    r = l2 / 2
    c, s = np.cos(q2), np.sin(q2)
    M12 = I2 + m2 * (r * r + l1 * r * c)
    M = np.array([[I1 + I2 + m1 * l1**2 / 4 + m2 * (l1**2 + r * r + 2 * l1 * r * c), M12], [M12, I2 + m2 * r * r]])
    h = m2 * l1 * r * s
    centrifugal = np.array([-h * (2 * v1 * v2 + v2**2), h * v1**2])
    N2 = m2 * g * r * np.cos(q1 + q2)
    gravity = np.array([(m1 / 2 + m2) * l1 * g * np.cos(q1) + N2, N2])
    spring = k * (angle - q2) + d * (speed - v2)
    a = np.linalg.solve(M, np.array([u[0], spring]) - centrifugal - gravity)
    return np.array([v1, v2, *a, speed, (u[1] - spring - b * speed) / inertia])


@BOTH
def test_a_2r_with_one_elastic_joint_is_that_of_equations_written_out(engine: str) -> None:
    """PD on both joints of which the second has a motor: SciPy's DOP853 at 1e-13 on the textbook's equations, 1e-10."""
    k, d, b, inertia = 300.0, 0.7, 0.4, 0.05 * 4.0**2
    target, kp, kd = np.array([0.6, 0.4]), np.array([150.0, 60.0]), np.array([25.0, 9.0])

    def f(t: float, x: np.ndarray) -> np.ndarray:
        return two_r(t, x, kp * (target - x[:2]) - kd * x[2:4], k, d, b, inertia)

    exact = solve_ivp(
        f, (0, 1), [*Q, 0.4, -0.6, Q[1], -0.6], method="DOP853", rtol=1e-13, atol=1e-15, dense_output=True
    )
    drive = rd.effects.SeriesElastic(
        {"joint_2": k}, {"joint_2": 0.05}, {"joint_2": 4.0}, {"joint_2": d}, {"joint_2": b}
    )
    run = rd.simulate(
        rd.Plant(ARM, [drive]), Q, [0.4, -0.6], duration_s=1.0,
        controller=rd.control.PD(rd.control.hold(target), kp=kp, kd=kd),
        method=TIGHT, engine=engine, record_every_s=0.1, estimate_error=False,
    )  # fmt: skip
    x = np.array([exact.sol(t) for t in run.t])
    np.testing.assert_allclose(run.q, x[:, :2], atol=1e-10)
    np.testing.assert_allclose(run.v, x[:, 2:4], atol=1e-9)
    states = run.effect_states["series_elastic"]
    np.testing.assert_allclose(states, np.column_stack([x[:, 4] - x[:, 1], x[:, 5]]), atol=1e-9)
    assert np.abs(run.ledger.residual).max() < 1e-10


@pytest.mark.long
def test_stiff_springs_are_the_armature_of_gear_and_rotor() -> None:
    """The distance from M + n² J falls as 1/k: tenfold for a tenfold stiffness, within a tenth."""
    control = rd.control.PD(rd.control.quintic(Q, [0.6, 0.4], 0.2), kp=100.0, kd=20.0)
    options = {
        "duration_s": 0.2, "method": rd.integrate.Adaptive("Rodas5P", 1e-10, 1e-12), "record_every_s": 0.2,
        "estimate_error": False, "controller": control,
    }  # fmt: skip
    rigid = rd.simulate(ARM.with_(armature=[0.4 * 2.0**2, 0.05 * 5.0**2]), Q, **options)
    far = []
    for k in (1e5, 1e6):
        drive = rd.effects.SeriesElastic(k, [0.4, 0.05], [2.0, 5.0], damping=1e-3 * k)
        far.append(np.abs(rd.simulate(rd.Plant(ARM, [drive]), Q, **options).q[-1] - rigid.q[-1]).max())
    assert 1e-8 < far[1] < 1e-4
    assert far[0] / far[1] == pytest.approx(10, rel=0.1)


@pytest.mark.parametrize("side", [*long([1]), -1])
@BOTH
def test_beyond_the_gap_of_a_backlash_the_spring_turns_what_moved_freely_within_it(side: int, engine: str) -> None:
    """Pushed by F from the middle of the gap, δ is periodic, and m q + B θ the parabola of F; 1e-11.

    A parabola up to β, half a wave about F/(B ω²) beyond it, the same parabola back to rest. The motor is pushed, or
    the joint: the other side.
    """
    beta, F = 0.02, 1.3
    drive = rd.effects.SeriesElastic(K, J, RATIO, half_gap=beta)
    push = rd.effects.ExternalWrench("cart", [F, 0, 0, 0, 0, 0])
    plant, law = rd.Plant(SLIDER, [drive] if side == 1 else [drive, push]), Ramp(F if side == 1 else 0.0)
    run = rd.simulate(plant, [0.0], duration_s=2.0, controller=law, engine=engine, **OFTEN)
    free, omega = F / (REFLECTED if side == 1 else MASS), np.sqrt(K * (1 / MASS + 1 / REFLECTED))
    t1 = np.sqrt(2 * beta / free)
    s, c = free / omega**2, free * t1 / omega
    t2 = 2 * (np.pi - np.arctan(c / s)) / omega
    tau = run.t % (2 * t1 + t2)
    beyond = beta + s - s * np.cos(omega * (tau - t1)) + c * np.sin(omega * (tau - t1))
    back = 2 * t1 + t2 - tau
    expected = np.where(tau < t1, free * tau**2 / 2, np.where(tau < t1 + t2, beyond, free * back**2 / 2))
    found = run.effect_states["series_elastic"][:, 0]
    np.testing.assert_allclose(found, side * expected, atol=1e-11)
    pushed = F * run.t**2 / 2
    np.testing.assert_allclose(run.q[:, 0], (pushed - REFLECTED * found) / (MASS + REFLECTED), atol=1e-11)
    which = "forward" if side == 1 else "backward"
    at = [(each.t, each.name) for each in run.events][:4]
    times = [t1, t1 + t2, 3 * t1 + t2, 3 * t1 + 2 * t2]
    np.testing.assert_allclose([t for t, _ in at], times, atol=1e-11)
    words = [f"{which} side of the backlash of slide {what}" for what in ("touched", "left", "touched", "left")]
    assert [name for _, name in at] == words
    assert np.abs(run.ledger.residual).max() < 1e-11


def test_dry_friction_of_a_joint_holds_it_until_its_spring_has_the_load() -> None:
    """A motor at constant speed behind a spring: the joint sticks until k δ reaches the friction of rest; 1e-9."""
    speed, level = 0.3, 2.0
    drive = rd.effects.SeriesElastic(K, J, RATIO, viscous=1e3)  # its friction keeps the speed u/b, to 1e-3 of it
    plant = rd.Plant(SLIDER, [drive, rd.effects.DryFriction(1.0, level)])
    run = rd.simulate(plant, [0.0], duration_s=0.2, controller=Ramp(1e3 * speed), **OFTEN)
    first = next(each for each in run.events if each.name == "slide slides")
    assert first.q == (0.0,)
    row = np.searchsorted(run.t, first.t)
    deflection = run.effect_states["series_elastic"][row - 1, 0]
    assert deflection < level / K < run.effect_states["series_elastic"][row, 0] + 1e-3
    assert np.abs(run.ledger.residual).max() < 1e-9


def test_a_plant_that_is_asked_takes_relaxed_springs() -> None:
    """No torque on the joint of a drive, which the actuation does not reach; also compiled."""
    plant, v = rd.Plant(ARM, [rd.effects.SeriesElastic([0.0, 90.0], 0.02, damping=2.0)]), np.array([0.3, -0.7])
    np.testing.assert_array_equal(plant.torque(Q, v, t=0.0), [0.0, 0.0])
    expected = ARM.forward_dynamics(Q, v, [3.0, 0.0])
    np.testing.assert_allclose(plant.forward_dynamics(Q, v, [3.0, 5.0], t=0.0), expected, rtol=1e-13)
    np.testing.assert_allclose(rd.compiled(plant).forward_dynamics(Q, v, [3.0, 5.0], t=0.0), expected, rtol=1e-12)
