"""What follows from the states of a run: acceleration, actuation, power and energy of each sample.

a = M⁻¹ (u + Σ τ − C v − N),   P_k = τ_kᵀ v,   E = K + Σ potentials
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from robot_dyn.errors import RobotDynError
from robot_dyn.simulation.motion import Motion

if TYPE_CHECKING:
    from robot_dyn.simulation.machine.machine import Machine
    from robot_dyn.simulation.record import Record


def columns(motion: Motion, rows: np.ndarray) -> tuple[np.ndarray, ...]:
    """q, v, a, u, work, power (k, …) and energies (k, 2) of rows (k, 4 n + 2 s + 2)."""
    n, s = motion.plant.dynamics.n, len(motion.sources)
    return tuple(np.split(rows, np.cumsum([n, n, n, n, s, s]), axis=1))


def row(motion: Motion, t: float, y: np.ndarray, held: np.ndarray | None) -> np.ndarray:
    """q, v, a, u, work, power and energies of one sample; nan for what has no value just before a run diverged."""
    n = motion.plant.dynamics.n
    q, v, z, W = y[:n], np.full(n, np.nan), y[2 * n : 2 * n + motion.memory_size], y[2 * n + motion.memory_size :]
    u = a = np.full_like(q, np.nan)
    power, energy = np.full_like(W, np.nan), np.full(2, np.nan)
    try:
        with np.errstate(all="ignore"):
            v = motion.state(y)[1]
            energy = np.array(motion.energy(t, q, v))
            u = motion.command(t, q, v, z) if held is None else held
            power = motion.powers(t, q, v, u)
            a = motion.plant.forward_dynamics(t, q, v, u)
    except RobotDynError:
        pass
    return np.concatenate([q, v, a, u, W, power, energy])


def compiled_rows(motion: Motion, machine: Machine, record: Record) -> tuple[np.ndarray, ...]:
    """The same as `columns` of rows, in machine code: y' holds v, a and the powers."""
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
