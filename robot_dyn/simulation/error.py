"""The error of a run, estimated from companion runs of twice and four times its step [Richardson 1911].

    |q_h − q| ≈ |q_h − q_2h| / (2ᵖ − 1)  while  |q_2h − q_4h| / |q_h − q_2h| is near 2ᵖ

Where the ratio falls below that, the step is too large for the method's order to show: not resolved. Where it lies
above, the longest step alone is too large, and the estimate errs on the safe side.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np

ROUNDING = 1e-12  # of the largest |q| + 1: differences below it are rounding
_BAND = 2.5  # the ratio may be this factor below 2ᵖ


@final
@dataclass(frozen=True)
class ErrorEstimate:
    """Estimated error of positions, the largest over the joints, in [rad] or [m].

    Attributes:
        t: Times of the estimate, (k,), in [s].
        error: |q_h − q|, (k,).
        resolved_until: t*, up to which the estimate holds, in [s].
        note: Why it ends there, or why there is none; empty if it holds to the end.
    """

    t: np.ndarray
    error: np.ndarray
    resolved_until: float
    note: str = ""

    def __str__(self) -> str:
        if not self.resolved_until > 0:
            return f"not estimated; {self.note}"
        return f"{self.final:.1e}, estimated" + (f"; {self.note}" if self.note else "")

    @property
    def final(self) -> float:
        """The largest error up to t*; nan if nothing is resolved."""
        known = self.error[self.t <= self.resolved_until]
        return float(known.max()) if len(known) else float("nan")


def richardson(t: np.ndarray, fine: np.ndarray, middle: np.ndarray, coarse: np.ndarray, order: int) -> ErrorEstimate:
    """The estimate from positions (k, n) of runs with steps h, 2h, 4h at common times t (k,).

    The runs may have ended early; what all three reached is used.
    """
    k = min(len(fine), len(middle), len(coarse))
    if k < 2:
        return ErrorEstimate(t[:0], np.empty(0), 0.0, "a companion run diverged at once: take a smaller step")
    t, fine, middle, coarse = t[:k], fine[:k], middle[:k], coarse[:k]
    first = np.abs(fine - middle).max(axis=1)
    second = np.abs(middle - coarse).max(axis=1)
    floor = ROUNDING * (1 + np.abs(fine).max(axis=1))
    factor = 2.0**order
    # what has accumulated up to a time tells more than one crossing of two runs
    first_so_far, second_so_far = np.maximum.accumulate(first), np.maximum.accumulate(second)
    with np.errstate(divide="ignore", invalid="ignore"):
        ratio = second_so_far / first_so_far
    near = (ratio > factor / _BAND) | (first_so_far <= floor)
    bad = np.flatnonzero(~near)
    until = float(t[bad[0] - 1]) if len(bad) and bad[0] else (0.0 if len(bad) else float(t[-1]))
    note = f"not resolved after t* = {until:g} s: take a smaller step" if len(bad) else ""
    return ErrorEstimate(t, np.maximum(first_so_far / (factor - 1), floor * (first_so_far > 0)), until, note)


def difference(t: np.ndarray, tight: np.ndarray, loose: np.ndarray) -> ErrorEstimate:
    """The estimate of an adaptive run: its distance from one of ten times the tolerance, which errs more."""
    error = np.maximum.accumulate(np.abs(tight - loose).max(axis=1))
    lost = np.flatnonzero(error > 0.1)
    until = float(t[max(lost[0] - 1, 0)]) if len(lost) else float(t[-1])
    note = f"not resolved after t* = {until:g} s: take a smaller tolerance" if len(lost) else ""
    return ErrorEstimate(t, error, until, note)
