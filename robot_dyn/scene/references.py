"""The references that a scene can name."""

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
from robot_dyn.scene.schema import NotNegative, Number, Part, PerJoint, Positive, Truth, Vector3, one_of, per_joint


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
    """Position, in rad, or m for a prismatic joint; that of the start by default."""

    def build(self, robot: Robot, q0: np.ndarray, frame: str | None) -> PiecewisePolynomial:
        return hold(q0 if self.q is None else per_joint("q", self.q, robot))


class Quintic(Reference):
    """From the start to q in a given time, by a polynomial of degree 5 at rest at both ends."""

    kind: Literal["quintic"]
    q: PerJoint
    """Position at the end, in rad, or m for a prismatic joint."""
    duration_s: Positive
    """Time from the start to q."""
    start_s: NotNegative = 0.0
    """When it starts."""

    def build(self, robot: Robot, q0: np.ndarray, frame: str | None) -> PiecewisePolynomial:
        return quintic(q0, per_joint("q", self.q, robot), self.duration_s, start_s=self.start_s)


class ViaPoints(Reference):
    """A spline from the start, at rest, through points; at rest at the end unless v_end is given.

    The points are those of times_s and points, or of a file; up to 2000 of them.
    """

    kind: Literal["via_points"]
    times_s: tuple[Positive, ...] = ()
    """Time of each point."""
    points: tuple[list[Number], ...] = ()
    """Position at each time, a list of n numbers, in rad, or m for a prismatic joint."""
    file: str | None = None
    """Path of a CSV file with columns of t and of each joint, from the folder of the scene."""
    joints: dict[str, str] | None = None
    """Heading of the column of each joint, where they are not the names of the joints."""
    unit: Literal["rad", "deg"] | None = None
    """Of angles whose heading states none."""
    v_end: PerJoint = 0.0
    """Velocity at the last point."""

    def build(self, robot: Robot, q0: np.ndarray, frame: str | None) -> PiecewisePolynomial:
        times, points = self._given(robot)
        if len(times) != len(points):
            raise SceneError(f"reference: {len(times)} times_s for {len(points)} points; give one for each")
        v1 = per_joint("v_end", self.v_end, robot)
        if len(times) and times[0] == 0:
            return via_points(times, points, v1=v1)
        return via_points([0.0, *times], [q0.tolist(), *points], v1=v1)

    def _given(self, robot: Robot) -> tuple[list[float], list[list[float]]]:
        """Times and points, of the scene or of the file."""
        if (self.file is None) != bool(self.times_s or self.points):
            raise SceneError("reference: give times_s and points, or a file of both")
        if self.file is None:
            return list(self.times_s), list(self.points)
        table = recorded(robot, self.file, joints=self.joints, unit=self.unit, least=1)
        refuse_other_units(table)
        if table.more:
            raise SceneError(f"{self.file}: columns of v are for kind = 'samples'; leave them out")
        if table.t[0] < 0:
            raise SceneError(f"{self.file}: the first time is {table.t[0]:g} s; start at 0 s or later")
        turns = joined_turns(table)
        if said := [each for i in range(robot.n) for each in turned(turns, i)]:
            warnings.warn(f"{self.file}: {'; '.join(said)}", PlanWarning, stacklevel=2)
        return table.t.tolist(), turns.table.q.tolist()


class Sampled(Reference):
    """The motion through samples of a file, as rd.control.from_samples makes it, with a warning of doubtful ones."""

    kind: Literal["samples"]
    file: str
    """Path of a CSV file, or of an MCAP log of ROS 2 (.mcap), from the folder of the scene."""
    time: str | None = None
    """Heading of the times; of a log "header" or "log". By default the column t, time or timestamp."""
    joints: dict[str, str] | None = None
    """Heading of the column of each joint, or its name in the log, where they are not the names of the joints."""
    unit: Literal["rad", "deg"] | None = None
    """Of angles whose heading states none."""
    ends: Literal["rest", "measured"] | None = None
    """Whether it is at rest at both ends, or moves as the samples do; at rest by default, an error if they move."""
    start_s: Number | None = None
    """Time of the first sample; as in the file by default."""
    topic: str | None = None
    """Topic of a log; by default its only one of joint states, or /joint_states."""

    def build(self, robot: Robot, q0: np.ndarray, frame: str | None) -> PiecewisePolynomial:
        stated = {key: getattr(self, key) for key in ("time", "joints", "unit", "ends", "start_s", "topic")}
        plan = from_samples(robot, self.file, **stated)
        if plan.findings:
            warnings.warn(f"{self.file}: {'; '.join(plan.findings)}", PlanWarning, stacklevel=2)
        return plan.reference


def _start(robot: Robot, q0: np.ndarray, frame: str | None, hold: bool) -> tuple[np.ndarray, np.ndarray | None]:
    """Return the position of the frame under control at the start, and its rotation if that is held."""
    with part("control"):  # which names the frame
        g = robot.placement(q0, str(frame))
    return g[:3, 3], g[:3, :3] if hold else None


class Line(Reference):
    """A straight line of the frame under control from where it is at the start; for operational_space."""

    kind: Literal["line"]
    by_m: Vector3
    """From the start to the end, in base axes."""
    duration_s: Positive
    """Time from start to end."""
    start_s: NotNegative = 0.0
    """When it starts."""
    hold_orientation: Truth = True
    """Whether the orientation of the start is kept; otherwise it is free."""

    def build(self, robot: Robot, q0: np.ndarray, frame: str | None) -> CartesianReference:
        p, R = _start(robot, q0, frame, self.hold_orientation)
        return line(p, p + self.by_m, self.duration_s, rotation=R, start_s=self.start_s)


class Circle(Reference):
    """A circle of the frame under control that begins where it is at the start; for operational_space."""

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
    """Whether the orientation of the start is kept; otherwise it is free."""

    def build(self, robot: Robot, q0: np.ndarray, frame: str | None) -> CartesianReference:
        p, R = _start(robot, q0, frame, self.hold_orientation)
        axis, direction = np.array(self.normal), np.array(self.to_centre)
        if not np.linalg.norm(np.cross(axis, direction)) > 0:
            raise SceneError("reference.to_centre: must not be zero, nor along reference.normal")
        direction = direction - axis * (axis @ direction) / (axis @ axis)  # into the plane of the circle
        direction = direction / np.linalg.norm(direction)
        centre = p + self.radius_m * direction
        return circle(
            centre, self.radius_m, self.normal, self.period_s, turns=self.turns, toward=-direction, rotation=R
        )


KINDS = Hold, Quintic, ViaPoints, Sampled, Line, Circle
AnyReference = one_of(*KINDS)
