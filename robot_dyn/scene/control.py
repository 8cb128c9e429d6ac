"""The controllers and references a scene can name."""

from __future__ import annotations

from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from robot_dyn.control.cartesian import CartesianReference, circle, line
from robot_dyn.control.computed_torque import ComputedTorque, FeedForward, PDGravity
from robot_dyn.control.controller import Controller
from robot_dyn.control.independent_joint import PD, PID, gains_from
from robot_dyn.control.operational_space import OperationalSpace
from robot_dyn.control.reference import PiecewisePolynomial, hold, quintic, via_points
from robot_dyn.effects.actuator import stated_efforts
from robot_dyn.effects.effect import URDF
from robot_dyn.errors import SceneError
from robot_dyn.model.robot import Robot
from robot_dyn.scene.effects import Edit
from robot_dyn.scene.schema import (
    NotNegative,
    Number,
    Part,
    PerJoint,
    Positive,
    Stated,
    Truth,
    Vector3,
    per_joint,
)


class Hold(Part):
    """Rest at a position, that of the start unless said."""

    kind: Literal["hold"]
    q: PerJoint | None = None

    def build(self, robot: Robot, q0: np.ndarray, frame: str | None) -> PiecewisePolynomial:
        """The reference."""
        return hold(q0 if self.q is None else per_joint("q", self.q, robot))


class Quintic(Part):
    """From the start to q in a given time, with least jerk."""

    kind: Literal["quintic"]
    q: PerJoint
    duration_s: Positive
    start_s: NotNegative = 0.0

    def build(self, robot: Robot, q0: np.ndarray, frame: str | None) -> PiecewisePolynomial:
        """The reference."""
        return quintic(q0, per_joint("q", self.q, robot), self.duration_s, start=self.start_s)


class ViaPoints(Part):
    """A spline from the start through points."""

    kind: Literal["via_points"]
    times_s: list[Positive]
    points: list[list[Number]]

    def build(self, robot: Robot, q0: np.ndarray, frame: str | None) -> PiecewisePolynomial:
        """The reference."""
        if len(self.times_s) != len(self.points):
            raise SceneError(f"reference: {len(self.times_s)} times_s for {len(self.points)} points; give one for each")
        return via_points([0.0, *self.times_s], [q0.tolist(), *self.points])


class Line(Part):
    """A straight line of the frame from where it is."""

    kind: Literal["line"]
    by_m: Vector3
    duration_s: Positive
    start_s: NotNegative = 0.0
    hold_orientation: Truth = True

    def build(self, robot: Robot, q0: np.ndarray, frame: str | None) -> CartesianReference:
        """The reference."""
        g = robot.placement(q0, _frame(frame))
        R = g[:3, :3] if self.hold_orientation else None
        return line(g[:3, 3], g[:3, 3] + self.by_m, self.duration_s, rotation=R, start=self.start_s)


class Circle(Part):
    """A circle of the frame that begins where it is; the centre lies from there in the direction given."""

    kind: Literal["circle"]
    radius_m: Positive
    period_s: Positive
    normal: Vector3 = (0.0, 0.0, 1.0)
    to_centre: Vector3 = (0.0, 1.0, 0.0)
    turns: Positive = 1.0
    hold_orientation: Truth = True

    def build(self, robot: Robot, q0: np.ndarray, frame: str | None) -> CartesianReference:
        """The reference."""
        g = robot.placement(q0, _frame(frame))
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


AnyReference = Annotated[Hold | Quintic | ViaPoints | Line | Circle, Field(discriminator="kind")]


class Model(Part):
    """The controller's model of the arm, where it differs from the plant's."""

    mass_scale: Positive = 1.0
    effects: list[Annotated[Edit, Field(discriminator="kind")]] | None = None

    def build(self, described: Robot, robot: Robot) -> Robot:
        """The model: the plant's robot, or the described one with edits of its own; masses scaled."""
        if self.effects is not None:
            robot = described
            for edit in self.effects:
                robot = edit.edit(robot)
        return robot.with_(mass_scale=self.mass_scale)


class Control(Part):
    """A controller; gains follow from the closed loop's frequency ω and damping ratio ζ.

    kp = ω², kd = 2 ζ ω, times the diagonal of M at the start for joint controllers without a model in the loop. PID has
    ki = integral_rate kp and is cut at effort_limit_N_m, unless given the limits of the file. Operational space holds
    the posture of the start with a tenth of the stiffness.
    """

    kind: Literal["pd", "pid", "pd_gravity", "feed_forward", "computed_torque", "operational_space"]
    frequency_rad_per_s: PerJoint
    damping_ratio: PerJoint = 1.0
    integral_rate_per_s: Positive = 1.0
    effort_limit_N_m: Stated = "urdf"
    period_s: NotNegative = 0.0
    frame: str | None = None
    model: Model = Model()

    def build(self, described: Robot, robot: Robot, q0: np.ndarray, reference: Any) -> Controller:
        """The controller for a reference.

        Raises:
            SceneError: If the reference is none of its kind.
        """
        for key, kinds in _OF_ONE_KIND.items():
            if key in self.model_fields_set and self.kind not in kinds:
                raise SceneError(f"control.{key}: has no effect on {self.kind}, only on {', '.join(kinds)}; remove it")
        model, wanted = self.model.build(described, robot), reference.build(robot, q0, self.frame)
        cartesian = isinstance(wanted, CartesianReference)
        if cartesian != (self.kind == "operational_space"):
            need = "line or circle" if self.kind == "operational_space" else "hold, quintic or via_points"
            raise SceneError(f"reference.kind: {self.kind} follows {need}, got {reference.kind!r}")
        if cartesian:
            kp, kd = gains_from(1.0, self.frequency_rad_per_s, self.damping_ratio)
            return OperationalSpace(
                model, _frame(self.frame), wanted, kp, kd, q0, kp.max() / 10, 2 * np.sqrt(kp.max() / 10),
                period_s=self.period_s,
            )  # fmt: skip
        frequency = per_joint("frequency_rad_per_s", self.frequency_rad_per_s, robot)
        ratio = per_joint("damping_ratio", self.damping_ratio, robot)
        inertia = 1.0 if self.kind == "computed_torque" else np.diag(model.M(q0))
        kp, kd = gains_from(inertia, frequency, ratio)
        if self.kind == "computed_torque":
            return ComputedTorque(model, wanted, kp, kd, self.period_s)
        if self.kind == "pid":
            limit = per_joint("effort_limit_N_m", self.effort_limit_N_m, robot, elsewhere=np.inf)
            limit = stated_efforts(robot) if limit is URDF else limit
            return PID(wanted, kp, kp * self.integral_rate_per_s, kd, limit, period_s=self.period_s)
        if self.kind == "pd":
            return PD(wanted, kp, kd, self.period_s)
        return (PDGravity if self.kind == "pd_gravity" else FeedForward)(model, wanted, kp, kd, self.period_s)


# keys that other kinds of control do not read
_OF_ONE_KIND = {"integral_rate_per_s": ("pid",), "effort_limit_N_m": ("pid",), "frame": ("operational_space",)}


def _frame(frame: str | None) -> str:
    if frame is None:
        raise SceneError("control.frame: name the link that follows a line or a circle")
    return frame
