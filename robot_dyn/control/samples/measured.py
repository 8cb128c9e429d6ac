"""A motion from samples: the spline of degree 5 through them, with findings about doubtful samples."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from robot_dyn.control.plan import Plan
from robot_dyn.control.reference import PiecewisePolynomial, spline
from robot_dyn.control.samples.findings import DENSE, findings, refuse_moving_ends, refuse_other_units
from robot_dyn.control.samples.publishers import refuse_alternating
from robot_dyn.control.samples.recorded import recorded
from robot_dyn.control.samples.spline import Samples
from robot_dyn.control.samples.turns import joined_turns
from robot_dyn.foundations.errors import PlanError
from robot_dyn.foundations.validate import choice, instance, number
from robot_dyn.model.robot import Robot
from robot_dyn.queries.units import of_joint

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from robot_dyn.control.samples.sources import Source
    from robot_dyn.foundations.validate import JointValues


_ROUNDED = 0.01  # largest rounding of the times, as a fraction of the time between two samples


def from_samples(
    arm: Robot,
    source: Source,
    *,
    time: ArrayLike | None = None,
    joints: Mapping[str, str] | None = None,
    unit: str | None = None,
    ends: str | None = None,
    q0: JointValues | None = None,
    start_s: float | None = None,
    topic: str | None = None,
) -> Plan:
    """Return the motion through samples of joint positions: a spline of degree 5, with four continuous derivatives.

    The spline passes through every sample: noise is not smoothed. Its error between samples is estimated by a spline
    through every second sample, evaluated at the others. Findings report gaps in time, steps faster than the velocity
    limits, whole turns, positions beyond the limits, noise, and ends that are not at rest.

    Angles of a continuous joint are unwrapped if all of them lie within one turn and every step of more than half a
    turn becomes similar to its neighbours when a whole turn is removed; a finding reports the first such step. Other
    angles are not changed: whole turns of a joint with limits, or recorded over several turns, are findings.

    Args:
        arm: The robot.
        source: Path of a CSV file, a data frame, columns by heading in a dict, an array (m, n) in the order of q, or a
            list of states, also by joint name, 0 for joints left out.
            Headings are names of joints, with or without a unit, such as "elbow_joint [deg]", or the headings of
            `run.save`, such as "q elbow_joint [rad]". Or the path of an MCAP log (.mcap) with ROS 2 messages
            sensor_msgs/msg/JointState that name the joints; this needs the extra "data".
        time: Heading of the times, with or without its unit, or the times, (m,), in [s], or the time between samples;
            by default the column "t", "time" or "timestamp", with a unit of s, ms, µs or ns. For a log, "header"
            (when joints were measured) or "log" (when messages arrived), counted from the first message; by default
            "header" if headers have times.
        joints: Heading, with or without its unit, or name in a log, by joint, if headings are not joint names; other
            columns are then ignored. By default only columns without numbers are ignored.
        unit: "rad" or "deg", for angles without a unit in the heading; "rad" by default, unless they look like degrees.
        ends: "rest", with zero velocity and acceleration at both ends; or "measured", with the velocities and
            accelerations of a run's table if it has them, else not-a-knot. By default "rest", which is an error if 16
            or more samples move there.
        q0: Rest positions of joints without a column, (n,) or by joint name, in [rad] or [m]; by default each joint
            needs a column.
        start_s: Time of the first sample, in [s]; by default unchanged.
        topic: Topic of a log; by default its only topic of joint states, or "/joint_states".

    Raises:
        PlanError: If the file is of another kind, a column is missing or unknown, times do not increase, samples of two
            publishers interleave, angles look like degrees or times like ms without a unit, or joints move at the ends
            and `ends` is not passed.
        MissingExtraError: If a log needs mcap or mcap-ros2-support, and it is not installed.
    """
    instance("arm", arm, Robot, "give a robot, such as rd.load('ur5')", error=PlanError)
    if ends is not None:
        choice("ends", ends, ("rest", "measured"), error=PlanError)
    samples = recorded(arm, source, time, joints, unit, q0, topic)
    refuse_alternating(samples)
    refuse_other_units(samples)
    turns = joined_turns(samples)
    table, t, q = turns.table, turns.table.t, turns.table.q
    if ends is None:
        refuse_moving_ends(table)
        ends = "rest"
    if start_s is not None:
        t = _shifted(t, number("start_s", start_s, error=PlanError))
    if ends == "rest":
        reference = PiecewisePolynomial(*spline(t, q, np.zeros((2, 2, arm.n))))
    else:
        reference = Samples(t, q, **table.more)
    method = "; ".join([_method(arm, t, q, ends), *([table.note] if table.note else [])])
    return Plan(
        *(arm.name, arm.joint_names, arm.joint_types, reference, method),
        *({"velocity": arm.velocity_limit}, tuple(findings(turns, reference, ends))),
    )


def _shifted(t: np.ndarray, start_s: float) -> np.ndarray:
    """Return times that begin at start_s; raise a PlanError if rounding changes the steps between them."""
    shifted = t - t[0] + start_s
    if (np.abs(np.diff(shifted) - np.diff(t)) > _ROUNDED * np.diff(t)).any():
        raise PlanError(
            f"start_s is {start_s:g} s, where floating-point times are {np.spacing(abs(start_s)):.2g} s apart, but"
            f" samples {np.diff(t).min():.3g} s; give a smaller start_s"
        )
    return shifted


def _method(arm: Robot, t: np.ndarray, q: np.ndarray, ends: str) -> str:
    """Describe the motion, and the error of a spline through every second sample at the others."""
    text = f"through {len(t)} samples, ends {'at rest' if ends == 'rest' else 'as measured'}"
    if len(t) < DENSE:
        return text
    through = PiecewisePolynomial(*spline(t[::2], q[::2]))
    left_out = t[1::2][t[1::2] <= t[::2][-1]]
    off = np.abs(through.at(left_out)[0] - q[1::2][: len(left_out)])
    k, i = np.unravel_index(off.argmax(), off.shape)
    unit = of_joint("rad", arm.joint_types[i])
    most = f"{off[k, i]:.2g} {unit} ({arm.joint_names[i]})"
    return f"{text}; a spline through every second sample misses the others by at most {most}"
