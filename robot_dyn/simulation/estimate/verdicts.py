"""Verdicts on the error of a run of step h, from companion runs with steps of another length.

With e(h) = q_h − q the error of a run of step h:

    order seen   |e(h)| ≈ |q_h − q_2h| / (2ᵖ − 1), where |q_h − q_mh| / |q_h − q_2h| is near (mᵖ − 1) / (2ᵖ − 1),
                 m = 3 and 5: two of three companions may agree by chance
    bounded      |e(h)| ≤ about max |q_h − q_mh| / (m − 1) over m = 2, 3, 5: undivided but for the order 1 that every
                 method keeps; steps of incommensurate lengths do not meet a switch at the same node
    none         where the companions differ by more than a tenth of the motion, or 0.1 rad or m

[Richardson 1911; Hairer, Nørsett, Wanner 1993, II.4]
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import final

import numpy as np

from robot_dyn.simulation.results.error_estimate import ErrorEstimate, Verdict, no_estimate
from robot_dyn.simulation.run.recording import Path

ROUNDED = "what rounding leaves of q, as the motion magnifies it, is more than"
PUSH = 4.0  # units of rounding by which a start is moved, to see how the motion magnifies rounding
ROUNDING = 4500  # units of rounding of q, or as many as steps if there are more: differences below are not an error
COARSE = (Fraction(2), Fraction(3), Fraction(5))
FINE = (Fraction(1, 2), Fraction(1, 3))
_UNITS = 100.0  # of rounding, that ten steps may leave in q
_BANDS = 2.0, 8.0  # a ratio of differences, of 3 and of 5, may be this factor off the one of the method's order
_ROWS = 2000  # of an estimate, at most
_FAR_OFF = 8.0  # times the bound of the others: above, the longest step is no longer in the range of the method
_DOUBT = 3.0  # times what follows from the order of the method: above, shorter steps are needed
_LOST = 0.1  # of the motion, at most 0.1 rad or m: companions that differ by more show nothing


@final
@dataclass(frozen=True)
class Estimated:
    """The run whose error is estimated.

    Attributes:
        path: Its states at which companion runs are compared, k of them.
        n: Number of joints.
        kink: Time from which the right-hand side may not be smooth, in [s]: no division by 2ᵖ − 1 after it.
        floor: Error that rounding may leave in q, up to each state, (k,).
        meaningless: Difference of companions that is meaningless, in [rad] or [m].
    """

    path: Path
    n: int
    kink: float
    floor: np.ndarray
    meaningless: float

    def from_longer_steps(self, companions: Mapping[Fraction, Path], order: int) -> ErrorEstimate:
        """The estimate from companions of longer steps, by the length of their steps: those of `COARSE`."""
        A, B, C = (differences(self.path, companions[pace], self.n) for pace in COARSE)
        bound = np.maximum(A, B / 2)  # nan after the end of a companion that ended early
        bound = np.fmax(bound, np.minimum(C / 4, _FAR_OFF * bound))
        order_seen = np.ones(len(A), bool)
        for far, pace, band in zip((B, C), COARSE[1:], _BANDS, strict=True):
            nominal = (float(pace) ** order - 1) / (2.0**order - 1)
            ratio = np.maximum(far, self.floor) / np.maximum(A, self.floor)
            order_seen &= (ratio > nominal / band) & (ratio < nominal * band)
        order_seen |= self.floor >= A
        return self._judged(np.where(self._smooth(order_seen), A / (2.0**order - 1), bound), bound, order_seen)

    def doubts(self, result: ErrorEstimate, companions: Mapping[Fraction, Path], order: int) -> bool:
        """Whether an estimate from longer steps is far above the one that follows from the order of the method.

        Long steps may be unstable, or show no order for a while, where those of the run are neither. A kink is another
        matter: shorter steps show no order either.
        """
        by_order = differences(self.path, companions[COARSE[0]], self.n)[-1] / (2.0**order - 1)
        return self.kink > self.path.t[-1] and not result.largest <= _DOUBT * max(by_order, float(self.floor[-1]))

    def from_shorter_steps(self, companions: Mapping[Fraction, Path], order: int) -> ErrorEstimate:
        """The estimate from companions of `FINE`: |q_h − q_{h/m}| = |e(h)| (1 − m⁻ᵖ), of order 1 where none shows."""
        half, third = (companions[pace] for pace in FINE)
        between = at_states(self.path, third, differences(third, half, self.n))
        gaps = [differences(self.path, each, self.n) for each in (half, third)]
        largest = np.maximum(np.maximum(*gaps), between)
        order_seen = (between < largest / 2) | (largest <= self.floor)
        error = np.maximum(largest, gaps[1] / (1 - 3.0 ** -np.where(self._smooth(order_seen), order, 1)))
        return self._judged(error, error, order_seen)

    def from_refinement(self, near: np.ndarray, tight: Path | None) -> ErrorEstimate:
        """The estimate of a method that chooses its steps.

        Args:
            near: Differences from the companion of half as long steps, |q_h − q_{h/2}| = |e(h)| (1 − 2⁻ᵖ).
            tight: The companion of a tenth of the tolerance, where something may switch unseen.
        """
        bound = near if tight is None else np.fmax(near, differences(self.path, tight, self.n))
        order_seen = np.ones(len(near), bool)
        return self._judged(np.where(self._smooth(order_seen), near, bound), bound, order_seen)

    def begins_as_rounding(self, gap: np.ndarray, until: float) -> bool:
        """Whether differences from other steps are rounding alone up to a time, in [s], and more later."""
        last = min(int(np.searchsorted(self.path.t, until)), len(gap) - 1)
        size = 1 + float(np.abs(self.path.y[: last + 1, : self.n]).max())
        return bool(gap[last] < _UNITS * np.finfo(float).eps * size and np.any(gap > self.floor))

    def lost_at(self, companion: Path) -> float:
        """Time in [s] from which a companion is no longer comparable with the run; inf if there is none."""
        gap = differences(self.path, companion, self.n)
        lost = np.flatnonzero(np.isnan(gap) | (gap > self.meaningless))
        return float(self.path.t[lost[0]]) if len(lost) else np.inf

    @property
    def _limit(self) -> str:
        """A description of `meaningless`."""
        most = "rad or m" if self.meaningless >= _LOST else "[rad] or [m], a tenth of the motion"
        return f"{self.meaningless:.2g} {most}"

    def _smooth(self, order_seen: np.ndarray) -> np.ndarray:
        return order_seen & (self.path.t < self.kink)

    def _judged(self, error: np.ndarray, bound: np.ndarray, order_seen: np.ndarray) -> ErrorEstimate:
        """The estimate up to where nothing is known, with its verdict."""
        t, error = self.path.t, np.maximum(error, self.floor)
        bad = np.flatnonzero(np.isnan(bound) | (np.maximum(bound, self.floor) > self.meaningless))
        last, note = len(t) - 1, ""
        if len(bad):
            last, rounded = int(bad[0]) - 1, self.floor[bad[0]] > self.meaningless
            note = f"{ROUNDED if rounded else 'runs with other steps differ by more than'} {self._limit}"
        if last < 1 < len(t):
            return no_estimate(note)
        rows = np.arange(last + 1) if last < _ROWS else np.unique(np.linspace(0, last, _ROWS).astype(int))
        verdict = Verdict.ORDER if self._smooth(order_seen)[last] else Verdict.BOUND
        return ErrorEstimate(t[rows], np.maximum.accumulate(error)[rows], float(t[last]), note, verdict)


def at_states(run: Path, companion: Path, values: np.ndarray) -> np.ndarray:
    """Values at the states of a companion, at those of the run: of the next one; nan of a companion without states."""
    if not len(companion.key):  # it diverged before the first state that it shares
        return np.full(len(run.key), np.nan)
    return values[np.searchsorted(companion.key[:-1], run.key)]


def differences(run: Path, companion: Path, n: int) -> np.ndarray:
    """Largest |q − q_companion| over the joints up to each state of the run; nan after the companion's end."""
    if np.array_equal(run.key, companion.key):
        return np.maximum.accumulate(_largest(run.y[:, :n] - companion.y[:, :n]))
    _, here, there = np.intersect1d(run.key, companion.key, assume_unique=True, return_indices=True)
    if not len(here):
        return np.full(len(run.t), np.nan)
    gap = np.maximum.accumulate(_largest(run.y[here, :n] - companion.y[there, :n]))
    following = np.searchsorted(here, np.arange(len(run.t)))  # between two common states the later one counts
    result = gap[np.minimum(following, len(gap) - 1)]
    result[run.key > companion.key[-1]] = np.nan
    return result


def _largest(x: np.ndarray) -> np.ndarray:
    """The largest |x| of each row; by columns, as there are few of them."""
    return np.abs(np.ascontiguousarray(x.T)).max(axis=0)


def rounding(run: Path, n: int) -> np.ndarray:
    """Error that rounding of q in every step may leave, up to each state, where nothing magnifies it."""
    size = np.maximum.accumulate(_largest(run.y[:, :n]))
    return np.finfo(float).eps * np.maximum(ROUNDING, run.key) * (1 + size)


def carried(run: Path, pushed: np.ndarray, n: int) -> np.ndarray:
    """Error that rounding of every step leaves where the motion magnifies it: a random walk of steps, each magnified.

    G(t) √Σ_k (u_k / G(t_k))²,    G the growth of a push at the start up to t
    """
    u = np.finfo(float).eps * (1 + np.maximum.accumulate(_largest(run.y[:, :n])))
    growth = np.fmax(pushed / (PUSH * np.finfo(float).eps), 1.0)
    walk = np.sqrt(np.cumsum(np.diff(run.key, prepend=run.key[0]) * (u / growth) ** 2))
    return np.fmax(pushed, growth * walk)


def meaningless(step_log: Path, n: int) -> float:
    """Difference of companions that is meaningless: a tenth of the motion of a run, at most 0.1 rad or m."""
    return _LOST * min(1.0, max(float(np.ptp(step_log.y[:, :n], axis=0).max()), 1e-6))
