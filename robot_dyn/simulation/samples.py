"""What follows from the states of a run: acceleration, actuation, power and energy of each sample.

a = M⁻¹ (u + Σ τ − C v − N),   P_k = τ_kᵀ v,   E = K + Σ potentials
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from robot_dyn.errors import RobotDynError
from robot_dyn.simulation.motion import Motion
from robot_dyn.simulation.record import Record

if TYPE_CHECKING:
    from robot_dyn.simulation.machine.machine import Machine


def rows(motion: Motion, record: Record) -> tuple[np.ndarray, ...]:
    """q, v, a, u, work, power (k, …) and energies (k, 2) of the samples of a record."""
    each = [_row(motion, record, i) for i in range(len(record.t))]
    return tuple(np.array(column) for column in zip(*each, strict=True))


def _row(motion: Motion, record: Record, i: int) -> tuple[Any, ...]:
    """The same of one sample; nan for what has no value just before a run diverged."""
    t = float(record.t[i])
    q, v, z, W = motion.state(record.y[i])
    u = a = np.full_like(q, np.nan)
    power, energy = np.full_like(W, np.nan), np.full(2, np.nan)
    try:
        with np.errstate(all="ignore"):
            energy = np.array(motion.energy(t, q, v))
            u = motion.command(t, q, v, z) if record.held is None else record.held[i]
            power = motion.powers(t, q, v, u)
            a = motion.plant.forward_dynamics(t, q, v, u)
    except RobotDynError:
        pass
    return q, v, a, u, W, power, energy


def compiled_rows(motion: Motion, machine: Machine, record: Record) -> tuple[np.ndarray, ...]:
    """The same as `rows`, in machine code: y' holds v, a and the powers."""
    n, end = motion.plant.dynamics.n, 2 * motion.plant.dynamics.n + motion.memory_size
    made, energy = machine.look(record.t, np.ascontiguousarray(record.y), record.held)
    m = record.y.shape[1]
    v, u = made[:, :n], made[:, m : m + n]
    a = made[:, n : 2 * n]
    if motion.canonical:  # y' holds the rate of the momentum
        a = np.array([_acceleration(motion, *each) for each in zip(record.t, record.y[:, :n], v, u, strict=True)])
    return record.y[:, :n], v, a, u, record.y[:, end:], made[:, end:m], energy


def _acceleration(motion: Motion, t: float, q: np.ndarray, v: np.ndarray, u: np.ndarray) -> np.ndarray:
    try:
        return motion.plant.forward_dynamics(float(t), q, v, u)
    except RobotDynError:
        return np.full_like(q, np.nan)
