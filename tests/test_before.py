"""The comparison of two trees: rounding passes, and what is larger than rounding and growth does not."""

from __future__ import annotations

import numpy as np
import pytest
from referee import results, runs, sweeps, timings
from referee.results import Result
from scipy.stats import binom

STORED = Result({"q": np.array([1.0, 2.0])}, {"ending": "finished", "steps": 10}, {"q": 1e-12}, {"steps": [10, 11, 10]})


def faults(values: list[float], ending: str = "finished", steps: int = 10) -> int:
    """Return the number of faults of a result beside the stored one."""
    new = Result({"q": np.array(values)}, {"ending": ending, "steps": steps})
    return len(results.compared("case", STORED, new).faults)


def test_rounding_times_growth_passes_and_more_does_not() -> None:
    assert faults([1.0, 2.0]) == 0
    assert faults([1.0, 2.0 + 99e-12]) == 0
    assert faults([1.0, 2.0 + 101e-12]) == 1
    assert faults([1.0, np.nan]) == 1
    assert faults([1.0]) == 1


def test_texts_are_equal_and_counts_as_near_as_those_of_pushed_runs() -> None:
    assert faults([1.0, 2.0], ending="diverged") == 1
    assert [faults([1.0, 2.0], steps=k) for k in (8, 9, 12, 13)] == [1, 0, 0, 1]


def test_results_are_read_as_they_were_written(tmp_path) -> None:
    results.save({"case": STORED}, tmp_path, "runs")
    row = results.compared("case", results.load(tmp_path, "runs")["case"], STORED)
    assert row.is_same and row.ratio == 0.0


def test_the_upper_end_covers_the_median_with_95_percent() -> None:
    """Of 30 values the twentieth, by the binomial distribution; of four none."""
    assert timings.upper_end([float(k) for k in range(1, 31)]) == 20.0
    assert binom.cdf(19, 30, 0.5) >= 0.95 > binom.cdf(18, 30, 0.5)
    assert timings.upper_end([1.0] * 4) == np.inf


@pytest.mark.parametrize(
    ("count", "names"),
    [(runs.COUNT, runs.cases()), (sweeps.COUNT, sweeps.sweeps()), (timings.COUNT, timings.names())],
)
def test_all_cases_have_names(count: int, names: object) -> None:
    assert len(set(names)) == count  # type: ignore[call-overload]
