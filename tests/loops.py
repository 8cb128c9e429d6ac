"""Exact references of sampled loops about linear plants, written from the definition of a delay and not from states.

x' = A x + B u;   u_k = law(k, what was measured at t_k − τ_m) acts on [t_k + τ_u, t_{k+1} + τ_u)
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from scipy.linalg import expm

import robot_dyn as rd
from tests.short_loops import Arm, ShortLoop
from tests.slides import slides

Law = Callable[[int, np.ndarray, np.ndarray], np.ndarray]
ARM = slides(("a", "base", "one", 1.3), ("b", "one", "two", 0.7), axes=("1 0 0", "0.6 0.8 0"))
STIFFNESS, DAMPING = np.array([7.0, 3.0]), np.array([0.4, 0.9])
Q0, V0 = np.array([0.31, -0.23]), np.array([0.7, -0.4])


def plant() -> rd.Plant:
    """Two coupled slides on springs and dampers: a linear plant whose M is constant and not diagonal."""
    robot = ARM.with_(gravity=(0.0, 0.0, 0.0))
    return rd.Plant(robot, [rd.effects.Spring(STIFFNESS), rd.effects.ViscousFriction(DAMPING)])


def matrices() -> tuple[np.ndarray, np.ndarray]:
    """A and B of the plant."""
    M = np.array([[2.0, 0.7 * 0.6], [0.7 * 0.6, 0.7]])
    A = np.block(
        [
            [np.zeros((2, 2)), np.eye(2)],
            [-np.linalg.solve(M, np.diag(STIFFNESS)), -np.linalg.solve(M, np.diag(DAMPING))],
        ]
    )
    return A, np.vstack([np.zeros((2, 2)), np.linalg.inv(M)])


class Exact:
    """The motion up to now: its breaks, with the state and the torque from each on."""

    def __init__(self) -> None:
        self.A, self.B = matrices()
        self.t, self.x, self.u = [0.0], [np.concatenate([Q0, V0])], [np.zeros(2)]

    def at(self, t: float) -> np.ndarray:
        """The state at a time of the past; before the start q and v were constant."""
        k = max(int(np.searchsorted(self.t, t + 1e-12, side="right")) - 1, 0)
        if t <= self.t[k]:
            return self.x[k]
        both = np.block([[self.A, self.B], [np.zeros((2, 6))]])
        return (expm(both * (t - self.t[k])) @ np.concatenate([self.x[k], self.u[k]]))[:4]

    def acts(self, t: float, u: np.ndarray) -> None:
        """A torque that acts from t on."""
        x = self.at(t)
        self.t.append(t)
        self.x.append(x)
        self.u.append(u)


def exact(law: Law, period: float, periods: int, measured_late: float = 0.0, acts_late: float = 0.0) -> Exact:
    """The motion under a law of (k, q, v), with delays in periods."""
    made, coming = Exact(), []

    def release(k: int) -> None:
        while coming and coming[0][0] < k + 1e-9:
            when, u = coming.pop(0)
            made.acts(when * period, u)

    for k in range(periods):
        release(k)
        x = made.at((k - measured_late) * period)
        coming.append((k + acts_late, law(k, x[:2], x[2:])))
        release(k)
    release(periods)
    return made


def growth(
    arm: rd.Robot, q: np.ndarray, gains: tuple[np.ndarray, np.ndarray], period: float, late: tuple[float, float]
) -> float:
    """ρ of the exact map of a period of an arm at rest under PD, by the definition of delays (measured, acting)."""
    n, e, M = arm.n, 1e-6, arm.M(q)
    slope = np.array([(arm.N(q + e * d) - arm.N(q - e * d)) / (2 * e) for d in np.eye(n)]).T
    A = np.block([[np.zeros((n, n)), np.eye(n)], [-np.linalg.solve(M, slope), np.zeros((n, n))]])
    B = np.vstack([np.zeros((n, n)), np.linalg.inv(M)])
    about = Arm("at rest", rd.Plant(arm), A, B, np.diag(M), q, q, 0 * q)
    return ShortLoop(about, gains[0], None, gains[1], late, False, 0, 1.0, 1).radius(period)
