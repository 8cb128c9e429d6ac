"""The fastest speed along a path under limits: toppra on cells of a grid, repeated for effects that depend on speed.

    τ(s) = a(s) s̈ + b(s) ṡ² + c(s) + h(s, ṡ),    h ≈ h₀ + (∂h/∂x)₀ (x − x₀),  x = ṡ²

a, b, c belong to the rigid bodies; h is the torque of effects, linearised in x about the last solution x₀(s). Viscous
friction as a part of b would be scaled by ṡ² instead of ṡ. In a cell s̈ is constant, and the limits are imposed just
after its start, in its middle and just before its end. [Pham, Pham, A New Approach to Time-Optimal Path
Parameterization Based on Reachability Analysis, 2018]

A torque–speed line ℓ bounds τ ≤ ℓ(v) where the motor drives; τ_max − ℓ(v) is linearised
with h, as τ + τ_max − ℓ(v) ≤ τ_max.
"""

from __future__ import annotations

from functools import partial
from types import SimpleNamespace
from typing import Any, NamedTuple

import numpy as np

from robot_dyn import Plant
from robot_dyn.control import PiecewisePolynomial
from robot_dyn.foundations import needs
from robot_dyn.tools.motors.limits import Limits

IMPOSED = np.array([1e-6, 0.5, 1 - 1e-6])  # places in a cell; not its ends, where the sign of a velocity may change
_SLOW = 1e-3  # relative to the largest ṡ²
_BEND = 1e-4  # step of the difference quotient ∂h/∂x, in x

needs_plan = partial(needs, extra="plan")


class Speed(NamedTuple):
    """ṡ² = x at the points s of a grid, both (m + 1,), linear between them, so that s̈ is constant there."""

    s: np.ndarray
    x: np.ndarray


class Cells(NamedTuple):
    """The limits in the cells of a grid, at several places of each: |A s̈ + B x + C| ≤ 1, with x at the cell's start.

    Attributes:
        s: The grid, (m + 1,).
        rows: A, B, C, all (m, r).
    """

    s: np.ndarray
    rows: tuple[np.ndarray, np.ndarray, np.ndarray]

    @property
    def expected_duration(self) -> float:
        """Duration with the mean acceleration and speed that the limits allow, in [s]: an order of magnitude."""
        (A, B, _), length = self.rows, self.s[-1] - self.s[0]
        per_acceleration, per_squared_speed = (np.median(np.abs(x).max(axis=-1)) for x in (A, B))
        return float(2 * np.sqrt(length * per_acceleration) + length * np.sqrt(per_squared_speed))


class Effects(NamedTuple):
    """The torque of effects along a path, h ≈ h₀ + slope (x − x₀) at places s, all of shape (m,) or (m, n)."""

    s: np.ndarray
    x0: np.ndarray
    h0: np.ndarray
    slope: np.ndarray

    @classmethod
    def about(cls, plant: Plant, limits: Limits, path: PiecewisePolynomial, s: np.ndarray, x0: np.ndarray) -> Effects:
        """Linearise in x = ṡ² about x0 > 0; near rest, where ∂h/∂x of friction is large, the slope is 0."""
        h = partial(effects_load, plant, limits, path, s)
        slope = (h(x0 * (1 + _BEND)) - h(x0 * (1 - _BEND))) / (2 * _BEND * x0)[:, None]
        slope[x0 < _SLOW * x0.max()] = 0.0
        return cls(s, x0, h(x0), slope)

    def error(self, plant: Plant, limits: Limits, path: PiecewisePolynomial, x: np.ndarray) -> float:
        """Return the largest error of the linearised torque at speeds x, as a share of the effort limits."""
        off = effects_load(plant, limits, path, self.s, x) - self.h0 - self.slope * (x - self.x0)[:, None]
        return float(np.abs(off / efforts(limits)).max())


def effects_load(plant: Plant, limits: Limits, path: PiecewisePolynomial, s: np.ndarray, x: np.ndarray) -> np.ndarray:
    """Return the load h of the effects, −Σ τ_effect, (m, n), at places s with ṡ² = x, both (m,).

    With torque–speed lines, it is h plus what lines take from the peak: of the upper limit, then of the lower, (m, 2n),
    for the lines themselves and for each straight line of their hull, which has no corner that a slope misses.
    """
    q, slope, _ = path.at(s)
    v = slope * np.sqrt(x)[:, None]
    h = -plant.torque(q, v, t=0.0)
    if limits.line is None:
        return h
    slopes = _straight(limits)[1]
    with np.errstate(invalid="ignore"):  # inf − inf of a joint without a limit
        bent = np.where(limits.line.exists, limits.effort - np.minimum(limits.line.at(v), limits.effort), 0.0)
    taken = [bent, *(-b * np.abs(v) for b in slopes[1:])]
    return np.concatenate([h + sign * np.where(sign * v >= 0, x, 0.0) for x in taken for sign in (1, -1)], axis=1)


def _straight(limits: Limits) -> tuple[np.ndarray, np.ndarray]:
    """Return torque at rest and slope, (1 + m, n), of the effort limits and of the m straight lines of the hull."""
    n = len(limits.effort)
    a, b = (np.zeros((n, 0)),) * 2 if limits.line is None else limits.line.hull
    flat = limits.effort[:, None]
    return np.hstack([flat, np.where(b < 0, a, flat)]).T, np.hstack([np.zeros((n, 1)), b]).T


def efforts(limits: Limits) -> np.ndarray:
    """Return the limit of each column of `effects_load`."""
    return limits.effort if limits.line is None else np.repeat(_straight(limits)[0], 2, axis=0).ravel()


def imposed(grid: np.ndarray) -> np.ndarray:
    """Return the places in the cells of a grid at which limits are imposed, (m, 3)."""
    return grid[:-1, None] + np.diff(grid)[:, None] * IMPOSED


def cells(plant: Plant, limits: Limits, path: PiecewisePolynomial, grid: np.ndarray, effects: Effects | None) -> Cells:
    """Return the limits in the cells of a grid, with effects linearised at its imposed places."""
    n, ahead = path.n, (np.diff(grid)[:, None] * IMPOSED).reshape(-1, 1)
    q, slope, bend = path.at(imposed(grid).ravel())
    rigid, zero = plant.dynamics.inverse_dynamics, np.zeros_like(q)
    still = rigid(q, zero, zero)
    A, B, C = rigid(q, zero, slope) - still, rigid(q, slope, bend) - still, still
    effort = limits.effort
    if effects is not None:
        A, B, C = (np.tile(x, effects.h0.shape[1] // n) for x in (A, B, C))
        effort = efforts(limits)
        B, C = B + effects.slope, C + effects.h0 - effects.slope * effects.x0[:, None]
    fast = (slope**2 / limits.velocity**2).max(axis=-1, keepdims=True)
    torque = (A / effort, B / effort, C / effort)
    acceleration = (slope / limits.acceleration, bend / limits.acceleration, zero)
    velocity = (0 * fast, fast, 0 * fast)
    A, B, C = (np.concatenate(rows, axis=-1) for rows in zip(torque, acceleration, velocity, strict=True))
    A = A + 2 * ahead * B  # x in the cell is x at its start plus 2 s̈ times the distance from there
    shape = len(grid) - 1, len(IMPOSED) * A.shape[1]
    return Cells(grid, (A.reshape(shape), B.reshape(shape), C.reshape(shape)))


def fastest(grid: Cells, duration: float) -> np.ndarray | None:
    """Return the greatest ṡ² at the points of the grid, (m + 1,), from rest to rest; None if there is no such motion.

    Args:
        grid: The limits.
        duration: Expected duration, in [s]: ṡ is scaled to a mean of about 1, because toppra rounds ṡ² to 1e-8.
    """
    algorithm, constraint = needs_plan("toppra.algorithm"), _constraint(grid, duration)
    unit = duration / (grid.s[-1] - grid.s[0])
    scaled = (grid.s - grid.s[0]) * unit
    path = SimpleNamespace(path_interval=scaled[[0, -1]], dof=1, waypoints=None)  # limits are computed already
    solver = algorithm.TOPPRA([constraint], path, gridpoints=scaled, solver_wrapper="seidel")
    _, speed, _ = solver.compute_parameterization(0.0, 0.0)
    if speed is None or not np.isfinite(speed).all():
        return None
    x = (speed / unit) ** 2
    x[[0, -1]] = 0.0
    return x if (x[1:-1] > 0).all() else None


def _constraint(grid: Cells, duration: float) -> Any:
    """Return the rows of the cells in toppra's form, F (A s̈ + B x + C) ≤ g."""
    unit = duration / (grid.s[-1] - grid.s[0])
    A, B, C = (np.concatenate([x, x[-1:]]) for x in grid.rows)  # toppra requires a last row but ignores it
    used = np.any(A, axis=0) | np.any(B, axis=0) | np.any(C, axis=0)  # rows without a limit are 0
    A, B, C = (x[:, used] for x in (A / unit, B / unit**2, C))
    both = np.concatenate([np.eye(A.shape[1]), -np.eye(A.shape[1])])
    constraint = needs_plan("toppra.constraint").LinearConstraint()
    constraint.identical = True
    constraint.get_dof = lambda: 1
    constraint.compute_constraint_params = lambda *_: (A, B, C, both, np.ones(len(both)), None, None)
    return constraint
