"""Sobol' points with random linear scrambling and digital shift: direction numbers are SciPy's.

    x_i = 2⁻⁵³ (s ⊕ v_k1 ⊕ v_k2 ⊕ …),    k1, k2, …: bits of the Gray code i ⊕ ⌊i/2⌋

s is the shift and v_k are the scrambled direction numbers. Numbers of 53 bits are exact in float64; SciPy's default of
30 bits would repeat values, 0 among them, in long sweeps.

Sources: Joe, Kuo, Constructing Sobol' sequences with better two-dimensional projections, SIAM J. Sci. Comput. 30, 2008;
Matoušek, On the L2-discrepancy for anchored boxes, J. Complexity 14, 1998.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, final

import numpy as np

from robot_dyn.foundations import SweepError
from robot_dyn.tools.sweeps.designs.base import REPLICATES, Replicated, check_power, source

BITS = 53
_LOW = 6  # bits of the number of a point within a block
MOST_DIMENSIONS = 21201  # of the table of Joe and Kuo


@final
@dataclass(frozen=True, eq=False)
class Sobol(Replicated):
    """16 scramblings of the first N/16 points of the Sobol' sequence; N/16 is a power of two."""

    def __post_init__(self) -> None:
        if self.dimensions > MOST_DIMENSIONS:
            raise SweepError(f"design 'sobol' takes at most {MOST_DIMENSIONS} dimensions, got {self.dimensions}")
        check_power("sobol", self.runs, REPLICATES, "16 scramblings of a balanced sequence")

    @cached_property
    def scramblings(self) -> tuple[np.ndarray, np.ndarray]:
        """Scrambled direction numbers, shape (53, 16 d), and shifts, shape (16 d,)."""
        parts = [_scrambling(self.seed, replicate, self.dimensions) for replicate in range(REPLICATES)]
        return np.concatenate([v for v, _ in parts], axis=1), np.concatenate([s for _, s in parts])

    def points_of_all(self, start: int, stop: int) -> np.ndarray:
        x = sobol_points(*self.scramblings, start, stop, (self.points - 1).bit_length())
        return x.reshape(-1, REPLICATES, self.dimensions)


def sobol_points(v: np.ndarray, s: np.ndarray, start: int, stop: int, bits: int) -> np.ndarray:
    """Points start, …, stop − 1; `bits` of their numbers are looked at, so that all cost the same.

    The Gray code is linear in the bits: a point is the sum, ⊕, of one of a block and one of the blocks.
    """
    first, last = start >> _LOW, (stop - 1) >> _LOW
    blocks = _combined(np.arange(first, last + 1) << _LOW, v, bits)
    x = blocks[:, None] ^ (_combined(np.arange(1 << _LOW), v, _LOW) ^ s)
    return x.reshape(-1, len(s))[start - (first << _LOW) : stop - (first << _LOW)] * 2.0**-BITS


def _combined(i: np.ndarray, v: np.ndarray, bits: int) -> np.ndarray:
    """v_k1 ⊕ v_k2 ⊕ … of the bits of the Gray codes of i, shape (len(i), d)."""
    gray = (i ^ (i >> 1)).astype(np.uint64)
    x = np.zeros((len(i), v.shape[1]), np.uint64)
    for k in range(bits):
        x ^= ((gray >> np.uint64(k)) & np.uint64(1))[:, None] * v[k]
    return x


def scipy_sobol(seed: int, replicate: int, dimensions: int) -> Any:
    """SciPy's engine of one scrambling, at its first point."""
    from scipy.stats import qmc  # late: it takes a second

    return qmc.Sobol(dimensions, bits=BITS, rng=np.random.default_rng(source(seed, replicate)))


def _scrambling(seed: int, replicate: int, dimensions: int) -> tuple[np.ndarray, np.ndarray]:
    engine = scipy_sobol(seed, replicate, dimensions)
    v, s = engine._sv.T, engine._shift.copy()
    # these attributes are not documented by SciPy: its own points are the check
    if not np.array_equal(engine.random(8), sobol_points(v, s, 0, 8, 3)):
        raise SweepError("this version of SciPy keeps direction numbers of Sobol' in another form; use SciPy 1.17")
    return v, s
