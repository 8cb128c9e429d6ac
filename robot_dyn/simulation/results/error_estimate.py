"""The estimated error of a run, with its verdict and the doubts about it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from math import inf, nan
from typing import Annotated, final, overload

import numpy as np

from robot_dyn.foundations.store import Layout
from robot_dyn.foundations.validate import times
from robot_dyn.foundations.values import ReadOnly
from robot_dyn.simulation.results.doubts import Doubt

_SAME = 8 * np.finfo(float).eps  # relative difference of one time computed in two ways


class Verdict(StrEnum):
    """Basis of an estimate."""

    ORDER = "order seen"
    BOUND = "bounded"
    NONE = "none"


@final
@dataclass(frozen=True, eq=False, repr=False)
class ErrorEstimate(ReadOnly):
    """Estimated error of positions, the largest over the joints, in [rad] or [m].

    Attributes:
        t: Times of the estimate, (k,), in [s].
        error: Estimate of |q_h − q|, the largest up to each time, (k,).
        until_s: Time up to which the estimate is valid, in [s]; 0 if no error is estimated.
        ends_early: Reason why it ends before the run, or why no error is estimated; None if it covers the run.
        verdict: Basis of the estimate at `until_s`.
        no_order: Reason why the order of the method does not show; None unless the verdict is "bounded".
    """

    t: Annotated[np.ndarray, Layout(("k",))]
    error: Annotated[np.ndarray, Layout(("k",), finite=False)]
    until_s: float
    ends_early: Doubt | None = None
    verdict: Verdict = Verdict.ORDER
    no_order: Doubt | None = None

    def __str__(self) -> str:
        if not self.until_s > 0:
            return f"not estimated; {self.note}"
        last = self.at(self.until_s)
        figure = f"{last:.1e}" if self.verdict is Verdict.ORDER else f"about {last:.1e}"
        if self.ends_early:
            figure += f" up to t = {self.until_s:g} s"
        reason = f": {self.no_order.text}" if self.no_order else ""
        return f"{figure} ({self.verdict}{reason})" + (f"; after that none: {self.note}" if self.ends_early else "")

    def __repr__(self) -> str:
        return f"<ErrorEstimate: {self}>"

    @property
    def note(self) -> str:
        """The text of `ends_early` with a remedy; empty if the estimate covers the run."""
        if self.ends_early is None:
            return ""
        return f"{self.ends_early}{', or a shorter run' if self.ends_early.is_of_steps else ''}"

    @property
    def largest(self) -> float:
        """Largest estimated error over the run; inf if the estimate ends before the run does."""
        return inf if self.ends_early else self.at(self.until_s)

    @overload
    def at(self, t: float) -> float: ...
    @overload
    def at(self, t: np.ndarray | Sequence[object]) -> np.ndarray: ...
    def at(self, t: float | np.ndarray | Sequence[object]) -> float | np.ndarray:
        """Return the estimate of the largest error up to time(s) t, in [rad] or [m].

        It is inf after `until_s`, and at all times if no error is estimated; nan for a time before 0, or a t of nan.
        Between two times of the estimate, the value at the later one is returned.

        Args:
            t: Times in [s], of any shape; a number gives a number.

        Raises:
            QueryError: If t is not a time.
        """
        time = times("t", t)
        early = time * (1 - _SAME)
        estimate = np.full(time.shape, inf)
        if len(self.t):
            later = np.searchsorted(self.t, early).clip(max=len(self.t) - 1)
            estimate = np.where(early <= self.until_s, self.error[later], inf)
        estimate = np.where(time >= 0, estimate, nan)
        return estimate if time.ndim else float(estimate)


def no_estimate(doubt: Doubt) -> ErrorEstimate:
    """Return an estimate without values, for the reason given."""
    return ErrorEstimate(np.empty(0), np.empty(0), 0.0, doubt, Verdict.NONE)
