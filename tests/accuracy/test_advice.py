"""Advice on steps and control periods: limits are those of the book, and where runs blow up."""

from __future__ import annotations

import json
from fractions import Fraction
from math import inf
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn.simulation import linearised
from robot_dyn.simulation.dynamics.stability import longest_step
from tests.campaigns.estimates.advised import blow_up, limited
from tests.campaigns.estimates.scenes import RAIL
from tests.command import run
from tests.long import long, third
from tests.loops import growth
from tests.own_method import OwnImplicit
from tests.two_rates import TwoRates

BLOCK = rd.Robot.from_text(RAIL)  # 1 kg
IMPLICIT = "GaussLegendre2", "GaussLegendre4", "Rodas5PFixed"
OSCILLATOR = np.array([[0.0, 1.0], [-400.0, 0.0]])  # ω = 20/s


@pytest.mark.parametrize(
    ("name", "limit"),
    [("Euler", 2.0), ("Midpoint", 2.0), ("RK4", 2.785293563405282), ("Rodas5PFixed", inf)],
)
def test_limits_on_a_decay_are_those_of_the_stability_function(name: str, limit: float) -> None:
    """|R(z)| = 1 at z = −2, and −2.785… for RK4 [Hairer, Wanner 1996, IV.2]; the last is A-stable."""
    found = longest_step(rd.integrate.method(name), np.diag([-100.0, -1.0]), 1)
    assert found == pytest.approx(limit / 100, rel=2e-3)  # it is bisected to 1e-3


def test_an_oscillation_bounds_some_methods_only() -> None:
    """ω h ≤ 2 for semi-implicit Euler, 2.828 for RK4; explicit Euler grows by (1 + ω² h²)^½ in each step.

    With a damping ratio ζ that is 1 at ω h = 2 ζ; growth of e in a million radians is not told from none.
    """
    of = {
        name: longest_step(rd.integrate.method(name), OSCILLATOR, 1)
        for name in ("SemiImplicitEuler", "RK4", "Rodas5PFixed")
    }
    assert of["SemiImplicitEuler"] * 20 == pytest.approx(2.0, rel=2e-3)
    assert of["RK4"] * 20 == pytest.approx(2 * np.sqrt(2), rel=2e-3)
    assert of["Rodas5PFixed"] == inf
    for ratio in (0.0, 1e-2, 0.3):
        J = OSCILLATOR - np.diag([0.0, 40.0 * ratio])
        assert longest_step(rd.integrate.method("Euler"), J, 1) * 20 == pytest.approx(2 * ratio, rel=2e-3, abs=2.1e-6)


def test_a_method_may_let_grow_faster_what_grows() -> None:
    """Twice as fast at most: 1 / (1 − z) does up to z = 3 h = 0.797, the others beyond 1, where their stages are found.

    Implicit Euler and the implicit midpoint rule let it grow faster with every step.
    """
    J = np.diag([-3.0, 3.0])
    assert 3 * longest_step(OwnImplicit(), J, 1) == pytest.approx(0.79681213, rel=2e-3)
    assert min(3 * longest_step(rd.integrate.method(name), J, 1) for name in IMPLICIT) > 1.0


def test_what_grows_excuses_no_other_motion() -> None:
    """An oscillation beside an upright link has the limits that it has alone, in any coordinates of both."""
    both = np.kron([[0.0, 1.0], [0.0, 0.0]], np.eye(2))
    both[2:, :2] = [[25.0, 0.0], [0.0, -400.0]]  # 5/s and 20/s
    mixed = np.kron(np.eye(2), [[1.0, 0.7], [-0.4, 1.3]])
    J = mixed @ both @ np.linalg.inv(mixed)
    for name, limit in [("SemiImplicitEuler", 2.0), ("MoreauJean", 2.0), ("RK4", 2 * np.sqrt(2))]:
        assert longest_step(rd.integrate.method(name), J, 2) * 20 == pytest.approx(limit, rel=2e-3)
    assert longest_step(rd.integrate.method("Euler"), J, 2) * 20 == pytest.approx(0.0, abs=2.1e-6)


def test_a_method_of_ones_own_has_a_limit() -> None:
    """Heun's rule, 1 + z + z²/2, on a decay: h |λ| = 2, as of the midpoint rule."""
    tableau = rd.integrate.ButcherTableau(a=((), (1,)), b=(Fraction(1, 2), Fraction(1, 2)), c=(0, 1), order=2)
    heun = rd.integrate.ExplicitRungeKutta("heun", tableau)
    plant = rd.Plant(BLOCK, [rd.effects.ViscousFriction(100.0)])
    fine, coarse = (rd.advise(plant, [0.1], [1.0], duration_s=0.1, method=heun, step_s=h) for h in (0.019, 0.021))
    assert fine.limits["heun"] == pytest.approx(0.02, rel=2e-3)
    assert fine.stable
    assert not coarse.stable


@pytest.mark.parametrize("ki", [*long([0.0]), 900.0])
def test_the_period_of_a_loop_about_a_block_is_that_of_its_discrete_matrix(ki: float) -> None:
    """A mass under PID in zero-order hold, q and v in closed form between ticks."""
    kp, kd = 100.0, 20.0
    law = (
        rd.control.PID(rd.control.hold([0.0]), kp=kp, ki=ki, kd=kd, period_s=0.02)
        if ki
        else rd.control.PD(rd.control.hold([0.0]), kp=kp, kd=kd, period_s=0.02)
    )
    advice = rd.advise(BLOCK, [0.1], duration_s=5.0, controller=law)

    def radius(T: float) -> float:
        u = np.array([-kp, -kd, ki])
        loop = np.array([[1.0, T, 0.0], [0.0, 1.0, 0.0], [-T, 0.0, 1.0]])
        loop += np.outer([T**2 / 2, T, 0.0], u)
        return np.abs(np.linalg.eigvals(loop if ki else loop[:2, :2])).max()

    assert radius(advice.longest_period_s) <= 1 + 1e-9
    assert radius(1.001 * advice.longest_period_s) > 1
    assert advice.stable
    assert "control period 0.02 s: stable" in advice.text


def test_the_panda_under_sampled_control() -> None:
    """Values by the exponential of the sampled system, found apart from this library."""
    arm = rd.load("panda").with_(lock={"panda_finger_joint1": 0.0})
    q0 = np.array([0.3, 0.6, -0.4, -1.2, 0.5, 1.1, 0.2])
    law = rd.control.PDGravity(arm, rd.control.hold(q0), kp=1000.0, kd=60.0, period_s=2.5e-4)
    advice = rd.advise(arm, q0, controller=law, method="RK4", duration_s=0.2)
    assert advice.longest_period_s == pytest.approx(0.211e-3, rel=0.01)  # three digits
    assert advice.fastest.joint == "panda_joint7"
    assert advice.fastest.source == "control"
    assert not advice.stable
    assert "control period 0.00025 s: unstable; the loop is stable up to 0.000211 s: use period_s=0.0001" in advice.text
    assert advice.run is None


def test_runs_blow_up_where_the_limit_says() -> None:
    """Within a factor of 1.5: it is linear, at nine states of the motion."""
    scene = limited(1, 6)
    advice = rd.advise(scene.setup)
    limit = advice.longest_period_s
    assert 1 / 1.5 < limit / blow_up(scene, limit) < 1.5


@pytest.mark.parametrize(
    "late", [(0.4, 1.3), *third(pytest.param(each) for each in [(0.0, 0.0), (0.0, 0.5), (1.0, 0.5), (2.0, 1.0)])]
)
@pytest.mark.parametrize("name", ["kinova", "xarm7"])
def test_the_period_of_a_loop_with_delays_is_that_of_its_exact_map(name: str, late: tuple[float, float]) -> None:
    """To 1e-3, to which limits are bisected."""
    arm = rd.load(name)
    q = 0.3 * np.cos(np.arange(arm.n) + 0.4)
    inertia = np.diag(arm.M(q))
    gains = 400 * inertia, 36 * inertia
    law = rd.control.PD(
        rd.control.hold(q + arm.N(q) / gains[0]), kp=gains[0], kd=gains[1], period_s=1e-3
    )  # which holds the arm where it is
    loop = rd.control.Loop(law, measurement_delay_periods=late[0], actuation_delay_periods=late[1])
    found = linearised(rd.Plant(arm), loop, 0.0, np.concatenate([q, 0 * q])).longest_period()
    assert growth(arm, q, gains, 0.999 * found, late) <= 1 + 1e-6  # gravity's slope is by differences
    assert growth(arm, q, gains, 1.001 * found, late) > 1 + 1e-5


def test_blocks_and_rates_of_a_loop_bound_its_period() -> None:
    """A mass under PD by differences through a filter, with a slow spring beside: its exact map, over two periods."""
    mass, kp, kd, slow, cutoff = 1.0, 100.0, 14.0, 60.0, 150.0
    law = rd.control.PD(rd.control.hold([0.0]), kp=kp, kd=kd, period_s=0.002)
    both = TwoRates(law.reference, kp, kd, (0.0,), slow, 0.0, 2, 0.002)
    blocks: dict[str, Any] = {
        "velocity": [rd.control.Differences(), rd.control.LowPass(cutoff, 1)],
        "position": rd.control.Quantisation(1e-4),
    }
    loop = rd.control.Loop(
        both, **blocks, actuation=[rd.control.RateLimit(9.0), rd.control.Noise(0.1)], measurement_delay_periods=1.0
    )
    found = linearised(rd.Plant(BLOCK), loop, 0.0, np.zeros(2)).longest_period()

    def radius(T: float) -> float:
        """Of (q, v, q̂, the difference's q̂₋, the filter's y₋ and x₋, the slow torque)."""
        K = np.tan(cutoff * T / 2)
        made = np.eye(7)
        for k in range(2):
            rate = np.array([0, 0, 1 / T, -1 / T, 0, 0, 0])
            y = (K * (rate + np.eye(7)[5]) + (1 - K) * np.eye(7)[4]) / (1 + K)
            late = np.eye(7)[2]
            held = -slow * late if k == 0 else np.eye(7)[6]
            u = (-kp * late - kd * y + held) / mass
            q, v = np.eye(7)[:2]
            made = np.array([q + T * v + T * T / 2 * u, v + T * u, q, late, y, rate, held]) @ made
        return float(np.abs(np.linalg.eigvals(made)).max())

    assert radius(0.999 * found) <= 1 + 1e-9
    assert radius(1.001 * found) > 1 + 1e-5


def test_friction_a_thousand_times_faster_than_the_period_does_not_hide_its_limit() -> None:
    """Of m v̇ = u − b v with m/b ≪ T gives q⁺ = (1 − kp T/b) q: |·| = 1 at T = 2 b/kp, but for m/b."""
    b, kp = 1e6, 5e8
    law, plant = (
        rd.control.PD(rd.control.hold([0.0]), kp=kp, kd=0.0, period_s=1e-3),
        rd.Plant(BLOCK, [rd.effects.ViscousFriction(b)]),
    )
    assert linearised(plant, law, 0.0, np.zeros(2)).longest_period() == pytest.approx(2 * b / kp, rel=1e-3)


def test_a_loop_that_no_period_makes_stable_says_so() -> None:
    loop = rd.control.Loop(
        rd.control.PD(rd.control.hold([0.0]), kp=1e4, kd=20.0, period_s=1e-3),
        velocity=rd.control.LowPass(5.0),
        actuation=rd.control.LowPass(30.0),
    )
    advice = rd.advise(BLOCK, [0.1], duration_s=0.1, controller=loop)
    assert advice.longest_period_s == 0.0
    assert not advice.stable
    assert "no period is stable: use lower gains, or less delay" in advice.text


def test_a_step_that_is_short_enough_is_told_with_its_error() -> None:
    plant = rd.Plant(rd.load("planar_2r"), [rd.effects.ViscousFriction(60.0)])
    fine = rd.advise(plant, [0.4, -0.7], method="RK4", step_s=1e-4, duration_s=0.05)
    assert fine.stable
    assert f"expected error of q [rad]: {fine.run.error}" in fine.text
    coarse = rd.advise(plant, [0.4, -0.7], method="RK4", step_s=1e-2, duration_s=0.05)
    assert coarse.limits == fine.limits
    assert not coarse.stable
    assert "step 0.01 s: unstable; RK4 is stable up to" in coarse.text
    assert rd.simulate(plant, [0.4, -0.7], method="RK4", step_s=1e-2, duration_s=0.2).outcome.ending == "diverged"
    chosen = rd.advise(plant, [0.4, -0.7], duration_s=0.05)
    assert chosen.stable
    assert "method auto: error control" in chosen.text


def test_the_command_prints_it_and_its_exit_code_tells(tmp_path: Path) -> None:
    scene = tmp_path / "scene.toml"
    text = (
        'robot = "planar_2r"\nduration_s = 0.05\nmethod = "RK4"\nstep_s = {}\n[[effect]]\nkind = "viscous_friction"\n'
    )
    scene.write_text(text.format("1e-2") + "viscous_N_m_s_per_rad = 60.0\n")
    result = run("advise", scene)
    assert (result.returncode, result.stderr) == (1, "")
    assert "unstable; RK4 is stable up to" in result.stdout
    scene.write_text(text.format("1e-4") + "viscous_N_m_s_per_rad = 60.0\n")
    result = run("advise", scene, "--json")
    made = json.loads(result.stdout)
    assert result.returncode == 0
    assert made["stable"] is True
    assert made["limits"]["Rodas5PFixed"] is None
    assert made["error"] < 1e-6
    assert made["fastest"]["source"] == "viscous_friction"


@pytest.mark.parametrize("k", [*long([1e5]), 1e9])
def test_a_stop_that_samples_miss_bounds_the_step(k: float) -> None:
    """On a stop ω = √(k / I), for half a period only; RK4 is stable up to h ω = √8 there."""
    bar = rd.load("pendulum").with_(gravity=(0.0, 0.0, 0.0))
    plant = rd.Plant(bar, [rd.effects.JointStopSpring(-9.0, 0.0, k)])
    advice = rd.advise(plant, [-0.3], [1.5], duration_s=0.5, method="RK4", step_s=1e-3)
    omega = np.sqrt(3 * k)
    assert advice.limits["RK4"] == pytest.approx(np.sqrt(8) / omega, rel=2e-3)
    assert advice.fastest.source == "joint_stops"
    assert advice.stable == (omega * 1e-3 < np.sqrt(8))


def test_free_flight_bounds_no_step() -> None:
    """J = [[0, 1], [0, 0]]: no force depends on the motion."""
    bar = rd.load("pendulum").with_(gravity=(0.0, 0.0, 0.0))
    advice = rd.advise(bar, [0.1], [1.0], duration_s=0.2, step_s=1e-2, method="RK4")
    assert advice.stable
    assert "no force depends on the motion" in str(advice.fastest)
    assert all(limit == np.inf for limit in advice.limits.values())


def test_a_loop_that_is_damped_critically_has_a_fastest_motion() -> None:
    """Of x'' = −ω² x − 2 ω x': both eigenvalues are −ω, with one eigenvector."""
    advice = rd.advise(
        BLOCK, [0.0], duration_s=0.1, controller=rd.control.PD(rd.control.hold([0.0]), kp=400.0, kd=40.0)
    )
    assert abs(advice.fastest.eigenvalue) == pytest.approx(20.0, rel=1e-3)  # of a double root, of the root of rounding
    assert advice.fastest.source == "control"
