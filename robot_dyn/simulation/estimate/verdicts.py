"""Verdicts on the error of a run of step h, from companion runs with steps of other lengths.

With e(h) = q_h − q the error of a run of step h:

    order seen   |e(h)| ≈ |q_h − q_2h| / (2ᵖ − 1), if |q_h − q_mh| / |q_h − q_2h| is near (mᵖ − 1) / (2ᵖ − 1) for
                 m = 3 and 5: two of three companions may agree by chance
    bounded      |e(h)| ≤ about max |q_h − q_mh| / (m − 1) over m = 2, 3, 5: divided as for order 1, which every
                 method has; steps of incommensurate lengths do not pass a switch at the same node
    none         if the companions differ by more than a tenth of the motion, or 0.1 rad or m

[Richardson 1911; Hairer, Nørsett, Wanner 1993, II.4]
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from typing import final

import numpy as np

from robot_dyn.simulation.results.doubts import Doubt, DoubtKind
from robot_dyn.simulation.results.error_estimate import ErrorEstimate, Verdict, no_estimate
from robot_dyn.simulation.run.recording import Path

PUSH = 4.0  # displacement of the start, in units of rounding, to measure how the motion magnifies rounding
ROUNDING = 4500  # units of rounding of q, or the number of steps if that is larger: the smallest meaningful difference
COARSE = (Fraction(2), Fraction(3), Fraction(5))
FINE = (Fraction(1, 2), Fraction(1, 3))
_UNITS = 100.0  # largest error of q after ten steps, in units of rounding, that may be rounding
_BANDS = 2.0, 8.0  # largest factor between the ratio of differences, for m = 3 and 5, and that of the method's order
_ROWS = 2000  # largest number of times in an estimate
_FAR_OFF = 8.0  # times the bound from the other two: larger differences only show that the longest step is too long
_DOUBT = 3.0  # times the estimate from the order of the method; above it, shorter steps are needed
_LOST = 0.1  # fraction of the motion, at most 0.1 rad or m: a larger difference of companions is meaningless


@final
@dataclass(frozen=True)
class Estimated:
    """The run whose error is estimated.

    Attributes:
        path: The k states at which it is compared with companion runs.
        n: Number of joints.
        kink: Time from which the right-hand side may not be smooth, in [s]; after it, nothing is divided by 2ᵖ − 1.
        floor: Error that rounding may leave in q, up to each state, (k,).
        meaningless: Smallest meaningless difference of companions, in [rad] or [m].
    """

    path: Path
    n: int
    kink: float
    floor: np.ndarray
    meaningless: float

    def from_longer_steps(self, companions: Mapping[Fraction, Path], order: int) -> ErrorEstimate:
        """Return the estimate from companions with the longer steps of `COARSE`, by their factor on the step."""
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
        """Return True if an estimate from longer steps is far above the one from the order of the method.

        Long steps may be unstable, or show no order for a while, although the steps of the run do not. After a kink,
        shorter steps show no order either, and the result is False.
        """
        by_order = differences(self.path, companions[COARSE[0]], self.n)[-1] / (2.0**order - 1)
        return self.kink > self.path.t[-1] and not result.largest <= _DOUBT * max(by_order, float(self.floor[-1]))

    def from_shorter_steps(self, companions: Mapping[Fraction, Path], order: int) -> ErrorEstimate:
        """Return the estimate from companions of `FINE`: |q_h − q_{h/m}| = |e(h)| (1 − m⁻ᵖ), p = 1 without an order."""
        half, third = (companions[pace] for pace in FINE)
        between = at_states(self.path, third, differences(third, half, self.n))
        gaps = [differences(self.path, companion, self.n) for companion in (half, third)]
        largest = np.maximum(np.maximum(*gaps), between)
        order_seen = (between < largest / 2) | (largest <= self.floor)
        error = np.maximum(largest, gaps[1] / (1 - 3.0 ** -np.where(self._smooth(order_seen), order, 1)))
        return self._judged(error, error, order_seen)

    def from_refinement(self, near: np.ndarray, tight: Path | None) -> ErrorEstimate:
        """Return the estimate of a method that chooses its steps.

        Args:
            near: Differences from the companion with steps half as long, |q_h − q_{h/2}| = |e(h)| (1 − 2⁻ᵖ).
            tight: The companion at a tenth of the tolerance, or None if the right-hand side is smooth.
        """
        bound = near if tight is None else np.fmax(near, differences(self.path, tight, self.n))
        order_seen = np.ones(len(near), bool)
        return self._judged(np.where(self._smooth(order_seen), near, bound), bound, order_seen)

    def begins_as_rounding(self, gap: np.ndarray, until: float) -> bool:
        """Return True if differences from a companion are rounding up to a time, in [s], and larger later."""
        last = min(int(np.searchsorted(self.path.t, until)), len(gap) - 1)
        size = 1 + float(np.abs(self.path.y[: last + 1, : self.n]).max())
        return bool(gap[last] < _UNITS * np.finfo(float).eps * size and np.any(gap > self.floor))

    def lost_at(self, companion: Path) -> float:
        """Return the time from which a companion differs too much from the run, in [s]; inf if it never does."""
        gap = differences(self.path, companion, self.n)
        lost = np.flatnonzero(np.isnan(gap) | (gap > self.meaningless))
        return float(self.path.t[lost[0]]) if len(lost) else np.inf

    def _smooth(self, order_seen: np.ndarray) -> np.ndarray:
        return order_seen & (self.path.t < self.kink)

    def _judged(self, error: np.ndarray, bound: np.ndarray, order_seen: np.ndarray) -> ErrorEstimate:
        """Return the estimate, with its verdict, up to the first meaningless difference."""
        t, error = self.path.t, np.maximum(error, self.floor)
        bad = np.flatnonzero(np.isnan(bound) | (np.maximum(bound, self.floor) > self.meaningless))
        last, doubt = len(t) - 1, None
        if len(bad):
            last, is_rounding = int(bad[0]) - 1, self.floor[bad[0]] > self.meaningless
            limit = "limit" if self.meaningless >= _LOST else "tenth"
            kind = DoubtKind.ROUNDING if is_rounding else DoubtKind.COMPANIONS_DIFFER
            doubt = Doubt(kind, {limit: self.meaningless})
            if last < 1 < len(t):
                return no_estimate(doubt)
        rows = np.arange(last + 1) if last < _ROWS else np.unique(np.linspace(0, last, _ROWS).astype(int))
        verdict = Verdict.ORDER if self._smooth(order_seen)[last] else Verdict.BOUND
        return ErrorEstimate(t[rows], np.maximum.accumulate(error)[rows], float(t[last]), doubt, verdict)


def at_states(run: Path, companion: Path, values: np.ndarray) -> np.ndarray:
    """Return values of a companion at each state of the run: at its next state, or its last; nan if it has none."""
    if not len(companion.key):  # it diverged before the first shared state
        return np.full(len(run.key), np.nan)
    return values[np.searchsorted(companion.key[:-1], run.key)]


def differences(run: Path, companion: Path, n: int) -> np.ndarray:
    """Return the largest |q − q_companion| over joints up to each state of the run; nan after the companion's end."""
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
    """Return the largest |x| of each row; by columns, because there are few of them."""
    return np.abs(np.ascontiguousarray(x.T)).max(axis=0)


def rounding(run: Path, n: int) -> np.ndarray:
    """Return the error from rounding of q in every step, up to each state, if the motion does not magnify it."""
    size = np.maximum.accumulate(_largest(run.y[:, :n]))
    return np.finfo(float).eps * np.maximum(ROUNDING, run.key) * (1 + size)


def carried(run: Path, pushed: np.ndarray, n: int) -> np.ndarray:
    """Return the error from rounding of every step, magnified by the motion: a random walk.

    G(t) √Σ_k (u_k / G(t_k))²,    G the growth of a push at the start up to t
    """
    u = np.finfo(float).eps * (1 + np.maximum.accumulate(_largest(run.y[:, :n])))
    growth = np.fmax(pushed / (PUSH * np.finfo(float).eps), 1.0)
    walk = np.sqrt(np.cumsum(np.diff(run.key, prepend=run.key[0]) * (u / growth) ** 2))
    return np.fmax(pushed, growth * walk)


def meaningless(step_log: Path, n: int) -> float:
    """Return the smallest meaningless difference of companions: a tenth of the motion, at most 0.1 rad or m."""
    return _LOST * min(1.0, max(float(np.ptp(step_log.y[:, :n], axis=0).max()), 1e-6))
