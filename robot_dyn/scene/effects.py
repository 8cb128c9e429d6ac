"""The effects in a scene: edits of the robot (gravity, lock, payload, armature) and effects of the plant."""

from __future__ import annotations

from collections.abc import Iterator
from inspect import isabstract, isclass
from math import inf
from typing import Annotated, Any, Literal

from pydantic import Field

from robot_dyn import effects
from robot_dyn.description.edits import STANDARD_GRAVITY, Payload
from robot_dyn.effects.carried_payload import CarriedPayload
from robot_dyn.effects.effect import Effect
from robot_dyn.effects.joint_limit import JointStopDamper, JointStopSpring, joint_stops
from robot_dyn.effects.line_spring_damper import LineSpringDamper
from robot_dyn.effects.torque_speed_limit import TorqueSpeedLimit
from robot_dyn.effects.wrench import ExternalWrench
from robot_dyn.foundations.coefficients import URDF
from robot_dyn.foundations.errors import SceneError
from robot_dyn.model.robot import Robot
from robot_dyn.scene.declared import Declared, declared_part
from robot_dyn.scene.messages import named_by_key
from robot_dyn.scene.schema import (
    Form,
    NotNegative,
    Number,
    Part,
    PerJoint,
    Positive,
    Stated,
    Truth,
    Vector3,
    kinds_of,
    one_of,
    per_joint,
)

Matrix3 = Annotated[tuple[Vector3, Vector3, Vector3], Form("3 rows of 3 finite numbers", "list of 3 rows of 3 numbers")]


class Edit(Part):
    """An edit of the robot."""

    kind: Any

    def edit(self, robot: Robot, loaded: Robot) -> Robot:
        """Return the edited robot; `loaded` has the gravity and armature of the file."""
        raise NotImplementedError


def bare(loaded: Robot) -> Robot:
    """Return the robot without gravity and armature, which act only if a scene lists them."""
    return loaded.with_(gravity=(0.0, 0.0, 0.0), armature={})


class Acting(Part):
    """An effect of the plant."""

    kind: Any

    def build(self, robot: Robot) -> tuple[Effect, ...]:
        """Return the effects of this table."""
        raise NotImplementedError


class DeclaredEffect(Acting, Declared):
    """An effect with the declared coefficients of its classes."""

    def build(self, robot: Robot) -> tuple[Effect, ...]:
        effect = self.call(robot)
        effects = effect if isinstance(effect, tuple) else effect.parts
        with named_by_key(self.key_by_name()):
            for one in effects:
                one.on(robot)  # reports wrong values here, where the keys of the file are known
        return effects


class Body(Part):
    """A rigid body on a link."""

    kind: Any
    frame: str
    """The link that carries it."""
    mass_kg: NotNegative
    """Mass."""
    com_m: Vector3 = (0.0, 0.0, 0.0)
    """Centre of mass, in the frame of the link."""
    inertia_kg_m2: Matrix3 = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    """Inertia about the centre of mass, three rows, in axes parallel to the link's."""

    @property
    def payload(self) -> Payload:
        """The body and its link."""
        with named_by_key({"payload inertia": "inertia_kg_m2"}):
            return Payload(self.frame, self.mass_kg, self.com_m, self.inertia_kg_m2)


class Gravity(Edit):
    """Gravity: ∂V/∂q in N, with V = −Σ m gᵀ p."""

    kind: Literal["gravity"]
    acceleration_m_s2: Annotated[
        Vector3 | Literal["urdf"], Form("a list of 3 finite numbers, or 'urdf'", 'list of 3 numbers or `"urdf"`')
    ] = STANDARD_GRAVITY
    """Acceleration of free fall, in base axes; or "urdf" for the value in an MJCF file."""

    def edit(self, robot: Robot, loaded: Robot) -> Robot:
        is_stated = self.acceleration_m_s2 == URDF
        return robot.with_(gravity=loaded.edits.gravity if is_stated else self.acceleration_m_s2)


class Lock(Edit):
    """Joints fixed at a value: their links become part of the parent links."""

    kind: Literal["lock"]
    joints: dict[str, Number]
    """Value by joint, in rad, or m for a prismatic joint."""

    def edit(self, robot: Robot, loaded: Robot) -> Robot:
        return robot.with_(lock=self.joints)


class Load(Edit, Body):
    """A rigid body fixed to a link, in M, C and N."""

    kind: Literal["payload"]

    def edit(self, robot: Robot, loaded: Robot) -> Robot:
        return robot.with_(payload=self.payload)


class Armature(Edit):
    """Inertia of the drives at the joints, added to the diagonal of M."""

    kind: Literal["armature"]
    inertia_kg_m2: Stated
    """Inertia by joint, of the rotor if there is a gear; "urdf" for the values of the file, after gears."""
    gear_ratio: PerJoint = 1.0
    """n: n² times the inertia of the rotor acts at the joint; omitted joints have 1."""

    def edit(self, robot: Robot, loaded: Robot) -> Robot:
        if self.inertia_kg_m2 == URDF:
            stated = dict(loaded.edits.armature)  # stated by an MJCF file
            if not stated and not loaded.stated_armature.any():
                raise SceneError("inertia_kg_m2: the robot's file states no armature; give it by joint")
            if "gear_ratio" in self.model_fields_set:
                raise SceneError("gear_ratio: the armature of a file already includes gears; remove gear_ratio")
            if not stated:
                return robot.with_(armature=URDF)
            return robot.with_(armature={name: stated.get(name, 0.0) for name in robot.joint_names})
        with named_by_key({"armature": "inertia_kg_m2"}):
            inertia = per_joint("armature", self.inertia_kg_m2, robot)
            return robot.with_(armature=per_joint("gear_ratio", self.gear_ratio, robot, elsewhere=1.0) ** 2 * inertia)


class Carried(Acting, Body):
    """A rigid body on a link that is picked up and dropped: in M, C and N for start_s ≤ t < end_s."""

    kind: Literal["carried_payload"]
    start_s: NotNegative = 0.0
    """Time at which it is picked up; 0 if the arm starts with it."""
    end_s: Positive | None = None
    """Time at which it is dropped."""
    at_rest: Truth = True
    """True if the body rests before it is picked up, an impact that loses energy; false if it moves with the link."""

    def build(self, robot: Robot) -> tuple[Effect, ...]:
        end = inf if self.end_s is None else self.end_s
        return (CarriedPayload(self.payload, self.start_s, end, self.at_rest),)


class Wrench(Acting):
    """A force and a torque on a link, for start_s ≤ t < end_s: τ = Jᵀ F."""

    kind: Literal["external_wrench"]
    frame: str
    """The link."""
    force_N: Vector3 = (0.0, 0.0, 0.0)
    """Force."""
    torque_N_m: Vector3 = (0.0, 0.0, 0.0)
    """Torque."""
    expressed_in: Literal["world_aligned", "body", "world"] = "world_aligned"
    """At the origin of the link in base axes, or in the axes of the link ("body"); or at the base ("world")."""
    start_s: NotNegative = 0.0
    """Time at which it starts."""
    end_s: Positive | None = None
    """Time at which it ends."""

    def build(self, robot: Robot) -> tuple[Effect, ...]:
        if not any((*self.force_N, *self.torque_N_m)):
            raise SceneError(f"external_wrench on {self.frame!r} has no effect; give force_N or torque_N_m")
        end = inf if self.end_s is None else self.end_s
        return (ExternalWrench(self.frame, [*self.force_N, *self.torque_N_m], self.expressed_in, self.start_s, end),)


class MassScale(Edit):
    """Factors on mass and inertia of single links, except payloads: the same shape with another density."""

    kind: Literal["mass_scales"]
    factors: dict[str, Positive]
    """Factor by link. To change the mass alone, vary `LINK.mass`."""

    def edit(self, robot: Robot, loaded: Robot) -> Robot:
        return robot.with_(mass_scales=self.factors)


EDITS = Gravity, Lock, Load, Armature, MassScale
_JOINT_STOPS = declared_part(
    DeclaredEffect, "joint_stops", JointStopSpring, JointStopDamper, factory=joint_stops,
    text="Soft joint stops: τ = k (δ₋ − δ₊) − c (δ₋ + δ₊) v, with δ the depth beyond a stop.",
)  # fmt: skip
_LINE = declared_part(
    DeclaredEffect, "line_spring_damper", LineSpringDamper,
    others={
        "frame": (str, Field(description="A frame of the arm.")),
        "other_frame": (str | None, Field(None, description="Another frame of the arm; the world by default.")),
    },
)  # fmt: skip
_MOTOR = declared_part(
    DeclaredEffect, "torque_speed_limit", TorqueSpeedLimit,
    others={"at": (Literal["joint", "motor"], Field("joint", description="Where speeds and torques are measured."))},
)  # fmt: skip
_OTHERS: dict[str, type[Acting]] = {kinds_of(part)[0]: part for part in (_JOINT_STOPS, _LINE, _MOTOR, Wrench, Carried)}
"""Tables that are not built from one class, by kind."""


def _acting() -> Iterator[type[Acting]]:
    """Yield a table for each effect in `robot_dyn.effects`."""
    listed = [getattr(effects, name) for name in effects.__all__]
    classes = [kind for kind in listed if isclass(kind) and issubclass(kind, Effect) and not isabstract(kind)]
    for name, kind in {kind.name: kind for kind in classes if kind is not Effect}.items():
        yield _OTHERS[name] if name in _OTHERS else declared_part(DeclaredEffect, name, kind)


ACTING = tuple(_acting())
BY_KIND: dict[str, type[Edit | Acting]] = {kinds_of(part)[0]: part for part in (*EDITS, *ACTING)}
AnyEdit = one_of(*EDITS)
AnyEffect = one_of(*EDITS, *ACTING)
