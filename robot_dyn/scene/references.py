"""The references that a scene can name."""

from __future__ import annotations

from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from robot_dyn.control.cartesian import CartesianReference, circle, line
from robot_dyn.control.reference import PiecewisePolynomial, hold, quintic, via_points
from robot_dyn.control.samples import Samples, read_table
from robot_dyn.errors import SceneError
from robot_dyn.model.robot import Robot
from robot_dyn.scene.schema import NotNegative, Number, Part, PerJoint, Positive, Truth, Vector3, per_joint


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
    """Position; that of the start by default."""

    def build(self, robot: Robot, q0: np.ndarray, frame: str | None) -> PiecewisePolynomial:
        return hold(q0 if self.q is None else per_joint("q", self.q, robot))


class Quintic(Reference):
    """From the start to q in a given time, by a polynomial of degree 5 at rest at both ends."""

    kind: Literal["quintic"]
    q: PerJoint
    """Position at the end."""
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
    """Path of a CSV file with columns t and q of each joint, from the folder of the scene."""
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
        table = read_table(self.file, robot.joint_names)
        if more := table.keys() - {"t", "q"}:
            raise SceneError(f"{self.file}: columns of {min(more)} are for kind = 'samples'; leave them out")
        t = table["t"]
        if len(t) and t[0] < 0:
            raise SceneError(f"{self.file}: the first time is {t[0]:g} s; start at 0 s or later")
        return t.tolist(), table["q"].tolist()


class Sampled(Reference):
    """Samples of a CSV file with columns t, q and if given v and a of each joint, as rd.Samples takes them."""

    kind: Literal["samples"]
    file: str
    """Path of the file, from the folder of the scene."""

    def build(self, robot: Robot, q0: np.ndarray, frame: str | None) -> PiecewisePolynomial:
        return Samples.from_csv(self.file, robot.joint_names)


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
        g = robot.placement(q0, frame_of(frame))
        R = g[:3, :3] if self.hold_orientation else None
        return line(g[:3, 3], g[:3, 3] + self.by_m, self.duration_s, rotation=R, start_s=self.start_s)


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
        g = robot.placement(q0, frame_of(frame))
        axis, direction = np.array(self.normal), np.array(self.to_centre)
        if not np.linalg.norm(np.cross(axis, direction)) > 0:
            raise SceneError("reference.to_centre: must not be zero, nor along reference.normal")
        direction = direction - axis * (axis @ direction) / (axis @ axis)  # into the plane of the circle
        direction = direction / np.linalg.norm(direction)
        centre = g[:3, 3] + self.radius_m * direction
        R = g[:3, :3] if self.hold_orientation else None
        return circle(
            centre, self.radius_m, self.normal, self.period_s, turns=self.turns, toward=-direction, rotation=R
        )


AnyReference = Annotated[Hold | Quintic | ViaPoints | Sampled | Line | Circle, Field(discriminator="kind")]


def frame_of(frame: str | None) -> str:
    """Return the link under control; SceneError if none is named."""
    if frame is None:
        raise SceneError("control.frame: name the link that follows a line or a circle")
    return frame
