"""What follows from the states of a run: acceleration, actuation, power and energy of each sample.

a = M⁻¹ (u + Σ τ − C v − N),   P_k = τ_kᵀ v,   E = K + Σ potentials
"""

from __future__ import annotations

import numpy as np

from robot_dyn.errors import RobotDynError
from robot_dyn.simulation.motion import Motion


def columns(motion: Motion, t: np.ndarray, y: np.ndarray, made: np.ndarray) -> tuple[np.ndarray, ...]:
    """q, v, a, u, work, power (k, …) and energies (k, 2) of samples.

    Args:
        motion: What moved.
        t: Times, (k,).
        y: States, (k, m).
        made: y', u, K and V, (k, m + n + 2): y' holds v, a and the powers.
    """
    n, m, works = motion.plant.dynamics.n, motion.size, motion.size - len(motion.sources)
    q, v, a, u = y[:, :n], y[:, n : 2 * n], made[:, n : 2 * n], made[:, m : m + n]
    if motion.canonical:  # y holds the momentum, and y' its rate
        v = made[:, :n]
        a = np.array([_acceleration(motion, *each) for each in zip(t, q, v, u, strict=True)]).reshape(q.shape)
    return q, v, a, u, y[:, works:], made[:, works:m], made[:, m + n :]


def _acceleration(motion: Motion, t: float, q: np.ndarray, v: np.ndarray, u: np.ndarray) -> np.ndarray:
    try:
        return motion.plant.forward_dynamics(float(t), q, v, u)
    except RobotDynError:
        return np.full_like(q, np.nan)
