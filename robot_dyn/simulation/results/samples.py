"""What follows from the states of a run: acceleration, actuation, power and energy of each sample.

a = M⁻¹ (u + Σ τ − C v − N),   P_k = τ_kᵀ v,   E = K + Σ potentials
"""

from __future__ import annotations

import numpy as np

from robot_dyn.errors import RobotDynError
from robot_dyn.simulation.dynamics.state_equation import StateEquation
from robot_dyn.simulation.results.ledger import Ledger
from robot_dyn.simulation.run.recording import Recording


def columns(equation: StateEquation, t: np.ndarray, y: np.ndarray, made: np.ndarray) -> tuple[np.ndarray, ...]:
    """q, v, a, u, work, power (k, …) and energies (k, 2) of samples.

    Args:
        equation: State equation of the run.
        t: Times, (k,).
        y: States, (k, m).
        made: y', u, K and V, (k, m + n + 2): y' holds v, a and the powers.
    """
    n, m, works = equation.plant.dynamics.n, equation.size, equation.size - len(equation.sources)
    q, v, a, u = y[:, :n], y[:, n : 2 * n], made[:, n : 2 * n], made[:, m : m + n]
    if equation.canonical:  # y holds the momentum, and y' its rate
        v = made[:, :n]
        z = y[:, 2 * n : works]
        a = np.array([_acceleration(equation, *each) for each in zip(t, q, v, z, u, strict=True)]).reshape(q.shape)
    return q, v, a, u, y[:, works:], made[:, works:m], made[:, m + n :]


def ledger(equation: StateEquation, record: Recording) -> Ledger:
    """The energy ledger at the samples of a run."""
    m, works = equation.size, equation.size - len(equation.sources)
    E, work = record.made[:, -2:], dict(zip(equation.sources, record.y[:, works:m].T, strict=True))
    return Ledger(E[:, 0], E[:, 1], work, record.kinetic_peak, equation.stored(record.t, record.y))


def _acceleration(
    equation: StateEquation, t: float, q: np.ndarray, v: np.ndarray, z: np.ndarray, u: np.ndarray
) -> np.ndarray:
    try:
        return equation.acceleration(float(t), q, v, z, u)
    except RobotDynError:
        return np.full_like(q, np.nan)
