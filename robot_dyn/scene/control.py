"""The controllers in a scene, and the blocks of their digital loop."""

from __future__ import annotations

from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import Field, model_validator
from pydantic_core import PydanticCustomError

from robot_dyn.control.computed_torque import ComputedTorque, FeedForward, PDGravity
from robot_dyn.control.controller import Controller
from robot_dyn.control.digital_loop.block import Block, Differences, Noise, Quantisation, RateLimit, name_of
from robot_dyn.control.digital_loop.loop import LINES, SIGNALS, Loop
from robot_dyn.control.digital_loop.low_pass import LowPass
from robot_dyn.control.independent_joint import PD, PID, gains_from
from robot_dyn.control.operational_space import OperationalSpace
from robot_dyn.control.reference import numbers
from robot_dyn.effects.actuator import stated_efforts
from robot_dyn.foundations.coefficients import URDF
from robot_dyn.model.robot import Robot
from robot_dyn.scene.declared import Declared, declared_part
from robot_dyn.scene.effects import AnyEdit, bare
from robot_dyn.scene.messages import named_by_key, part
from robot_dyn.scene.references import Reference
from robot_dyn.scene.schema import NotNegative, Part, PerJoint, Positive, Stated, one_of, per_joint, wrong_key

_BLOCKS: dict[str, tuple[type[Block], ...]] = {  # by line
    "position": (Noise, Quantisation, LowPass),
    "velocity": (Differences, Noise, Quantisation, LowPass),
    "actuation": (LowPass, Quantisation, RateLimit, Noise),
}
_ORDER: dict[type[Block], dict[str, Any]] = {LowPass: {"order": (Literal[1, 2], Field(2, description="Order."))}}
BLOCKS: dict[str, tuple[type[Declared], ...]] = {
    line: tuple(
        declared_part(Declared, name_of(kind), kind, signal=SIGNALS[line], others=_ORDER.get(kind)) for kind in classes
    )
    for line, classes in _BLOCKS.items()
}
PositionBlock, VelocityBlock, ActuationBlock = (one_of(*BLOCKS[line]) for line in LINES)


class Model(Part):
    """The controller's model of the arm, if it differs from the plant; a table of `[control]`."""

    mass_scale: Positive = 1.0
    """Factor on mass and inertia of all links, except payloads."""
    effects: list[AnyEdit] | None = None  # pyright: ignore[reportInvalidTypeForm]
    """Gravity, lock, payload and armature of the model, written like `[[effect]]`; by default the scene's."""

    def build(self, loaded: Robot, robot: Robot) -> Robot:
        """Return the plant's robot, or the file's robot with the edits of this table only, with scaled masses."""
        if self.effects is not None:
            robot = bare(loaded)
            for edit in self.effects:
                robot = edit.edit(robot, loaded)
        return robot.with_(mass_scale=self.mass_scale)


KINDS: dict[str, type[Controller]] = {
    "pd": PD,
    "pid": PID,
    "pd_gravity": PDGravity,
    "feed_forward": FeedForward,
    "computed_torque": ComputedTorque,
    "operational_space": OperationalSpace,
}


class Control(Part):
    """A controller, with gains kp and kd, or gains from the bandwidth ω and the damping ratio ζ of the closed loop.

    kp = ω² and kd = 2 ζ ω, times the diagonal of M at the start for `pd`, `pid`, `pd_gravity` and `feed_forward`.
    `operational_space` holds the posture of the start with a tenth of the largest kp.
    """

    kind: Literal["pd", "pid", "pd_gravity", "feed_forward", "computed_torque", "operational_space"]
    """The control law."""
    bandwidth_rad_s: PerJoint | None = None
    """Natural frequency ω of the closed loop; required without kp and kd."""
    damping_ratio: PerJoint = 1.0
    """Damping ratio ζ of the closed loop, 1 for critical damping."""
    kp: PerJoint | None = None
    """Stiffness, in N m/rad (N/m for a prismatic joint); in 1/s² for computed_torque and operational_space."""
    kd: PerJoint | None = None
    """Damping, in N m s/rad (N s/m for a prismatic joint); in 1/s for computed_torque and operational_space."""
    integral_rate_per_s: Positive = 1.0
    """For pid: ki = integral_rate_per_s · kp."""
    effort_limit_N_m: Stated = "urdf"
    """For pid: the largest torque."""
    period_s: NotNegative = 0.0
    """Time between samples, with the torque constant between them; 0 for continuous control."""
    frame: str | None = None
    """For operational_space: the controlled link."""
    model: Model = Model()
    """The controller's model of the arm; by default the model of the plant."""
    measurement_delay_periods: NotNegative = 0.0
    """Delay of measured positions and velocities, in periods."""
    actuation_delay_periods: NotNegative = 0.0
    """Delay of torques, in periods."""
    position: tuple[PositionBlock, ...] = ()  # pyright: ignore[reportInvalidTypeForm]
    """Blocks of the measured position, in order."""
    velocity: tuple[VelocityBlock, ...] = ()  # pyright: ignore[reportInvalidTypeForm]
    """Blocks of the measured velocity, in order."""
    actuation: tuple[ActuationBlock, ...] = ()  # pyright: ignore[reportInvalidTypeForm]
    """Blocks of the torque, in order."""
    noise_seed: Annotated[int, Field(ge=0, strict=True)] = 0
    """Seed of the noise."""

    @property
    def unused(self) -> dict[str, str]:
        """Keys that have no effect with this kind, these gains and these blocks, with the reason."""
        kinds = {key: kind for key, kind in _OF_ONE_KIND.items() if self.kind != kind}
        reasons = {key: f"on {self.kind}, only on {kind}" for key, kind in kinds.items()}
        if self.kp is not None:
            reasons["damping_ratio"] = "together with kp and kd"
        if not any(block.factory.random for _, block in self.blocks):  # pyright: ignore[reportFunctionMemberAccess]
            reasons["noise_seed"] = "without a block of kind noise"
        return reasons

    @model_validator(mode="after")
    def _every_key_has_an_effect_and_gains_are_stated_once(self) -> Self:
        if len({self.kp is None, self.kd is None, self.bandwidth_rad_s is not None}) > 1:
            raise PydanticCustomError("wrong_key", "give bandwidth_rad_s, or both kp and kd")
        for key, reason in self.unused.items():
            if key in self.model_fields_set:
                raise wrong_key(key, f"has no effect {reason}; remove it")
        return self

    @property
    def blocks(self) -> list[tuple[str, Any]]:
        """The blocks of the loop, with their line."""
        return [(line, block) for line in LINES for block in getattr(self, line)]

    def build(self, loaded: Robot, robot: Robot, q0: np.ndarray, reference: Reference) -> Controller:
        """Return the controller for a reference."""
        controller = self._controller(loaded, robot, q0, reference)
        if not (self.measurement_delay_periods or self.actuation_delay_periods or self.blocks):
            return controller
        lines: Any = {line: [block.call(robot) for block in getattr(self, line)] for line in LINES}
        return Loop(
            controller, **lines, noise_seed=self.noise_seed,
            measurement_delay_periods=self.measurement_delay_periods,
            actuation_delay_periods=self.actuation_delay_periods,
        )  # fmt: skip

    def _controller(self, loaded: Robot, robot: Robot, q0: np.ndarray, reference: Reference) -> Controller:
        """Return the controller inside the loop."""
        model = self.model.build(loaded, robot)
        with part("reference"):
            desired = reference.build(robot, q0, self.frame)
        kp, kd = self._gains(model, q0)
        if self.kind == "operational_space":
            return OperationalSpace(
                model, str(self.frame), desired, kp=kp, kd=kd, period_s=self.period_s,
                posture=q0, posture_kp=kp.max() / 10, posture_kd=2 * np.sqrt(kp.max() / 10),
            )  # fmt: skip
        if self.kind == "pid":
            limit = per_joint("effort_limit_N_m", self.effort_limit_N_m, robot, elsewhere=np.inf)
            limit = stated_efforts(robot) if limit is URDF else limit
            with named_by_key({"effort_limit": "effort_limit_N_m"}):
                return PID(
                    desired, kp=kp, ki=kp * self.integral_rate_per_s, kd=kd, effort_limit=limit, period_s=self.period_s
                )
        if self.kind == "pd":
            return PD(desired, kp=kp, kd=kd, period_s=self.period_s)
        return KINDS[self.kind](model, desired, kp=kp, kd=kd, period_s=self.period_s)  # pyright: ignore[reportCallIssue]

    def _gains(self, model: Robot, q0: np.ndarray) -> tuple[Any, Any]:
        """Return stiffness and damping, as stated or from ω and ζ."""
        names = ("kp", "kd") if self.kp is not None else ("bandwidth_rad_s", "damping_ratio")
        of_frame = self.kind == "operational_space"
        first, second = (
            numbers(f"control.{name}", getattr(self, name), (), ("n",), least=0)
            if of_frame
            else per_joint(name, getattr(self, name), model)
            for name in names
        )
        if self.kp is not None:
            return first, second
        return gains_from(1.0 if of_frame or self.kind == "computed_torque" else np.diag(model.M(q0)), first, second)


# keys that only one kind of control reads
_OF_ONE_KIND = {"integral_rate_per_s": "pid", "effort_limit_N_m": "pid", "frame": "operational_space"}
