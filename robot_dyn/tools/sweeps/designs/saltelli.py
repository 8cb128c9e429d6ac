"""The design of Saltelli for Sobol' indices: of each pair of rows A and B, also A with column j of B, for every j.

    row i:  A if i mod (d + 2) = 0,  B if 1,  A with column j of B if j + 2

Pairs (A, B) are scrambled Sobol' points in 2d dimensions; all rows of a pair belong to one scrambling.

Source: Saltelli et al., Variance based sensitivity analysis of model output, Comput. Phys. Commun. 181, 2010.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import final

import numpy as np

from robot_dyn.tools.sweeps.designs.base import REPLICATES, Design, check_power
from robot_dyn.tools.sweeps.designs.sobol import Sobol


@final
@dataclass(frozen=True, eq=False)
class Saltelli(Design):
    """N / (d + 2) pairs of rows, in 16 scramblings; N / (d + 2) / 16 is a power of two."""

    def __post_init__(self) -> None:
        check_power("saltelli", self.runs, REPLICATES * self.block, f"16 scramblings of {self.block} rows a pair")

    @property
    def block(self) -> int:
        """Rows of a pair, d + 2."""
        return self.dimensions + 2

    @property
    def replicates(self) -> int:
        return REPLICATES

    @cached_property
    def pairs(self) -> Sobol:
        """Rows (A, B), of 2d numbers."""
        return Sobol(self.runs // self.block, 2 * self.dimensions, self.seed)

    def replicate_of(self, i: np.ndarray | int) -> np.ndarray:
        return self.pairs.replicate_of(np.asarray(i, np.int64) // self.block)

    def _rows(self, start: int, stop: int) -> np.ndarray:
        pair, kind = np.divmod(np.arange(start, stop), self.block)
        if not len(pair):
            return np.empty((0, self.dimensions))
        both = self.pairs.rows(int(pair[0]), int(pair[-1]) + 1)[pair - pair[0]]
        A, B = both[:, : self.dimensions], both[:, self.dimensions :]
        of_B = (kind[:, None] == 1) | (kind[:, None] - 2 == np.arange(self.dimensions))
        return np.where(of_B, B, A)
