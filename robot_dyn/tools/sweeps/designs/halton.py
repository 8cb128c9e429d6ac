"""Halton points with random permutations of their digits: permutations are SciPy's.

    x_ij = Σ_k π_jk(digit k of i in base b_j) b_j^−(k+1),    b_j: the first d primes

Source: Owen, A randomized Halton algorithm in R, arXiv:1706.02808, 2017.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, final

import numpy as np

from robot_dyn.foundations import SweepError
from robot_dyn.tools.sweeps.designs.base import REPLICATES, Replicated, check_multiple, source

Permutations = list[np.ndarray]  # by dimension, shape (digits, base, R), of R scramblings


@final
@dataclass(frozen=True, eq=False)
class Halton(Replicated):
    """16 scramblings of the first N/16 points of the Halton sequence."""

    def __post_init__(self) -> None:
        check_multiple("halton", self.runs, REPLICATES, "16 scramblings")

    @cached_property
    def scramblings(self) -> Permutations:
        """The permutations of all scramblings."""
        parts = [_permutations(self.seed, replicate, self.dimensions) for replicate in range(REPLICATES)]
        return [np.concatenate(of_dimension, axis=2) for of_dimension in zip(*parts, strict=True)]

    def points_of_all(self, start: int, stop: int) -> np.ndarray:
        return halton_points(self.scramblings, start, stop, self.points)


def halton_points(permutations: Permutations, start: int, stop: int, points: int) -> np.ndarray:
    """Points start, …, stop − 1 of so many, shape (stop − start, R, d), of R scramblings."""
    x = np.zeros((stop - start, permutations[0].shape[2], len(permutations)))
    for j, of_digits in enumerate(permutations):
        base = of_digits.shape[1]
        quotient, weight, largest = np.arange(start, stop), 1.0 / base, points - 1
        for permutation in of_digits:  # in the order of SciPy, which fixes the rounding
            if largest:
                quotient, digit = np.divmod(quotient, base)
                x[:, :, j] += permutation[digit] * weight
            else:  # this digit of every point is 0
                x[:, :, j] += permutation[0] * weight
            weight, largest = weight / base, largest // base
    return x


def scipy_halton(seed: int, replicate: int, dimensions: int) -> Any:
    """SciPy's engine of one scrambling, at its first point."""
    from scipy.stats import qmc  # late: it takes a second

    return qmc.Halton(dimensions, rng=np.random.default_rng(source(seed, replicate)))


def _permutations(seed: int, replicate: int, dimensions: int) -> Permutations:
    engine = scipy_halton(seed, replicate, dimensions)
    permutations = [np.asarray(each, np.int64)[:, :, None] for each in engine._permutations]
    # this attribute is not documented by SciPy: its own points are the check
    if not np.array_equal(engine.random(8), halton_points(permutations, 0, 8, 8)[:, 0]):
        raise SweepError("this version of SciPy keeps permutations of Halton in another form; use SciPy 1.17")
    return permutations
