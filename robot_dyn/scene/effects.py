"""The effects a scene can name: edits of the robot (gravity, lock, payload, armature) and effects of the plant."""

from __future__ import annotations

from math import inf
from typing import Annotated, Any, ClassVar, Literal

from robot_dyn.description.edits import STANDARD_GRAVITY, Payload
from robot_dyn.effects.actuator import ActuatorLag, EffortLimit
from robot_dyn.effects.carried_payload import CarriedPayload
from robot_dyn.effects.dahl import DahlFriction
from robot_dyn.effects.dry_friction import DryFriction
from robot_dyn.effects.effect import Effect
from robot_dyn.effects.explanation import EDITED, term_of
from robot_dyn.effects.friction import RegularisedCoulombFriction, ViscousFriction
from robot_dyn.effects.joint_limit import JointStopDamper, JointStopSpring, joint_stops
from robot_dyn.effects.line_spring_damper import LineSpringDamper
from robot_dyn.effects.lugre import LuGreFriction
from robot_dyn.effects.rigid_backlash import RigidBacklash
from robot_dyn.effects.rigid_stops import RigidStops
from robot_dyn.effects.series_elastic import SeriesElastic
from robot_dyn.effects.spring import Spring
from robot_dyn.effects.wrench import ExternalWrench
from robot_dyn.foundations.coefficients import URDF
from robot_dyn.foundations.errors import SceneError
from robot_dyn.model.robot import Robot
from robot_dyn.scene.declared import Declared, declared_part
from robot_dyn.scene.schema import (
    Form,
    NotNegative,
    Number,
    Part,
    PerJoint,
    Positive,
    Stated,
    Vector3,
    kinds_of,
    one_of,
    per_joint,
)

Matrix3 = Annotated[tuple[Vector3, Vector3, Vector3], Form("3 rows of 3 finite numbers", "list of 3 rows of 3 numbers")]


class Edit(Part):
    """An edit of the robot."""

    term: ClassVar[str] = ""
    """What it does, in a line."""
    kind: Any

    def edit(self, robot: Robot, loaded: Robot) -> Robot:
        """Return the edited robot; `loaded` has gravity and armature of its file."""
        raise NotImplementedError


def bare(loaded: Robot) -> Robot:
    """The robot without gravity and armature, which a scene names where they act."""
    return loaded.with_(gravity=(0.0, 0.0, 0.0), armature={})


class Acting(Part):
    """An effect of the plant."""

    term: ClassVar[str] = ""
    """Its equation in a line."""
    kind: Any

    def build(self, robot: Robot) -> tuple[Effect, ...]:
        """Return the effects of this table."""
        raise NotImplementedError


class DeclaredEffect(Declared, Acting):
    """An effect made of the coefficients that its classes declare."""

    def build(self, robot: Robot) -> tuple[Effect, ...]:
        effects = self.call(robot)
        return effects if isinstance(effects, tuple) else (effects,)


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
        return Payload(self.frame, self.mass_kg, self.com_m, self.inertia_kg_m2)


class Gravity(Edit):
    """Gravity: ∂V/∂q in N, with V = −Σ m gᵀ p."""

    term = EDITED["gravity"]

    kind: Literal["gravity"]
    acceleration_m_s2: Annotated[
        Vector3 | Literal["urdf"], Form("a list of 3 finite numbers, or 'urdf'", 'list of 3 numbers or `"urdf"`')
    ] = STANDARD_GRAVITY
    """Acceleration of free fall, in base axes; or "urdf", that of a file of MJCF."""

    def edit(self, robot: Robot, loaded: Robot) -> Robot:
        of_file = self.acceleration_m_s2 == URDF
        return robot.with_(gravity=loaded.edits.gravity if of_file else self.acceleration_m_s2)


class Lock(Edit):
    """Joints held at a value: their links become part of the links before them."""

    term = EDITED["lock"]

    kind: Literal["lock"]
    joints: dict[str, Number]
    """Value by joint, in rad, or m for a prismatic joint."""

    def edit(self, robot: Robot, loaded: Robot) -> Robot:
        return robot.with_(lock=self.joints)


class Load(Edit, Body):
    """A rigid body fixed to a link, in M, C and N."""

    term = EDITED["payload"]

    kind: Literal["payload"]

    def edit(self, robot: Robot, loaded: Robot) -> Robot:
        return robot.with_(payload=self.payload)


class Armature(Edit):
    """Inertia of the drives felt at the joints, added to the diagonal of M."""

    term = EDITED["armature"]

    kind: Literal["armature"]
    inertia_kg_m2: Stated
    """Inertia by joint, of the rotor where there is a gear; "urdf" is that of a file of MJCF, as joints feel it."""
    gear_ratio: PerJoint = 1.0
    """n: the joint feels n² times the inertia of the rotor; joints left out have 1."""

    def edit(self, robot: Robot, loaded: Robot) -> Robot:
        stated = dict(loaded.edits.armature)
        if self.inertia_kg_m2 == URDF:
            if not stated:
                raise SceneError("inertia_kg_m2: the robot's file states no armature; give it by joint")
            if "gear_ratio" in self.model_fields_set:
                raise SceneError("gear_ratio: armature of a file is what joints feel, after gears; leave it out")
            return robot.with_(armature={name: stated.get(name, 0.0) for name in robot.joint_names})
        inertia = per_joint("armature", self.inertia_kg_m2, robot)
        return robot.with_(armature=per_joint("gear_ratio", self.gear_ratio, robot, elsewhere=1.0) ** 2 * inertia)


class Carried(Acting, Body):
    """A rigid body on a link that is picked up and dropped: in M, C and N for start_s ≤ t < end_s."""

    term = CarriedPayload.term

    kind: Literal["carried_payload"]
    start_s: NotNegative = 0.0
    """When it is picked up; 0 if the arm starts with it."""
    end_s: Positive | None = None
    """When it is dropped."""
    picked_up: Literal["at_rest", "at_speed_of_link"] = "at_rest"
    """Whether it rests until it is picked up, an impact that loses energy, or moves with the link by then."""

    def build(self, robot: Robot) -> tuple[Effect, ...]:
        end = inf if self.end_s is None else self.end_s
        return (CarriedPayload(self.payload, self.start_s, end, self.picked_up == "at_rest"),)


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
        line = LineSpringDamper(
            self.frame, self.other_frame, self.point_m, self.other_point_m,
            stiffness=self.stiffness_N_per_m, damping=self.damping_N_s_per_m, length=self.length_m,
        )  # fmt: skip
        return line.parts


def _declared(kind: str, *classes: type[Effect], **choices: Any) -> type[DeclaredEffect]:
    part = declared_part(DeclaredEffect, kind, *classes, **choices)
    part.term = term_of(classes)
    return part


EDITS = Gravity, Lock, Load, Armature
ACTING = (
    _declared("viscous_friction", ViscousFriction),
    _declared("regularised_coulomb_friction", RegularisedCoulombFriction),
    _declared("dry_friction", DryFriction),
    _declared("lugre_friction", LuGreFriction),
    _declared("dahl_friction", DahlFriction),
    _declared("spring", Spring),
    _declared(
        "joint_stops", JointStopSpring, JointStopDamper, factory=joint_stops,
        text="Soft joint stops: τ = k (δ₋ − δ₊) − c (δ₋ + δ₊) v, with δ the depth beyond a stop.",
    ),
    _declared("rigid_stops", RigidStops),
    Line,
    Wrench,
    Carried,
    _declared("series_elastic", SeriesElastic),
    _declared("rigid_backlash", RigidBacklash),
    _declared("effort_limit", EffortLimit),
    _declared("actuator_lag", ActuatorLag),
)  # fmt: skip
BY_KIND: dict[str, type[Edit | Acting]] = {kinds_of(part)[0]: part for part in (*EDITS, *ACTING)}
AnyEdit = one_of(*EDITS)
AnyEffect = one_of(*EDITS, *ACTING)
