"""Stiff motion whose course is known: closed forms of one joint without gravity, or Radau IIA over Pinocchio.

    damper    q = q₀ + v₀ (I/b) (1 − e^(−b t / I))                spring    q = q₀ cos(√(k/I) t)
    stop      I q'' = k (q̂ − q)⁺: flight at v₀, half a period π √(I/k), flight at −v₀
    dry       sinh(v/v_s) = sinh(v₀/v_s) e^(−f t / (I v_s)),  q = q₀ + (I/f) ∫ v coth(v/v_s) dv

Bars of 1 kg and 1 m have I = 1/3. [Hairer, Wanner, Solving Ordinary Differential Equations II, 2nd ed., 1996, IV.5]
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cache
from typing import Any

import numpy as np
import pinocchio as pin
from scipy.integrate import quad, solve_ivp

import robot_dyn as rd

INERTIA, SPEED = 1 / 3, 1.5
SAMPLES = 50  # at which motion is known
Times = Callable[[np.ndarray], np.ndarray]


@dataclass(frozen=True)
class Motion:
    """A setup, and its positions at ascending times, (k, n)."""

    setup: rd.Setup
    exact: Times = field(repr=False)


@cache
def bar() -> rd.Robot:
    """One joint without gravity."""
    return rd.load("pendulum").with_(gravity=(0.0, 0.0, 0.0))


def _of_bar(effect: Any, q0: float, v0: float, duration: float, q: Callable[[float], float]) -> Motion:
    effects = list(effect) if isinstance(effect, tuple) else [effect]
    setup = rd.Setup(rd.Plant(bar(), effects), [q0], [v0], duration)
    return Motion(setup, lambda t: np.array([[q(float(x))] for x in t]))


def damper(b: float) -> Motion:
    """A joint that comes to rest."""
    decay = b / INERTIA
    return _of_bar(rd.effects.ViscousFriction(b), 0.3, SPEED, 0.5, lambda t: 0.3 - SPEED / decay * np.expm1(-decay * t))


def spring(k: float) -> Motion:
    """A joint that swings, some 80 times at most."""
    rate = np.sqrt(k / INERTIA)
    return _of_bar(rd.effects.Spring(k), 1e-2, 0.0, float(min(0.5, 500 / rate)), lambda t: 1e-2 * np.cos(rate * t))


def stop(k: float) -> Motion:
    """A joint that meets its stop at 0.2 s and comes back."""
    touch, rate = 0.2, np.sqrt(k / INERTIA)

    def q(t: float) -> float:
        inside = (t - touch) * rate
        if inside <= 0:
            return SPEED * (t - touch)
        return SPEED / rate * np.sin(inside) if inside < np.pi else -SPEED * (t - touch - np.pi / rate)

    return _of_bar(rd.effects.JointStopSpring(-9.0, 0.0, k), -SPEED * touch, SPEED, 0.5, q)


def dry(width: float) -> Motion:
    """A joint that tanh friction of a width brings to rest at 0.25 s."""
    friction = INERTIA * SPEED / 0.25
    far = SPEED / width

    def q(t: float) -> float:
        log = far + np.log(-np.expm1(-2 * far) / 2) - friction * t / (INERTIA * width)  # of sinh(v / v_s)
        near = log + np.log(2) if log > 20 else float(np.arcsinh(np.exp(log)))
        rest, _ = quad(lambda w: 2 * w / np.expm1(2 * w), min(near, 40), min(far, 40), epsabs=1e-14)
        speed = near * width
        return INERTIA / friction * ((SPEED - speed) * (SPEED + speed) / 2 + width**2 * rest)

    return _of_bar(rd.effects.RegularisedCoulombFriction(friction, width), 0.0, SPEED, 0.5, q)


def of_arm(
    name: str, effects: list[Any], torque: Callable, controller: Any = None, armature: Any = 0.0, duration: float = 0.3
) -> Motion:
    """An arm in gravity, whose effects and control have a torque (q, v) that is written out; known to some 1e-9."""
    robot = rd.load(name)
    model, n = robot.model, robot.n
    data = model.createData()
    q0, v0 = 0.4 + 0.1 * np.arange(n), 0.5 - 0.3 * np.arange(n)
    if np.any(armature):
        robot = robot.with_(armature=np.broadcast_to(armature, n))

    def rate(t: float, y: np.ndarray) -> np.ndarray:
        q, v = y[:n], y[n:]
        M = pin.crba(model, data, q)
        M = np.triu(M) + np.triu(M, 1).T + np.diag(np.broadcast_to(armature, n))
        return np.concatenate([v, np.linalg.solve(M, torque(q, v) - pin.rnea(model, data, q, v, 0 * q))])

    @cache
    def samples() -> np.ndarray:
        y, t = np.concatenate([q0, v0]), np.linspace(0, duration, SAMPLES + 1)
        return solve_ivp(rate, (0, duration), y, "Radau", t, rtol=1e-9, atol=np.repeat([1e-11, 1e-8], n)).y[:n].T

    def exact(t: np.ndarray) -> np.ndarray:
        return samples()[np.rint(t / duration * SAMPLES).astype(int)]

    return Motion(rd.Setup(rd.Plant(robot, effects), q0, v0, duration, controller), exact)
