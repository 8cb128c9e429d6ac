"""The fastest motion between two states under limits of velocity, acceleration and jerk, all joints arriving together.

Each joint moves with constant jerk between the times at which its profile switches: cubic pieces. Ruckig computes them;
here their breaks are merged. [Berscheid, Kröger, Jerk-limited real-time trajectory generation with arbitrary target
states, 2021]
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from robot_dyn import Robot
from robot_dyn.control import PiecewisePolynomial, Plan
from robot_dyn.foundations import PlanError, instance, needs, number, numbers, one_state
from robot_dyn.queries import of_joint
from robot_dyn.tools.motors.limits import outside_positions

_SAME = 1e-12  # of the duration: breaks of two joints that differ by their rounding


_Segment = tuple[float, ...]  # of one joint: the time at which it starts, position, velocity, acceleration, jerk


def point_to_point(
    arm: Robot,
    q0: Any,
    q1: Any,
    *,
    acceleration: Any,
    jerk: Any,
    velocity: Any = None,
    v0: Any = 0.0,
    v1: Any = 0.0,
    start_s: float = 0.0,
) -> Plan:
    """The fastest motion from q0 to q1 under limits of velocity, acceleration and jerk; all joints arrive together.

    Computed on this machine: no service is asked. Needs the extra "plan".

    Args:
        arm: The robot.
        q0: Position at the start, (n,), in [rad] or [m] by joint.
        q1: Position at the end, likewise.
        acceleration: Largest, a scalar or (n,), in [rad/s²] or [m/s²].
        jerk: Largest, a scalar or (n,), in [rad/s³] or [m/s³]; inf for none: then the acceleration has steps.
        velocity: Largest, a scalar or (n,), in [rad/s] or [m/s]; those of the robot's file by default.
        v0: Velocity at the start, a scalar or (n,), in [rad/s] or [m/s].
        v1: Velocity at the end, likewise.
        start_s: Time of the start, in [s].

    Raises:
        MissingExtraError: If ruckig is not installed.
        PlanError: If a value is not allowed, if no motion meets the limits, or if it leaves the position limits of the
            robot; names joint, time and value.
    """
    instance("arm", arm, Robot, "give a robot, such as rd.load('ur5')", error=PlanError)
    start_s, shape = number("start_s", start_s, error=PlanError), (arm.n,)
    ends = [one_state(name, x, arm.joint_names) for name, x in (("q0", q0), ("q1", q1))]
    rates = [_of_joints(name, v, shape) for name, v in (("v0", v0), ("v1", v1))]
    limits = {
        "velocity": arm.velocity_limit if velocity is None else _of_joints("velocity", velocity, shape, limit=True),
        "acceleration": _of_joints("acceleration", acceleration, shape, limit=True),
        "jerk": _of_joints("jerk", jerk, shape, limit=True),
    }
    if np.isinf(limits["acceleration"]).any():
        raise PlanError("acceleration must be finite: the file of a robot states none, motors have one")
    _check_ends(arm, ends, rates, limits["velocity"])
    reference = _merged([list(_segments(each)) for each in _profiles(ends, rates, limits)], start_s)
    for where in outside_positions(arm, reference):
        raise PlanError(f"{where}; change the ends or their velocities")
    return Plan(arm.name, arm.joint_names, arm.joint_types, reference, "from point to point, by ruckig", limits)


def _of_joints(name: str, values: Any, shape: tuple[int], *, limit: bool = False) -> np.ndarray:
    """A number for all joints or for each, as (n,); limits are positive and may be infinite."""
    above = 0.0 if limit else None
    given = numbers(name, values, (), shape, error=PlanError, above=above, infinite=limit)
    return np.broadcast_to(given, shape)


def _check_ends(arm: Robot, ends: list[np.ndarray], rates: list[np.ndarray], most: np.ndarray) -> None:
    for name, v in zip(("v0", "v1"), rates, strict=True):
        for i in np.flatnonzero(np.abs(v) > most)[:1]:
            unit = of_joint("rad/s", arm.joint_types[i])
            raise PlanError(
                f"{name}: {arm.joint_names[i]} moves at {v[i]:g} {unit}, beyond its limit {most[i]:g}; give less"
            )
    if np.array_equal(ends[0], ends[1]) and not np.any(rates):
        raise PlanError("q0 and q1 are the same position at rest: nothing moves; rd.control.hold(q) rests there")


def _profiles(ends: list[np.ndarray], rates: list[np.ndarray], limits: dict[str, np.ndarray]) -> list[Any]:
    """Ruckig's profile of each joint.

    Way points are never given to it: it would send them to a service.
    """
    ruckig = needs("ruckig", extra="plan")
    n = len(ends[0])
    asked, trajectory = ruckig.InputParameter(n), ruckig.Trajectory(n)
    asked.current_position, asked.target_position = (x.tolist() for x in ends)
    asked.current_velocity, asked.target_velocity = (x.tolist() for x in rates)
    asked.max_velocity, asked.max_acceleration, asked.max_jerk = (
        limits[each].tolist() for each in ("velocity", "acceleration", "jerk")
    )
    try:
        result = ruckig.Ruckig(n).calculate(asked, trajectory)
    except Exception as error:  # ruckig's own, of what it finds in the input
        raise PlanError(f"no motion meets the limits: {error}") from None
    if result != ruckig.Result.Working:
        raise PlanError(f"no motion was found: ruckig answers {result.name}; check the limits and the velocities")
    return trajectory.profiles[0]


def _segments(profile: Any) -> Iterator[_Segment]:
    """Yield the pieces of a joint: what brings its start within the limits, seven of constant jerk, and its end."""
    t = 0.0
    for times, of in ((profile.brake.t, profile.brake), (profile.t, profile)):
        for duration, *state in zip(times, of.p, of.v, of.a, of.j, strict=False):
            if duration > 0:
                yield t, *state
                t += duration
    yield t, profile.pf, profile.vf, profile.af, 0.0


def _merged(joints: list[list[_Segment]], start_s: float) -> PiecewisePolynomial:
    """The pieces of all joints between all their breaks."""
    times = np.unique([segment[0] for joint in joints for segment in joint])
    kept = times[np.concatenate([[True], np.diff(times) > _SAME * times[-1]])]
    middles = (kept[1:] + kept[:-1]) / 2
    coefficients = np.zeros((len(middles), 4, len(joints)))
    for i, joint in enumerate(joints):
        starts, p, v, a, j = np.array(joint).T
        at = np.searchsorted(starts, middles, side="right") - 1
        s, p, v, a, j = kept[:-1] - starts[at], p[at], v[at], a[at], j[at]
        coefficients[:, 0, i] = p + s * (v + s * (a / 2 + s * j / 6))
        coefficients[:, 1, i] = v + s * (a + s * j / 2)
        coefficients[:, 2, i] = (a + s * j) / 2
        coefficients[:, 3, i] = j / 6
    return PiecewisePolynomial(start_s + kept, coefficients)
