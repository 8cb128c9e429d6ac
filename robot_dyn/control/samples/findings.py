"""What is doubtful in samples: units that are not stated, gaps, jumps, whole turns, limits passed, ends that move."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from robot_dyn.control.extremes import extreme_values
from robot_dyn.control.reference import PiecewisePolynomial
from robot_dyn.control.samples.columns import Columns
from robot_dyn.control.samples.turns import Turns, joined_turns, whole_turns
from robot_dyn.foundations.errors import PlanError
from robot_dyn.model.robot import Robot
from robot_dyn.queries.units import of_joint

_GAP = 5  # times the median time between samples
_DEGREE = np.pi / 180
_FAR = 1.5  # times the limit: beyond, positions may be in degrees
_TURNS = 4 * np.pi  # the same for joints without limits, [rad]
_MANY = 0.1  # of the samples: so many faster than their limit may be in degrees
_SLOW, _SPEED = 0.01, np.pi  # of the velocity limit, or of so much without one: slower, times may be in [ms]
_WHOLE = 1e-6  # from whole numbers
_MOVES = 1e-6  # [rad] or [m]
_LATE_S, _LATE = 1000.0, 10  # a later start, by so many durations, is that of a clock
_ROUNDING = 1e-9  # of a limit that a sample may pass
DENSE = 16  # samples from which ends at rest, noise, and an error, can be judged
_AT_REST = 0.05  # of the largest speed of a joint
_NOISY = 0.1  # part of the rms acceleration that noise may be
_ROUNDED = 1e-12  # [rad] or [m]: float64, and no sensor


def refuse_other_units(arm: Robot, table: Columns) -> None:
    """Raise PlanError if angles look like degrees, or times like [ms], and their columns state no unit."""
    t = table.t
    if len(t) < 2:
        return
    _refuse_degrees(arm, table)
    slow = not table.of_time and _slow(arm, joined_turns(arm, table).table)
    if slow and np.abs(t - np.round(t)).max() <= _WHOLE:
        raise PlanError(
            f"times look like ms, µs or ns: whole numbers, {np.median(np.diff(t)):.6g} apart, and no joint reaches 1 %"
            " of its speed; state the unit in the heading, as 't [ms]', or 't [s]' if they are not"
        )


def findings(arm: Robot, turns: Turns, reference: PiecewisePolynomial, ends: str) -> Iterator[str]:
    """What is doubtful, in words, each with its remedy."""
    table = turns.table
    yield from _of_times(arm, table, reference)
    speed = np.diff(table.q, axis=0) / np.diff(table.t)[:, None]
    within, velocity = extreme_values(reference), extreme_values(reference, 1)
    for i in range(arm.n):
        name, unit = arm.joint_names[i], of_joint("rad", arm.joint_types[i])
        if not table.given[i]:
            yield f"{name} has no samples and rests at {table.q[0, i]:g} {unit}; give a column if it moves"
            continue
        yield from turned(arm, turns, i)
        jumps = list(_jumps(arm, turns, i, speed[:, i]))
        outside = list(_outside(arm, table, i))
        yield from jumps + outside
        if not jumps and velocity.largest[i] > (1 + _ROUNDING) * _limit(arm)[i]:
            at = velocity.at_greatest[i] if velocity.greatest[i] > -velocity.least[i] else velocity.at_least[i]
            yield (
                f"{name} moves at {velocity.largest[i]:.4g} {unit}/s at {at:.6g} s, between samples that are no faster"
                f" than its limit, {arm.velocity_limit[i]:.4g}; lengthen the times, or give more samples"
            )
        if not jumps and not outside:
            yield from _between(arm, i, within.least[i], within.at_least[i], within.greatest[i], within.at_greatest[i])
    yield from _noise(arm, turns)
    if ends == "rest":
        yield from (
            f"{what}, where the motion is at rest; ends='measured' moves as they do" for what in _ends(arm, table)
        )


def _limit(arm: Robot) -> np.ndarray:
    """Velocity limits, (n,): 0 in a file is none."""
    return np.where(arm.velocity_limit > 0, arm.velocity_limit, np.inf)


def _refuse_degrees(arm: Robot, table: Columns) -> None:
    """PlanError if angles without a stated unit are beyond the limits, and within them as degrees."""
    unknown = ~table.stated & table.given
    if not unknown.any():
        return
    most = np.maximum(np.abs(arm.lower), np.abs(arm.upper))
    far = np.abs(table.q).max(axis=0)
    speed, turns = np.abs(np.diff(table.q, axis=0)) / np.diff(table.t)[:, None], whole_turns(arm, table)
    fast = ((speed > _limit(arm)) & ~turns).mean(axis=0) > _MANY
    beyond = (far > np.where(np.isfinite(most), _FAR * most, _TURNS)) & ~turns.any(axis=0)
    fits = (far * _DEGREE <= np.where(np.isfinite(most), most, np.inf)) | ~unknown
    of_degrees = (beyond | fast) & unknown
    for i in np.flatnonzero(of_degrees)[:1]:
        if fits.all():
            name = arm.joint_names[i]
            what = f"{name} is at up to {far[i]:.4g}, moving at up to {speed[:, i].max():.4g} a second"
            remedy, others = "give unit='deg'", np.flatnonzero(unknown & ~of_degrees)
            if len(others):
                remedy += f" if those of {arm.joint_names[others[0]]} are, too, else head columns as '{name} [deg]'"
            raise PlanError(
                f"angles look like degrees: {what}; {remedy}, or unit='rad' if none are; --unit on the command line"
            )


def _slow(arm: Robot, table: Columns) -> bool:
    """Whether some joint moves, and none reaches a hundredth of its speed."""
    speed = np.abs(np.diff(table.q, axis=0) / np.diff(table.t)[:, None]).max(axis=0)
    limit = np.where(np.isfinite(_limit(arm)), _limit(arm), _SPEED)
    return bool((np.ptp(table.q, axis=0) > _MOVES).any() and (speed < _SLOW * limit).all())


def _of_times(arm: Robot, table: Columns, reference: PiecewisePolynomial) -> Iterator[str]:
    t, dt = table.t, np.diff(table.t)
    middle, longest = float(np.median(dt)), int(dt.argmax())
    if gaps := int((dt > _GAP * middle).sum()):
        yield (
            f"{gaps} gap{'s' * (gaps > 1)} in time, the longest of {dt[longest]:.4g} s from {t[longest]:.6g} s, where"
            f" samples are {middle:.4g} s apart: the spline is a guess there; fill it in"
        )
    if not table.of_time and (len(t) >= DENSE or middle > 1) and _slow(arm, table):
        yield (
            f"no joint reaches 1 % of its speed in {t[-1] - t[0]:.6g} s, samples are {middle:.4g} s apart: are the"
            f" times in ms? state the unit in the heading, as 't [ms]' or 't [s]'"
        )
    start, duration = reference.start, reference.end - reference.start
    if start < 0 or start > max(_LATE_S, _LATE * duration):
        yield f"the first sample is at {start:.10g} s, and runs begin at 0 s; start_s=0 begins there"


def turned(arm: Robot, turns: Turns, i: int) -> Iterator[str]:
    """Yield what was done about whole turns of a joint recorded within one turn."""
    name, t, q = arm.joint_names[i], turns.recorded.t, turns.recorded.q[:, i]
    if turns.joined[i]:
        count, k = int(turns.steps[:, i].sum()), int(turns.steps[:, i].argmax())
        yield (
            f"{name} jumps by a whole turn in {count} step{'s' * (count > 1)}, the first from {q[k]:.5g} to"
            f" {q[k + 1]:.5g} rad at sample {k + 2}, {t[k + 1]:.6g} s; all its samples lie within one turn, so the"
            " angles were unwrapped: the joint turns on; give more samples there if it turned back"
        )
    elif turns.unclear[:, i].any():
        count, k = int(turns.unclear[:, i].sum()), int(turns.unclear[:, i].argmax())
        yield (
            f"{name} moves by more than half a turn in {count} step{'s' * (count > 1)}, the first from {q[k]:.5g} to"
            f" {q[k + 1]:.5g} rad at sample {k + 2}, {t[k + 1]:.6g} s; it may have turned either way, and nothing"
            " was changed; give more samples there, or unwrap the angles"
        )


def _jumps(arm: Robot, turns: Turns, i: int, speed: np.ndarray) -> Iterator[str]:
    """Steps of a joint that are too fast: whole turns that were left, and others."""
    table, name, unit = turns.table, arm.joint_names[i], of_joint("rad", arm.joint_types[i])
    dt, whole = np.diff(table.t), turns.steps[:, i] & ~turns.joined[i]
    for steps, what, remedy in (
        (whole, "jumps by a whole turn", "unwrap the angles if the joint turned on, as numpy.unwrap does"),
        ((np.abs(speed) > _limit(arm)[i]) & ~whole, "jumps", "correct the sample, or lengthen the times"),
    ):
        if count := int(steps.sum()):
            k = int(np.where(steps, np.abs(speed), 0).argmax())
            yield (
                f"{name} {what}: from {table.q[k, i]:.5g} to {table.q[k + 1, i]:.5g} {unit} in {dt[k]:.4g} s at"
                f" {table.t[k]:.6g} s, {abs(speed[k]):.4g} {unit}/s of {_limit(arm)[i]:.4g} allowed, in {count}"
                f" step{'s' * (count > 1)}; {remedy}"
            )


def _outside(arm: Robot, table: Columns, i: int) -> Iterator[str]:
    """The sample that is furthest outside the position limits."""
    q = table.q[:, i]
    outside = np.maximum(arm.lower[i] - q, q - arm.upper[i])
    if outside.max() > _ROUNDING:
        k = int(outside.argmax())
        at = f"{arm.joint_names[i]} is at {q[k]:.5g} {of_joint('rad', arm.joint_types[i])} at {table.t[k]:.6g} s"
        yield f"{at}, outside its limits {arm.lower[i]:.5g} to {arm.upper[i]:.5g}; check unit and joint"


def _between(arm: Robot, i: int, least: float, at_least: float, greatest: float, at_greatest: float) -> Iterator[str]:
    """Where the spline is outside the position limits, between samples that are within them."""
    for q, t, outside in (
        (least, at_least, arm.lower[i] - least),
        (greatest, at_greatest, greatest - arm.upper[i]),
    ):
        if outside > _ROUNDING:
            at = f"{arm.joint_names[i]} is at {q:.5g} {of_joint('rad', arm.joint_types[i])} at {t:.6g} s"
            limits = f"{arm.lower[i]:.5g} to {arm.upper[i]:.5g}"
            yield f"{at}, between samples within its limits {limits}; give more samples there"


def refuse_moving_ends(arm: Robot, table: Columns) -> None:
    """Raise PlanError if joints move at the ends of dense samples: a stop within one step takes torques of its own."""
    for what in _ends(arm, table):
        raise PlanError(
            f"{what}: say whether the samples are cut from a longer motion, ends='measured', or the motion stops there,"
            " ends='rest'; --ends on the command line"
        )


def _ends(arm: Robot, table: Columns) -> Iterator[str]:
    """Of dense samples the joint that moves fastest at the start, and at the end, unless all are nearly at rest."""
    if len(table.t) < DENSE:
        return
    speed = np.diff(table.q, axis=0) / np.diff(table.t)[:, None]
    for where, k in (("start", 0), ("end", -1)):
        i = int(np.abs(speed[k]).argmax())
        if abs(speed[k, i]) > _AT_REST * np.abs(speed[:, i]).max():
            unit = of_joint("rad/s", arm.joint_types[i])
            yield f"by its samples {arm.joint_names[i]} moves at {abs(speed[k, i]):.3g} {unit} at the {where}"


def _noise(arm: Robot, turns: Turns) -> Iterator[str]:
    """The joint whose acceleration noise or rounding determines most; none with whole turns, which are not noise.

    Of a smooth motion fourth divided differences vanish with the step as its fourth power, beside those of independent
    errors of deviation σ, which are σ times the norm of their weights; second ones are halves of accelerations.
    """
    table = turns.table
    if len(table.t) < DENSE:
        return
    fourth, second = _divided(table, 4), _divided(table, 2)
    if not min(len(fourth.norms), len(second.norms)):
        return
    noise = np.sqrt(((fourth.values / fourth.norms[:, None]) ** 2).mean(axis=0))
    by_noise = 2 * noise * np.sqrt((second.norms**2).mean())
    with np.errstate(invalid="ignore", divide="ignore"):
        part = np.nan_to_num(np.minimum(by_noise / (2 * np.sqrt((second.values**2).mean(axis=0))), 1.0))
    part[noise < _ROUNDED] = 0.0  # of joints that rest
    part[(turns.steps.any(axis=0) & ~turns.joined) | turns.unclear.any(axis=0)] = 0.0
    i = int(part.argmax())
    if part[i] > _NOISY:
        unit, others = of_joint("rad", arm.joint_types[i]), int((part > _NOISY).sum()) - 1
        also = f" ({others} other joint{'s' * (others > 1)} alike)" * bool(others)
        yield (
            f"{arm.joint_names[i]}{also}: noise or rounding of {noise[i]:.1g} {unit}, or times that are off, make"
            f" accelerations of {by_noise[i]:.2g} {unit}/s², {part[i]:.0%} of those of the samples, and torques with"
            " them; smooth the samples first, as scipy.signal.savgol_filter does"
        )


class _Divided(NamedTuple):
    """Divided differences Σ_j w_j q_j of neighbouring samples: values, (k, n), and norms of their weights w, (k,)."""

    values: np.ndarray
    norms: np.ndarray


def _divided(table: Columns, order: int) -> _Divided:
    """Divided differences of an order, without those that span a gap."""
    t = np.lib.stride_tricks.sliding_window_view(table.t, order + 1)
    t = t[np.diff(t).max(axis=1) <= _GAP * np.median(np.diff(table.t))]
    at = np.searchsorted(table.t, t)
    apart = t[:, :, None] - t[:, None, :] + np.eye(order + 1)
    weights = 1 / apart.prod(axis=2)
    return _Divided(np.einsum("kj,kji->ki", weights, table.q[at]), np.sqrt((weights**2).sum(axis=1)))
