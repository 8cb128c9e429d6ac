"""Estimates of the error of a run of step h, from companion runs with steps of another length.

With e(h) = q_h − q the error of a run of step h:

    order seen   |e(h)| ≈ |q_h − q_2h| / (2ᵖ − 1), where |q_h − q_3h| / |q_h − q_2h| is near (3ᵖ − 1) / (2ᵖ − 1)
    bounded      |e(h)| ≤ about max |q_h − q_mh| / (m − 1) over m = 2, 3, 5: undivided but for the order 1 that every
                 method keeps; steps of incommensurate lengths do not meet a switch at the same node
    none         where the companions differ as much as the motion itself

[Richardson 1911; Hairer, Nørsett, Wanner 1993, II.4]
"""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction

import numpy as np

from robot_dyn.simulation.error import ErrorEstimate, Verdict, no_estimate
from robot_dyn.simulation.record import Path

ROUNDING = 4500  # units of rounding of q, or as many as steps if there are more: differences below are no error
COARSE = (Fraction(2), Fraction(3), Fraction(5))
FINE = (Fraction(1, 2), Fraction(1, 3))
_BAND = 2.0  # a ratio of differences may be this factor off the one of the method's order
_ROWS = 2000  # of an estimate, at most
_FAR_OFF = 8.0  # times the bound of the others: beyond, the longest step is no longer in the range of the method
_LOST = 0.1  # of the motion, at most 0.1 rad or m: companions that differ by more tell nothing


def from_longer_steps(run: Path, n: int, companions: Mapping[Fraction, Path], order: int, kink: float) -> ErrorEstimate:
    """The estimate from companion runs of longer steps.

    Args:
        run: States of the run.
        n: Number of joints.
        companions: States of the companions by the length of their steps; those of `COARSE`.
        order: p, of the method.
        kink: Time from which the right-hand side may not be smooth, in [s]: no division by 2ᵖ − 1 after it.
    """
    gaps = {pace: differences(run, path, n) for pace, path in companions.items()}
    t = run.t
    A, B, C = (gaps[pace] for pace in COARSE)
    floor = rounding(run, n)
    # a companion that ended early leaves nan; the longest step may, the others are needed
    bound = np.maximum(A, B / 2)
    bound = np.fmax(bound, np.minimum(C / 4, _FAR_OFF * bound))
    ratio = np.maximum(B, floor) / np.maximum(A, floor)
    nominal = (3.0**order - 1) / (2.0**order - 1)
    seen = ((ratio > nominal / _BAND) & (ratio < nominal * _BAND) | (floor >= A)) & (t < kink)
    error = np.maximum(np.where(seen, A / (2.0**order - 1), bound), floor)
    return _judged(run, n, error, seen, np.isnan(bound) | (_least_motion(run, n) < A))


def from_shorter_steps(
    run: Path, n: int, companions: Mapping[Fraction, Path], order: int, kink: float
) -> ErrorEstimate:
    """The estimate from companion runs of shorter steps, as `from_longer_steps`; those of `FINE`.

    |q_h − q_{h/m}| = |e(h)| (1 − m⁻ᵖ) needs no division.
    """
    gaps = [differences(run, companions[pace], n) for pace in FINE]
    between = differences(companions[FINE[1]], companions[FINE[0]], n)
    between = between[np.minimum(np.searchsorted(companions[FINE[1]].key, run.key), len(between) - 1)]
    floor = rounding(run, n)
    error = np.maximum(np.maximum(*gaps), between)
    seen = ((between < error / 2) | (error <= floor)) & (run.t < kink)
    return _judged(run, n, np.maximum(error, floor), seen, np.isnan(error) | (error > _least_motion(run, n)))


def from_tolerances(run: Path, n: int, tight: Path | None, loose: Path, kink: float) -> ErrorEstimate:
    """The estimate of a method that chooses its steps, from companions of a tenth and of ten times its tolerance.

    Args:
        run: States of the run.
        n: Number of joints.
        tight: Of a tenth of the tolerance; None where that is beyond floats.
        loose: Of ten times the tolerance.
        kink: As of `from_longer_steps`.
    """
    far, floor = differences(run, loose, n), rounding(run, n)
    near = differences(run, tight, n) if tight is not None else far
    bound = np.fmax(near, far / 4) if tight is not None else far
    ratio = np.maximum(far, floor) / np.maximum(near, floor)
    seen = ((ratio > 2) & (ratio < 100) | (bound <= floor)) & (run.t < kink) & (tight is not None)
    error = np.maximum(np.where(seen, near, bound), floor)
    return _judged(run, n, error, seen, np.isnan(bound) | (bound > _least_motion(run, n)))


def differences(run: Path, companion: Path, n: int) -> np.ndarray:
    """Largest |q − q_companion| over the joints up to each state of the run; nan after the companion's end."""
    _, here, there = np.intersect1d(run.key, companion.key, assume_unique=True, return_indices=True)
    if not len(here):
        return np.full(len(run.t), np.nan)
    gap = np.maximum.accumulate(np.abs(run.y[here, :n] - companion.y[there, :n]).max(axis=1))
    result = gap[np.maximum(np.searchsorted(here, np.arange(len(run.t)), side="right") - 1, 0)]
    result[run.key > companion.key[-1]] = np.nan
    return result


def lost_at(run: Path, companion: Path, n: int) -> float:
    """Time in [s] at which a companion differs from the run as much as the motion itself; inf if it does not."""
    gap = differences(run, companion, n)
    lost = np.flatnonzero(np.isnan(gap) | (gap > _least_motion(run, n)))
    return float(run.t[lost[0]]) if len(lost) else np.inf


def rounding(run: Path, n: int) -> np.ndarray:
    """Error that rounding of q in every step may leave, up to each state."""
    size = np.maximum.accumulate(np.abs(run.y[:, :n]).max(axis=1))
    return np.finfo(float).eps * np.maximum(ROUNDING, run.key) * (1 + size)


def _least_motion(run: Path, n: int) -> float:
    return _LOST * min(1.0, max(float(np.ptp(run.y[:, :n], axis=0).max()), 1e-6))


def _judged(run: Path, n: int, error: np.ndarray, seen: np.ndarray, lost: np.ndarray) -> ErrorEstimate:
    """The estimate up to where it is lost, with its verdict."""
    bad = np.flatnonzero(lost)
    last = int(bad[0]) - 1 if len(bad) else len(run.t) - 1
    if last < 0:
        return no_estimate("runs with other steps fail at the start")
    rows = np.unique(np.linspace(0, last, min(last + 1, _ROWS)).astype(int))
    verdict = Verdict.ORDER if seen[last] else Verdict.BOUND
    note = "" if last == len(run.t) - 1 else "runs with other steps differ as much as the motion itself"
    return ErrorEstimate(run.t[rows], np.maximum.accumulate(error)[rows], float(run.t[last]), note, verdict)
