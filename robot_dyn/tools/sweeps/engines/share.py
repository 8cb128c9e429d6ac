"""The chunks of one job of an array: "3/16" is the third of 16 jobs, which need no scheduler between them."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Any, final

import numpy as np

from robot_dyn.foundations import SweepError, shown


@final
@dataclass(frozen=True)
class Share:
    """The chunks whose number is job − 1 modulo jobs.

    Attributes:
        job: From 1 on.
        jobs: How many there are.
    """

    job: int
    jobs: int

    def of(self, chunks: np.ndarray) -> np.ndarray:
        """Which of these chunks are its own."""
        return chunks[chunks % self.jobs == self.job - 1]


def share(given: Any) -> Share:
    """The share of a text such as "3/16"; None for all chunks.

    Raises:
        SweepError: If it is not one.
    """
    if given is None:
        return Share(1, 1)
    found = re.fullmatch(r"(\d{1,6})/(\d{1,6})", given) if isinstance(given, str) else None
    if found is None or not 1 <= int(found[1]) <= int(found[2]):
        raise SweepError(f"share: give job and number of jobs, such as '3/16' for the third of 16, got {shown(given)}")
    return Share(int(found[1]), int(found[2]))
