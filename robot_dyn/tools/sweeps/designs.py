"""Designs of experiments: N rows of d numbers in [0, 1), drawn once by `scipy.stats.qmc` or SALib and kept as a table.

    random                  independent rows
    sobol, halton, latin    16 independent scramblings, each of N/16 rows
    saltelli                16 scramblings of blocks of d + 2 rows, for Sobol' indices
    grid                    every combination of k levels: not random
    a table                 rows that are given: how they were drawn is not known

Row i belongs to scrambling (i mod 16), a block of "saltelli" as one row, so that the first rows hold a part of each.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from itertools import product
from typing import Any, final

import numpy as np

from robot_dyn.foundations import SweepError, Value, choice, integer, needs, numbers

SCRAMBLINGS = 16
"""Independent scramblings of a design, from which intervals come: Student's t with 15 degrees of freedom."""
MOST_ROWS = 10_000_000
NAMES = ("random", "sobol", "halton", "latin", "saltelli", "grid")
_BITS = 53  # of Sobol' numbers, exact in float64; SciPy's 30 would repeat values in long sweeps


@final
@dataclass(frozen=True, eq=False)
class Design(Value):
    """The rows of a design.

    Attributes:
        name: One of `NAMES`, or "table".
        rows: Numbers in [0, 1), shape (N, d).
        block: Consecutive rows that belong together: d + 2 of "saltelli", else 1.
    """

    name: str
    rows: np.ndarray = field(repr=False)
    block: int = 1

    def __post_init__(self) -> None:
        self.rows.setflags(write=False)

    @property
    def independent(self) -> bool:
        """Whether the rows are independent, so that formulas for independent runs hold."""
        return self.name == "random"

    @property
    def scrambling(self) -> np.ndarray:
        """The scrambling of each row, shape (N,); 0 everywhere if the design has none."""
        scramblings = SCRAMBLINGS if self.name in ("sobol", "halton", "latin", "saltelli") else 1
        return np.arange(len(self.rows)) // self.block % scramblings


def design(name: str | Any, runs: int, dimensions: int, seed: int = 0) -> Design:
    """Draw a design by its name, or take the rows that are given.

    Args:
        name: One of `NAMES`, or a table of numbers in [0, 1), shape (N, d).
        runs: N, the number of rows, 10 million at most.
        dimensions: d, the numbers of a row.
        seed: Of random numbers; with the same versions of SciPy and SALib the same seed gives the same rows.

    Raises:
        SweepError: If the name is unknown, or the design cannot have so many rows; names the two nearest counts.
    """
    runs = integer("runs", runs, least=1, most=MOST_ROWS, error=SweepError)
    d = integer("dimensions", dimensions, least=1, error=SweepError)
    seed = integer("seed", seed, error=SweepError)
    if isinstance(name, np.ndarray | list | tuple):
        return given(name, runs, d)
    name = choice("design", name, NAMES, error=SweepError)
    if name == "saltelli":
        return Design(name, _saltelli(runs, d, seed), d + 2)
    return Design(name, _DRAWN[name](runs, d, seed))


def given(table: Any, runs: int, dimensions: int, name: str = "table") -> Design:
    """The design of a table of rows; SweepError unless it has N rows of d numbers in [0, 1)."""
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
    return Design(name, rows, dimensions + 2 if name == "saltelli" else 1)


def _generators(seed: int) -> list[np.random.Generator]:
    """One generator a scrambling, independent of each other."""
    return list(map(np.random.default_rng, np.random.SeedSequence(seed).spawn(SCRAMBLINGS)))


def _random(runs: int, d: int, seed: int) -> np.ndarray:
    return np.random.default_rng(seed).random((runs, d))


def _scrambled(engine: Callable[..., Any]) -> Callable[[int, int, int], np.ndarray]:
    """Draw N/16 rows of each of 16 scramblings of an engine of SciPy, and take them in turns."""

    def draw(runs: int, d: int, seed: int) -> np.ndarray:
        each = [engine(d, generator).random(runs // SCRAMBLINGS) for generator in _generators(seed)]
        return np.minimum(np.stack(each, axis=1).reshape(runs, d), np.nextafter(1.0, 0.0))

    return draw


def _sobol(runs: int, d: int, seed: int) -> np.ndarray:
    from scipy.stats import qmc  # late: it takes a second

    _check_dimensions("sobol", d, qmc.Sobol.MAXDIM)
    _check_power("sobol", runs, SCRAMBLINGS, "16 scramblings of a balanced sequence")
    return _scrambled(lambda d, rng: qmc.Sobol(d, bits=_BITS, rng=rng))(runs, d, seed)


def _halton(runs: int, d: int, seed: int) -> np.ndarray:
    from scipy.stats import qmc

    _check_multiple("halton", runs, "16 scramblings")
    return _scrambled(lambda d, rng: qmc.Halton(d, rng=rng))(runs, d, seed)


def _latin(runs: int, d: int, seed: int) -> np.ndarray:
    from scipy.stats import qmc

    _check_multiple("latin", runs, "16 hypercubes")
    return _scrambled(lambda d, rng: qmc.LatinHypercube(d, rng=rng))(runs, d, seed)


def _saltelli(runs: int, d: int, seed: int) -> np.ndarray:
    """Blocks A, A with column j of B for every j, B, as SALib draws and analyses them."""
    from scipy.stats import qmc

    sample = needs("SALib.sample.sobol", extra="sweeps").sample
    _check_dimensions("saltelli", d, qmc.Sobol.MAXDIM // 2)  # A and B are one point of Sobol'
    _check_power("saltelli", runs, SCRAMBLINGS * (d + 2), f"16 scramblings of blocks of {d + 2} rows")
    problem = {"num_vars": d, "names": [f"x{j}" for j in range(d)], "bounds": [[0.0, 1.0]] * d}
    blocks = runs // (d + 2)
    each = [
        sample(problem, blocks // SCRAMBLINGS, calc_second_order=False, seed=generator)
        for generator in _generators(seed)
    ]
    rows = np.stack([x.reshape(-1, d + 2, d) for x in each], axis=1).reshape(runs, d)
    return np.minimum(rows, np.nextafter(1.0, 0.0))


def _grid(runs: int, d: int, seed: int) -> np.ndarray:
    """Levels (2m + 1) / 2k, m = 0, …, k − 1; the last dimension changes first."""
    k = round(runs ** (1 / d)) + 1
    while k**d > runs:
        k -= 1
    _check_count("grid", runs, f"a number of levels to the power of {d}", k**d, (k + 1) ** d)
    return np.array(list(product((np.arange(k) + 0.5) / k, repeat=d))).reshape(runs, d)


_DRAWN: Mapping[str, Callable[[int, int, int], np.ndarray]] = {
    "random": _random, "sobol": _sobol, "halton": _halton, "latin": _latin, "grid": _grid,
}  # fmt: skip


def _check_dimensions(name: str, d: int, most: int) -> None:
    if d > most:
        raise SweepError(f"design {name!r} takes at most {most} dimensions, got {d}")


def _check_count(name: str, runs: int, allowed: str, count: int, above: int) -> None:
    """Raise SweepError unless `runs` is the nearest count that is allowed; names it and the next one."""
    if runs != count:
        raise SweepError(f"design {name!r} takes {allowed}, got {runs} runs; nearest: {count} or {above}")


def _check_multiple(name: str, runs: int, why: str) -> None:
    """Raise SweepError unless `runs` is a multiple of the scramblings, and at least two times it."""
    count = max(runs // SCRAMBLINGS, 2) * SCRAMBLINGS
    allowed = f"a multiple of {SCRAMBLINGS}, {2 * SCRAMBLINGS} at least ({why})"
    _check_count(name, runs, allowed, count, count + SCRAMBLINGS)


def _check_power(name: str, runs: int, of: int, why: str) -> None:
    """Raise SweepError unless `runs` is a number times a power of two, at least two times it."""
    count = of << max((runs // of).bit_length() - 1, 1)
    _check_count(name, runs, f"{of} times a power of two, {2 * of} at least ({why})", count, 2 * count)
