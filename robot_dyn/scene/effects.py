"""The effects a scene can name: edits of the robot (gravity, lock, payload, armature) and effects of the plant."""

from __future__ import annotations

from math import inf
from typing import Annotated, Literal, get_args

from pydantic import Field

from robot_dyn.effects.actuator import EffortLimit
from robot_dyn.effects.effect import Effect
from robot_dyn.effects.friction import RegularisedCoulombFriction, ViscousFriction
from robot_dyn.effects.joint_limit import joint_stops
from robot_dyn.effects.spring import Spring
from robot_dyn.effects.wrench import ExternalWrench
from robot_dyn.errors import SceneError
from robot_dyn.model.edits import STANDARD_GRAVITY, Payload
from robot_dyn.model.robot import Robot
from robot_dyn.scene.schema import NotNegative, Number, Part, PerJoint, Positive, Stated, Vector3, per_joint


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
    """Inertia by joint."""

    def edit(self, robot: Robot) -> Robot:
        """The robot with these drives."""
        return robot.with_(armature=self.inertia_kg_m2)


class Viscous(Part):
    """Viscous friction τ = −b v."""

    kind: Literal["viscous_friction"]
    damping_N_m_s_per_rad: Stated = "urdf"
    """b."""

    def build(self, robot: Robot) -> tuple[Effect, ...]:
        """The effect."""
        return (ViscousFriction(per_joint("damping", self.damping_N_m_s_per_rad, robot)),)


class RegularisedCoulomb(Part):
    """Dry friction, regularised: τ = −f tanh(v / v_s). Inside |v| < v_s it creeps and does not stick."""

    kind: Literal["regularised_coulomb_friction"]
    friction_N_m: Stated = "urdf"
    """f."""
    velocity_scale_rad_per_s: Positive = 0.01
    """v_s."""

    def build(self, robot: Robot) -> tuple[Effect, ...]:
        """The effect."""
        friction = per_joint("friction", self.friction_N_m, robot)
        return (RegularisedCoulombFriction(friction, self.velocity_scale_rad_per_s),)


class JointSpring(Part):
    """Springs in the joints: τ = −k (q − q₀)."""

    kind: Literal["spring"]
    stiffness_N_m_per_rad: PerJoint
    """k."""
    rest_rad: PerJoint = 0.0
    """Rest position q₀."""

    def build(self, robot: Robot) -> tuple[Effect, ...]:
        """The effect."""
        stiffness = per_joint("stiffness", self.stiffness_N_m_per_rad, robot)
        return (Spring(stiffness, per_joint("rest", self.rest_rad, robot)),)


class JointStops(Part):
    """Soft joint stops: τ = k (δ₋ − δ₊) − c (δ₋ + δ₊) v, with δ the depth beyond a stop."""

    kind: Literal["joint_stops"]
    lower_rad: Stated = "urdf"
    """Lower stops; joints left out have none."""
    upper_rad: Stated = "urdf"
    """Upper stops; joints left out have none."""
    stiffness_N_m_per_rad: PerJoint = 1e4
    """k."""
    damping_N_m_s_per_rad2: PerJoint = 1e3
    """c, damping for each unit of depth."""

    def build(self, robot: Robot) -> tuple[Effect, ...]:
        """The elastic and the dissipative part."""
        return joint_stops(
            per_joint("lower", self.lower_rad, robot, elsewhere=-1e9),
            per_joint("upper", self.upper_rad, robot, elsewhere=1e9),
            per_joint("stiffness", self.stiffness_N_m_per_rad, robot),
            per_joint("damping", self.damping_N_m_s_per_rad2, robot),
        )


class Wrench(Part):
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
    """When it starts."""
    end_s: Positive | None = None
    """When it ends."""

    def build(self, robot: Robot) -> tuple[Effect, ...]:
        """The effect."""
        if not any((*self.force_N, *self.torque_N_m)):
            raise SceneError(f"external_wrench on {self.frame!r}: has no effect; give force_N or torque_N_m")
        end = inf if self.end_s is None else self.end_s
        return (ExternalWrench(self.frame, [*self.force_N, *self.torque_N_m], self.expressed_in, self.start_s, end),)


class Effort(Part):
    """Limits of the actuation: −u_max ≤ u ≤ u_max."""

    kind: Literal["effort_limit"]
    limit_N_m: Stated = "urdf"
    """u_max; joints left out have none."""

    def build(self, robot: Robot) -> tuple[Effect, ...]:
        """The bound."""
        return (EffortLimit(per_joint("limit", self.limit_N_m, robot, elsewhere=inf)),)


Edit = Gravity | Lock | Load | Armature
Acting = Viscous | RegularisedCoulomb | JointSpring | JointStops | Wrench | Effort
AnyEffect = Annotated[Edit | Acting, Field(discriminator="kind")]


def kinds() -> tuple[str, ...]:
    """All kinds of effects that a scene can name."""
    return tuple(
        str(get_args(part.model_fields["kind"].annotation)[0]) for part in (*get_args(Edit), *get_args(Acting))
    )
