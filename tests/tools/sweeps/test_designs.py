"""Designs: Sobol', Halton and Latin hypercubes are those of `scipy.stats.qmc`, Saltelli's is SALib's; all are fair."""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np
import pytest
from SALib.sample import sobol as salib
from scipy.stats import chisquare, qmc

from robot_dyn.foundations import SweepError
from robot_dyn.tools.sweeps import designs
from robot_dyn.tools.sweeps.designs import SCRAMBLINGS

RUNS = {"random": 100, "sobol": 64, "halton": 48, "latin": 48, "saltelli": 7 * 32, "grid": 3**5}
ENGINES: dict[str, Any] = {
    "sobol": lambda d, rng: qmc.Sobol(d, bits=53, rng=rng),
    "halton": lambda d, rng: qmc.Halton(d, rng=rng),
    "latin": lambda d, rng: qmc.LatinHypercube(d, rng=rng),
}
LEAST_P = 1e-6  # of a test of chance with fixed seeds


def rows(name: Any, runs: int, dimensions: int, seed: int = 0) -> np.ndarray:
    return designs.design(name, runs, dimensions, seed).rows


@pytest.mark.parametrize("name", RUNS)
def test_a_seed_has_its_rows(name: str) -> None:
    made = rows(name, RUNS[name], 5, 11)
    assert made.shape == (RUNS[name], 5) and ((made >= 0) & (made < 1)).all()
    np.testing.assert_array_equal(made, rows(name, RUNS[name], 5, 11))
    assert name == "grid" or (made != rows(name, RUNS[name], 5, 12)).all(axis=1).any()


@pytest.mark.parametrize("name", ENGINES)
def test_each_scrambling_is_that_of_scipy(name: str) -> None:
    """Row i is of scrambling i mod 16, whose generator is the child of that number of the seed."""
    made = designs.design(name, SCRAMBLINGS * 64, 6, 3)
    for k, child in enumerate(np.random.SeedSequence(3).spawn(SCRAMBLINGS)):
        expected = ENGINES[name](6, np.random.default_rng(child)).random(64)
        np.testing.assert_array_equal(made.rows[made.scrambling == k], expected)


@pytest.mark.parametrize("n", [2, 3, 10, 64, 1000])
def test_each_stratum_of_a_latin_hypercube_holds_one_point(n: int) -> None:
    made = rows("latin", SCRAMBLINGS * n, 3, 7).reshape(n, SCRAMBLINGS, 3)
    strata = np.sort(np.floor(made * n), axis=0)
    np.testing.assert_array_equal(strata, np.broadcast_to(np.arange(n)[:, None, None], strata.shape))


@pytest.mark.parametrize("name", ["sobol", "halton", "latin"])
def test_scramblings_and_seeds_are_independent(name: str) -> None:
    """First points of 16 scramblings and 60 seeds are uniform; no two scramblings are correlated."""
    first = np.array([rows(name, 64, 2, seed)[:16] for seed in range(60)])
    assert chisquare(np.histogram(first, 20, (0, 1))[0]).pvalue > LEAST_P
    correlation = np.corrcoef(first.reshape(60, -1).T)[~np.eye(32, dtype=bool)]
    assert np.abs(correlation).max() < 5.2 / np.sqrt(60)  # 496 pairs: 5.2 σ is passed once in 10 000


@pytest.mark.parametrize("name", ["random", *ENGINES])
def test_points_of_designs_integrate_better_than_random_ones(name: str) -> None:
    """Mean of a sum: its variance is 1/12N · d of random points, at most a tenth of it of the others. [Owen 1997]."""
    squares = [(rows(name, 1024, 4, s).sum(axis=1).mean() - 2.0) ** 2 for s in range(20)]
    ratio = np.mean(squares) / (4 / 12 / 1024)
    assert 0.25 < ratio < 2.6 if name == "random" else ratio < 0.1  # χ² of 20, to 1e-4 on each side


def test_blocks_of_saltelli_are_those_of_salib() -> None:
    """A, A with a column of B for each column, B; all rows of a block are of one scrambling."""
    made = designs.design("saltelli", 16 * 5 * 8, 3, 1)
    problem = {"num_vars": 3, "names": ["x", "y", "z"], "bounds": [[0.0, 1.0]] * 3}
    blocks, of = made.rows.reshape(-1, 5, 3), made.scrambling.reshape(-1, 5)
    np.testing.assert_array_equal(of, np.broadcast_to((np.arange(128) % 16)[:, None], (128, 5)))
    A, *mixed, B = blocks.transpose(1, 0, 2)
    assert (A != B).all()
    for j, AB in enumerate(mixed):
        np.testing.assert_array_equal(AB, np.where(np.arange(3) == j, B, A))
    child = np.random.SeedSequence(1).spawn(16)[4]
    expected = salib.sample(problem, 8, calc_second_order=False, seed=np.random.default_rng(child))
    np.testing.assert_array_equal(blocks[of[:, 0] == 4].reshape(-1, 3), expected)


def test_a_grid_has_every_combination_once() -> None:
    assert sorted(map(tuple, rows("grid", 27, 3))) == sorted(product([1 / 6, 0.5, 5 / 6], repeat=3))


def test_a_table_is_its_rows_and_stays_as_it_was_given() -> None:
    table = np.random.default_rng(1).random((9, 2))
    made = designs.design(table, 9, 2)
    kept = table.copy()
    table += 1
    np.testing.assert_array_equal(made.rows, kept)


def test_designs_say_how_their_rows_depend_on_each_other() -> None:
    made = {name: designs.design(name, runs, 5) for name, runs in RUNS.items()}
    assert [name for name, each in made.items() if each.independent] == ["random"]
    assert {name: len(set(each.scrambling)) for name, each in made.items()} == {
        "random": 1, "sobol": 16, "halton": 16, "latin": 16, "saltelli": 16, "grid": 1,
    }  # fmt: skip


@pytest.mark.parametrize(
    ("name", "runs", "dimensions", "nearest"),
    [
        ("sobol", 100_000, 4, "65536 or 131072"), ("sobol", 1, 4, "32 or 64"), ("halton", 1000, 4, "992 or 1008"),
        ("halton", 16, 4, "32 or 48"), ("latin", 100_001, 4, "100000 or 100016"), ("saltelli", 1000, 3, "640 or 1280"),
        ("grid", 1000, 2, "961 or 1024"), ("grid", 2, 3, "1 or 8"),
    ],
)  # fmt: skip
def test_counts_that_a_design_cannot_take_are_refused_with_the_nearest_two(
    name: str, runs: int, dimensions: int, nearest: str
) -> None:
    with pytest.raises(SweepError, match=f"design '{name}' takes .*, got {runs} runs; nearest: {nearest}$"):
        designs.design(name, runs, dimensions)
    for count in nearest.split(" or "):
        assert len(rows(name, int(count), dimensions)) == int(count)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"name": "sobel"}, "no design 'sobel'; nearest: sobol"),
        ({"name": None}, "no design None"),
        ({"runs": 0}, "runs must be a whole number"),
        ({"runs": 10**7 + 1}, "runs must be a whole number"),
        ({"runs": 3.5}, "runs must be a whole number"),
        ({"name": [[0.5, 0.5]]}, "the table of the design has 1 rows of 2 numbers, the sweep 64 runs of 2"),
        ({"name": [[0.5, 1.0]]}, r"numbers in \[0, 1\), got 1 in row 0, column 1"),
        ({"name": [[0.5, np.nan]]}, "the table of a design must be finite"),
        ({"name": "sobol", "dimensions": 21202, "runs": 64}, "at most 21201 dimensions"),
        ({"name": "saltelli", "dimensions": 10601, "runs": 32 * 10603}, "at most 10600 dimensions"),
    ],
)
def test_what_is_not_a_design_is_refused(change: dict[str, Any], message: str) -> None:
    with pytest.raises(SweepError, match=message):
        designs.design(**{"name": "random", "runs": 64, "dimensions": 2, "seed": 0} | change)
