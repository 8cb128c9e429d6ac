"""Latin hypercubes: in every dimension each of the n strata [k/n, (k+1)/n) holds one point.

    x_ij = (π_j(i) + w_ij) / n

π_j is a permutation of 0, …, n − 1 that is computed by number: a Feistel network on pairs (l, r) = divmod(i, b) of
numbers below a and b, where a b ≥ n is just large enough; what falls outside n is mapped again (cycle walking).

Sources: McKay, Beckman, Conover, Technometrics 21, 1979; Black, Rogaway, Ciphers with arbitrary finite domains, CT-RSA
2002.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import isqrt
from typing import final

import numpy as np

from robot_dyn.tools.sweeps.designs.base import REPLICATES, Replicated, check_multiple, source
from robot_dyn.tools.sweeps.designs.random_rows import philox_key, uniform

ROUNDS = 12  # an even number: the halves have their sizes again; 8 favour some permutations of 5 points
_BELOW_ONE = np.nextafter(1.0, 0.0)


@final
@dataclass(frozen=True, eq=False)
class Latin(Replicated):
    """16 independent Latin hypercubes of N/16 points."""

    def __post_init__(self) -> None:
        check_multiple("latin", self.runs, REPLICATES, "16 hypercubes")

    @cached_property
    def keys(self) -> np.ndarray:
        """Of the permutations, shape (rounds, 16 d)."""
        columns = REPLICATES * self.dimensions
        return source(self.seed, 0).generate_state(ROUNDS * columns, np.uint64).reshape(ROUNDS, columns)

    @cached_property
    def jitter_key(self) -> np.ndarray:
        """Of the places within the strata."""
        return philox_key(self.seed, 1)

    def points_of_all(self, start: int, stop: int) -> np.ndarray:
        strata = permuted(np.arange(start, stop, dtype=np.uint64), self.points, self.keys)
        x = (strata + uniform(self.jitter_key, start, stop, strata.shape[1])) / self.points
        return np.minimum(x, _BELOW_ONE).reshape(-1, REPLICATES, self.dimensions)  # the last stratum, rounded


def permuted(i: np.ndarray, n: int, keys: np.ndarray) -> np.ndarray:
    """π(i) of numbers i < n, shape (len(i), m), by m permutations of 0, …, n − 1; keys have shape (rounds, m)."""
    a = isqrt(n - 1) + 1
    b = -(-n // a)
    y = _feistel(np.repeat(i[:, None], keys.shape[1], axis=1), a, b, keys)
    while (outside := y >= n).any():
        column = np.nonzero(outside)[1]
        y[outside] = _feistel(y[outside], a, b, keys[:, column])
    return y


def _feistel(i: np.ndarray, a: int, b: int, keys: np.ndarray) -> np.ndarray:
    """A permutation of 0, …, a b − 1."""
    moduli = np.array([a, b], np.uint64)
    left, right = np.divmod(i, moduli[1])
    for k, key in enumerate(keys):
        left, right = right, (left + _hash(right ^ key)) % moduli[k % 2]
    return left * moduli[1] + right


def _hash(x: np.ndarray) -> np.ndarray:
    """The upper half of the 64 bits of splitmix64, whose products wrap around."""
    x = (x ^ (x >> np.uint64(30))) * np.uint64(0xBF58476D1CE4E5B9)
    x = (x ^ (x >> np.uint64(27))) * np.uint64(0x94D049BB133111EB)
    return (x ^ (x >> np.uint64(31))) >> np.uint64(32)
