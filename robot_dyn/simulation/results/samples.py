"""Quantities derived from the states of a run: acceleration, actuation, power, energy and tracking error.

    a = M⁻¹ (τ − C v − N),   P_k = τ_kᵀ v,   E = K + Σ potentials

The root mean square of the tracking error is √(mean over samples and joints of (q_d − q)²).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from robot_dyn.control.cartesian import CartesianReference
from robot_dyn.control.reference import PiecewisePolynomial
from robot_dyn.foundations.errors import RobotDynError
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
        a = np.array([_acceleration(equation, *state) for state in zip(t, q, v, z, u, strict=True)]).reshape(q.shape)
    return Columns(q, v, a, u, y[:, works:], derived[:, works:m], derived[:, m + n :])


def ledger(equation: StateEquation, record: Recording) -> Ledger:
    """Return the energy ledger at the samples of a run."""
    m, works = equation.size, equation.size - len(equation.sources)
    E, work = record.sampled[:, -2:], dict(zip(equation.sources, record.y[:, works:m].T, strict=True))
    return Ledger(E[:, 0], E[:, 1], work, record.kinetic_peak, equation.stored(record.t, record.y))


def _acceleration(
    equation: StateEquation, t: float, q: np.ndarray, v: np.ndarray, z: np.ndarray, u: np.ndarray
) -> np.ndarray:
    try:
        return equation.acceleration(float(t), q, v, z, u)
    except RobotDynError:
        return np.full_like(q, np.nan)


class Tracking(NamedTuple):
    """Desired positions and velocities of the joints, (m, n), and the tracking error of joints or frame.

    A quantity without a reference is None; `tracking_error` is (…, m, n) or (…, m, 3).
    """

    desired: np.ndarray | None = None
    desired_velocity: np.ndarray | None = None
    tracking_error: np.ndarray | None = None


def tracking_of(setup: Setup, t: np.ndarray, q: np.ndarray) -> Tracking:
    """Return the reference of a controller, and the deviation of the motion from it.

    Args:
        setup: The setup with the controller.
        t: Times, (m,), in [s].
        q: Positions there, (…, m, n).
    """
    controller = setup.controller
    if controller is None:
        return Tracking()
    reference = controller.desired
    if isinstance(reference, PiecewisePolynomial):
        desired, velocity, _ = reference.at(t)
        return Tracking(desired, velocity, desired - q)
    if isinstance(reference, CartesianReference) and controller.task_frame is not None:
        p = setup.plant.dynamics.placement(q, controller.task_frame)[..., :3, 3]
        return Tracking(tracking_error=reference.at(t)[0] - p)
    return Tracking()


def root_mean_square(x: np.ndarray) -> float:
    """Return the root mean square of all entries."""
    scale = np.ldexp(1.0, np.frexp(np.abs(x).max(initial=0.0))[1] - 1)  # so that squares do not overflow
    return float(scale * np.sqrt(np.mean((x / scale) ** 2)))


def root_mean_squares(x: np.ndarray) -> np.ndarray:
    """Return the root mean squares over the samples of runs (B, m, n) that are not nan, (B, n); nan without any."""
    is_number = ~np.isnan(x)
    sizes = np.abs(x).max(axis=1, where=is_number, initial=0.0, keepdims=True)
    scale = np.ldexp(1.0, np.frexp(sizes)[1] - 1)
    with np.errstate(invalid="ignore"):  # 0 / 0 if all are nan
        mean = np.square(x / scale).sum(axis=1, where=is_number) / is_number.sum(axis=1)
    return scale[:, 0] * np.sqrt(mean)
