"""The estimated error of a run, and what the estimate rests on."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from math import inf, nan
from typing import Annotated, Any, final, overload

import numpy as np

from robot_dyn.foundations.store import Layout
from robot_dyn.foundations.validate import times
from robot_dyn.foundations.values import Value, read_only

_SAME = 8 * np.finfo(float).eps  # of a time: samples of one time, computed in two ways


class Verdict(StrEnum):
    """What an estimate rests on."""

    ORDER = "order seen"
    BOUND = "bounded"
    NONE = "none"


@final
@dataclass(frozen=True, eq=False, repr=False)
class ErrorEstimate(Value):
    """Estimated error of positions, the largest over the joints, in [rad] or [m].

    Attributes:
        t: Times of the estimate, (k,), in [s].
        error: Estimate of |q_h − q|, the largest up to each time, (k,).
        until_s: Time up to which the estimate holds, in [s]; 0 if no error is estimated.
        note: Why it ends there, or why no error is estimated, and what to do; empty if it holds to the end of the run.
        verdict: Basis of the estimate at `until_s`.
        reason: Why an error that is bounded shows no order.
    """

    t: Annotated[np.ndarray, Layout(("k",))]
    error: Annotated[np.ndarray, Layout(("k",), finite=False)]
    until_s: float
    note: str = ""
    verdict: Verdict = Verdict.ORDER
    reason: str = ""

    def __post_init__(self) -> None:
        read_only(self)

    def __str__(self) -> str:
        if not self.until_s > 0:
            return f"not estimated; {self.note}"
        last = self.at(self.until_s)
        figure = f"{last:.1e}" if self.verdict is Verdict.ORDER else f"about {last:.1e}"
        if self.note:
            figure += f" up to t = {self.until_s:g} s"
        reason = f": {self.reason}" if self.reason else ""
        return f"{figure} ({self.verdict}{reason})" + (f"; after that none: {self.note}" if self.note else "")

    def __repr__(self) -> str:
        return f"<ErrorEstimate: {self}>"

    @property
    def largest(self) -> float:
        """Largest estimated error over the run; inf if the estimate ends before the run does."""
        return inf if self.note else self.at(self.until_s)

    @overload
    def at(self, t: float) -> float: ...
    @overload
    def at(self, t: np.ndarray | Sequence[Any]) -> np.ndarray: ...
    def at(self, t: Any) -> Any:
        """Return the estimate of the largest error up to time(s) t, in [rad] or [m].

        It is inf after `until_s`, and at all times if no error is estimated; nan for a time before 0, or a t of nan.
        Between two times of the estimate it is that of the later one.

        Args:
            t: Times in [s], of any shape; a number gives a number.

        Raises:
            QueryError: If t is not a time.
        """
        known = times("t", t)
        early = known * (1 - _SAME)
        estimate = np.full(known.shape, inf)
        if len(self.t):
            later = np.searchsorted(self.t, early).clip(max=len(self.t) - 1)
            estimate = np.where(early <= self.until_s, self.error[later], inf)
        estimate = np.where(known >= 0, estimate, nan)
        return estimate if known.ndim else float(estimate)


def no_estimate(note: str) -> ErrorEstimate:
    """The estimate where there is none, with the reason."""
    return ErrorEstimate(np.empty(0), np.empty(0), 0.0, note, Verdict.NONE)
