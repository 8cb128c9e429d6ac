"""The fastest motion between two states under limits of velocity, acceleration and jerk; all joints arrive together.

The jerk of each joint is constant between the switching times of its profile: cubic pieces. Ruckig computes them; this
module merges the breaks of all joints. [Berscheid, Kröger, Jerk-limited real-time trajectory generation with arbitrary
target states, 2021]
"""

from __future__ import annotations

from collections.abc import Iterator
from math import inf
from typing import Any

import numpy as np

from robot_dyn import Robot
from robot_dyn.control import PiecewisePolynomial, Plan
from robot_dyn.foundations import JointValues, PlanError, in_order, instance, needs, number, numbers, one_state
from robot_dyn.queries import of_joint
from robot_dyn.tools.motors.limits import outside_positions

_SAME = 1e-12  # relative to the duration: breaks of two joints that differ by less are one


_Segment = tuple[float, ...]  # a joint's start time, position, velocity, acceleration, jerk


def point_to_point(
    arm: Robot,
    q0: JointValues,
    q1: JointValues,
    *,
    acceleration: JointValues,
    jerk: JointValues,
    velocity: JointValues | None = None,
    v0: JointValues = 0.0,
    v1: JointValues = 0.0,
    start_s: float = 0.0,
) -> Plan:
    """Plan the fastest motion from q0 to q1 under limits of velocity, acceleration and jerk.

    All joints arrive together. The motion is computed on this machine, without an online service. This needs the extra
    "plan".

    Args:
        arm: The robot.
        q0: Position at the start, (n,), in [rad] or [m] by joint; like all values of joints, also by joint name, where
            joints left out have 0, and no limit.
        q1: Position at the end, (n,), in [rad] or [m] by joint.
        acceleration: Largest acceleration, a scalar or (n,), in [rad/s²] or [m/s²].
        jerk: Largest jerk, a scalar or (n,), in [rad/s³] or [m/s³]; inf for no limit: the acceleration then jumps.
        velocity: Largest velocity, a scalar or (n,), in [rad/s] or [m/s]; by default the limits in the robot's file.
        v0: Velocity at the start, a scalar or (n,), in [rad/s] or [m/s].
        v1: Velocity at the end, a scalar or (n,), in [rad/s] or [m/s].
        start_s: Time of the start, in [s].

    Raises:
        MissingExtraError: If ruckig is not installed.
        PlanError: If a value is invalid, no motion satisfies the limits, or the motion leaves the position limits of
            the robot; the message names joint, time and value.
    """
    instance("arm", arm, Robot, "give a robot, such as rd.load('ur5')", error=PlanError)
    start_s = number("start_s", start_s, error=PlanError)
    ends = [one_state(name, x, arm.joint_names) for name, x in (("q0", q0), ("q1", q1))]
    rates = [_of_joints(arm, name, v) for name, v in (("v0", v0), ("v1", v1))]
    limits = {
        "velocity": arm.velocity_limit if velocity is None else _of_joints(arm, "velocity", velocity, limit=True),
        "acceleration": _of_joints(arm, "acceleration", acceleration, limit=True),
        "jerk": _of_joints(arm, "jerk", jerk, limit=True),
    }
    if np.isinf(limits["acceleration"]).any():
        raise PlanError("acceleration must be finite; give the largest acceleration of each joint")
    _check_ends(arm, ends, rates, limits["velocity"])
    reference = _merged([list(_segments(profile)) for profile in _profiles(ends, rates, limits)], start_s)
    for where in outside_positions(arm, reference):
        raise PlanError(f"{where}; change the ends or their velocities")
    return Plan(arm.name, arm.joint_names, arm.joint_types, reference, "from point to point, by ruckig", limits)


def _of_joints(arm: Robot, name: str, values: Any, *, limit: bool = False) -> np.ndarray:
    """Return one number for all joints, or one for each, as (n,); limits are positive and may be infinite."""
    above, fill_value, shape = (0.0, inf, (arm.n,)) if limit else (None, 0.0, (arm.n,))
    values = in_order(name, values, arm.joint_names, fill_value=fill_value, error=PlanError)
    return np.broadcast_to(numbers(name, values, (), shape, error=PlanError, above=above, infinite=limit), shape)


def _check_ends(arm: Robot, ends: list[np.ndarray], rates: list[np.ndarray], most: np.ndarray) -> None:
    for name, v in zip(("v0", "v1"), rates, strict=True):
        for i in np.flatnonzero(np.abs(v) > most)[:1]:
            unit = of_joint("rad/s", arm.joint_types[i])
            raise PlanError(
                f"{name}: {arm.joint_names[i]} moves at {v[i]:g} {unit}, beyond its limit {most[i]:g}; lower it"
            )
    if np.array_equal(ends[0], ends[1]) and not np.any(rates):
        raise PlanError("q0 and q1 are the same position at rest: nothing moves; use rd.control.hold(q)")


def _profiles(ends: list[np.ndarray], rates: list[np.ndarray], limits: dict[str, np.ndarray]) -> list[Any]:
    """Compute ruckig's profile of each joint.

    Way points are never passed to ruckig: it would send them to an online service.
    """
    ruckig = needs("ruckig", extra="plan")
    n = len(ends[0])
    inputs, trajectory = ruckig.InputParameter(n), ruckig.Trajectory(n)
    inputs.current_position, inputs.target_position = (x.tolist() for x in ends)
    inputs.current_velocity, inputs.target_velocity = (x.tolist() for x in rates)
    inputs.max_velocity, inputs.max_acceleration, inputs.max_jerk = (
        limits[name].tolist() for name in ("velocity", "acceleration", "jerk")
    )
    try:
        result = ruckig.Ruckig(n).calculate(inputs, trajectory)
    except Exception as error:  # ruckig raises its own type for invalid inputs
        raise PlanError(f"no motion satisfies the limits: {error}") from None
    if result != ruckig.Result.Working:
        raise PlanError(f"no motion was found: ruckig returned {result.name}; check the limits and the velocities")
    return trajectory.profiles[0]


def _segments(profile: Any) -> Iterator[_Segment]:
    """Yield the pieces of a joint: a piece that brings the start within the limits, seven of constant jerk, the end."""
    t = 0.0
    for times, x in ((profile.brake.t, profile.brake), (profile.t, profile)):
        for duration, *state in zip(times, x.p, x.v, x.a, x.j, strict=False):
            if duration > 0:
                yield t, *state
                t += duration
    yield t, profile.pf, profile.vf, profile.af, 0.0


def _merged(joints: list[list[_Segment]], start_s: float) -> PiecewisePolynomial:
    """Merge the pieces of all joints at all their breaks."""
    times = np.unique([segment[0] for joint in joints for segment in joint])
    breaks = times[np.concatenate([[True], np.diff(times) > _SAME * times[-1]])]
    middles = (breaks[1:] + breaks[:-1]) / 2
    coefficients = np.zeros((len(middles), 4, len(joints)))
    for i, joint in enumerate(joints):
        starts, p, v, a, j = np.array(joint).T
        at = np.searchsorted(starts, middles, side="right") - 1
        s, p, v, a, j = breaks[:-1] - starts[at], p[at], v[at], a[at], j[at]
        coefficients[:, 0, i] = p + s * (v + s * (a / 2 + s * j / 6))
        coefficients[:, 1, i] = v + s * (a + s * j / 2)
        coefficients[:, 2, i] = (a + s * j) / 2
        coefficients[:, 3, i] = j / 6
    return PiecewisePolynomial(start_s + breaks, coefficients)
