"""The difference of two runs of one robot: their motion at common times, and the settings that differ.

Two runs part where |q_b − q_a| of a joint is above twice the sum of their estimated errors, which are no bounds, or
above a tolerance where one of them has no estimate. Numbers are compared at common samples. Where few are common, q and
v are interpolated by the cubic Hermite polynomials of (q, v) and of (v, a), u by lines; the bound is then larger by
what the polynomials change when every other sample is left out: 16 times their error, where the motion is smooth.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf
from typing import final

import numpy as np

from robot_dyn.foundations.errors import QueryError
from robot_dyn.simulation.results.error_estimate import ErrorEstimate
from robot_dyn.simulation.results.trajectory import Trajectory

TOLERANCE = 1e-6  # [rad] or [m], for runs without an estimate of their error
_MARGIN = 2.0  # of estimated errors
_ROUNDING = 1e-12  # of the largest |q|: runs that differ by less are not said to part
_SAME = 8 * np.finfo(float).eps  # of the largest time: samples of one time, computed in two ways
_FEW = 0.5  # of the samples of the run with fewer: if no more are common, all are compared, interpolated


@final
@dataclass(frozen=True, eq=False)
class Difference:
    """b − a at k common times of two runs.

    Attributes:
        joint_names: Of the n joints.
        t: The times, (k,), in [s].
        q, v, u: b − a, (k, n); nan where it was not recorded.
        bound: Difference of q, (k,), up to which the runs are the same motion; inf where that is not known.
        interpolated: Whether they are compared between samples too.
        estimated: Whether the bound is of the estimated errors of both.
    """

    joint_names: tuple[str, ...]
    t: np.ndarray
    q: np.ndarray
    v: np.ndarray
    u: np.ndarray
    bound: np.ndarray
    interpolated: bool
    estimated: bool

    @property
    def parted(self) -> float | None:
        """The first common time at which q differs by more than the bound, in [s]; None if it never does."""
        beyond = np.flatnonzero(~(np.abs(self.q).max(axis=1) <= self.bound))
        return float(self.t[beyond[0]]) if len(beyond) else None

    @property
    def judged_until(self) -> float:
        """The last common time before the first one at which the bound is not known, in [s]."""
        known = np.cumsum(np.isinf(self.bound)) == 0
        return float(self.t[known][-1]) if known.any() else float(self.t[0])


def check_comparable(a: Trajectory, b: Trajectory) -> None:
    """QueryError unless two runs are of one robot, and have times in common."""
    names = tuple(run.about.get("robot", "") for run in (a, b))
    if a.joint_names != b.joint_names:
        of = [f"{name or 'a robot'} ({', '.join(x.joint_names)})" for name, x in zip(names, (a, b), strict=True)]
        raise QueryError(f"runs of different joints cannot be compared: {of[0]} and {of[1]}; give two of one robot")
    if all(names) and names[0] != names[1]:
        raise QueryError(f"runs of different robots, {names[0]} and {names[1]}, cannot be compared; give two of one")
    if not (len(a.t) and len(b.t)):
        raise QueryError("a run without samples cannot be compared; simulate it again")
    if max(a.t[0], b.t[0]) > min(a.t[-1], b.t[-1]):
        raise QueryError(
            f"the runs have no time in common: {a.t[0]:g} to {a.t[-1]:g} s and {b.t[0]:g} to {b.t[-1]:g} s"
        )


def comparable(a: Trajectory, b: Trajectory) -> bool:
    """Whether two runs are of one robot, and have times in common."""
    try:
        check_comparable(a, b)
    except QueryError:
        return False
    return True


@np.errstate(all="ignore")  # the last samples of a run that diverged may overflow
def difference(a: Trajectory, b: Trajectory, tolerance: float = TOLERANCE) -> Difference:
    """Return b − a on the time that both runs have.

    Args:
        a: A run.
        b: Another one of the same robot.
        tolerance: Difference of q above which they part, in [rad] or [m], where one has no estimate of its error.

    Raises:
        QueryError: If they are of different robots, or have no time in common.
    """
    check_comparable(a, b)
    begin, end = max(a.t[0], b.t[0]), min(a.t[-1], b.t[-1])
    inside = [np.flatnonzero((begin <= run.t) & (run.t <= end)) for run in (a, b)]
    i, j = _common(a.t, b.t, *inside)
    interpolates = len(i) <= _FEW * min(map(len, inside))
    if interpolates:
        t = np.unique(np.concatenate([run.t[at] for run, at in zip((a, b), inside, strict=True)]))
        (qa, va, ua), (qb, vb, ub) = _interpolated(a, t), _interpolated(b, t)
        between = np.abs(qa - _coarser(a, t)).max(axis=1) + np.abs(qb - _coarser(b, t)).max(axis=1)
    else:
        t, between = a.t[i], np.zeros(len(i))
        qa, va, ua, qb, vb, ub = a.q[i], a.v[i], a.u[i], b.q[j], b.v[j], b.u[j]
    estimated = _is_estimated(a.error) and _is_estimated(b.error)
    error = _MARGIN * (_error_at(a.error, t) + _error_at(b.error, t)) if estimated else tolerance
    size = np.nan_to_num(np.abs([qa, qb]), nan=0.0, posinf=0.0).max()
    bound = np.maximum(error + between, _ROUNDING * size)
    return Difference(a.joint_names, t, qb - qa, vb - va, ub - ua, bound, interpolates, estimated)


def _common(t: np.ndarray, s: np.ndarray, of_t: np.ndarray, of_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Indices of samples of one time."""
    of_t, of_s = of_t[_last(t[of_t])], of_s[_last(s[of_s])]
    if not (len(of_t) and len(of_s)):
        return of_t[:0], of_s[:0]
    slack = _SAME * t[of_t[-1]]
    near = of_s[np.searchsorted(s[of_s], t[of_t] - slack).clip(max=len(of_s) - 1)]
    same = np.abs(s[near] - t[of_t]) <= slack
    return of_t[same], near[same]


def _last(t: np.ndarray) -> np.ndarray:
    """Whether each of increasing times is the last of equal ones: a run may have several samples at a time."""
    return np.append(np.diff(t) > 0, np.ones(min(len(t), 1), dtype=bool))


def _interpolated(run: Trajectory, t: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """q, v and u of a run at times t within it."""
    at = np.flatnonzero(_last(run.t))
    known, q, v, a = run.t[at], run.q[at], run.v[at], run.a[at]
    return _hermite(known, q, v, t), _hermite(known, v, a, t), _lines(known, run.u[at], t)


def _coarser(run: Trajectory, t: np.ndarray) -> np.ndarray:
    """Positions at times t by every other sample; inf if these are too few."""
    at = np.flatnonzero(_last(run.t))
    at = np.append(at[:-2:2], at[-1:])
    return _hermite(run.t[at], run.q[at], run.v[at], t) if len(at) > 1 else np.full((len(t), run.q.shape[1]), inf)


def _hermite(t: np.ndarray, y: np.ndarray, rate: np.ndarray, at: np.ndarray) -> np.ndarray:
    """The piecewise cubic of values and rates, (k, n); lines where a rate is not known."""
    from scipy.interpolate import CubicHermiteSpline

    if len(t) < 2 or not (np.isfinite(y).all() and np.isfinite(rate).all()):
        return _lines(t, y, at)
    return CubicHermiteSpline(t, y, rate)(at)


def _lines(t: np.ndarray, y: np.ndarray, at: np.ndarray) -> np.ndarray:
    return np.stack([np.interp(at, t, column) for column in y.T], axis=1)


def _is_estimated(error: ErrorEstimate | None) -> bool:
    return error is not None and error.until_s > 0


def _error_at(error: ErrorEstimate | None, t: np.ndarray) -> np.ndarray:
    """The estimated error up to the next time of the estimate, (k,); inf after it is resolved."""
    assert error is not None
    later = np.searchsorted(error.t, t * (1 - _SAME)).clip(max=len(error.t) - 1)
    return np.where(t * (1 - _SAME) <= error.until_s, error.error[later], inf)
