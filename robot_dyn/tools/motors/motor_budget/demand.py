"""The demand of a motion on the joints: torque by cause and speed, along a plan or at the samples of a run.

A plan is evaluated in cells in which it is smooth, and repeatedly, at decreasing distances, near the largest values.
Where the torque jumps, for example at a break of the acceleration, both sides are evaluated.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, final

import numpy as np

from robot_dyn import Plant, Trajectory
from robot_dyn.control import PiecewisePolynomial, extreme_values
from robot_dyn.effects import Causes, Stateful, exerted_torques, torques_by_cause
from robot_dyn.foundations import EffectError, QueryError
from robot_dyn.simulation import Ending
from robot_dyn.tools.motors.gear import Gear, with_loss
from robot_dyn.tools.motors.limits import Limits
from robot_dyn.tools.motors.motor_budget.breakaway import NO_BREAKAWAY, Breakaway, breakaway, static_friction
from robot_dyn.tools.motors.motor_budget.cells import GAUSS, KRONROD, PEAKS, Cells, X, cells


@final
@dataclass(frozen=True, eq=False)
class Demand:
    """Torque by cause and velocity at k times.

    Attributes:
        split: The torque by cause.
        v: Velocities, (k, n), in [rad/s] or [m/s].
        weights: Weights of an integral over time, (k,), in [s].
        coarse: Weights of a coarser rule, for an estimate of the error, (k,), in [s].
        peak: Largest |τ| of each joint, (n,), in [N m] or [N].
        speed: Largest |v|, (n,), and its time, (n,).
        resolution: Description of the times, in words.
        friction: Static friction f_s of dry friction, (n,), in [N m] or [N]; nan for a run.
        starts: Torques at which joints break away; none for a run.
        cells: The cells of a plan; None for a run.
        cell, x: Index of the cell, and place in it, of each time of a plan, (k,); None for a run.
    """

    split: Causes
    v: np.ndarray
    weights: np.ndarray
    coarse: np.ndarray
    peak: np.ndarray
    speed: tuple[np.ndarray, np.ndarray]
    resolution: str
    friction: np.ndarray
    starts: Breakaway = NO_BREAKAWAY
    cells: Cells | None = None
    cell: Any = None
    x: Any = None

    @cached_property
    def power(self) -> np.ndarray:
        """P = τ v of each joint, (k, n), in [W]."""
        return self.split.tau * self.v

    @cached_property
    def mean_speed(self) -> np.ndarray:
        """Mean of |v| over time, (n,), in [rad/s] or [m/s]."""
        return self.mean(np.abs(self.v))

    @property
    def duration_s(self) -> float:
        """Duration of the motion, in [s]."""
        return float(self.weights.sum())

    def mean(self, y: np.ndarray, weights: np.ndarray | None = None) -> np.ndarray:
        """Return the mean over time of columns, (k, n), or of one column, (k,)."""
        weights = self.weights if weights is None else weights
        total = weights.sum()
        return weights @ y / total if total > 0 else y[0]

    @cached_property
    def error(self) -> float:
        """Largest difference between both rules for the means of τ² and |P|, relative to the largest mean."""
        tau, size = self.split.tau, np.abs(self.split.tau).max(initial=0.0)
        parts = ((tau / (size or 1.0)) ** 2, np.abs(self.power))
        off = [np.abs(self.mean(y) - self.mean(y, self.coarse)).max() / (self.mean(y).max() or 1.0) for y in parts]
        return float(max(off))


def of_motion(motion: PiecewisePolynomial, plant: Plant, limits: Limits | None = None) -> Demand:
    """Compute the demand along a plan, with the gears of limits, and times near the largest use of their lines.

    Raises:
        EffectError: If an effect has states, which a motion does not determine.
    """
    for effect in plant.forces:
        if isinstance(effect, Stateful):
            raise EffectError(
                f"budget: {effect.name} has states, which a motion does not determine; simulate the motion, and pass"
                " the run"
            )
    gear = limits and limits.gear
    grid = cells(motion, plant, gear)

    def sizes(cell: np.ndarray, x: np.ndarray) -> np.ndarray:
        tau, v = torques(grid, plant, cell, x, gear)
        used = () if limits is None or limits.line is None else (limits.used(tau, v),)
        return np.concatenate([np.abs(tau), np.abs(tau * v), *used], axis=1)

    cell, x = grid.nodes
    closer = grid.closer(sizes(cell, x), sizes)
    cell, x = np.concatenate([cell, closer[0]]), np.concatenate([x, closer[1]])
    rules = [
        np.concatenate([np.outer(grid.length / 2, rule).ravel(), np.zeros(len(closer[0]))]) for rule in (KRONROD, GAUSS)
    ]
    order = np.lexsort((x, cell))
    cell, x = cell[order], x[order]
    t, q, v, a = grid.states(cell, x)
    split = with_loss(torques_by_cause(plant, t, q, v, a), gear, v, a)
    fastest = extreme_values(grid.motion, 1)
    at = np.where(-fastest.least > fastest.greatest, fastest.least_at_s, fastest.greatest_at_s)
    gap = float(grid.length.max() * np.diff(X).max() / 2)
    return Demand(
        split=split,
        v=v,
        weights=rules[0][order],
        coarse=rules[1][order],
        peak=np.abs(split.tau).max(axis=0),
        speed=(fastest.largest, at),
        resolution=f"peaks are the largest of {len(t)} times, at most {gap:.2g} s apart, and closer around the {PEAKS}"
        " largest of each joint",
        friction=static_friction(plant),
        starts=breakaway(grid, plant, gear),
        cells=grid,
        cell=cell,
        x=x,
    )


def torques(
    cells: Cells, plant: Plant, cell: np.ndarray, x: np.ndarray, gear: Gear | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Return torque and velocity at places of cells, both (k, n): the sum of `torques_by_cause` and the gear loss."""
    t, q, v, a = cells.states(cell, x)
    acts = plant.forces or plant.equation_of_motion.payloads
    exerted = exerted_torques(plant, t, q, v, a).values() if acts else ()
    tau = plant.dynamics.inverse_dynamics(q, v, a) - sum(exerted, start=np.zeros_like(q))
    return tau if gear is None else tau + gear.loss(tau, v, a), v


def root_mean_squares(motion: PiecewisePolynomial, plant: Plant, gear: Gear | None) -> np.ndarray:
    """Compute √(1/T ∫ τ² dt) of each motor along a motion, (n,), in [N m] or [N]."""
    grid = cells(motion, plant, gear)
    tau, _ = torques(grid, plant, *grid.nodes, gear)
    weights = np.outer(grid.length / 2, KRONROD).ravel()
    return np.sqrt(weights @ tau**2 / weights.sum())


def of_run(run: Trajectory, gear: Gear | None) -> Demand:
    """Compute the demand at the samples of a run, with extremes over all steps; of torques only without gear losses.

    Raises:
        QueryError: If the run diverged, has one sample, or does not contain the torques of its effects.
    """
    if run.outcome.ending == Ending.DIVERGED:
        raise QueryError(f"the run diverged at {run.outcome.t:.6g} s, so its torques are meaningless; correct the run")
    if len(run.t) < 2:
        raise QueryError("the run has one sample: record more samples")
    split = with_loss(run.causes(), gear, run.v, run.a)
    weights = _trapezoidal(run.t, np.arange(len(run.t)))
    every_other = np.unique(np.append(np.arange(0, len(run.t), 2), len(run.t) - 1))
    row, column = np.abs(run.v).argmax(axis=0), np.arange(run.v.shape[1])
    peak, speed = np.abs(split.tau).max(axis=0), np.abs(run.v[row, column])
    resolution = f"at {len(run.t)} samples, at most {np.diff(run.t).max():.2g} s apart"
    if run.extremes is not None:
        largest = np.abs(run.extremes).max(axis=1)
        speed = np.fmax(speed, largest[1])
        peak = np.fmax(peak, largest[2]) if gear is None else peak
        resolution += f"; peaks of {'torque and ' if gear is None else ''}speed are over all steps"
    coarse = _trapezoidal(run.t, every_other)
    return Demand(split, run.v, weights, coarse, peak, (speed, run.t[row]), resolution, np.full(len(peak), np.nan))


def _trapezoidal(t: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Return the weights, (k,), of the trapezoidal rule over the times with these indices."""
    weights, half = np.zeros(len(t)), np.diff(t[at]) / 2
    weights[at[:-1]] += half
    weights[at[1:]] += half
    return weights
