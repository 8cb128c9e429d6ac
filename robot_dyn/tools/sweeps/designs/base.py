"""What all designs have in common: a number of rows in the unit cube, each computed from its own number."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np

from robot_dyn.foundations import SweepError, Value, integer

REPLICATES = 16
"""Independent scramblings of a design, from which intervals come: Student's t with 15 degrees of freedom."""


@dataclass(frozen=True, eq=False)
class Design(Value, ABC):
    """N rows of d numbers in [0, 1); each entry of a random design is uniformly distributed.

    Row i belongs to scrambling (i mod R), so that the first rows hold a part of every scrambling.

    Attributes:
        runs: N, the number of rows.
        dimensions: d, the numbers of a row.
        seed: Of random numbers.
    """

    runs: int
    dimensions: int
    seed: int

    @property
    def replicates(self) -> int:
        """R, the number of independent scramblings; 1 for other designs."""
        return 1

    @property
    def independent(self) -> bool:
        """Whether the rows are independent, so that formulas for independent runs hold."""
        return False

    def replicate_of(self, i: np.ndarray | int) -> np.ndarray:
        """The scrambling of rows i, whole numbers in [0, R), shape as i."""
        return np.asarray(i, np.int64) % self.replicates

    def rows(self, start: int, stop: int) -> np.ndarray:
        """Rows start, …, stop − 1, shape (stop − start, d).

        Raises:
            SweepError: If the design does not have these rows.
        """
        stop = integer("stop", stop, most=self.runs, error=SweepError)
        start = integer("start", start, most=stop, error=SweepError)
        return self._rows(start, stop)

    @abstractmethod
    def _rows(self, start: int, stop: int) -> np.ndarray:
        """Rows that the design has."""


@dataclass(frozen=True, eq=False)
class Replicated(Design):
    """A design of 16 independent scramblings of a sequence of N/16 points."""

    @property
    def replicates(self) -> int:
        return REPLICATES

    @property
    def points(self) -> int:
        """N/16, of one scrambling."""
        return self.runs // REPLICATES

    def _rows(self, start: int, stop: int) -> np.ndarray:
        if start == stop:
            return np.empty((0, self.dimensions))
        first, last = start // REPLICATES, (stop - 1) // REPLICATES
        rows = self.points_of_all(first, last + 1).reshape(-1, self.dimensions)
        return rows[start - first * REPLICATES : stop - first * REPLICATES]

    @abstractmethod
    def points_of_all(self, start: int, stop: int) -> np.ndarray:
        """Points start, …, stop − 1 of every scrambling, shape (stop − start, 16, d)."""


def source(seed: int, *use: int) -> np.random.SeedSequence:
    """The source of random numbers of one use: of a scrambling, of a dimension; each independent of the others."""
    return np.random.SeedSequence(seed, spawn_key=use)


def check_count(design: str, runs: int, allowed: str, count: int, above: int) -> None:
    """Raise SweepError unless `runs` is the nearest count that is allowed; names it and the next one."""
    if runs != count:
        raise SweepError(f"design {design!r} takes {allowed}, got {runs} runs; nearest: {count} or {above}")


def check_multiple(design: str, runs: int, of: int, why: str) -> None:
    """Raise SweepError unless `runs` is a multiple of a number, and at least two times it."""
    count = max(runs // of, 2) * of
    check_count(design, runs, f"a multiple of {of}, {2 * of} at least ({why})", count, count + of)


def check_power(design: str, runs: int, of: int, why: str) -> None:
    """Raise SweepError unless `runs` is a number times a power of two, at least two times it."""
    count = of << max((runs // of).bit_length() - 1, 1)
    check_count(design, runs, f"{of} times a power of two, {2 * of} at least ({why})", count, 2 * count)
