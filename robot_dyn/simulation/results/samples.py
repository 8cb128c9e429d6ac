"""What follows from the states of a run: acceleration, actuation, power, energy and tracking error of each sample.

    a = M⁻¹ (u + Σ τ − C v − N),   P_k = τ_kᵀ v,   E = K + Σ potentials

The tracking error is √(mean over samples and joints of (q − q_d)²).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from robot_dyn.control.cartesian import CartesianReference
from robot_dyn.control.reference import PiecewisePolynomial
from robot_dyn.errors import RobotDynError
from robot_dyn.simulation.dynamics.state_equation import StateEquation
from robot_dyn.simulation.results.ledger import Ledger
from robot_dyn.simulation.run.recording import Recording
from robot_dyn.simulation.setup.setup import Setup


class Columns(NamedTuple):
    """Quantities at k samples: position, velocity, acceleration, actuation, work and power by source, energies K, V."""

    q: np.ndarray
    v: np.ndarray
    a: np.ndarray
    u: np.ndarray
    work: np.ndarray
    power: np.ndarray
    energy: np.ndarray


def columns(equation: StateEquation, t: np.ndarray, y: np.ndarray, derived: np.ndarray) -> Columns:
    """Return the quantities at samples, (k, …).

    Args:
        equation: State equation of the run.
        t: Times, (k,).
        y: States, (k, m).
        derived: y', u, K and V, (k, m + n + 2): y' holds v, a and the powers.
    """
    n, m, works = equation.plant.dynamics.n, equation.size, equation.size - len(equation.sources)
    q, v, a, u = y[:, :n], y[:, n : 2 * n], derived[:, n : 2 * n], derived[:, m : m + n]
    if equation.canonical:  # y holds the momentum, and y' its rate
        v = derived[:, :n]
        z = y[:, 2 * n : works]
        a = np.array([_acceleration(equation, *each) for each in zip(t, q, v, z, u, strict=True)]).reshape(q.shape)
    return Columns(q, v, a, u, y[:, works:], derived[:, works:m], derived[:, m + n :])


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


def deviation_of(setup: Setup, t: np.ndarray, q: np.ndarray) -> tuple[np.ndarray | None, np.ndarray | None]:
    """Desired positions (m, n), and how far the joints (…, m, n), or the frame (…, m, 3), are from the reference.

    Args:
        setup: Of the controller.
        t: Times, (m,), in [s].
        q: Positions there, (…, m, n).
    """
    controller = setup.controller
    if controller is None:
        return None, None
    reference = controller.desired
    if isinstance(reference, PiecewisePolynomial):
        desired = reference.at(t)[0]
        return desired, q - desired
    if isinstance(reference, CartesianReference) and controller.task_frame is not None:
        return None, setup.plant.dynamics.placement(q, controller.task_frame)[..., :3, 3] - reference.at(t)[0]
    return None, None


def root_mean_square(deviation: np.ndarray) -> float:
    """Of all entries."""
    scale = np.ldexp(1.0, np.frexp(np.abs(deviation).max(initial=0.0))[1] - 1)  # that squares do not overflow
    return float(scale * np.sqrt(np.mean((deviation / scale) ** 2)))
