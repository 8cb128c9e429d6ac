"""Independent random numbers, a row by its number: the counter-based generator Philox 4×64-10.

Source: Salmon, Moraes, Dror, Shaw, Parallel random numbers: as easy as 1, 2, 3, SC 2011.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import final

import numpy as np

from robot_dyn.tools.sweeps.designs.base import Design, source

_WORDS = 4  # numbers that Philox makes of one value of its counter


@final
@dataclass(frozen=True, eq=False)
class RandomRows(Design):
    """Independent rows: those of Monte Carlo."""

    @property
    def independent(self) -> bool:
        return True

    @cached_property
    def key(self) -> np.ndarray:
        """Of Philox, two words of 64 bits."""
        return philox_key(self.seed, 0)

    def _rows(self, start: int, stop: int) -> np.ndarray:
        return uniform(self.key, start, stop, self.dimensions)


def philox_key(seed: int, *use: int) -> np.ndarray:
    """A key of Philox for one use of a seed."""
    return source(seed, *use).generate_state(2, np.uint64)


def uniform(key: np.ndarray, start: int, stop: int, dimensions: int) -> np.ndarray:
    """Rows start, …, stop − 1 of independent multiples of 2⁻⁵³ in [0, 1), shape (stop − start, d)."""
    blocks = -(-dimensions // _WORDS)  # counters of a row: row i begins at i · blocks
    philox = np.random.Philox(key=key, counter=start * blocks)
    words = philox.random_raw((stop - start) * blocks * _WORDS).reshape(stop - start, blocks * _WORDS)
    return (words[:, :dimensions] >> np.uint64(11)) * 2.0**-53
