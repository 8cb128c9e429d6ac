"""A log of an arm: positions and torques, or motor currents, at equal times; what cannot be a log is refused."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, final

import numpy as np

from robot_dyn import Robot, RobotDynError, Trajectory
from robot_dyn.control import PiecewisePolynomial, name_of, recorded, refuse_other_units, table_of
from robot_dyn.foundations import Value, instance, nearest, numbers, read_only
from robot_dyn.tools.identify.signals import evenly

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    State = tuple[np.ndarray, np.ndarray, np.ndarray]

TORQUES = ("tau", "torque", "effort", "u")
_STILL = 1e-3  # [rad] or [m]: range of a joint that does not move
_STUCK, _STUCK_PART = 5, 0.01  # equal samples in a row at an extreme, and their part of a log
_GAINS = 1e-4, 1e6  # [N m/A]
_LEAST = 50  # samples
_ANOTHER = 0.1  # rms difference of positions of another motion, of their deviation


class LogError(RobotDynError):
    """A log does not suffice to identify the arm."""


@final
@dataclass(frozen=True, eq=False)
class Log(Value):
    """A log at equal times.

    Attributes:
        t: Times, (m,), in [s].
        q: Positions, (m, n), in [rad] or [m].
        tau: Torques, (m, n), in [N m] or [N].
        reference: Positions, velocities and accelerations of the desired motion, each (m, n); None without one.
        repeated: Positions of a second log of the same motion, (m, n), in [rad] or [m]; None without one.
    """

    t: np.ndarray
    q: np.ndarray
    tau: np.ndarray
    reference: State | None
    repeated: np.ndarray | None = None

    def __post_init__(self) -> None:
        read_only(self)

    @property
    def step_s(self) -> float:
        """Time between samples, in [s]."""
        return float(self.t[1] - self.t[0])

    @property
    def instruments(self) -> str:
        """The source of the instruments of the estimate."""
        return "desired motion" if self.reference else "smoothed positions" if self.repeated is None else "second log"


def read_log(
    arm: Robot,
    source: object,
    reference: PiecewisePolynomial | None = None,
    gains: ArrayLike | None = None,
    repeat: object = None,
) -> Log:
    """Return the log in a source.

    It has times, positions "q JOINT", torques "tau JOINT" or currents "current JOINT", and perhaps "desired JOINT".

    Args:
        arm: The arm.
        source: A CSV file, a data frame, columns by heading, or a `Trajectory`. In a dict, "t", "q", "tau", "current"
            and "desired" may be arrays (m, n) in the order of the joints.
        reference: The desired motion at the times of the log.
        gains: Drive gains, a number or (n,), in [N m/A], that turn currents into torques.
        repeat: A second log of the same motion, instead of desired positions; only its times and positions are read.

    Raises:
        LogError: If positions or torques are missing, a torque is constant or saturated, a joint does not move, the
            second log is of another motion, or both a desired motion and a second log are given.
        PlanError: If times are missing, or angles look like degrees.
    """
    table, columns, t, q = _positions(arm, source)
    tau = _torques(arm, table, columns, gains)
    _refuse(arm, q, tau)
    even = np.arange(t[0], t[-1], float(np.median(np.diff(t))))
    desired = [columns.get(f"desired {joint}") for joint in arm.joint_names]
    along, log = None, Log(even, evenly(t, q, even), evenly(t, tau, even), None)
    if reference is not None and repeat is not None:
        raise LogError("give reference, the desired motion, or repeat, a second log of the motion, but not both")
    if reference is not None:
        instance("reference", reference, PiecewisePolynomial, "give the reference of a plan", error=LogError)
        along = reference.at(even)
    elif repeat is not None:
        return _with_repeat(log, *_positions(arm, repeat)[2:])
    elif None not in desired:
        along = _rates(t, np.stack([table[str(head)] for head in desired], axis=1), even)
    return replace(log, reference=along)


def _positions(arm: Robot, source: object) -> tuple[Mapping[str, np.ndarray], dict[str, str], np.ndarray, np.ndarray]:
    """Return the columns of a source, their headings by name, its times, and its positions, (m, n)."""
    table = table_of(_spread(arm, source), arm.joint_names, {}, None, None).columns
    columns = {name_of(head): head for head in table}
    times = {head: x for head, x in table.items() if name_of(head) in ("t", "time", "timestamp", "stamp")}
    q_heads = _heads(arm, columns, ("q {}", "{}"))
    samples = recorded(arm, times | {_renamed(head, joint): table[head] for joint, head in q_heads.items()})
    refuse_other_units(samples)
    if len(samples.t) < _LEAST:
        raise LogError(f"the log has {len(samples.t)} samples, at least {_LEAST} are needed; record a longer motion")
    return table, columns, samples.t, samples.q


def _with_repeat(log: Log, t: np.ndarray, q: np.ndarray) -> Log:
    """Return the part of a log in which a second log has the same motion, shifted by the lag of largest correlation."""
    from scipy.signal import correlate

    again = evenly(t, q, np.arange(t[0], t[-1], log.step_s))
    v, w = (np.diff(x, axis=0) / log.q.std(axis=0) for x in (log.q, again))
    correlation = sum(correlate(a, b, method="fft") for a, b in zip(v.T, w.T, strict=True))
    lag = int(np.argmax(correlation)) - (len(w) - 1)  # log.q[k] is again[k − lag]
    both = slice(max(lag, 0), min(len(log.t), len(again) + lag))
    one, other = log.q[both], again[both.start - lag : both.stop - lag]
    if np.array_equal(one, other):
        raise LogError("repeat is the log itself, with the same noise; record the motion a second time")
    apart = np.sqrt(((one - other) ** 2).mean(axis=0)) / log.q.std(axis=0)
    if (worst := float(apart.max())) > _ANOTHER:
        raise LogError(
            f"repeat is not of the same motion: shifted by {lag * log.step_s:.3g} s, where it fits best, its positions"
            f" differ by {worst:.0%} of their deviation; record the motion twice"
        )
    return Log(log.t[both], one, log.tau[both], None, other)


def _spread(arm: Robot, source: object) -> Any:
    """Return a source whose arrays (m, n) are columns by joint."""
    if isinstance(source, Trajectory):
        return source.table()
    if not isinstance(source, Mapping) or not any(np.ndim(x) == 2 for x in source.values()):
        return source
    result: dict[str, np.ndarray] = {}
    for key, x in source.items():
        if np.ndim(x) == 2:
            x = numbers(str(key), x, ("m", arm.n), error=LogError)
            result |= {f"{key} {joint}": column for joint, column in zip(arm.joint_names, x.T, strict=True)}
        else:
            result[str(key)] = np.asarray(x)
    return result


def _renamed(head: str, joint: str) -> str:
    """Return the heading of positions with the name of the joint alone, and its unit."""
    return joint + head[len(name_of(head)) :] if head.startswith(name_of(head)) else joint


def _heads(arm: Robot, columns: Mapping[str, str], forms: Sequence[str]) -> dict[str, str]:
    """Return the heading of a quantity of each joint, in the first form that the table has."""
    heads = {}
    for joint in arm.joint_names:
        wanted = [form.format(joint) for form in forms]
        head = next((columns[name] for name in wanted if name in columns), None)
        if head is None:
            near = nearest(wanted[0], columns)
            raise LogError(
                f"there is no column {wanted[0]!r}; {near}; rename the headings: t [s], and for each joint q {joint},"
                f" tau {joint} or current {joint}, and desired {joint} if known"
            )
        heads[joint] = head
    return heads


def _torques(arm: Robot, table: Mapping[str, np.ndarray], columns: Mapping[str, str], gains: Any) -> np.ndarray:
    kinds, first = TORQUES if gains is None else ("current",), arm.joint_names[0]
    if f"current {first}" in columns and not any(f"{kind} {first}" in columns for kind in kinds):
        raise LogError("the log has currents, not torques; give the drive gains in N m/A as gains=, --gains")
    heads = _heads(arm, columns, [f"{kind} {{}}" for kind in kinds])
    tau = np.stack([np.asarray(table[head], float) for head in heads.values()], axis=1)
    if not np.isfinite(tau).all():
        k, i = np.argwhere(~np.isfinite(tau))[0]
        raise LogError(f"{kinds[0]} {arm.joint_names[i]}: sample {k + 1} is {tau[k, i]}; remove the sample")
    if gains is None:
        return tau
    factors = numbers("gains", gains, (), (arm.n,), error=LogError)
    if not ((_GAINS[0] <= np.abs(factors)) & (np.abs(factors) <= _GAINS[1])).all():
        raise LogError(f"gains must be from {_GAINS[0]:g} to {_GAINS[1]:g} N m/A, got {factors.tolist()}")
    return tau * factors


def _refuse(arm: Robot, q: np.ndarray, tau: np.ndarray) -> None:
    """Raise a LogError about the first joint that does not move, or whose torque is constant or saturated."""
    for i, joint in enumerate(arm.joint_names):
        if np.ptp(q[:, i]) < _STILL:
            raise LogError(
                f"{joint} moves by {np.ptp(q[:, i]):.2g} in the log: lock it by"
                f" arm.with_(lock={{{joint!r}: {q[0, i]:.4g}}}), or record a motion of all joints"
            )
        if np.ptp(tau[:, i]) == 0:
            raise LogError(f"the torque of {joint} is constant, {tau[0, i]:.4g}; record the measured torque")
        for level in (tau[:, i].max(), tau[:, i].min()):
            at = tau[:, i] == level
            longest = max(map(len, "".join("x" if x else " " for x in at).split()), default=0)
            if longest >= _STUCK and at.mean() > _STUCK_PART:
                raise LogError(
                    f"the torque of {joint} stays at {level:.4g} for {longest} samples: it is saturated; record a"
                    " slower motion"
                )


def _rates(t: np.ndarray, q: np.ndarray, at: np.ndarray) -> State:
    """Return positions, velocities and accelerations of desired positions."""
    from scipy.interpolate import make_interp_spline

    spline = make_interp_spline(t, q, k=5)
    return spline(at), spline.derivative()(at), spline.derivative(2)(at)


def swapped(tau: np.ndarray, model: np.ndarray, v: np.ndarray) -> Iterator[tuple[int, int]]:
    """Yield pairs of joints whose torques follow the model of the other joint: r² higher by a half in both."""
    n = tau.shape[1]
    r2 = np.array([[_r2(tau[:, i], model[:, j], v[:, j]) for j in range(n)] for i in range(n)])
    for i in range(n):
        for j in range(i):
            if min(r2[i, j] - r2[i, i], r2[j, i] - r2[j, j]) > 0.5:
                yield j, i


def _r2(tau: np.ndarray, model: np.ndarray, v: np.ndarray) -> float:
    A = np.column_stack([model, v, np.sign(v), np.ones(len(v))])
    rest = tau - A @ np.linalg.lstsq(A, tau, rcond=None)[0]
    return 1 - float(rest.var() / max(tau.var(), 1e-300))
