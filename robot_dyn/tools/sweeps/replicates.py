"""Intervals from independent groups of runs: Student's t over scramblings, and the jackknife over groups.

The points of one scrambling are not independent, so that no formula for independent runs holds for them; the
scramblings are, and so are the 16 statistics of them.

Sources: Owen, Monte Carlo theory, methods and examples, ch. 17; Wolter, Introduction to variance estimation, 2007.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import sqrt
from typing import Any, final

import numpy as np

from robot_dyn.foundations import SweepError, real

_MOST = 2**20  # scramblings; more are a mistake, such as numbers of runs


@final
@dataclass(frozen=True, eq=False)
class Groups:
    """Runs by group.

    Attributes:
        of: The group of each run, whole numbers, shape (N,).
        sizes: Of the groups, none of which is empty.
    """

    of: np.ndarray
    sizes: np.ndarray

    @property
    def count(self) -> int:
        """R, the number of groups."""
        return len(self.sizes)

    def part(self, mask: np.ndarray) -> Groups:
        """The groups of some of the runs."""
        return _groups(self.of[mask])

    def means(self, x: np.ndarray) -> np.ndarray:
        """Of each group, shape (R,)."""
        return np.bincount(self.of, x, self.count) / self.sizes


def groups_of(replicate: Any, runs: int) -> Groups:
    """Groups by the number of the scrambling of each run."""
    try:
        of = real(replicate)
    except ValueError as found:
        raise SweepError(f"replicate must be the number of the scrambling of each run, got {found}") from None
    if of.shape != (runs,) or of.dtype.kind not in "iu" or not ((of >= 0) & (of < _MOST)).all():
        raise SweepError(
            f"replicate must be {runs} whole numbers below {_MOST}, the scrambling of each run, got"
            f" {of.dtype} of shape {of.shape}"
        )
    return _groups(of)


def _groups(of: np.ndarray) -> Groups:
    """Groups by number; those without a run are left out."""
    sizes = np.bincount(of)
    filled = sizes > 0
    return Groups((np.cumsum(filled) - 1)[of], sizes[filled])


def student(level: float, freedom: int) -> float:
    """The quantile t of (1 + level)/2 of Student's distribution."""
    from scipy.special import stdtrit  # late: only statistics need it

    return float(stdtrit(freedom, (1 + level) / 2))


def half_width_of_mean(statistics: np.ndarray, level: float) -> float:
    """Half the width of Student's interval, t s / √R, of R independent statistics."""
    return student(level, len(statistics) - 1) * float(np.std(statistics, ddof=1)) / sqrt(len(statistics))


def half_width_of_share(events: np.ndarray, groups: Groups, level: float) -> float:
    """Half the width t s / √R of shares of events in R groups, where the sum of squares of counts is 2 larger.

    Counts are whole numbers: 16 equal ones do not show that their variance is 0. With 2 more, the half-width of 16
    equal counts is 0.195 of one event a group, near to 0.206, the Clopper–Pearson bound of 0 in 16.
    """
    shares = groups.means(events)
    R = groups.count
    squares = float(np.sum((shares - shares.mean()) ** 2)) + 2 * (R / len(events)) ** 2
    return student(level, R - 1) * sqrt(squares / (R - 1) / R)


def jackknife(
    estimate: Callable[[np.ndarray], np.ndarray], groups: Groups, level: float, unbiased: bool = False
) -> tuple[np.ndarray, ...]:
    """An estimate from all runs, and the ends of its interval from those without one group each.

    s² = (R − 1)/R Σ (θ_(r) − mean θ_(r))², with Student's t of R − 1 degrees of freedom. Of ratios such as indices the
    bias is that of all runs, not of a sixteenth of them. Of it (R − 1)(mean θ_(r) − θ) goes as 1/R.

    Args:
        estimate: θ of the runs for which a mask is true.
        groups: R groups.
        level: Of the interval.
        unbiased: Whether that bias is subtracted.
    """
    theta = estimate(np.ones(len(groups.of), bool))
    without = np.array([estimate(groups.of != r) for r in range(groups.count)])
    s = np.sqrt((groups.count - 1) * without.var(axis=0))
    half = student(level, groups.count - 1) * s
    if unbiased:
        theta = theta - (groups.count - 1) * (without.mean(axis=0) - theta)
    return theta, theta - half, theta + half
