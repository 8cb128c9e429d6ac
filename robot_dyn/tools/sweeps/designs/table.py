"""A user-defined design: the rows of a table."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import final

import numpy as np

from robot_dyn.foundations import SweepError, numbers
from robot_dyn.tools.sweeps.designs.base import Design


@final
@dataclass(frozen=True, eq=False)
class Table(Design):
    """Rows that are given. How they were drawn is not known, so that statistics of them have no interval.

    Attributes:
        table: Numbers in [0, 1), shape (N, d).
    """

    table: np.ndarray = field(repr=False)

    def __post_init__(self) -> None:
        table = numbers("the table of a design", self.table, ("N", "d"), error=SweepError, least=0.0)
        if (table >= 1).any():
            row, column = np.argwhere(table >= 1)[0]
            raise SweepError(
                f"a table of a design has numbers in [0, 1), got {table[row, column]:g} in row {row}, column {column}"
            )
        if table.shape != (self.runs, self.dimensions):
            raise SweepError(
                f"the table of the design has {table.shape[0]} rows of {table.shape[1]} numbers,"
                f" the sweep {self.runs} runs of {self.dimensions}"
            )
        object.__setattr__(self, "table", table)

    def _rows(self, start: int, stop: int) -> np.ndarray:
        return self.table[start:stop].copy()
