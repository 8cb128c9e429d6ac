"""Statistics of the runs of a sweep, each with an interval and with the number of runs that failed.

    independent runs        quantiles by order statistics, probabilities by Clopper and Pearson, means by Student's t
    several scramblings     each statistic by scrambling, and Student's t over the scramblings
    points not random       the statistic alone: there is no interval

A run whose value is not finite failed. Quantiles count it as +∞; means are of finished runs only where this is asked
for.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from math import ceil, floor, inf, isnan, log, log1p, nan, sqrt
from typing import Any

import numpy as np

from robot_dyn.foundations import SweepError, float64, integer, number, numbers, shown
from robot_dyn.tools.sweeps.estimate import Estimate
from robot_dyn.tools.sweeps.replicates import (
    Groups,
    groups_of,
    half_width_of_mean,
    half_width_of_share,
    student,
)

FEW = 5
"""Events below which intervals of probabilities are said to be conservative."""
_COUNTABLE = 1e15  # runs; a larger number is rounded, or infinite
NOT_RANDOM = "points that are not random"
GIVEN = None, "finished", "known"
"""Which runs a question is about: all, those that finished, or those of them that have the figures it asks of."""


def quantiles(
    x: Any, probabilities: Sequence[float] | float, level: float = 0.95, replicate: Any = None
) -> tuple[Estimate, ...]:
    """Quantiles of a figure, one for each probability.

    Of independent runs the interval ends at two order statistics x₍l₎ and x₍u₎ with P(l ≤ B < u) ≥ level, where B is
    binomial of N and p: it holds for every continuous distribution. Of scramblings it is the interval of F(x̂) = p,
    taken to x by the order statistics of all runs: quantiles of a sixteenth of the runs would be biased.

    Args:
        x: The figure of each run, shape (N,); what is not finite counts as +∞.
        probabilities: p, each between 0 and 1.
        level: Of the intervals.
        replicate: The scrambling of each run, whole numbers, shape (N,); None for independent runs.

    Raises:
        SweepError: If an argument has another form.

    Sources: David, Nagaraja, Order statistics, 2003, §7.1; Woodruff, Confidence intervals for medians and other
    position measures, J. Am. Stat. Assoc. 47, 1952.
    """
    x, level = check_figure(x), check_level(level)
    asked = numbers("probabilities", probabilities, (), ("k",), error=SweepError, above=0.0).reshape(-1)
    if (asked >= 1).any():
        raise SweepError(f"probabilities must be below 1, got {asked.max():g}")
    finite = np.isfinite(x)
    counted, failed = np.sort(np.where(finite, x, inf)), int(np.sum(~finite))
    groups = None if replicate is None else groups_of(replicate, len(x))
    made = []
    for p in map(float, asked):
        estimate = _at_rank(counted, max(ceil(len(x) * p - 1e-9), 1))  # N p may be rounded up
        below = np.where(finite, x, inf) <= estimate
        low, high, method = _interval_of_quantile(counted, below, p, level, groups)
        note = _note_of_quantile(p, level, len(x), estimate, low, high)
        made.append(Estimate(f"quantile {p:g}", estimate, low, high, level, len(x), failed, method, note))
    return tuple(made)


def probability(events: Any, level: float = 0.95, replicate: Any = None, *, failed: int = 0) -> Estimate:
    """Probability of an event.

    Args:
        events: Whether it happened, truth values, shape (N,).
        level: Of the interval.
        replicate: As of `quantiles`.
        failed: How many runs failed, for the result to say; whether these are events is in `events`.

    Raises:
        SweepError: If an argument has another form.

    Source: Clopper, Pearson, The use of confidence or fiducial limits, Biometrika 26, 1934.
    """
    events, level = np.asarray(events), check_level(level)
    if events.dtype != bool or events.ndim != 1 or not len(events):
        raise SweepError(f"events must be truth values, one a run, got {events.dtype} of shape {events.shape}")
    failed = integer("failed", failed, most=len(events), error=SweepError)
    n, k = len(events), int(events.sum())
    groups = None if replicate is None else groups_of(replicate, n)
    if groups is None:
        low, high = clopper_pearson(k, n, level)
        method = "Clopper–Pearson"
    elif groups.count == 1:
        low, high, method = nan, nan, NOT_RANDOM
    else:
        half = half_width_of_share(events, groups, level)
        low, high = max(k / n - half, 0.0), min(k / n + half, 1.0)
        method = _over(groups)
    few = min(k, n - k)
    which = "event" if few == k else "run without the event"
    note = (
        f"{few} {which}{'' if few == 1 else 's'}, fewer than {FEW}: the interval is conservative" if few < FEW else ""
    )
    return Estimate("probability", k / n, low, high, level, n, failed, method, "" if isnan(low) else note)


def mean(x: Any, level: float = 0.95, replicate: Any = None, *, given: str | None = None) -> Estimate:
    """Mean of a figure.

    Args:
        x: The figure of each run, shape (N,); a run whose figure is not finite failed.
        level: Of the interval.
        replicate: As of `quantiles`.
        given: "finished" or "known" for the mean of the runs with a value.

    Raises:
        SweepError: If runs failed and `given` is None, or fewer than two did not.
    """
    x, level = check_figure(x), check_level(level)
    finite = check_finished(x, "mean", given)
    groups = None if replicate is None else groups_of(replicate, len(x)).part(finite)
    n, finished = len(x), x[finite]
    if len(finished) < 2:
        raise SweepError(f"a mean needs two runs that finished, got {len(finished)}")
    estimate = float(finished.mean())
    if groups is None:
        half = student(level, len(finished) - 1) * float(finished.std(ddof=1)) / sqrt(len(finished))
        method = "Student's t"
    elif groups.count == 1:
        half, method = nan, NOT_RANDOM
    else:
        statistics = groups.means(finished - estimate)
        estimate += float(statistics.mean())
        half, method = half_width_of_mean(statistics, level), _over(groups)
    statistic = "mean" if given is None else f"mean given {given}"
    note = _note_of_mean(finished)
    return Estimate(statistic, estimate, estimate - half, estimate + half, level, n, n - len(finished), method, note)


def clopper_pearson(k: int, n: int, level: float) -> tuple[float, float]:
    """The interval of a probability from k events in n independent runs."""
    from scipy.special import betaincinv  # late: only statistics need it

    tail = (1 - level) / 2
    low = float(betaincinv(k, n - k + 1, tail)) if k else 0.0
    high = float(betaincinv(k + 1, n - k, 1 - tail)) if k < n else 1.0
    return low, high


def check_finished(x: np.ndarray, what: str, given: str | None) -> np.ndarray:
    """Which runs finished; SweepError if some did not and the question is not about those that did."""
    finite = np.isfinite(x)
    if checked_given(given) is None and (failed := int(np.sum(~finite))):
        raise SweepError(
            f"{failed} of {len(x)} runs failed or have no value: a {what} of those that finished is given='finished',"
            " of those with a value given='known'"
        )
    return finite


def checked_given(given: Any) -> str | None:
    """What `given` may be; SweepError otherwise."""
    if given is not None and not (isinstance(given, str) and given in GIVEN):
        raise SweepError(f"given must be {', '.join(map(repr, GIVEN[1:]))} or None, got {shown(given)}")
    return given


@lru_cache(maxsize=64)
def ranks(n: int, p: float, level: float) -> tuple[int, int]:
    """Ranks l and u such that P(l ≤ B < u) ≥ level, B binomial of n and p; 0 and n + 1 if there are none.

    Each tail has at most half of 1 − level; then an end moves inward as long as both tails together allow it, so that
    the level is exceeded by less than one step of the binomial distribution.
    """
    from scipy.stats import binom  # late: it takes a second

    low, high = int(binom.ppf((1 - level) / 2, n, p)), int(binom.ppf((1 + level) / 2, n, p)) + 1
    spare = float(binom.cdf(high - 1, n, p) - binom.cdf(low - 1, n, p)) - level
    if low > 0 and high <= n:
        of_low, of_high = (float(binom.pmf(k, n, p)) for k in (low, high - 1))
        if max(of_low, of_high) <= spare:
            return (low + 1, high) if of_low > of_high else (low, high - 1)
        if min(of_low, of_high) <= spare:
            return (low, high - 1) if of_low > of_high else (low + 1, high)
    return low, high


def _interval_of_quantile(
    ordered: np.ndarray, below: np.ndarray, p: float, level: float, groups: Groups | None
) -> tuple[float, float, str]:
    """Ends of the interval of a quantile and how they were found; `below` says which runs are at most the estimate."""
    n = len(ordered)
    if groups is None:
        low, high = ranks(n, p, level)
        return _at_rank(ordered, low), _at_rank(ordered, high), "order statistics, binomial ranks"
    if groups.count == 1:
        return nan, nan, NOT_RANDOM
    half = half_width_of_share(below, groups, level)
    low, high = (_at_rank(ordered, n * q + 0.5) for q in (p - half, p + half))
    return low, high, f"{_over(groups)}, at order statistics"


def _at_rank(ordered: np.ndarray, rank: float) -> float:
    """x₍rank₎, between two order statistics linear; infinite outside 1, …, N."""
    if rank < 1 or rank > len(ordered):
        return -inf if rank < 1 else inf
    lower = floor(rank)
    a, b = float(ordered[lower - 1]), float(ordered[min(lower, len(ordered) - 1)])
    return a if rank == lower or a == b else b if b == inf else a + (rank - lower) * (b - a)


def _note_of_quantile(p: float, level: float, n: int, estimate: float, low: float, high: float) -> str:
    if estimate == inf:
        return "the quantile lies among the runs that failed"
    if not (low == -inf or high == inf):
        return ""
    needed = log((1 - level) / 2) / log1p(-min(p, 1 - p))
    count = f"{ceil(needed)}" if needed < _COUNTABLE else f"{_COUNTABLE:g}"
    return f"{n} runs, or those that finished, do not bound the quantile; independent ones need {count} at least"


def _note_of_mean(x: np.ndarray) -> str:
    """Cochran's rule: Student's interval of a mean needs N > 25 g², where g is the skewness."""
    deviation = x - x.mean()
    variance = float(np.mean(deviation**2))
    skewness = float(np.mean(deviation**3)) / variance**1.5 if variance > 0 else 0.0
    if len(x) > 25 * skewness**2:
        return ""
    return f"skewness {skewness:.2g} is large for {len(x)} runs (Cochran's rule): coverage is below the level"


def _over(groups: Groups) -> str:
    return f"Student's t over {groups.count} scramblings"


def check_figure(x: Any) -> np.ndarray:
    """A figure of each run as float64; SweepError if it has another form."""
    try:
        x = float64(x)
    except ValueError as found:
        raise SweepError(f"a figure must be real numbers, one a run, got {found}") from None
    if x.ndim != 1 or not len(x):
        raise SweepError(f"a figure must have shape (N,), one number a run, got {x.shape}")
    return x


def check_level(level: Any) -> float:
    """A level between 0 and 1; SweepError if it is anything else."""
    level = number("level", level, error=SweepError, above=0.0)
    if level >= 1:
        raise SweepError(f"level must be below 1, such as 0.95, got {level:g}")
    return level
