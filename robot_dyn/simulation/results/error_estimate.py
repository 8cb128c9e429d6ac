"""The estimated error of a run, and what the estimate rests on."""

from __future__ import annotations

from dataclasses import dataclass
from enum import StrEnum
from typing import Annotated, final

import numpy as np

from robot_dyn.foundations.values import Layout, Value, read_only


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
        resolved_until: Time up to which it holds, in [s].
        note: Why it ends there, or why no error is estimated, and what to do; empty if it holds to the end of the run.
        verdict: What it rests on at `resolved_until`.
        reason: Why an error that is bounded shows no order.
    """

    t: Annotated[np.ndarray, Layout(("k",))]
    error: Annotated[np.ndarray, Layout(("k",), finite=False)]
    resolved_until: float
    note: str = ""
    verdict: Verdict = Verdict.ORDER
    reason: str = ""

    def __post_init__(self) -> None:
        read_only(self)

    def __str__(self) -> str:
        if not self.resolved_until > 0:
            return f"not estimated; {self.note}"
        figure = f"{self.final:.1e}" if self.verdict is Verdict.ORDER else f"about {self.final:.1e}"
        if self.note:
            figure += f" up to t = {self.resolved_until:g} s"
        reason = f": {self.reason}" if self.reason else ""
        return f"{figure} ({self.verdict}{reason})" + (f"; after that none: {self.note}" if self.note else "")

    def __repr__(self) -> str:
        return f"<ErrorEstimate: {self}>"

    @property
    def final(self) -> float:
        """The largest error up to `resolved_until`; nan if nothing is resolved."""
        known = self.error[self.t <= self.resolved_until]
        return float(known.max()) if len(known) else float("nan")


def no_estimate(note: str) -> ErrorEstimate:
    """The estimate where there is none, with the reason."""
    return ErrorEstimate(np.empty(0), np.empty(0), 0.0, note, Verdict.NONE)
