"""Work within a time limit: each piece has a name, and the pieces that were skipped or not finished are listed."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar, final

import numpy as np

from robot_dyn import RobotDynError
from robot_dyn.report import Budget, OvertimeError

T = TypeVar("T")
FAILURES = (RobotDynError, np.linalg.LinAlgError, FloatingPointError)
_REASONS = {
    np.linalg.LinAlgError: "; M is nearly singular",
    FloatingPointError: "; numbers exceed the range of float64",
}


@final
class Work:
    """Pieces of work, run one after another.

    Args:
        budget: Time budget for all pieces; the name of each piece is reported to it when the piece starts.
        longest_s: Time limit for one piece, in [s].

    Attributes:
        out_of_time: Names of the pieces that were skipped or cut short for lack of time.
        left_out: Names of the pieces that failed, with the reason.
    """

    def __init__(self, budget: Budget | None = None, longest_s: float = np.inf) -> None:
        self._budget, self._longest_s = budget or Budget(), longest_s
        self.out_of_time: list[str] = []
        self.left_out: list[str] = []

    def do(self, name: str, piece: Callable[[Budget], T], needed_for: tuple[str, ...] = ()) -> T | None:
        """Call a piece with its budget and return the result; None if it was skipped or did not finish.

        Args:
            name: Name of the piece.
            piece: The function to call.
            needed_for: Names of the pieces that depend on this one.
        """
        if self.over:
            self.skip(name, *needed_for)
            return None
        self._budget.report(name)
        try:
            with np.errstate(over="raise", divide="raise", invalid="raise"):
                return piece(self._budget.within(self._longest_s))
        except OvertimeError:
            self.skip(name, *needed_for)
        except FAILURES as error:
            why = next((why for kind, why in _REASONS.items() if isinstance(error, kind)), "")
            self.left_out.append(f"{name}: {error}{why}")
            if needed_for:
                self.left_out.append(f"{', '.join(needed_for)}: needs {name}")
        return None

    @property
    def over(self) -> bool:
        """True if no time remains."""
        return self._budget.left <= 0

    def skip(self, *names: str) -> None:
        """Record pieces that are skipped for lack of time."""
        self.out_of_time += names
