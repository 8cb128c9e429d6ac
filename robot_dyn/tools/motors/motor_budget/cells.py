"""Cells in which a motion is smooth, and the rule of integration over each: Kronrod's with 7 points.

    ∫ f dt ≈ Σ h/2 Σⱼ wⱼ f(xⱼ),   of degree 11; Gauss's rule with 3 of the points, of degree 5, estimates its error

[Kronrod, Nodes and Weights of Quadrature Formulas, 1965; Piessens et al., QUADPACK, 1983]
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import final

import numpy as np

from robot_dyn import Plant
from robot_dyn.control import PiecewisePolynomial, polynomial
from robot_dyn.tools.motors.gear import Gear
from robot_dyn.tools.motors.planning.geometric_path import at_rest_exactly, turning_points

FEWEST = 400  # smallest number of cells of a motion
PEAKS = 4  # number of local maxima of a quantity that are refined
_POINTS = 9  # points of a round of refinement
_NEAR = 1e-12  # relative to a cell: places at its ends lie this far inside, where friction has its sign
_RESTS, _NOTHING = 1e-9, 1e-300  # relative velocity whose sign may be rounding; a velocity that has only a sign
_CLOSE = 1e-6  # relative to a piece: a reversal nearer to its end is at the end, where the velocity has a multiple root
_HALF = np.array([0.9604912687080202, 0.7745966692414834, 0.4342437493468026])
X = np.array([-1.0, *-_HALF, 0.0, *_HALF[::-1], 1.0])
"""Places in a cell from −1 to 1: both ends, with weight 0, and the 7 points."""
KRONROD = np.array([0.0, *(k := (0.1046562260264673, 0.2684880898683334, 0.4013974147759622)), 0.4509165386584741,
                    *k[::-1], 0.0])  # fmt: skip
GAUSS = np.array([0.0, 0.0, 5 / 9, 0.0, 8 / 9, 0.0, 5 / 9, 0.0, 0.0])


@final
@dataclass(frozen=True, eq=False)
class Cells:
    """The c cells of a motion, in the order of time.

    Attributes:
        motion: The motion.
        piece: Index of the piece of the motion around each cell, (c,).
        t0, t1: Ends of the cells, (c,), in [s].
    """

    motion: PiecewisePolynomial
    piece: np.ndarray
    t0: np.ndarray
    t1: np.ndarray

    @property
    def length(self) -> np.ndarray:
        """Length of each cell, (c,), in [s]."""
        return self.t1 - self.t0

    @property
    def nodes(self) -> tuple[np.ndarray, np.ndarray]:
        """Cells and places of the nodes of the rule, (9 c,) each."""
        count = len(self.piece)
        return np.repeat(np.arange(count), len(X)), np.tile(X, count)

    @cached_property
    def _middle(self) -> np.ndarray:
        """Time from the start of the piece to the middle of each cell, (c,), in [s]."""
        return (self.t0 + self.t1) / 2 - self.motion.breaks[self.piece]

    @cached_property
    def largest_speed(self) -> np.ndarray:
        """Largest speed of each joint in the middle of cells, (n,), in [rad/s] or [m/s]."""
        return np.abs(polynomial(self.motion.coefficients[self.piece], self._middle[:, None])[1]).max(axis=0)

    def states(self, cell: np.ndarray, x: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """Return times, (k,), and q, v, a, (k, n), at places x of cells; at the ends, limits from inside."""
        inside = np.clip(x, -1 + 2 * _NEAR, 1 - 2 * _NEAR)
        start = self.motion.breaks[self.piece[cell]]
        s = self.t0[cell] - start + self.length[cell] * (1 + inside) / 2
        table = self.motion.coefficients[self.piece[cell]]
        q, v, a = polynomial(table, s[:, None])
        middle = polynomial(table, (self._middle[cell])[:, None])[1]
        noise = (np.abs(v) <= _RESTS * self.largest_speed) & (np.sign(v) != np.sign(middle))
        v = np.where(noise, _NOTHING * np.sign(middle), v)  # a joint that comes to rest does not reverse first
        t = np.clip(start + s, self.t0[cell], np.nextafter(self.t1[cell], -np.inf))
        return t, q, v, a

    def closer(
        self, values: np.ndarray, sizes: Callable[[np.ndarray, np.ndarray], np.ndarray], rounds: int = 7
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return cells and places near the largest values of each column, (k,) each.

        Args:
            values: Values at the nodes, (9 c, m).
            sizes: Function from cells and places, (k,) each, to values, (k, m).
            rounds: Rounds of refinement; a round divides distances by 4.
        """
        y = values.reshape(len(self.piece), len(X), -1)
        padded = np.pad(y, ((0, 0), (1, 1), (0, 0)), constant_values=-np.inf)
        highest = np.where((y >= padded[:, :-2]) & (y >= padded[:, 2:]), y, -np.inf).reshape(-1, y.shape[-1])
        rows = np.argsort(-highest, axis=0, kind="stable")[:PEAKS]
        column = np.tile(np.arange(y.shape[-1]), len(rows))
        cell, node = np.divmod(rows.ravel(), len(X))
        row = np.arange(len(cell))
        low, best, high = X[np.maximum(node - 1, 0)], X[node], X[np.minimum(node + 1, len(X) - 1)]
        for _ in range(rounds):
            x = low[:, None] + (high - low)[:, None] * np.linspace(0, 1, _POINTS)
            refined = sizes(np.repeat(cell, _POINTS), x.ravel()).reshape(len(cell), _POINTS, -1)
            k = refined[row, :, column].argmax(axis=1)
            best, low, high = x[row, k], x[row, np.maximum(k - 1, 0)], x[row, np.minimum(k + 1, _POINTS - 1)]
        return cell, best


def cells(motion: PiecewisePolynomial, plant: Plant, gear: Gear | None) -> Cells:
    """Return cells ending at the breaks of a motion, where effects switch and, with effects or gears, reversals."""
    motion = at_rest_exactly(motion)
    inner = [t for effect in plant.effects for t in effect.switches]
    inner += turning_points(motion).tolist() if plant.forces or gear else []
    ends = _ends(motion.breaks, np.array(inner))
    longest = (motion.end_s - motion.start_s) / FEWEST
    parts = np.ceil(np.diff(ends) / longest).astype(int)
    interval = np.repeat(np.arange(len(parts)), parts)
    k = np.arange(len(interval)) - np.repeat(np.cumsum(parts) - parts, parts)
    step = np.diff(ends)[interval]
    t0 = ends[interval] + step * (k / parts[interval])
    t1 = np.where(k + 1 == parts[interval], ends[interval + 1], ends[interval] + step * ((k + 1) / parts[interval]))
    piece = np.clip(np.searchsorted(motion.breaks, (t0 + t1) / 2, side="right") - 1, 0, len(motion.coefficients) - 1)
    return Cells(motion, piece, t0, t1)


def _ends(breaks: np.ndarray, inner: np.ndarray) -> np.ndarray:
    """Return all breaks, and the inner ends that differ from them by more than the error of roots."""
    inner = inner[(inner > breaks[0]) & (inner < breaks[-1])]
    k = np.clip(np.searchsorted(breaks, inner) - 1, 0, len(breaks) - 2)
    piece = np.diff(breaks)[k]
    apart = np.minimum(inner - breaks[k], breaks[k + 1] - inner) > _CLOSE * piece
    return np.unique(np.concatenate([breaks, inner[apart]]))
