"""A line spring-damper: τ = −(∂ℓ/∂q)ᵀ (k (ℓ − ℓ₀) + c ℓ') between points of two frames, or of one and the world."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn.foundations import EffectError
from robot_dyn.simulation import Ending
from tests.slides import slides

TREE = rd.load("skew_tree")
K, C, LENGTH = 320.0, 7.0, 0.45
BETWEEN = rd.effects.LineSpringDamper(
    "left_tool", "right_lower", [0.11, -0.2, 0.3], [0.4, 0.05, -0.15], stiffness=K, damping=C, length=LENGTH
)
TO_WORLD = replace(BETWEEN, other_frame=None, other_point=[0.9, -0.3, 0.7])
BOTH = pytest.mark.parametrize("effect", [BETWEEN, TO_WORLD], ids=["two frames", "frame and world"])

MASSES = slides(("to_a", "base", "a", 2.0), ("to_b", "base", "b", 0.5)).with_(gravity=(0.0, 0.0, 0.0))


def state(seed: int = 4) -> tuple[np.ndarray, np.ndarray]:
    q, v = np.random.default_rng(seed).normal(size=(2, TREE.n))
    return q, v


def distance(dynamics: rd.effects.Dynamics, q: np.ndarray, effect: rd.effects.LineSpringDamper) -> np.ndarray:
    """ℓ, by homogeneous coordinates."""
    ends = []
    for frame, point in ((effect.frame, effect.point), (effect.other_frame, effect.other_point)):
        p = np.append(point, 1.0)
        ends.append(p[:3] if frame is None else (dynamics.placement(q, frame) @ p)[:3])
    return np.sqrt(((ends[0] - ends[1]) ** 2).sum())


def slope(q: np.ndarray, along: np.ndarray, effect: rd.effects.LineSpringDamper) -> float:
    """∂ℓ/∂q in a direction by differences in longdouble: h = 1e-6 leaves h² and 1e-19 / h, both about 1e-12."""
    wide, h = rd.Lagrangian(TREE, np.longdouble), np.longdouble(1e-6)
    q, along = q.astype(np.longdouble), along.astype(np.longdouble)
    return float((distance(wide, q + h * along, effect) - distance(wide, q - h * along, effect)) / (2 * h))


@BOTH
def test_virtual_work_is_that_of_the_force_on_the_line(effect: rd.effects.LineSpringDamper) -> None:
    """τᵀ δq = −(k (ℓ − ℓ₀) + c ℓ') δℓ for any δq, each factor by differences."""
    q, v = state()
    force = K * (distance(TREE, q, effect) - LENGTH) + C * slope(q, v, effect)
    for virtual in np.random.default_rng(1).normal(size=(5, TREE.n)):
        work = rd.Plant(TREE, [effect]).torque(q, v, t=0.0) @ virtual
        assert work == pytest.approx(-force * slope(q, virtual, effect), rel=1e-9)


@BOTH
def test_the_damper_takes_the_power_of_its_force(effect: rd.effects.LineSpringDamper) -> None:
    """τᵀ v = −c ℓ'² ≤ 0, and the spring has the energy ½ k (ℓ − ℓ₀)²."""
    spring, damper = effect.parts
    for seed in range(20):
        q, v = state(seed)
        power = damper.torque(TREE, 0.0, q, v) @ v
        assert power == pytest.approx(-C * slope(q, v, effect) ** 2, rel=1e-8)
        assert power < 0
        energy = K * (distance(TREE, q, effect) - LENGTH) ** 2 / 2
        assert spring.potential(TREE, 0.0, q) == pytest.approx(energy, rel=1e-13)


def test_two_masses_move_as_the_damped_oscillator() -> None:
    """The excess x = ℓ − ℓ₀ obeys μ x'' + c x' + k x = 0 with the reduced mass μ; the centre moves uniformly."""
    m, k, c, length, t_end = np.array([2.0, 0.5]), 37.0, 1.3, 0.8, 1.7
    strut = rd.effects.LineSpringDamper(
        "b", "a", [0.1, 0.0, 0.0], [-0.2, 0.0, 0.0], stiffness=k, damping=c, length=length
    )
    q0, v0 = np.array([-0.3, 0.7]), np.array([0.4, -0.9])
    mu = m.prod() / m.sum()
    a, x0, s0 = c / (2 * mu), q0[1] - q0[0] + 0.3 - length, v0[1] - v0[0]
    w = np.sqrt(k / mu - a**2)
    x = np.exp(-a * t_end) * (x0 * np.cos(w * t_end) + (s0 + a * x0) / w * np.sin(w * t_end))
    centre = (m @ q0 + m @ v0 * t_end) / m.sum()
    gap = x + length - 0.3
    expected = centre + gap * np.array([-m[1], m[0]]) / m.sum()
    for engine in ("interpreted", "compiled"):
        run = rd.simulate(
            rd.Plant(MASSES, [strut]), q0=q0, v0=v0, duration_s=t_end, method="DP8", step_s=0.01, engine=engine,
            estimate_error=False, record_every_s=0.1,
        )  # fmt: skip
        np.testing.assert_allclose(run.q[-1], expected, atol=1e-12)
        spent = m @ v0**2 / 2 + k * x0**2 / 2 - m @ run.v[-1] ** 2 / 2 - k * x**2 / 2
        assert -run.ledger.work["line_spring_damper"][-1] == pytest.approx(spent, rel=1e-9)
        assert np.abs(run.ledger.residual).max() < 1e-11


def test_it_runs_in_balls_that_hold_the_float_value() -> None:
    own, (q, v) = rd.Lagrangian(TREE, rd.accuracy.Ball(200)), state()
    torque = rd.Plant(own, [BETWEEN]).torque(q, v, t=0.0)
    assert rd.accuracy.radius(torque).max() < 1e-50
    np.testing.assert_allclose(rd.Plant(TREE, [BETWEEN]).torque(q, v, t=0.0), rd.accuracy.midpoint(torque), atol=1e-10)


def test_where_the_points_meet_there_is_no_direction() -> None:
    """An error that says so; a run that comes there in either engine ends, with the same words."""
    plant = rd.Plant(MASSES, [rd.effects.LineSpringDamper("a", "b", stiffness=3.0, damping=1.0, length=0.1)])
    with pytest.raises(EffectError, match="line_spring_damper: the points on 'a' and 'b' coincide"):
        plant.torque(np.zeros(2), np.zeros(2), t=0.0)
    apart = rd.Plant(MASSES, [rd.effects.LineSpringDamper("a", "b", stiffness=0.0, damping=0.0, length=0.1)])
    for engine in ("interpreted", "compiled"):
        run = rd.simulate(
            apart, q0=[-0.5, 0.5], v0=[1.0, -1.0], duration_s=1.0, method="Euler", step_s=0.125,
            engine=engine, estimate_error=False,
        )  # fmt: skip
        assert run.outcome.ending is Ending.DIVERGED
        assert "has no direction" in run.outcome.text
