"""Designs: a row depends on its number alone; Sobol' and Halton are SciPy's; Latin hypercubes fill every stratum."""

from __future__ import annotations

from itertools import pairwise, product
from typing import Any

import numpy as np
import pytest
from scipy.stats import chisquare

from robot_dyn.foundations import SweepError
from robot_dyn.tools.sweeps import designs
from robot_dyn.tools.sweeps.designs.base import REPLICATES
from robot_dyn.tools.sweeps.designs.halton import scipy_halton
from robot_dyn.tools.sweeps.designs.latin import ROUNDS, permuted
from robot_dyn.tools.sweeps.designs.sobol import scipy_sobol
from tests.long import long

LARGE = {
    "random": 10**9 + 7, "sobol": 2**34, "halton": 16 * 10**8, "latin": 16 * (10**8 + 7), "saltelli": 7 * 2**30,
    "grid": 33**5,
}  # fmt: skip
SCIPY: dict[str, Any] = {"sobol": scipy_sobol, "halton": scipy_halton}
LEAST_P = 1e-6  # of a test of chance with fixed seeds


@pytest.mark.parametrize("start", [0, 5, 10**7 + 3])
@pytest.mark.parametrize("name", LARGE)
def test_rows_are_those_of_any_split_bit_for_bit(name: str, start: int) -> None:
    design = designs.design(name, LARGE[name], 5, 11)
    stop = start + 500
    whole = design.rows(start, stop)
    assert whole.shape == (500, 5) and ((whole >= 0) & (whole < 1)).all()
    rng = np.random.default_rng(start)
    for parts in (1, 2, 7, 60):
        cuts = [start, *sorted(rng.integers(start, stop, parts)), stop]
        np.testing.assert_array_equal(np.concatenate([design.rows(a, b) for a, b in pairwise(cuts)]), whole)
    again = designs.design(name, LARGE[name], 5, 11)  # nothing depends on what was asked before
    np.testing.assert_array_equal(np.concatenate([again.rows(i, i + 1) for i in range(start + 40, start, -1)]),
                                  whole[40:0:-1])  # fmt: skip


@pytest.mark.parametrize("points", [2**14, *long([2**20])])
@pytest.mark.parametrize("name", SCIPY)
def test_points_are_those_of_scipy_bit_for_bit(name: str, points: int) -> None:
    """Scrambling r of row i is (i mod 16), its point (i div 16)."""
    design = designs.design(name, REPLICATES * points, 6, 3)
    rows = design.rows(0, design.runs)
    for replicate in (0, 9, 15):
        of = design.replicate_of(np.arange(design.runs)) == replicate
        np.testing.assert_array_equal(rows[of], SCIPY[name](3, replicate, 6).random(points))


@pytest.mark.parametrize("name", SCIPY)
def test_late_points_are_those_of_scipy(name: str) -> None:
    engine = SCIPY[name](3, 1, 3)
    engine.random(2**20)  # fast_forward refuses Sobol' points of 53 bits
    design = designs.design(name, 2**30, 3, 3)
    np.testing.assert_array_equal(design.rows(2**24, 2**24 + 160)[1::16], engine.random(10))


@pytest.mark.parametrize(("dimensions", "row"), [*product((1, 4, 5), (0, 10**8))])
def test_random_rows_are_philox_of_numpy_with_the_row_as_counter(dimensions: int, row: int) -> None:
    design: Any = designs.design("random", 10**9, dimensions, 5)
    counter = row * -(-dimensions // 4)
    expected = np.random.Generator(np.random.Philox(key=design.key, counter=counter)).random(dimensions)
    np.testing.assert_array_equal(design.rows(row, row + 1)[0], expected)


@pytest.mark.parametrize("n", [2, 3, 10, 64, 1000, 1021])
def test_each_stratum_of_a_latin_hypercube_holds_one_point(n: int) -> None:
    rows = designs.design("latin", REPLICATES * n, 3, 7).rows(0, REPLICATES * n).reshape(n, REPLICATES, 3)
    strata = np.sort(np.floor(rows * n), axis=0)
    np.testing.assert_array_equal(strata, np.broadcast_to(np.arange(n)[:, None, None], strata.shape))
    within = (rows * n - np.floor(rows * n)).ravel()
    assert chisquare(np.histogram(within, 10, (0, 1))[0]).pvalue > LEAST_P


@pytest.mark.parametrize("n", [5, 16, 30])
def test_permutations_of_latin_hypercubes_are_those_of_chance(n: int) -> None:
    """Over keys, the images of two numbers are every pair of different numbers, each as likely."""
    keys = np.random.default_rng(n).integers(2**64, size=(ROUNDS, 50_000), dtype=np.uint64)
    first, second = permuted(np.array([1, n - 2], np.uint64), n, keys).astype(int)
    counts = np.bincount(first * n + second, minlength=n * n).reshape(n, n)
    assert not counts.diagonal().any()
    assert chisquare(counts[~np.eye(n, dtype=bool)]).pvalue > LEAST_P


@pytest.mark.parametrize("name", ["sobol", "halton", "latin"])
def test_scramblings_and_seeds_are_independent(name: str) -> None:
    """First points of 16 scramblings and 60 seeds are uniform; no two scramblings are correlated."""
    first = np.array([designs.design(name, 64, 2, seed).rows(0, 16) for seed in range(60)])
    assert chisquare(np.histogram(first, 20, (0, 1))[0]).pvalue > LEAST_P
    correlation = np.corrcoef(first.reshape(60, -1).T)[~np.eye(32, dtype=bool)]
    assert np.abs(correlation).max() < 5.2 / np.sqrt(60)  # 496 pairs: 5.2 σ is passed once in 10 000


@pytest.mark.parametrize("name", ["random", *SCIPY, "latin"])
def test_points_of_designs_integrate_better_than_random_ones(name: str) -> None:
    """Mean of a sum: its variance is 1/12N · d of random points, at most a tenth of it of the others. [Owen 1997]."""
    squares = [(designs.design(name, 1024, 4, s).rows(0, 1024).sum(axis=1).mean() - 2.0) ** 2 for s in range(20)]
    ratio = np.mean(squares) / (4 / 12 / 1024)
    assert 0.25 < ratio < 2.6 if name == "random" else ratio < 0.1  # χ² of 20, to 1e-4 on each side


def test_rows_of_saltelli_are_A_B_and_A_with_a_column_of_B() -> None:
    design = designs.design("saltelli", 16 * 5 * 8, 3, 1)
    A, B, *mixed = design.rows(0, design.runs).reshape(-1, 5, 3).transpose(1, 0, 2)
    assert (A != B).all()
    for j, AB in enumerate(mixed):
        np.testing.assert_array_equal(AB, np.where(np.arange(3) == j, B, A))
    pairs = designs.design("sobol", 16 * 8, 6, 1).rows(0, 16 * 8)
    np.testing.assert_array_equal(np.column_stack([A, B]), pairs)
    replicate = design.replicate_of(np.arange(design.runs)).reshape(-1, 5)
    np.testing.assert_array_equal(replicate, np.broadcast_to((np.arange(128) % 16)[:, None], (128, 5)))


def test_a_grid_has_every_combination_once() -> None:
    rows = designs.design("grid", 27, 3).rows(0, 27)
    assert sorted(map(tuple, rows)) == sorted(product([1 / 6, 0.5, 5 / 6], repeat=3))


def test_a_table_is_its_rows_and_stays_as_it_was_given() -> None:
    table = np.random.default_rng(1).random((9, 2))
    design = designs.design(table, 9, 2)
    kept = table.copy()
    table += 1
    np.testing.assert_array_equal(design.rows(2, 7), kept[2:7])


def test_designs_say_how_their_rows_depend_on_each_other() -> None:
    made = {name: designs.design(name, runs, 5) for name, runs in LARGE.items()}
    assert [name for name, each in made.items() if each.independent] == ["random"]
    assert {name: each.replicates for name, each in made.items()} == {
        "random": 1, "sobol": 16, "halton": 16, "latin": 16, "saltelli": 16, "grid": 1,
    }  # fmt: skip
    assert made["latin"].replicate_of(10**8 + 5) == 5 and made["grid"].replicate_of(7) == 0


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
        assert len(designs.design(name, int(count), dimensions).rows(0, int(count))) == int(count)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"name": "sobel"}, "no design 'sobel'; nearest: sobol"),
        ({"name": None}, "no design None"),
        ({"runs": 0}, "runs must be a whole number"),
        ({"runs": 3.5}, "runs must be a whole number"),
        ({"dimensions": 0}, "dimensions must be a whole number, 1 or more"),
        ({"seed": -1}, "seed must be a whole number"),
        ({"name": [[0.5, 0.5]]}, "the table of the design has 1 rows of 2 numbers, the sweep 64 runs of 2"),
        ({"name": [[0.5, 1.0]]}, r"numbers in \[0, 1\), got 1 in row 0, column 1"),
        ({"name": [[0.5, np.nan]]}, "the table of a design must be finite"),
        ({"name": "sobol", "dimensions": 21202, "runs": 64}, "at most 21201 dimensions"),
    ],
)
def test_what_is_not_a_design_is_refused(change: dict[str, Any], message: str) -> None:
    with pytest.raises(SweepError, match=message):
        designs.design(**{"name": "random", "runs": 64, "dimensions": 2, "seed": 0} | change)


@pytest.mark.parametrize(("start", "stop"), [(-1, 3), (3, 2), (0, 65), (0.5, 3)])
def test_rows_that_a_design_does_not_have_are_refused(start: Any, stop: Any) -> None:
    with pytest.raises(SweepError, match="must be a whole number"):
        designs.design("latin", 64, 2).rows(start, stop)
