"""Statistics of the runs of a sweep, with intervals and the number of failed runs.

    independent runs        probabilities by `scipy.stats.binomtest`, quantiles by `quantile_test`, means by Student's t
    16 scramblings          the statistic of each scrambling, and Student's t over them
    points not random       the statistic without an interval

docs/data/sweep_coverage.csv lists how often these intervals contain the true value (scripts/benchmark.py sweeps).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from math import ceil, floor, inf, isinf, isnan, log, log1p, nan, sqrt
from typing import final

import numpy as np

from robot_dyn.foundations import Answer, Block, SweepError, number, numbers

NOT_RANDOM = "points that are not random"
FEW = 5
"""Number of events below which a note calls intervals of probabilities conservative."""
_COCHRAN = 100  # with Cochran's 25, 10 % of the intervals for a log-normal figure of 512 runs are wrong
_COUNTABLE = 1e15  # largest number of runs in a message; larger ones are rounded, or infinite


@final
@dataclass(frozen=True, repr=False)
class Estimate(Answer):
    """A statistic of the runs of a sweep.

    Attributes:
        statistic: Name of the statistic, such as "mean".
        estimate: Value of the statistic; infinite if it lies among failed runs.
        low: Lower end of the interval; −∞ if there are too few runs to bound it, nan without an interval.
        high: Upper end of the interval; +∞ if there are too few runs to bound it, nan without an interval.
        level: Probability that such intervals contain the true value.
        n: Number of runs.
        failed: Number of runs without a finite value, or counted as failed.
        method: Method of the interval, in words.
        note: Limitation of the result; empty without one.
    """

    statistic: str
    estimate: float
    low: float
    high: float
    level: float
    n: int
    failed: int
    method: str
    note: str = ""

    @property
    def sentence(self) -> str:
        """The statistic and its interval in one line."""
        if isnan(self.low):
            return f"{self.statistic}: {text(self.estimate)}, without an interval"
        interval = f"{100 * self.level:g} % interval {text(self.low)} … {text(self.high)}"
        if self.statistic.startswith("probability") and self.estimate == 0:
            return f"{self.statistic}: below {text(self.high)} ({interval}; no events)"
        if self.statistic.startswith("probability") and self.estimate == 1:
            return f"{self.statistic}: above {text(self.low)} ({interval}; events in all runs)"
        return f"{self.statistic}: {text(self.estimate)} ({interval})"

    def blocks(self) -> Iterator[Block]:
        yield self.sentence
        yield f"{self.n} runs, {self.failed} failed; {self.method}"
        if self.note:
            yield f"note: {self.note}"


def text(x: float) -> str:
    """Return a number with four digits, or ±∞."""
    return ("−∞" if x < 0 else "+∞") if isinf(x) else f"{x:.4g}"


def probability(
    events: np.ndarray, level: float = 0.95, scrambling: np.ndarray | None = None, *, failed: int = 0
) -> Estimate:
    """Estimate the probability of an event.

    Args:
        events: True for runs with the event, shape (N,).
        level: Confidence level of the interval.
        scrambling: The scrambling of each run, shape (N,); None for independent runs.
        failed: Number of failed runs, for the result.

    Raises:
        SweepError: If the level is not between 0 and 1.

    Source: Clopper, Pearson, The use of confidence or fiducial limits, Biometrika 26, 1934.
    """
    level = check_level(level)
    n, k = len(events), int(events.sum())
    few = min(k, n - k)
    note = ""
    if scrambling is None:
        from scipy.stats import binomtest  # imported here because it takes a second

        low, high = binomtest(k, n).proportion_ci(level, "exact")
        method = "Clopper–Pearson"
    else:
        half, method = _half_width_of_share(events, scrambling, level)
        low, high = (nan, nan) if isnan(half) else (max(k / n - half, 0.0), min(k / n + half, 1.0))
    if few < FEW and not isnan(low):
        counted = "event" if few == k else "run without the event"
        note = f"{few} {counted}{'s' * (few != 1)}, fewer than {FEW}: the interval is conservative"
    stated = partial(Estimate, level=level, n=n, failed=failed)
    return stated("probability", k / n, float(low), float(high), method=method, note=note)


def quantiles(
    x: np.ndarray,
    probabilities: Sequence[float] | float,
    level: float = 0.95,
    scrambling: np.ndarray | None = None,
    *,
    failed: int = 0,
) -> tuple[Estimate, ...]:
    """Estimate quantiles of a figure, one for each probability.

    With scramblings, the interval of F(x̂) = p is mapped to x by the order statistics of all runs [Woodruff]: quantiles
    of a sixteenth of the runs would be biased.

    Args:
        x: The figure of each run, shape (N,), +∞ for failed runs.
        probabilities: p, between 0 and 1, one number or (k,).
        level: Confidence level of the intervals.
        scrambling: The scrambling of each run, shape (N,); None for independent runs.
        failed: Number of failed runs.

    Raises:
        SweepError: If a probability or the level is not between 0 and 1.

    Source: Woodruff, Confidence intervals for medians and other position measures, J. Am. Stat. Assoc. 47, 1952.
    """
    level = check_level(level)
    p_values = numbers("probabilities", probabilities, (), ("k",), error=SweepError, above=0.0).reshape(-1)
    if (p_values >= 1).any():
        raise SweepError(f"probabilities must be below 1, got {p_values.max():g}")
    ordered, estimates = np.sort(x), []
    stated = partial(Estimate, level=level, n=len(x), failed=failed)
    for p in map(float, p_values):
        estimate = _at_rank(ordered, max(ceil(len(x) * p - 1e-9), 1))  # N p may be rounded up
        if scrambling is None:
            from scipy.stats import quantile_test

            low, high = quantile_test(ordered, q=0, p=p).confidence_interval(level)
            # nan if the runs do not bound the quantile
            low, high, method = -inf if isnan(low) else low, inf if isnan(high) else high, "order statistics"
        else:
            half, method = _half_width_of_share(x <= estimate, scrambling, level)
            low, high = (_at_rank(ordered, len(x) * q + 0.5) for q in (p - half, p + half))
        note = _note_of_quantile(p, level, len(x), estimate, low, high)
        estimates.append(stated(f"quantile {p:g}", estimate, float(low), float(high), method=method, note=note))
    return tuple(estimates)


def mean(x: np.ndarray, level: float = 0.95, scrambling: np.ndarray | None = None, *, failed: int = 0) -> Estimate:
    """Estimate the mean of a figure; if N < 100 g² for the skewness g, there is no interval: it would be unreliable.

    Args:
        x: The finite figure of each run, shape (N,).
        level: Confidence level of the interval.
        scrambling: The scrambling of each run, shape (N,); None for independent runs.
        failed: Number of failed runs, which are not in x.

    Raises:
        SweepError: If the level is not between 0 and 1, or there are fewer than two runs.

    Source: Cochran, Sampling techniques, 1977, sec. 2.15.
    """
    from scipy.stats import skew

    level = check_level(level)
    if len(x) < 2:
        raise SweepError(f"a mean needs two runs with a finite value, got {len(x)}")
    estimate, note = float(x.mean()), ""
    stated = partial(Estimate, level=level, n=len(x), failed=failed)
    if len(two := np.unique(x)) <= 2:  # the mean follows from the share of the larger value
        share = probability(x == two[-1], level, scrambling)
        low, high = (float(two[0] + (two[-1] - two[0]) * end) for end in (share.low, share.high))
        return stated("mean", estimate, low, high, method=share.method, note=share.note)
    if scrambling is None:
        half, method = _student(x, level), "Student's t"
    else:
        means = _by_scrambling(x, scrambling)
        half, method = (nan, NOT_RANDOM) if len(means) < 2 else (_student(means, level), _over(means))
    skewness = float(skew(x))
    if len(x) < _COCHRAN * skewness**2 and not isnan(half):
        half, note = nan, f"no interval: skewness {skewness:.2g} is too large for {len(x)} runs (Cochran's rule)"
    return stated("mean", estimate, estimate - half, estimate + half, method=method, note=note)


def student_quantile(level: float, freedom: int) -> float:
    """Return the half-width of an interval of a level, in standard errors, by Student's t."""
    from scipy.special import stdtrit  # imported here because only statistics need it

    return float(stdtrit(freedom, (1 + level) / 2))


def _student(x: np.ndarray, level: float) -> float:
    """Return half the width, t s / √n, of Student's interval of the mean of n independent numbers."""
    return student_quantile(level, len(x) - 1) * float(np.std(x, ddof=1)) / sqrt(len(x))


def _by_scrambling(x: np.ndarray, scrambling: np.ndarray) -> np.ndarray:
    """Return the mean of each scrambling that has a run, shape (R,)."""
    size = np.bincount(scrambling)
    return np.bincount(scrambling, x)[size > 0] / size[size > 0]


def _half_width_of_share(events: np.ndarray, scrambling: np.ndarray, level: float) -> tuple[float, str]:
    """Return half the width of Student's interval over shares of scramblings, with 2 added to the sum of squares.

    Counts are integers: 16 equal counts do not prove that their variance is 0. With 2 added, the half-width of 16 equal
    counts is 0.195 of one event per scrambling, close to 0.206, the Clopper–Pearson bound for 0 in 16.
    """
    shares = _by_scrambling(events, scrambling)
    R = len(shares)
    if R < 2:
        return nan, NOT_RANDOM
    squares = float(np.sum((shares - shares.mean()) ** 2)) + 2 * (R / len(events)) ** 2
    return student_quantile(level, R - 1) * sqrt(squares / (R - 1) / R), _over(shares)


def _over(statistics: np.ndarray) -> str:
    return f"Student's t over {len(statistics)} scramblings"


def _at_rank(ordered: np.ndarray, rank: float) -> float:
    """Return x₍rank₎, linear between two order statistics; infinite outside 1, …, N; nan for nan."""
    if isnan(rank):
        return nan
    if rank < 1 or rank > len(ordered):
        return -inf if rank < 1 else inf
    lower = floor(rank)
    a, b = float(ordered[lower - 1]), float(ordered[min(lower, len(ordered) - 1)])
    if rank == lower or a == b:
        return a
    return b if isinf(b) else a if isinf(a) else a + (rank - lower) * (b - a)


def _note_of_quantile(p: float, level: float, n: int, estimate: float, low: float, high: float) -> str:
    if estimate == inf:
        return "the quantile lies among the failed runs"
    if not (low == -inf < estimate or high == inf):
        return ""
    needed = log((1 - level) / 2) / log1p(-min(p, 1 - p))
    count = f"{ceil(needed)}" if needed < _COUNTABLE else f"{_COUNTABLE:g}"
    return f"{n} runs, or those that finished, do not bound the quantile; at least {count} independent runs are needed"


def check_level(level: object) -> float:
    """Return a level between 0 and 1; raise a SweepError for other values."""
    level = number("level", level, error=SweepError, above=0.0)
    if level >= 1:
        raise SweepError(f"level must be below 1, such as 0.95, got {level:g}")
    return level
