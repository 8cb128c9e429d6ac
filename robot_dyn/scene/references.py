"""The references in a scene."""

from __future__ import annotations

import warnings
from typing import Any, Literal

import numpy as np

from robot_dyn.control.cartesian import CartesianReference, circle, line
from robot_dyn.control.reference import PiecewisePolynomial, hold, quintic, via_points
from robot_dyn.control.samples.findings import refuse_other_units, turned
from robot_dyn.control.samples.measured import from_samples
from robot_dyn.control.samples.recorded import recorded
from robot_dyn.control.samples.turns import joined_turns
from robot_dyn.foundations.errors import PlanWarning, SceneError
from robot_dyn.model.robot import Robot
from robot_dyn.scene.messages import part
from robot_dyn.scene.schema import (
    NotNegative,
    Number,
    Part,
    PerJoint,
    Point,
    Positive,
    Truth,
    Vector3,
    one_of,
    per_joint,
)


class Reference(Part):
    """A reference for the controller."""

    kind: Any

    def build(self, robot: Robot, q0: np.ndarray, frame: str | None) -> Any:
        """Return the reference of a run from q0; `frame` is the link under control."""
        raise NotImplementedError


class Hold(Reference):
    """Rest at a position."""

    kind: Literal["hold"]
    q: PerJoint | None = None
    """Position, in rad, or m for a prismatic joint; the initial position by default."""

    def build(self, robot: Robot, q0: np.ndarray, frame: str | None) -> PiecewisePolynomial:
        return hold(q0 if self.q is None else per_joint("q", self.q, robot))


class Quintic(Reference):
    """A polynomial of degree 5 from the start to q, at rest at both ends."""

    kind: Literal["quintic"]
    q: PerJoint
    """Position at the end, in rad, or m for a prismatic joint."""
    duration_s: Positive
    """Time from the start to q."""
    start_s: NotNegative = 0.0
    """Time of the start."""

    def build(self, robot: Robot, q0: np.ndarray, frame: str | None) -> PiecewisePolynomial:
        return quintic(q0, per_joint("q", self.q, robot), self.duration_s, start_s=self.start_s)


class ViaPoints(Reference):
    """A spline from rest at the start through at most 2000 points, which ends at rest unless v1 is given.

    The points are given by times_s and points, or by a file.
    """

    kind: Literal["via_points"]
    times_s: tuple[Positive, ...] = ()
    """Time of each point."""
    points: tuple[Point, ...] = ()
    """Position at each time, in rad, or m for a prismatic joint."""
    file: str | None = None
    """Path of a CSV file with columns t and one for each joint, relative to the folder of the scene."""
    joints: dict[str, str] | None = None
    """Headings of columns by joint, if they are not the names of the joints."""
    unit: Literal["rad", "deg"] | None = None
    """Unit of angles whose heading states none."""
    v1: PerJoint = 0.0
    """Velocity at the last point."""

    def build(self, robot: Robot, q0: np.ndarray, frame: str | None) -> PiecewisePolynomial:
        times, points = self._times_and_points(robot)
        if len(times) != len(points):
            raise SceneError(f"reference: {len(times)} times_s for {len(points)} points; give one time for each point")
        v1 = per_joint("v1", self.v1, robot)
        if len(times) and times[0] == 0:
            return via_points(times, points, v1=v1)
        return via_points([0.0, *times], [q0.tolist(), *points], v1=v1)

    def _times_and_points(self, robot: Robot) -> tuple[list[float], list[list[float]]]:
        """Return times and points from the scene or the file."""
        if (self.file is None) != bool(self.times_s or self.points):
            raise SceneError("reference: give times_s and points, or a file of both")
        if self.file is None:
            return list(self.times_s), [per_joint("points", point, robot).tolist() for point in self.points]
        table = recorded(robot, self.file, joints=self.joints, unit=self.unit, least=1)
        refuse_other_units(table)
        if table.more:
            raise SceneError(f"{self.file}: columns of v are for kind = 'samples'; remove them")
        if table.t[0] < 0:
            raise SceneError(f"{self.file}: the first time is {table.t[0]:g} s; start at 0 s or later")
        turns = joined_turns(table)
        if findings := [finding for i in range(robot.n) for finding in turned(turns, i)]:
            warnings.warn(f"{self.file}: {'; '.join(findings)}", PlanWarning, stacklevel=2)
        return table.t.tolist(), turns.table.q.tolist()


class Sampled(Reference):
    """The motion through samples of a file by rd.control.from_samples, with a warning about doubtful samples."""

    kind: Literal["samples"]
    file: str
    """Path of a CSV file, or of an MCAP log of ROS 2 (.mcap), relative to the folder of the scene."""
    time: str | None = None
    """Heading of the times; for a log "header" or "log". By default the column t, time or timestamp."""
    joints: dict[str, str] | None = None
    """Headings of columns, or names in the log, by joint, if they are not the names of the joints."""
    unit: Literal["rad", "deg"] | None = None
    """Unit of angles whose heading states none."""
    ends: Literal["rest", "measured"] | None = None
    """Motion at both ends: at rest, or as measured; "rest" by default, which is an error if the samples move there."""
    start_s: Number | None = None
    """Time of the first sample; by default the time in the file."""
    topic: str | None = None
    """Topic of a log; by default its only topic of joint states, or /joint_states."""

    def build(self, robot: Robot, q0: np.ndarray, frame: str | None) -> PiecewisePolynomial:
        stated = {key: getattr(self, key) for key in ("time", "joints", "unit", "ends", "start_s", "topic")}
        plan = from_samples(robot, self.file, **stated)
        if plan.findings:
            warnings.warn(f"{self.file}: {'; '.join(plan.findings)}", PlanWarning, stacklevel=2)
        return plan.reference


def _start(robot: Robot, q0: np.ndarray, frame: str | None, hold: bool) -> tuple[np.ndarray, np.ndarray | None]:
    """Return the initial position of the controlled frame, and its rotation if the orientation is held."""
    with part("control"):  # the table that names the frame
        g = robot.placement(q0, str(frame))
    return g[:3, 3], g[:3, :3] if hold else None


class Line(Reference):
    """A straight line of the controlled frame from its initial position; for operational_space."""

    kind: Literal["line"]
    by_m: Vector3
    """From the start to the end, in base axes."""
    duration_s: Positive
    """Time from start to end."""
    start_s: NotNegative = 0.0
    """Time of the start."""
    hold_orientation: Truth = True
    """True to keep the initial orientation; otherwise it is free."""

    def build(self, robot: Robot, q0: np.ndarray, frame: str | None) -> CartesianReference:
        p, R = _start(robot, q0, frame, self.hold_orientation)
        return line(p, p + self.by_m, self.duration_s, rotation=R, start_s=self.start_s)


class Circle(Reference):
    """A circle of the controlled frame from its initial position; for operational_space."""

    kind: Literal["circle"]
    radius_m: Positive
    """Radius."""
    period_s: Positive
    """Time of one turn."""
    normal: Vector3 = (0.0, 0.0, 1.0)
    """Normal of its plane, in base axes, of any length."""
    to_centre: Vector3 = (0.0, 1.0, 0.0)
    """Direction from the start to the centre, in base axes; its part in the plane is used."""
    turns: Positive = 1.0
    """Number of turns."""
    hold_orientation: Truth = True
    """True to keep the initial orientation; otherwise it is free."""

    def build(self, robot: Robot, q0: np.ndarray, frame: str | None) -> CartesianReference:
        p, R = _start(robot, q0, frame, self.hold_orientation)
        axis, direction = np.array(self.normal), np.array(self.to_centre)
        if not np.linalg.norm(np.cross(axis, direction)) > 0:
            raise SceneError("reference.to_centre must not be zero or parallel to reference.normal")
        direction = direction - axis * (axis @ direction) / (axis @ axis)  # into the plane of the circle
        direction = direction / np.linalg.norm(direction)
        centre = p + self.radius_m * direction
        return circle(
            centre, self.radius_m, self.normal, self.period_s, turns=self.turns, toward=-direction, rotation=R
        )


KINDS = Hold, Quintic, ViaPoints, Sampled, Line, Circle
AnyReference = one_of(*KINDS)
