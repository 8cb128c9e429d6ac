"""Designs by name."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from robot_dyn.foundations import SweepError, choice, integer
from robot_dyn.tools.sweeps.designs.base import Design
from robot_dyn.tools.sweeps.designs.grid import Grid
from robot_dyn.tools.sweeps.designs.halton import Halton
from robot_dyn.tools.sweeps.designs.latin import Latin
from robot_dyn.tools.sweeps.designs.random_rows import RandomRows
from robot_dyn.tools.sweeps.designs.saltelli import Saltelli
from robot_dyn.tools.sweeps.designs.sobol import Sobol
from robot_dyn.tools.sweeps.designs.table import Table

DESIGNS: Mapping[str, type[Design]] = {
    "random": RandomRows,
    "sobol": Sobol,
    "halton": Halton,
    "latin": Latin,
    "saltelli": Saltelli,
    "grid": Grid,
}
_MOST_RUNS = 2**48  # run numbers, products with them and strata stay exact


def design(name: str | Any, runs: int, dimensions: int, seed: int = 0) -> Design:
    """A design by its name, or one whose rows are given.

    Args:
        name: "random", "sobol", "halton", "latin", "saltelli" or "grid", or a table of numbers in [0, 1), shape (N, d).
        runs: N, the number of rows.
        dimensions: d, the numbers of a row.
        seed: Of random numbers; the same seed gives the same rows.

    Raises:
        SweepError: If the name is not known, or the design cannot have so many rows; names the two nearest counts.
    """
    runs = integer("runs", runs, least=1, most=_MOST_RUNS, error=SweepError)
    dimensions = integer("dimensions", dimensions, least=1, error=SweepError)
    seed = integer("seed", seed, error=SweepError)
    if isinstance(name, np.ndarray | list | tuple):
        return Table(runs, dimensions, seed, name)  # pyright: ignore[reportArgumentType]
    return DESIGNS[choice("design", name, DESIGNS, error=SweepError)](runs, dimensions, seed)
