"""Findings about doubtful samples: missing units, gaps, jumps, whole turns, exceeded limits, moving ends, noise."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from robot_dyn.control.extremes import extreme_values
from robot_dyn.control.reference import PiecewisePolynomial
from robot_dyn.control.samples.recorded import Recorded
from robot_dyn.control.samples.turns import Turns, joined_turns, whole_turns
from robot_dyn.foundations.errors import PlanError

_GAP = 5  # times the median time between samples
_DEGREE = np.pi / 180
_FAR = 1.5  # times the limit: positions beyond may be in degrees
_TURNS = 4 * np.pi  # [rad]: the same threshold for joints without limits
_MANY = 0.1  # fraction of samples faster than the limit from which positions may be in degrees
_SLOW, _SPEED = 0.01, np.pi  # fraction of the velocity limit (by default π) below which times may be in [ms]
_WHOLE = 1e-6  # largest distance of times from integers
_MOVES = 1e-6  # [rad] or [m]: a joint with a larger range moves
_LATE_S, _LATE = 1000.0, 10  # [s] and durations: a later start is probably a clock time
_ROUNDING = 1e-9  # rounding by which a sample may exceed a limit
DENSE = 16  # smallest number of samples from which ends at rest, noise and errors can be judged
_AT_REST = 0.05  # fraction of the largest speed of a joint, below which it is at rest
_NOISY = 0.1  # largest fraction of noise in the rms acceleration
_ROUNDED = 1e-12  # [rad] or [m]: rounding of float64, not noise of a sensor


def refuse_other_units(table: Recorded) -> None:
    """Raise a PlanError if angles look like degrees, or times like [ms], and their columns state no unit."""
    t = table.t
    if len(t) < 2:
        return
    _refuse_degrees(table)
    if not table.has_time_unit and np.abs(t - np.round(t)).max() <= _WHOLE and _slow(joined_turns(table).table):
        raise PlanError(
            f"times may be in ms, µs or ns: they are integers, {np.median(table.dt):.6g} apart, and no joint reaches"
            " 1 % of its velocity limit; state the unit in the heading, for example 't [ms]' or 't [s]'"
        )


def findings(turns: Turns, reference: PiecewisePolynomial, ends: str) -> Iterator[str]:
    """Yield a finding, in words, with its remedy, for each doubtful part of the samples or their spline."""
    table, arm = turns.table, turns.table.arm
    yield from _of_times(table, reference)
    position, velocity = extreme_values(reference), extreme_values(reference, 1)
    for i, name in enumerate(arm.joint_names):
        unit, limit = table.unit(i), table.limit[i]
        if not table.has_column[i]:
            yield f"{name} has no samples and rests at {table.q[0, i]:g} {unit}; add a column if it moves"
            continue
        yield from turned(turns, i)
        jumps = list(_jumps(turns, i))
        q = table.q[:, i]
        k = int(np.maximum(arm.lower[i] - q, q - arm.upper[i]).argmax())
        outside = list(_outside(table, i, q[k], table.t[k], "outside its limits", "check unit and joint"))
        yield from jumps + outside
        if not jumps and velocity.largest[i] > (1 + _ROUNDING) * limit:
            at = velocity.greatest_at_s[i] if velocity.greatest[i] > -velocity.least[i] else velocity.least_at_s[i]
            yield (
                f"{name} moves at {velocity.largest[i]:.4g} {unit}/s at {at:.6g} s, although its samples are within the"
                f" limit of {limit:.4g}; slow the motion down, or give more samples"
            )
        if not jumps and not outside:
            for q, t in ((position.least, position.least_at_s), (position.greatest, position.greatest_at_s)):
                where = "between samples within its limits"
                yield from _outside(table, i, q[i], t[i], where, "give more samples there")
    yield from _noise(turns)
    if ends == "rest":
        moving = "although the motion starts and ends at rest; ends='measured' keeps the measured velocity"
        yield from (f"{end}, {moving}" for end in _ends(table))


def _refuse_degrees(table: Recorded) -> None:
    """Raise a PlanError if angles without a stated unit exceed the limits, but would not if they were in degrees."""
    arm, unknown = table.arm, ~table.stated & table.has_column
    if not unknown.any():
        return
    most = np.maximum(np.abs(arm.lower), np.abs(arm.upper))
    far = np.abs(table.q).max(axis=0)
    speed, turns = np.abs(table.speed), whole_turns(table)
    fast = ((speed > table.limit) & ~turns).mean(axis=0) > _MANY
    beyond = (far > np.where(np.isfinite(most), _FAR * most, _TURNS)) & ~turns.any(axis=0)
    fits = (far * _DEGREE <= np.where(np.isfinite(most), most, np.inf)) | ~unknown
    of_degrees = (beyond | fast) & unknown
    if of_degrees.any() and fits.all():
        i, others = int(of_degrees.argmax()), np.flatnonzero(unknown & ~of_degrees)
        name, remedy = arm.joint_names[i], "give unit='deg'"
        if len(others):
            remedy += f" if {arm.joint_names[others[0]]} is in degrees, too; else state units, as in '{name} [deg]'"
        raise PlanError(
            f"angles may be in degrees: {name} reaches {far[i]:.4g}, at up to {speed[:, i].max():.4g} per second;"
            f" {remedy}; give unit='rad' if all are in rad (--unit on the command line)"
        )


def _slow(table: Recorded) -> bool:
    """Return True if a joint moves, but no joint reaches 1 % of its velocity limit."""
    limit = np.where(np.isfinite(table.limit), table.limit, _SPEED)
    moves = (np.ptp(table.q, axis=0) > _MOVES).any()
    return bool(moves and (np.abs(table.speed).max(axis=0) < _SLOW * limit).all())


def _of_times(table: Recorded, reference: PiecewisePolynomial) -> Iterator[str]:
    t, dt = table.t, table.dt
    middle, longest = float(np.median(dt)), int(dt.argmax())
    if gaps := int((dt > _GAP * middle).sum()):
        yield (
            f"{gaps} gap{'s' * (gaps > 1)} in time, the longest of {dt[longest]:.4g} s from {t[longest]:.6g} s, while"
            f" samples are {middle:.4g} s apart: the spline is a guess there; add samples"
        )
    if not table.has_time_unit and (len(t) >= DENSE or middle > 1) and _slow(table):
        yield (
            f"no joint reaches 1 % of its velocity limit in {t[-1] - t[0]:.6g} s, and samples are {middle:.4g} s apart:"
            f" are the times in ms? State the unit in the heading, for example 't [ms]' or 't [s]'"
        )
    start, duration = reference.start_s, reference.end_s - reference.start_s
    if start < 0 or start > max(_LATE_S, _LATE * duration):
        yield f"the first sample is at {start:.10g} s, but runs begin at 0 s; pass start_s=0 to shift the times"


def turned(turns: Turns, i: int) -> Iterator[str]:
    """Yield a finding if the angles of a joint were unwrapped, or if the direction of a large step is ambiguous."""
    table, joined = turns.recorded, turns.joined[i]
    steps = (turns.steps if joined else turns.unclear)[:, i]
    if not steps.any():
        return
    count, k, t, q = int(steps.sum()), int(steps.argmax()), table.t, table.q[:, i]
    first = f"{count} step{'s' * (count > 1)}, the first from {q[k]:.5g} to {q[k + 1]:.5g} rad"
    first = f"{first} at sample {k + 2}, {t[k + 1]:.6g} s"
    if joined:
        yield (
            f"{table.arm.joint_names[i]} jumps by a whole turn in {first}; all its samples lie within one turn, so the"
            " angles were unwrapped: the joint keeps turning; give more samples there if it turned back"
        )
    else:
        yield (
            f"{table.arm.joint_names[i]} moves by more than half a turn in {first}; the direction is ambiguous, so the"
            " angles were not changed; give more samples there, or unwrap the angles"
        )


def _jumps(turns: Turns, i: int) -> Iterator[str]:
    """Yield findings about steps of a joint that are too fast: whole turns that were not unwrapped, and others."""
    table, unit, limit = turns.table, turns.table.unit(i), turns.table.limit[i]
    speed, whole = np.abs(table.speed[:, i]), turns.steps[:, i] & ~turns.joined[i]
    for steps, jump, remedy in (
        (whole, "jumps by a whole turn", "unwrap the angles if the joint kept turning, for example by numpy.unwrap"),
        ((speed > limit) & ~whole, "jumps", "correct the sample, or slow the motion down"),
    ):
        if count := int(steps.sum()):
            k = int(np.where(steps, speed, 0).argmax())
            yield (
                f"{table.arm.joint_names[i]} {jump}: from {table.q[k, i]:.5g} to {table.q[k + 1, i]:.5g} {unit} in"
                f" {table.dt[k]:.4g} s at {table.t[k]:.6g} s, {speed[k]:.4g} {unit}/s of {limit:.4g} allowed, in"
                f" {count} step{'s' * (count > 1)}; {remedy}"
            )


def _outside(table: Recorded, i: int, q: float, t: float, where: str, remedy: str) -> Iterator[str]:
    """Yield a finding if a position is outside the limits of a joint."""
    lower, upper = table.arm.lower[i], table.arm.upper[i]
    if max(lower - q, q - upper) > _ROUNDING:
        at = f"{table.arm.joint_names[i]} is at {q:.5g} {table.unit(i)} at {t:.6g} s"
        yield f"{at}, {where} {lower:.5g} to {upper:.5g}; {remedy}"


def refuse_moving_ends(table: Recorded) -> None:
    """Raise a PlanError if joints move at the ends of dense samples: stopping in one step would need large torques."""
    for end in _ends(table):
        raise PlanError(
            f"{end}; give ends='measured' if the samples are part of a longer motion, or ends='rest' if the motion"
            " stops there (--ends on the command line)"
        )


def _ends(table: Recorded) -> Iterator[str]:
    """Yield a sentence about the fastest joint at each end of dense samples, unless it is nearly at rest."""
    speed = np.abs(table.speed)
    for where, k in (("start", 0), ("end", -1)) if len(table.t) >= DENSE else ():
        i = int(speed[k].argmax())
        if speed[k, i] > _AT_REST * speed[:, i].max():
            name, unit = table.arm.joint_names[i], table.unit(i, "rad/s")
            yield f"{name} moves at {speed[k, i]:.3g} {unit} at the {where} of the samples"


def _noise(turns: Turns) -> Iterator[str]:
    """Yield a finding about the joint whose acceleration is affected most by noise, if noise exceeds 10 % of it.

    Fourth divided differences of independent errors have an rms of σ times the norm of their weights. At small steps
    this exceeds those of a smooth motion by far. A second divided difference is half an acceleration. Joints whose
    turns were not unwrapped, or are unclear, are skipped.
    """
    table = turns.table
    if len(table.t) < DENSE:
        return
    (fourth, norms), (second, norms_of_second) = _divided(table, 4), _divided(table, 2)
    if not min(len(norms), len(norms_of_second)):
        return
    noise = np.sqrt(((fourth / norms[:, None]) ** 2).mean(axis=0))
    by_noise = 2 * noise * np.sqrt((norms_of_second**2).mean())
    with np.errstate(invalid="ignore", divide="ignore"):
        part = np.nan_to_num(np.minimum(by_noise / (2 * np.sqrt((second**2).mean(axis=0))), 1.0))
    part[noise < _ROUNDED] = 0.0  # joints at rest
    part[(turns.steps.any(axis=0) & ~turns.joined) | turns.unclear.any(axis=0)] = 0.0
    i = int(part.argmax())
    if part[i] > _NOISY:
        unit, others = table.unit(i), int((part > _NOISY).sum()) - 1
        also = f" (and {others} other joint{'s' * (others > 1)})" * bool(others)
        yield (
            f"{table.arm.joint_names[i]}{also}: noise or rounding of {noise[i]:.1g} {unit}, or inexact times, causes"
            f" accelerations of {by_noise[i]:.2g} {unit}/s², {part[i]:.0%} of those of the samples, and therefore"
            " wrong torques; smooth the samples first, for example by scipy.signal.savgol_filter"
        )


def _divided(table: Recorded, order: int) -> tuple[np.ndarray, np.ndarray]:
    """Return divided differences Σ_j w_j q_j of neighbours without gaps, (k, n), and the norms of w, (k,)."""
    t = np.lib.stride_tricks.sliding_window_view(table.t, order + 1)
    t = t[np.diff(t).max(axis=1) <= _GAP * np.median(table.dt)]
    at = np.searchsorted(table.t, t)
    apart = t[:, :, None] - t[:, None, :] + np.eye(order + 1)
    weights = 1 / apart.prod(axis=2)
    return np.einsum("kj,kji->ki", weights, table.q[at]), np.sqrt((weights**2).sum(axis=1))
