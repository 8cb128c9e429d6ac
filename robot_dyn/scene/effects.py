"""The effects a scene can name: edits of the robot (gravity, lock, payload, armature) and effects of the plant."""

from __future__ import annotations

from math import inf
from typing import Annotated, Literal, Union, get_args

from pydantic import Field

from robot_dyn.description.edits import STANDARD_GRAVITY, Payload
from robot_dyn.effects.actuator import ActuatorLag, EffortLimit
from robot_dyn.effects.carried_payload import CarriedPayload
from robot_dyn.effects.dahl import DahlFriction
from robot_dyn.effects.dry_friction import DryFriction
from robot_dyn.effects.effect import Effect
from robot_dyn.effects.friction import RegularisedCoulombFriction, ViscousFriction
from robot_dyn.effects.joint_limit import JointStopDamper, JointStopSpring, joint_stops
from robot_dyn.effects.line_spring_damper import LineSpringDamper
from robot_dyn.effects.lugre import LuGreFriction
from robot_dyn.effects.rigid_backlash import RigidBacklash
from robot_dyn.effects.rigid_stops import RigidStops
from robot_dyn.effects.series_elastic import SeriesElastic
from robot_dyn.effects.spring import Spring
from robot_dyn.effects.wrench import ExternalWrench
from robot_dyn.errors import SceneError
from robot_dyn.model.robot import Robot
from robot_dyn.scene.declared import Acting, declared_part
from robot_dyn.scene.schema import NotNegative, Number, Part, PerJoint, Positive, Vector3, per_joint


class Gravity(Part):
    """Gravity: ∂V/∂q in N, with V = −Σ m gᵀ p."""

    kind: Literal["gravity"]
    acceleration_m_s2: Vector3 = STANDARD_GRAVITY
    """Acceleration of free fall, in base axes."""

    def edit(self, robot: Robot) -> Robot:
        """The robot in this gravity."""
        return robot.with_(gravity=self.acceleration_m_s2)


class Lock(Part):
    """Joints held at a value: their links become part of the links before them."""

    kind: Literal["lock"]
    joints: dict[str, Number]
    """Value by joint, in rad, or m for a prismatic joint."""

    def edit(self, robot: Robot) -> Robot:
        """The robot with these joints locked."""
        return robot.with_(lock=self.joints)


class Load(Part):
    """A rigid body fixed to a link, in M, C and N."""

    kind: Literal["payload"]
    frame: str
    """The link that carries it."""
    mass_kg: NotNegative
    """Mass."""
    com_m: Vector3 = (0.0, 0.0, 0.0)
    """Centre of mass, in the frame of the link."""
    inertia_kg_m2: tuple[Vector3, Vector3, Vector3] = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
    """Inertia about the centre of mass, three rows, in axes parallel to the link's."""

    def edit(self, robot: Robot) -> Robot:
        """The robot that carries it."""
        return robot.with_(payload=Payload(self.frame, self.mass_kg, self.com_m, self.inertia_kg_m2))


class Armature(Part):
    """Inertia of the drives felt at the joints, added to the diagonal of M."""

    kind: Literal["armature"]
    inertia_kg_m2: PerJoint
    """Inertia by joint, of the rotor where there is a gear."""
    gear_ratio: PerJoint = 1.0
    """n: the joint feels n² times the inertia of the rotor; joints left out have 1."""

    def edit(self, robot: Robot) -> Robot:
        """The robot with these drives."""
        inertia = per_joint("armature", self.inertia_kg_m2, robot)
        return robot.with_(armature=per_joint("gear_ratio", self.gear_ratio, robot, elsewhere=1.0) ** 2 * inertia)


class Carried(Acting):
    """A rigid body on a link that is picked up and dropped: in M, C and N for start_s ≤ t < end_s."""

    term = CarriedPayload.term

    kind: Literal["carried_payload"]
    frame: str
    """The link that carries it."""
    mass_kg: NotNegative
    """Mass."""
    com_m: Vector3 = Load.model_fields["com_m"].default
    """Centre of mass, in the frame of the link."""
    inertia_kg_m2: tuple[Vector3, Vector3, Vector3] = Load.model_fields["inertia_kg_m2"].default
    """Inertia about the centre of mass, three rows, in axes parallel to the link's."""
    start_s: NotNegative = 0.0
    """When it is picked up; 0 if the arm starts with it."""
    end_s: Positive | None = None
    """When it is dropped."""
    picked_up: Literal["at_rest", "at_speed_of_link"] = "at_rest"
    """Whether it rests until it is picked up, an impact that loses energy, or moves with the link by then."""

    def build(self, robot: Robot) -> tuple[Effect, ...]:
        body = Payload(self.frame, self.mass_kg, self.com_m, self.inertia_kg_m2)
        end = inf if self.end_s is None else self.end_s
        return (CarriedPayload(body, self.start_s, end, self.picked_up == "at_rest"),)


class Wrench(Acting):
    """A force and a torque on a link, for start_s ≤ t < end_s: τ = Jᵀ F."""

    term = ExternalWrench.term

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
    """When it starts."""
    end_s: Positive | None = None
    """When it ends."""

    def build(self, robot: Robot) -> tuple[Effect, ...]:
        if not any((*self.force_N, *self.torque_N_m)):
            raise SceneError(f"external_wrench on {self.frame!r}: has no effect; give force_N or torque_N_m")
        end = inf if self.end_s is None else self.end_s
        return (ExternalWrench(self.frame, [*self.force_N, *self.torque_N_m], self.expressed_in, self.start_s, end),)


class Line(Acting):
    """A spring and a damper along the line between two points: τ = −(∂ℓ/∂q)ᵀ (k (ℓ − ℓ₀) + c ℓ'), ℓ their distance."""

    term = LineSpringDamper.term

    kind: Literal["line_spring_damper"]
    frame: str
    """A link."""
    other_frame: str | None = None
    """Another one; the world unless given."""
    point_m: Vector3 = (0.0, 0.0, 0.0)
    """A point of the link, in its axes."""
    other_point_m: Vector3 = (0.0, 0.0, 0.0)
    """A point of the other link, in its axes, or of the world, in those of the base."""
    stiffness_N_per_m: NotNegative
    """k."""
    damping_N_s_per_m: NotNegative
    """c."""
    length_m: NotNegative
    """ℓ₀, the length without force."""

    def build(self, robot: Robot) -> tuple[Effect, ...]:
        made = LineSpringDamper(
            self.frame, self.other_frame, self.point_m, self.other_point_m,
            stiffness=self.stiffness_N_per_m, damping=self.damping_N_s_per_m, length=self.length_m,
        )  # fmt: skip
        return made.parts


EDITS = Gravity, Lock, Load, Armature
ACTING = (
    declared_part("viscous_friction", ViscousFriction),
    declared_part("regularised_coulomb_friction", RegularisedCoulombFriction),
    declared_part("dry_friction", DryFriction),
    declared_part("lugre_friction", LuGreFriction),
    declared_part("dahl_friction", DahlFriction),
    declared_part("spring", Spring),
    declared_part(
        "joint_stops", JointStopSpring, JointStopDamper, make=joint_stops,
        text="Soft joint stops: τ = k (δ₋ − δ₊) − c (δ₋ + δ₊) v, with δ the depth beyond a stop.",
    ),
    declared_part("rigid_stops", RigidStops),
    Line,
    Wrench,
    Carried,
    declared_part("series_elastic", SeriesElastic),
    declared_part("rigid_backlash", RigidBacklash),
    declared_part("effort_limit", EffortLimit),
    declared_part("actuator_lag", ActuatorLag),
)  # fmt: skip
Edit = Gravity | Lock | Load | Armature
AnyEffect = Annotated[Union[EDITS + ACTING], Field(discriminator="kind")]  # pyright: ignore  # noqa: UP007


def kind_of(part: type[Part]) -> str:
    """The kind that names a part."""
    return str(get_args(part.model_fields["kind"].annotation)[0])


def kinds() -> tuple[str, ...]:
    """All kinds of effects that a scene can name."""
    return tuple(map(kind_of, (*EDITS, *ACTING)))
