"""The controllers and references a scene can name."""

from __future__ import annotations

from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field

from robot_dyn.coefficients import URDF
from robot_dyn.control.cartesian import CartesianReference, circle, line
from robot_dyn.control.computed_torque import ComputedTorque, FeedForward, PDGravity
from robot_dyn.control.controller import Controller
from robot_dyn.control.digital_loop.loop import LINES, Loop
from robot_dyn.control.digital_loop.multirate import Multirate
from robot_dyn.control.independent_joint import PD, PID, gains_from
from robot_dyn.control.operational_space import OperationalSpace
from robot_dyn.control.reference import PiecewisePolynomial, hold, numbers, quintic, via_points
from robot_dyn.control.samples import Samples, read_table
from robot_dyn.effects.actuator import stated_efforts
from robot_dyn.errors import SceneError
from robot_dyn.model.robot import Robot
from robot_dyn.scene.effects import Edit
from robot_dyn.scene.loop import ActuationBlock, PositionBlock, VelocityBlock
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
    """Rest at a position."""

    kind: Literal["hold"]
    q: PerJoint | None = None
    """Position; that of the start by default."""

    def build(self, robot: Robot, q0: np.ndarray, frame: str | None) -> PiecewisePolynomial:
        """The reference."""
        return hold(q0 if self.q is None else per_joint("q", self.q, robot))


class Quintic(Part):
    """From the start to q in a given time, by a polynomial of degree 5 at rest at both ends."""

    kind: Literal["quintic"]
    q: PerJoint
    """Position at the end."""
    duration_s: Positive
    """Time from the start to q."""
    start_s: NotNegative = 0.0
    """When it starts."""

    def build(self, robot: Robot, q0: np.ndarray, frame: str | None) -> PiecewisePolynomial:
        """The reference."""
        return quintic(q0, per_joint("q", self.q, robot), self.duration_s, start_s=self.start_s)


class ViaPoints(Part):
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
        """The reference."""
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


class Sampled(Part):
    """Samples of a CSV file with columns t, q and if given v and a of each joint, as rd.Samples takes them."""

    kind: Literal["samples"]
    file: str
    """Path of the file, from the folder of the scene."""

    def build(self, robot: Robot, q0: np.ndarray, frame: str | None) -> PiecewisePolynomial:
        """The reference."""
        return Samples.from_csv(self.file, robot.joint_names)


class Line(Part):
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
        """The reference."""
        g = robot.placement(q0, _frame(frame))
        R = g[:3, :3] if self.hold_orientation else None
        return line(g[:3, 3], g[:3, 3] + self.by_m, self.duration_s, rotation=R, start_s=self.start_s)


class Circle(Part):
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


AnyReference = Annotated[Hold | Quintic | ViaPoints | Sampled | Line | Circle, Field(discriminator="kind")]


class Model(Part):
    """The controller's model of the arm, where it differs from the plant's; a table of `[control]`."""

    mass_scale: Positive = 1.0
    """Factor on mass and inertia of all links, payloads excepted."""
    effects: list[Annotated[Edit, Field(discriminator="kind")]] | None = None
    """Its gravity, lock, payload and armature, as of `[[effect]]`, in place of the scene's; those by default."""

    def build(self, described: Robot, robot: Robot) -> Robot:
        """The model: the plant's robot, or the described one with edits of its own; masses scaled."""
        if self.effects is not None:
            robot = described
            for edit in self.effects:
                robot = edit.edit(robot)
        return robot.with_(mass_scale=self.mass_scale)


LAWS = {
    "pd": "u = kp (q_d − q) + kd (v_d − v)",
    "pid": "u = sat(kp e + kd ė + z),  ż = ki e + (sat(u) − u)/T_t",
    "pd_gravity": "u = kp e + kd ė + N(q)",
    "feed_forward": "u = M a_d + C v_d + N at the reference + kp e + kd ė",
    "computed_torque": "u = M (a_d + kd ė + kp e) + C v + N",
    "operational_space": "u = Jᵀ (Λ (ẍ_d + kd ė + kp e) + μ + p) + null-space posture",
}


class Slow(Part):
    """A second controller with a longer period, whose torque is added; a table of `[control]`."""

    kind: Literal["pd", "pd_gravity", "feed_forward", "computed_torque"]
    """The control law."""
    period_s: Positive
    """Time between samples, a whole number of those of the first."""
    kp: PerJoint = 0.0
    """Stiffness, in N m/rad (N/m for a prismatic joint); in 1/s² for computed_torque."""
    kd: PerJoint = 0.0
    """Damping, in N m s/rad (N s/m for a prismatic joint); in 1/s for computed_torque."""

    def build(self, model: Robot, desired: Any) -> Controller:
        """The controller, with the model and the reference of the first."""
        kp, kd = (per_joint(name, getattr(self, name), model) for name in ("kp", "kd"))
        if self.kind == "pd":
            return PD(desired, kp, kd, self.period_s)
        return _WITH_MODEL[self.kind](model, desired, kp, kd, self.period_s)


_WITH_MODEL = {"pd_gravity": PDGravity, "feed_forward": FeedForward, "computed_torque": ComputedTorque}


class Control(Part):
    """A controller. Its gains are kp and kd, or follow from the frequency ω and the damping ratio ζ of the closed loop.

    kp = ω² and kd = 2 ζ ω, times the diagonal of M at the start for `pd`, `pid`, `pd_gravity` and `feed_forward`.
    `operational_space` holds the posture of the start with a tenth of the largest kp.
    """

    kind: Literal["pd", "pid", "pd_gravity", "feed_forward", "computed_torque", "operational_space"]
    """The control law."""
    frequency_rad_per_s: PerJoint | None = None
    """Frequency ω of the closed loop; required without kp and kd."""
    damping_ratio: PerJoint = 1.0
    """Damping ratio ζ of the closed loop, 1 for critical damping."""
    kp: PerJoint | None = None
    """Stiffness, in N m/rad (N/m for a prismatic joint); in 1/s² for computed_torque and operational_space."""
    kd: PerJoint | None = None
    """Damping, in N m s/rad (N s/m for a prismatic joint); in 1/s for computed_torque and operational_space."""
    integral_rate_per_s: Positive = 1.0
    """Of pid: ki = integral_rate_per_s · kp."""
    effort_limit_N_m: Stated = "urdf"
    """Of pid: the greatest torque."""
    period_s: NotNegative = 0.0
    """Time between samples, with the torque constant between them; 0 for continuous control."""
    frame: str | None = None
    """Of operational_space: the link under control."""
    model: Model = Model()
    """The controller's model of the arm; that of the plant by default."""
    slow: Slow | None = None
    """A second controller with a longer period, whose torque is added."""
    measurement_delay_periods: NotNegative = 0.0
    """How late position and velocity are measured, in periods."""
    actuation_delay_periods: NotNegative = 0.0
    """How late a torque acts, in periods."""
    position: tuple[PositionBlock, ...] = ()  # pyright: ignore[reportInvalidTypeForm]
    """Blocks of the measured position, one after the other."""
    velocity: tuple[VelocityBlock, ...] = ()  # pyright: ignore[reportInvalidTypeForm]
    """Blocks of the measured velocity, one after the other."""
    actuation: tuple[ActuationBlock, ...] = ()  # pyright: ignore[reportInvalidTypeForm]
    """Blocks of the torque, one after the other."""
    noise_seed: Annotated[int, Field(ge=0, strict=True)] = 0
    """Seed of noise; other seeds give other noise of the same kind."""

    @property
    def unused(self) -> set[str]:
        """Keys that this kind, with these gains, does not read."""
        of_others = {key for key, kinds in _OF_ONE_KIND.items() if self.kind not in kinds}
        return of_others | ({"damping_ratio"} if self.kp is not None else set()) | ({"noise_seed"} - self._with_noise)

    @property
    def _with_noise(self) -> set[str]:
        """The key of the seed, if a block draws noise."""
        blocks = (*self.position, *self.velocity, *self.actuation)
        return {"noise_seed"} if any(each.make.random for each in blocks) else set()

    @property
    def loops(self) -> bool:
        """Whether anything stands between the arm and the controller."""
        late = self.measurement_delay_periods or self.actuation_delay_periods
        return bool(late or self.position or self.velocity or self.actuation)

    def build(self, described: Robot, robot: Robot, q0: np.ndarray, reference: Any) -> Controller:
        """The controller for a reference.

        Raises:
            SceneError: If the gains are stated twice or not at all, or its kind does not follow this kind of reference.
        """
        for key, kinds in _OF_ONE_KIND.items():
            if key in self.model_fields_set and self.kind not in kinds:
                raise SceneError(f"control.{key}: has no effect on {self.kind}, only on {', '.join(kinds)}; remove it")
        if "noise_seed" in self.model_fields_set and not self._with_noise:
            raise SceneError("control.noise_seed: has no effect without a block of kind noise; remove it")
        made = self._controller(described, robot, q0, reference)
        if not self.loops:
            return made
        lines: Any = {line: [each.build(robot) for each in getattr(self, line)] for line in LINES}
        late: Any = {
            "measurement_delay": self.measurement_delay_periods,
            "actuation_delay": self.actuation_delay_periods,
        }
        return Loop(made, **lines, **late, seed=self.noise_seed)

    def _controller(self, described: Robot, robot: Robot, q0: np.ndarray, reference: Any) -> Controller:
        """What is in the loop: one controller, or two."""
        model, desired = self.model.build(described, robot), reference.build(robot, q0, self.frame)
        cartesian = isinstance(desired, CartesianReference)
        if cartesian != (self.kind == "operational_space"):
            need = "line or circle" if self.kind == "operational_space" else "hold, quintic, via_points or samples"
            raise SceneError(f"reference.kind: {self.kind} follows {need}, got {reference.kind!r}")
        made = self._law(model, robot, q0, desired, cartesian)
        if self.slow is None:
            return made
        if cartesian:
            raise SceneError("control.slow: follows hold, quintic, via_points or samples; remove it")
        return Multirate(made, self.slow.build(model, desired))

    def _law(self, model: Robot, robot: Robot, q0: np.ndarray, desired: Any, cartesian: bool) -> Controller:
        """The first controller."""
        kp, kd = self._gains(model, q0)
        if cartesian:
            return OperationalSpace(
                model, _frame(self.frame), desired, kp, kd, q0, kp.max() / 10, 2 * np.sqrt(kp.max() / 10),
                period_s=self.period_s,
            )  # fmt: skip
        if self.kind == "pid":
            limit = per_joint("effort_limit_N_m", self.effort_limit_N_m, robot, elsewhere=np.inf)
            limit = stated_efforts(robot) if limit is URDF else limit
            return PID(desired, kp, kp * self.integral_rate_per_s, kd, limit, period_s=self.period_s)
        if self.kind == "pd":
            return PD(desired, kp, kd, self.period_s)
        return _WITH_MODEL[self.kind](model, desired, kp, kd, self.period_s)

    def _gains(self, model: Robot, q0: np.ndarray) -> tuple[Any, Any]:
        """Stiffness and damping, as stated or of ω and ζ."""
        stated = self.kp is not None
        if stated != (self.kd is not None) or stated == (self.frequency_rad_per_s is not None):
            raise SceneError("control: give frequency_rad_per_s, or both kp and kd")
        if stated and "damping_ratio" in self.model_fields_set:
            raise SceneError("control.damping_ratio: has no effect beside kp and kd; remove it")
        names = ("kp", "kd") if stated else ("frequency_rad_per_s", "damping_ratio")
        of_frame = self.kind == "operational_space"
        first, second = (
            numbers(f"control.{name}", getattr(self, name), (), ("n",), least=0)
            if of_frame
            else per_joint(name, getattr(self, name), model)
            for name in names
        )
        if stated:
            return first, second
        return gains_from(1.0 if of_frame or self.kind == "computed_torque" else np.diag(model.M(q0)), first, second)


# keys that other kinds of control do not read
_OF_ONE_KIND = {"integral_rate_per_s": ("pid",), "effort_limit_N_m": ("pid",), "frame": ("operational_space",)}


def _frame(frame: str | None) -> str:
    if frame is None:
        raise SceneError("control.frame: name the link that follows a line or a circle")
    return frame
