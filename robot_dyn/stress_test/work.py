"""Work within a time: each piece has a name, and what is not done, or not to its end, is kept by that name."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar, final

import numpy as np

from robot_dyn.accuracy.budget import OvertimeError
from robot_dyn.accuracy.deadline import NEVER, Deadline
from robot_dyn.errors import RobotDynError

T = TypeVar("T")
_REASONS = {
    np.linalg.LinAlgError: "; M is near a singular one",
    FloatingPointError: "; its numbers are beyond those of a float64",
}


@final
class Work:
    """Pieces of work, one after the other.

    Args:
        deadline: Of all of them.
        longest_s: Time that one piece may take, in [s].
        tell: Called with the name of each piece when it begins.

    Attributes:
        out_of_time: Names of the pieces that were not begun, or were ended, for lack of time.
        left_out: Names of those that have no answer, and why.
    """

    def __init__(
        self, deadline: Deadline = NEVER, longest_s: float = np.inf, tell: Callable[[str], object] = lambda name: None
    ) -> None:
        self._deadline, self._longest_s, self._tell = deadline, longest_s, tell
        self.out_of_time: list[str] = []
        self.left_out: list[str] = []

    def do(self, name: str, piece: Callable[[Deadline], T], needed_for: tuple[str, ...] = ()) -> T | None:
        """What a piece gives, called with its deadline; None if it was not done, or not to its end.

        Args:
            name: Of the piece.
            piece: The work.
            needed_for: Names of the pieces that cannot be done without it.
        """
        if self.over:
            self.skip(name, *needed_for)
            return None
        self._tell(name)
        try:
            with np.errstate(over="raise", divide="raise", invalid="raise"):
                return piece(self._deadline.within(self._longest_s))
        except OvertimeError:
            self.skip(name, *needed_for)
        except (RobotDynError, np.linalg.LinAlgError, FloatingPointError) as error:
            why = next((why for kind, why in _REASONS.items() if isinstance(error, kind)), "")
            self.left_out.append(f"{name}: {error}{why}")
            if needed_for:
                self.left_out.append(f"{', '.join(needed_for)}: not without {name}")
        return None

    @property
    def over(self) -> bool:
        """Whether there is no time left."""
        return self._deadline.passed

    def skip(self, *names: str) -> None:
        """Name pieces that are not done for lack of time."""
        self.out_of_time += names
