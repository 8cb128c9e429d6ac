"""Designs of experiments: N rows of d numbers in [0, 1), drawn once by `scipy.stats.qmc` or SALib and kept as a table.

    random                  independent rows
    sobol, halton, latin    16 independent scramblings of N/16 rows
    saltelli                16 scramblings of blocks of d + 2 rows, for Sobol' indices
    grid                    every combination of k levels: not random
    a table                 rows from the user, of unknown origin

Row i belongs to scrambling (i mod 16), where a block of "saltelli" counts as one row, so that the first rows include
all scramblings.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import product
from typing import final

import numpy as np
from numpy.typing import ArrayLike

from robot_dyn.foundations import SweepError, Value, choice, integer, needs, numbers

SCRAMBLINGS = 16
"""Independent scramblings of a design, from which intervals come: Student's t with 15 degrees of freedom."""
MOST_ROWS = 10_000_000
NAMES = ("random", "sobol", "halton", "latin", "saltelli", "grid")
_BITS = 53  # bits of Sobol' numbers, exact in float64; SciPy's 30 would repeat values in long sweeps


@final
@dataclass(frozen=True, eq=False)
class Design(Value):
    """The rows of a design.

    Attributes:
        name: One of `NAMES`, or "table".
        rows: Numbers in [0, 1), shape (N, d).
        block: Number of consecutive rows that belong together: d + 2 for "saltelli", else 1.
    """

    name: str
    rows: np.ndarray = field(repr=False)
    block: int = 1

    def __post_init__(self) -> None:
        self.rows.setflags(write=False)

    @property
    def independent(self) -> bool:
        """True if the rows are independent, so that formulas for independent runs hold."""
        return self.name == "random"

    @property
    def scrambling(self) -> np.ndarray:
        """The scrambling of each row, shape (N,); 0 everywhere if the design has none."""
        scramblings = SCRAMBLINGS if self.name in ("sobol", "halton", "latin", "saltelli") else 1
        return np.arange(len(self.rows)) // self.block % scramblings


def design(name: ArrayLike, runs: int, dimensions: int, seed: int = 0) -> Design:
    """Draw a design by name, or use a table of rows.

    Args:
        name: One of `NAMES`, or a table of numbers in [0, 1), shape (N, d).
        runs: N, the number of rows, at most 10 million.
        dimensions: d, the number of columns.
        seed: Seed of random numbers; with the same versions of SciPy and SALib the same seed gives the same rows.

    Raises:
        SweepError: If the name is unknown, or the design cannot have N rows; the message has the two nearest counts.
    """
    runs = integer("runs", runs, least=1, most=MOST_ROWS, error=SweepError)
    if isinstance(name, np.ndarray | list | tuple):
        return from_table(name, runs, dimensions)
    name = choice("design", name, NAMES, error=SweepError)
    return _design(name, _drawn(name, runs, dimensions, seed))


def from_table(table: ArrayLike, runs: int, dimensions: int, name: str = "table") -> Design:
    """Return the design of a table of rows; raise a SweepError unless it has N rows of d numbers in [0, 1)."""
    rows = numbers("the table of a design", table, ("N", "d"), error=SweepError, least=0.0)
    if (rows >= 1).any():
        row, column = np.argwhere(rows >= 1)[0]
        raise SweepError(
            f"a table of a design has numbers in [0, 1), got {rows[row, column]:g} in row {row}, column {column}"
        )
    if rows.shape != (runs, dimensions):
        raise SweepError(
            f"the table of the design has {rows.shape[0]} rows of {rows.shape[1]} numbers,"
            f" the sweep {runs} runs of {dimensions}"
        )
    return _design(name, rows)


def _design(name: str, rows: np.ndarray) -> Design:
    return Design(name, rows, rows.shape[1] + 2 if name == "saltelli" else 1)


def _drawn(name: str, runs: int, d: int, seed: int) -> np.ndarray:
    """Draw the rows of a design, (N, d)."""
    if name == "random":
        return np.random.default_rng(seed).random((runs, d))
    if name == "grid":
        return _grid(runs, d)
    block = d + 2 if name == "saltelli" else 1
    draw = _engine(name, d)
    _check_scrambled(name, runs, SCRAMBLINGS * block)
    seeds = np.random.SeedSequence(seed).spawn(SCRAMBLINGS)
    rows = [draw(runs // block // SCRAMBLINGS, np.random.default_rng(child)) for child in seeds]
    return np.minimum(np.stack([x.reshape(-1, block, d) for x in rows], 1).reshape(runs, d), np.nextafter(1.0, 0.0))


def _engine(name: str, d: int) -> Callable[[int, np.random.Generator], np.ndarray]:
    """Return a function that draws points, or blocks of "saltelli", of one scrambling."""
    from scipy.stats import qmc  # imported here because it takes a second

    most = {"sobol": qmc.Sobol.MAXDIM, "saltelli": qmc.Sobol.MAXDIM // 2}.get(name, d)  # A and B are one point
    if d > most:
        raise SweepError(f"design {name!r} takes at most {most} dimensions, got {d}")
    if name == "saltelli":  # blocks A, A with column j of B for every j, B
        sample = needs("SALib.sample.sobol", extra="sweeps").sample
        problem = {"num_vars": d, "names": [f"x{j}" for j in range(d)], "bounds": [[0.0, 1.0]] * d}
        return lambda count, rng: sample(problem, count, calc_second_order=False, seed=rng)
    if name == "sobol":
        return lambda count, rng: qmc.Sobol(d, bits=_BITS, rng=rng).random(count)
    engine = qmc.Halton if name == "halton" else qmc.LatinHypercube
    return lambda count, rng: engine(d, rng=rng).random(count)


def _check_scrambled(name: str, runs: int, unit: int) -> None:
    """Raise a SweepError unless each scrambling has at least 2 points or blocks, or a power of two for balance."""
    if name in ("sobol", "saltelli"):
        count = unit << max((runs // unit).bit_length() - 1, 1)
        _check_count(name, runs, f"{unit} times a power of two, {2 * unit} at least", count, 2 * count)
    else:
        count = max(runs // unit, 2) * unit
        _check_count(name, runs, f"a multiple of {unit}, {2 * unit} at least", count, count + unit)


def _check_count(name: str, runs: int, allowed: str, count: int, above: int) -> None:
    """Raise a SweepError unless `runs` is the nearest allowed count; the message has this count and the next one."""
    if runs != count:
        raise SweepError(f"design {name!r} takes {allowed}, got {runs} runs; nearest: {count} or {above}")


def _grid(runs: int, d: int) -> np.ndarray:
    """Return levels (2m + 1) / 2k, m = 0, …, k − 1; the last dimension changes first."""
    k = round(runs ** (1 / d)) + 1
    while k**d > runs:
        k -= 1
    _check_count("grid", runs, f"a number of levels to the power of {d}", k**d, (k + 1) ** d)
    return np.array(list(product((np.arange(k) + 0.5) / k, repeat=d))).reshape(runs, d)
