"""A full factorial design: every combination of k levels in each of d dimensions, at the middle of their cells."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np

from robot_dyn.tools.sweeps.designs.base import Design, check_count


@final
@dataclass(frozen=True, eq=False)
class Grid(Design):
    """kᵈ rows (2m + 1) / 2k, m = 0, …, k − 1; the last dimension changes first. They are not random."""

    def __post_init__(self) -> None:
        count, above = (levels**self.dimensions for levels in (self.levels, self.levels + 1))
        check_count("grid", self.runs, f"a number of levels to the power of {self.dimensions}", count, above)

    @property
    def levels(self) -> int:
        """k, the largest for which kᵈ ≤ N."""
        k = round(self.runs ** (1 / self.dimensions)) + 1
        while k**self.dimensions > self.runs:
            k -= 1
        return k

    def _rows(self, start: int, stop: int) -> np.ndarray:
        k, i = self.levels, np.arange(start, stop)
        rows = np.empty((len(i), self.dimensions))
        for j in reversed(range(self.dimensions)):
            i, m = np.divmod(i, k)
            rows[:, j] = (m + 0.5) / k
        return rows
