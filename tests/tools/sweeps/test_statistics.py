"""Statistics: intervals are those of SciPy's tests, hold known values as often as they say, and count failed runs."""

from __future__ import annotations

import json
from collections.abc import Callable
from math import inf, isnan, log10
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.special import ndtri
from scipy.stats import binomtest, quantile_test, ttest_1samp

from robot_dyn.foundations import SweepError
from robot_dyn.tools import sweeps as sw
from robot_dyn.tools.sweeps import Estimate, designs, statistics
from tests.long import long
from tests.tools.sweeps.swept import of_figure

N = 1600
X = np.random.default_rng(5).gamma(2.0, size=N)
SIXTEEN = np.arange(N) % 16


def ends(made: Estimate) -> tuple[float, float]:
    return made.low, made.high


@pytest.mark.parametrize(("k", "n", "level"), [(0, 50, 0.95), (1, 50, 0.9), (13, 50, 0.99), (50, 50, 0.95)])
def test_probabilities_of_independent_runs_have_the_interval_of_clopper_and_pearson(
    k: int, n: int, level: float
) -> None:
    expected = binomtest(k, n).proportion_ci(level, method="exact")
    made = statistics.probability(np.arange(n) < k, level)
    assert made.estimate == k / n
    assert ends(made) == pytest.approx((expected.low, expected.high), rel=1e-12)


@pytest.mark.parametrize("level", [0.9, 0.95])
def test_means_of_independent_runs_have_students_interval(level: float) -> None:
    expected = ttest_1samp(X, 0).confidence_interval(level)
    assert ends(statistics.mean(X, level)) == pytest.approx((expected.low, expected.high), rel=1e-12)


def test_means_of_scramblings_have_students_interval_of_their_means() -> None:
    expected = ttest_1samp(X.reshape(-1, 16).mean(axis=0), 0).confidence_interval(0.95)
    assert ends(statistics.mean(X, scrambling=SIXTEEN)) == pytest.approx((expected.low, expected.high), rel=1e-12)


@pytest.mark.parametrize("p", [0.1, 0.5, 0.97])
def test_quantiles_of_independent_runs_have_the_interval_of_scipys_quantile_test(p: float) -> None:
    (made,) = statistics.quantiles(X, p)
    assert ends(made) == quantile_test(X, q=1, p=p).confidence_interval(0.95)
    assert np.mean(made.estimate >= X) == pytest.approx(p, abs=1 / N)


@pytest.mark.parametrize("scrambling", [None, SIXTEEN], ids=["independent", "scramblings"])
def test_quantiles_follow_a_change_of_unit_and_of_sign_of_order(scrambling: Any) -> None:
    before = statistics.quantiles(X, [0.3, 0.9], scrambling=scrambling)
    for one, other in zip(before, statistics.quantiles(2 * X + 1, [0.3, 0.9], scrambling=scrambling), strict=True):
        assert (other.estimate, *ends(other)) == pytest.approx([2 * x + 1 for x in (one.estimate, *ends(one))])


FUNCTIONS: dict[str, tuple[Callable[[np.ndarray], np.ndarray], float, float]] = {  # with mean and quantile of 0.9
    "sum of normals": (lambda u: ndtri(u).sum(axis=1) / 3**0.5, 0.0, float(ndtri(0.9))),
    "largest": (lambda u: u.max(axis=1), 0.75, 0.9 ** (1 / 3)),
}


@pytest.mark.parametrize(
    ("name", "function"),
    [
        ("random", "largest"),
        ("latin", "sum of normals"),
        *long([("random", "sum of normals"), ("latin", "largest")]),
    ],
)
def test_intervals_hold_known_values_as_often_as_they_say(name: str, function: str) -> None:
    """200 seeds: 95 % ± 4 σ is 89 … 100 %. scripts/benchmark.py sweeps has 4000 seeds and all designs."""
    value, mean, quantile = FUNCTIONS[function]
    held = []
    for seed in range(200):
        design = designs.design(name, 512, 3, seed)
        y = value(np.clip(design.rows, 2.0**-54, 1))
        scrambling = None if design.independent else design.scrambling
        made = statistics.mean(y, scrambling=scrambling), *statistics.quantiles(y, 0.9, scrambling=scrambling)
        chance = statistics.probability(y > quantile, scrambling=scrambling)
        held.append([a.low <= x <= a.high for a, x in zip((*made, chance), (mean, quantile, 0.1), strict=True)])
    assert (np.mean(held, axis=0) > 0.95 - 4 * (0.95 * 0.05 / 200) ** 0.5).all()
    assert np.mean(held) < 1


def test_the_interval_of_scramblings_shows_that_they_are_better_than_independent_runs() -> None:
    design = designs.design("sobol", 4096, 2, 1)
    y, scrambling = design.rows.sum(axis=1), design.scrambling
    one, other = statistics.mean(y, scrambling=scrambling), statistics.mean(y)
    assert one.high - one.low < (other.high - other.low) / 10
    one, other = statistics.probability(y > 1.5, scrambling=scrambling), statistics.probability(y > 1.5)
    assert one.high - one.low < (other.high - other.low) / 2


def test_sixteen_equal_counts_do_not_show_that_nothing_varies() -> None:
    """The Clopper–Pearson bound of 0 in 16 is 0.206 of one event a scrambling."""
    made = statistics.probability(np.arange(N) < 16 * 20, scrambling=SIXTEEN)
    bound = binomtest(0, 16).proportion_ci(0.95, method="exact").high / (N / 16)
    assert made.estimate == 0.2 and made.high - 0.2 == pytest.approx(bound, rel=0.06) == 0.2 - made.low


@pytest.mark.parametrize("scrambling", [None, SIXTEEN], ids=["independent", "scramblings"])
def test_no_event_has_a_bound_and_is_never_shown_as_0(scrambling: Any) -> None:
    made = statistics.probability(np.zeros(N, bool), scrambling=scrambling)
    assert made.estimate == made.low == 0 < made.high < 4 / N
    assert repr(made).startswith(f"probability: below {made.high:.4g} (95 % interval 0 … ")
    assert "the interval is conservative" in repr(made)
    every = statistics.probability(np.ones(N, bool), scrambling=scrambling)
    assert every.estimate == every.high == 1 > every.low > 1 - 4 / N
    assert repr(every).startswith("probability: above 0.99")


@pytest.mark.parametrize(("k", "said"), [(4, True), (5, False), (N - 4, True), (N - 5, False)])
def test_few_events_are_said_to_give_a_conservative_interval(k: int, said: bool) -> None:
    assert ("conservative" in statistics.probability(np.arange(N) < k).note) == said


@pytest.mark.parametrize("scrambling", [None, SIXTEEN], ids=["independent", "scramblings"])
def test_quantiles_count_failed_runs_as_infinite(scrambling: Any) -> None:
    failed = X.copy()
    failed[:120] = inf
    few, many = statistics.quantiles(failed, [0.5, 0.99], scrambling=scrambling, failed=120)
    finite = np.sort(X[120:])
    assert few.estimate == finite[N // 2 - 1] and few.low < few.estimate < few.high < inf and few.failed == 120
    assert many.estimate == many.high == inf and many.note
    assert many.to_json().count("null") >= 2


def test_points_that_are_not_random_have_no_interval() -> None:
    fixed = np.zeros(N, int)
    made = [statistics.mean(X, scrambling=fixed), *statistics.quantiles(X, 0.5, scrambling=fixed)]
    for each in (*made, statistics.probability(X > 1, scrambling=fixed)):
        assert isnan(each.low) and isnan(each.high) and not isnan(each.estimate)
        assert "without an interval" in repr(each) and "not random" in each.method
        assert json.loads(each.to_json())["low"] is None


def test_runs_that_do_not_bound_a_quantile_say_how_many_would() -> None:
    """1 − pᴺ ≥ 97.5 %: from N = 3688 on at p = 0.999."""
    (made,) = statistics.quantiles(X, 0.999)
    assert made.high == inf and "at least 3688 independent runs are needed" in made.note
    (made,) = statistics.quantiles(np.arange(3688.0), 0.999)
    assert made.high == 3687 and not made.note


def test_a_mean_of_too_skewed_runs_has_no_interval() -> None:
    """By Cochran's rule; the reason is in its note."""
    made = statistics.mean(np.exp(3 * np.random.default_rng(1).normal(size=500)))
    assert isnan(made.low) and isnan(made.high) and made.note and not statistics.mean(X).note


WRONG: dict[str, Callable[[], Any]] = {
    "probabilities must be below 1, got 99": lambda: statistics.quantiles(X, 99),
    "probabilities must be positive, got 0": lambda: statistics.quantiles(X, [0.0]),
    "level must be below 1, such as 0.95, got 95": lambda: statistics.mean(X, 95),
    "a mean needs two runs with a finite value, got 1": lambda: statistics.mean(X[:1]),
}


@pytest.mark.parametrize("message", WRONG)
def test_what_has_no_statistic_is_refused(message: str) -> None:
    with pytest.raises(SweepError, match=message):
        WRONG[message]()


# --- of sweeps, whose figures are functions of what varies

UNIT = sw.uniform(low=0.0, high=1.0)


def test_the_mean_of_a_figure_of_0_and_1_has_an_interval(tmp_path: Path) -> None:
    """The probability 0.48 by 64 runs: an interval that is a point, 0.5, does not hold it."""
    found = [of_figure(tmp_path, "below", UNIT, 64, design="sobol", seed=seed).mean("f") for seed in range(3)]
    assert all(each.low < each.estimate < each.high for each in found)


def test_a_figure_of_minus_infinity_is_below_all_others(tmp_path: Path) -> None:
    """log10 of an error, half of which vanish: quantile 0.25 is −∞, and quantile 0.75 is log10(1/4)."""
    done = of_figure(tmp_path, "logarithm", UNIT, design="random")
    low, high = done.quantiles("f", [0.25, 0.75])
    assert low.estimate == -inf
    assert high.low <= log10(0.25) <= high.high < log10(0.5)
    with pytest.raises(SweepError, match="'f' is infinite in"):
        done.mean("f")


def test_the_label_of_a_statistic_names_the_runs_that_were_asked_about(tmp_path: Path) -> None:
    """Finished runs without a figure did not fail."""
    done = of_figure(tmp_path, "partly", UNIT, design="random")
    assert done.outcomes == {"finished": 512, "diverged": 0, "raised": 0}
    assert done.mean("f", condition="known").failed == done.sensitivity("f", condition="known").failed == 0
    known = done.probability("f > 0.5", condition="known")
    assert known.n == np.isfinite(done.table("f")["f"]).sum()
    assert "known" in known.statistic and "finished" not in known.statistic
    assert "finished" in done.probability("kp > 0.5", condition="finished").statistic
