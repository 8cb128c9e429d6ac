"""The difference of two runs of one robot: their motion at common times, and the settings that differ.

Two runs part where |q_b − q_a| of a joint exceeds twice the sum of their estimated errors, which are not bounds, or a
tolerance if one of them has no estimate. They are compared at common samples. Between these, q of each run is
interpolated at the samples of the other by quintics of (q, v, a), if no event is near and the error of interpolation is
at most half of the difference at which runs part. The bound at samples h apart is

    δ = max |q_j − p| + h |v_j − p'| + h² |a_j − p''|,    p the quintic between the two neighbours of sample j

over the samples j next to it. If q is smooth, δ is 400 times the error. If an interval contains one impact, or one jump
of a force or of its rate, the error is below δ anywhere in the interval.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import inf, nan
from typing import final

import numpy as np

from robot_dyn.control.reference import hermite, polynomial
from robot_dyn.foundations.errors import QueryError
from robot_dyn.simulation.results.run_data import TrajectoryData

TOLERANCE = 1e-6  # [rad] or [m], for runs without an estimate of their error
HALF = 0.5  # fraction of the time: least fraction that must be compared to conclude that runs are the same motion
_MARGIN = 2.0  # factor on estimated errors
_ROUNDING = 1e-12  # fraction of the largest |q|: a smaller difference is rounding
_SAME = 8 * np.finfo(float).eps  # relative difference of one time computed in two ways
_PART = 0.5  # fraction of the difference up to which runs are the same motion: largest error of interpolation
_NEIGHBOUR = 0.5  # fraction of the length of an interval: a shorter neighbour does not bound its error
_CHUNK = 20_000  # times at which a run is interpolated at once


@final
@dataclass(frozen=True, eq=False)
class Difference:
    """b − a at k times of two runs.

    Attributes:
        joint_names: Names of the n joints.
        start_s, end_s: First and last time of both runs, in [s].
        t: The times at which they are compared, (k,), in [s].
        q, v, u: b − a, (k, n); nan if not recorded; v and u are nan between common samples.
        is_common: True at times when both runs have a sample, (k,); at the others, q of one run is interpolated.
        bound: Difference of q, (k,), up to which the runs are the same motion; inf if unknown.
        interpolation: Largest error of interpolation that the bounds allow for; 0 if no time is interpolated.
        fraction: Fraction of the common time that was compared: intervals between neighbouring times of t in which at
            most one run has further samples.
        estimated: True if the bound is computed from the estimated errors of both.
    """

    joint_names: tuple[str, ...]
    start_s: float
    end_s: float
    t: np.ndarray
    q: np.ndarray
    v: np.ndarray
    u: np.ndarray
    is_common: np.ndarray
    bound: np.ndarray
    interpolation: float
    fraction: float
    estimated: bool

    @property
    def parted_s(self) -> float | None:
        """The first time at which q differs by more than the bound, in [s]; None if it never does."""
        beyond = np.flatnonzero(~(np.abs(self.q).max(axis=1) <= self.bound))
        return float(self.t[beyond[0]]) if len(beyond) else None

    @property
    def is_conclusive(self) -> bool:
        """True if enough of the time was compared to conclude that runs do not part."""
        return self.fraction >= HALF

    @property
    def judged_until_s(self) -> float:
        """The last time before the first unknown bound, in [s]."""
        bounded = np.cumsum(np.isinf(self.bound)) == 0
        return float(self.t[bounded][-1]) if bounded.any() else self.start_s


def check_comparable(a: TrajectoryData, b: TrajectoryData) -> None:
    """Raise a QueryError unless two runs are of one robot and have times in common."""
    names = tuple(run.metadata.get("robot", "") for run in (a, b))
    if a.joint_names != b.joint_names:
        both = [f"{name or 'a robot'} ({', '.join(x.joint_names)})" for name, x in zip(names, (a, b), strict=True)]
        raise QueryError(
            f"runs of different joints cannot be compared: {both[0]} and {both[1]}; compare runs of one robot"
        )
    if all(names) and names[0] != names[1]:
        raise QueryError(
            f"runs of different robots, {names[0]} and {names[1]}, cannot be compared; compare runs of one robot"
        )
    if not (len(a.t) and len(b.t)):
        raise QueryError("a run without samples cannot be compared; simulate it again")
    if max(a.t[0], b.t[0]) > min(a.t[-1], b.t[-1]):
        raise QueryError(
            f"the runs have no time in common: {a.t[0]:g} to {a.t[-1]:g} s and {b.t[0]:g} to {b.t[-1]:g} s"
        )


def comparable(a: TrajectoryData, b: TrajectoryData) -> bool:
    """Return True if two runs are of one robot and have times in common."""
    try:
        check_comparable(a, b)
    except QueryError:
        return False
    return True


@np.errstate(all="ignore")  # the last samples of a run that diverged may overflow
def difference(a: TrajectoryData, b: TrajectoryData, tolerance: float = TOLERANCE) -> Difference:
    """Return b − a over the time common to both runs.

    Args:
        a: A run.
        b: Another run of the same robot.
        tolerance: Difference of q above which they part, in [rad] or [m], if one has no estimate of its error.

    Raises:
        QueryError: If the robots differ, or the runs have no time in common.
    """
    check_comparable(a, b)
    start, end = float(max(a.t[0], b.t[0])), float(min(a.t[-1], b.t[-1]))
    inside = [np.flatnonzero((start <= run.t) & (run.t <= end)) for run in (a, b)]
    i, j = _common(a.t, b.t, *inside)
    estimated = a.error is not None and b.error is not None and min(a.error.until_s, b.error.until_s) > 0
    floor = _ROUNDING * max((float(np.abs(run.q[at][np.isfinite(run.q[at])]).max(initial=0.0))
                             for run, at in zip((a, b), inside, strict=True)))  # fmt: skip

    def allowed(t: np.ndarray) -> np.ndarray:
        """Return the difference of q, (k,), that their errors explain."""
        if not (estimated and a.error is not None and b.error is not None):
            return np.full(len(t), max(tolerance, floor))
        return np.maximum(_MARGIN * (a.error.at(t) + b.error.at(t)), floor)

    alone_a, alone_b = _not_among(a.t, inside[0], i), _not_among(b.t, inside[1], j)
    stretches = np.intersect1d(np.searchsorted(a.t[i], a.t[alone_a]), np.searchsorted(a.t[i], b.t[alone_b]))
    parts = [(a.t[i], b.q[j] - a.q[i], np.zeros(len(i)))]
    for run, at, other, sign in ((a, alone_a, b, 1), (b, alone_b, a, -1)):
        at = at[np.isin(np.searchsorted(a.t[i], run.t[at]), stretches)]
        q, between = _interpolated(other, run.t[at])
        limit = allowed(run.t[at])
        limit[np.isinf(limit)] = max(limit[np.isfinite(limit)].max(initial=0.0), tolerance)
        sound = between <= _PART * limit
        parts.append((run.t[at][sound], sign * (q - run.q[at])[sound], between[sound]))
    t, q, between = (np.concatenate(arrays) for arrays in zip(*parts, strict=True))
    order = np.argsort(t, kind="stable")
    unknown = np.full((len(t) - len(i), len(a.joint_names)), nan)
    v, u = (np.concatenate([x[j] - y[i], unknown])[order] for x, y in ((b.v, a.v), (b.u, a.u)))
    return Difference(
        a.joint_names, start, end, t[order], q[order], v, u,
        is_common=order < len(i),
        bound=(allowed(t) + between)[order],
        interpolation=float(between.max(initial=0.0)),
        fraction=_fraction(start, end, t[order], a.t[alone_a], b.t[alone_b]),
        estimated=estimated,
    )  # fmt: skip


def _fraction(start: float, end: float, t: np.ndarray, of_a: np.ndarray, of_b: np.ndarray) -> float:
    """Return the fraction of the time that was compared at times t, from the other samples of both runs."""
    if not start < end:
        return float(len(t) > 0)
    hidden = [np.bincount(np.searchsorted(t, np.setdiff1d(x, t)), minlength=len(t) + 1)[1:-1] for x in (of_a, of_b)]
    return float(np.diff(t)[np.minimum(*hidden) == 0].sum()) / (end - start)


def _not_among(t: np.ndarray, inside: np.ndarray, common: np.ndarray) -> np.ndarray:
    """Return the indices of the last sample at each time, without the common samples."""
    return np.setdiff1d(inside[_last(t[inside])], common, assume_unique=True)


def _common(t: np.ndarray, s: np.ndarray, of_t: np.ndarray, of_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the indices of samples of two runs at the same times."""
    of_t, of_s = of_t[_last(t[of_t])], of_s[_last(s[of_s])]
    if not (len(of_t) and len(of_s)):
        return of_t[:0], of_s[:0]
    slack = _SAME * t[of_t[-1]]
    near = of_s[np.searchsorted(s[of_s], t[of_t] - slack).clip(max=len(of_s) - 1)]
    same = np.abs(s[near] - t[of_t]) <= slack
    return of_t[same], near[same]


def _last(t: np.ndarray) -> np.ndarray:
    """Return True for the last of equal times, in increasing order: a run may have several samples at a time."""
    return np.append(np.diff(t) > 0, np.ones(min(len(t), 1), dtype=bool))


def _interpolated(run: TrajectoryData, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return positions (k, n) of a run at times t within it, and the bound on their error, (k,); inf if unbounded."""
    at = np.flatnonzero(_last(run.t))
    times, points = run.t[at], np.stack([run.q[at], run.v[at], run.a[at]], axis=1)
    if len(times) < 3:
        return np.full((len(t), points.shape[2]), nan), np.full(len(t), inf)
    events = np.array([event.t for event in run.events])
    slack = _SAME * times[-1]
    eventful = np.searchsorted(events, times[:-1] - slack) < np.searchsorted(events, times[1:] + slack, "right")
    chunks = [_of_quintics(times, points, eventful, t[k : k + _CHUNK]) for k in range(0, max(len(t), 1), _CHUNK)]
    q, bound = (np.concatenate(arrays) for arrays in zip(*chunks, strict=True))
    return q, bound


def _of_quintics(
    times: np.ndarray, points: np.ndarray, eventful: np.ndarray, t: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return the result of `_interpolated` at times t.

    Args:
        times: Times of samples, (m,).
        points: q, v and a there, (m, 3, n).
        eventful: True for intervals between samples that contain an event, (m − 1,).
        t: Times, (k,).
    """
    i = (np.searchsorted(times, t, "right") - 1).clip(0, len(times) - 2)
    h = times[i + 1] - times[i]
    bound = np.full(len(t), -inf)
    for j in (i, i + 1):  # samples next to t
        before, after = np.maximum(j - 1, 0), np.minimum(j + 1, len(times) - 1)
        neighbour = np.where(j == i, times[i] - times[before], times[after] - times[i + 1])
        usable = (neighbour >= _NEIGHBOUR * h) & ~eventful[before] & ~eventful[np.minimum(j, len(eventful) - 1)]
        off = np.abs(points[j] - np.stack(_quintic(times, points, before, after, times[j]), axis=1))
        sizes = (off * (h[:, None] ** np.arange(3))[:, :, None]).sum(axis=1).max(axis=1)
        bound = np.where(usable, np.maximum(bound, sizes), bound)
    bound = np.where((bound >= 0) & ~eventful[i], bound, inf)
    return _quintic(times, points, i, i + 1, t)[0], bound


def _quintic(
    times: np.ndarray, points: np.ndarray, i: np.ndarray, j: np.ndarray, t: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return q, v and a at times t of the quintics between samples i and j, (k, n) each."""
    c = hermite(times[j] - times[i], np.concatenate([points[i], points[j]], axis=1))
    return polynomial(c, (t - times[i])[:, None])
