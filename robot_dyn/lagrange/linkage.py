"""The linkage: a Tree converted to numbers of one arithmetic, and its kinematics g(q) = Π gᵢ exp(ξ̂ᵢ qᵢ).

Links without relative motion form one body; its spatial inertia is 𝓜 = Σ Adᵀ 𝓜_link Ad in the frame of the joint that
carries it. [Murray, Li, Sastry 1994, ch. 3 and 4]
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, final

import numpy as np

from robot_dyn.description.couplings import Couplings, resolve
from robot_dyn.description.inertial_parameters import ordered
from robot_dyn.foundations.arithmetic import Arithmetic, Array, apply, sqrt, symmetric, transpose
from robot_dyn.foundations.spatial import adjoint_inverse, hat, rotation_about, rotation_rpy, spatial_inertia
from robot_dyn.lagrange.tree import Joint, Link, Tree

BASE = -1  # index of the fixed body


@final
@dataclass(frozen=True, eq=False)
class Pose:
    """A constant placement (R, p)."""

    R: Array
    p: Array

    def __matmul__(self, other: Pose) -> Pose:
        return Pose(self.R @ other.R, self.R @ other.p + self.p)


@final
@dataclass(frozen=True, eq=False)
class Body:
    """A moving body and the joint that carries it.

    Attributes:
        joint: Name of the joint.
        parent: Index of the parent body, or BASE.
        pose: Placement of the joint in the parent's frame at q = 0.
        axis: Unit vector (3,).
        revolute: True if it turns about the axis, False if it slides along it.
        path: Indices of the bodies from the base to this one, inclusive.
    """

    joint: str
    parent: int
    pose: Pose
    axis: Array
    revolute: bool
    path: tuple[int, ...]

    @cached_property
    def screw(self) -> Array:
        """Body twist ξ at unit rate, (6,)."""
        return np.concatenate((np.zeros_like(self.axis), self.axis)[:: 1 if self.revolute else -1])

    @cached_property
    def generators(self) -> tuple[Array, Array]:
        """Matrices â and â² of the axis, for `rotation_about`."""
        A = hat(self.axis)
        return A, A @ A

    def step(self, q: Array) -> Step:
        """Return the change of frame from the parent at the joint's coordinate q (...,)."""
        zero, one = np.zeros_like(self.axis), np.broadcast_to(np.eye(3, dtype=self.axis.dtype), (*q.shape, 3, 3))
        slide = q[..., None] * self.axis
        motion = (rotation_about(*self.generators, q), zero) if self.revolute else (one, slide)
        origin = self.pose.p if self.revolute else self.pose.p + apply(self.pose.R, slide)
        return Step(adjoint_inverse(self.pose.R, self.pose.p), adjoint_inverse(*motion), origin)

    def placement(self, q: Array) -> tuple[Array, Array]:
        """Return (R, p) in the parent's frame at the joint's coordinate q (...,)."""
        if self.revolute:
            return self.pose.R @ rotation_about(*self.generators, q), np.broadcast_to(self.pose.p, (*q.shape, 3))
        slide = self.pose.R @ self.axis
        return np.broadcast_to(self.pose.R, (*q.shape, 3, 3)), self.pose.p + q[..., None] * slide


@final
@dataclass(frozen=True, eq=False)
class Step:
    """Change of frame from a parent to its child body, Ad⁻¹ = Ad_joint⁻¹ Ad_pose⁻¹; two factors need fewer products.

    Attributes:
        pose: Ad⁻¹ of the joint's constant placement, (6, 6).
        joint: Ad⁻¹ of the joint's motion, (..., 6, 6).
        origin: Origin of the body's frame in its parent's, (3,) or (..., 3).
    """

    pose: Array
    joint: Array
    origin: Array

    def rotated(self, x: Array) -> Array:
        """Convert a vector from the parent's axes to the body's: Rᵀ x."""
        return apply(self.joint[..., 3:, 3:], apply(self.pose[3:, 3:], x))

    def twist(self, V: Array) -> Array:
        """Convert a twist from the parent's frame to the body's: Ad⁻¹ V."""
        return apply(self.joint, apply(self.pose, V))

    def wrench(self, F: Array) -> Array:
        """Convert a wrench from the body's frame to the parent's: Ad⁻ᵀ F."""
        return apply(self.pose.T, apply(transpose(self.joint), F))

    def inertia(self, A: Array) -> Array:
        """Convert a symmetric form on twists, such as 𝓜, from the body's frame to the parent's: Ad⁻ᵀ A Ad⁻¹."""
        for X in (self.joint, self.pose):
            A = symmetric(transpose(X) @ (A @ X))
        return A


@final
@dataclass(frozen=True, eq=False)
class Linkage:
    """The N moving bodies, parents first.

    Attributes:
        bodies: Bodies with their joints.
        links: By name: the body of a link, its placement in that body's frame, its 𝓜 in that frame (6, 6).
        couplings: Map q_full = S q + s₀ from the n coordinates to the N joints.
        gravity: Acceleration of free fall, (3,) in [m/s²].
        armature: Armature of the N joints, (N,).
        order: Indices of the bodies in the order of the inertial parameters.
        joint_names: Names of the n coordinates.
    """

    bodies: tuple[Body, ...]
    links: dict[str, tuple[int, Pose, Array]]
    couplings: Couplings
    gravity: Array
    armature: Array
    order: tuple[int, ...]
    joint_names: tuple[str, ...]

    @cached_property
    def inertias(self) -> tuple[Array, ...]:
        """Spatial inertia 𝓜 of each body in its frame, (6, 6)."""
        total = [np.zeros((6, 6), dtype=self.gravity.dtype) for _ in self.bodies]
        for body, _, inertia in self.links.values():
            if body != BASE:
                total[body] = total[body] + inertia
        return tuple(total)

    def steps(self, q: Array) -> list[Step]:
        """Return the change of frame from each body's parent at coordinates q (..., n)."""
        q = self.couplings.position(q)
        return [body.step(q[..., i]) for i, body in enumerate(self.bodies)]

    def at(self, q: Array) -> Configuration:
        """Return the configuration at coordinates q (..., n)."""
        return self._at(q, range(len(self.bodies)))

    def at_link(self, q: Array, link: str) -> Configuration:
        """Return the configuration of the bodies that carry a link, at coordinates q (..., n)."""
        body, *_ = self.links[link]
        return self._at(q, () if body == BASE else self.bodies[body].path)

    def _at(self, q: Array, indices: Iterable[int]) -> Configuration:
        q = self.couplings.position(q)
        return Configuration(self, q.shape[:-1], {i: self.bodies[i].placement(q[..., i]) for i in indices})


@final
@dataclass(frozen=True, eq=False)
class Configuration:
    """The linkage, or some of its bodies, at one configuration or a batch.

    Attributes:
        linkage: Linkage of the bodies.
        batch: Shape of the batch axes.
        in_parent: (R, p) of each body in its parent's frame, by index; parents first.
    """

    linkage: Linkage
    batch: tuple[int, ...]
    in_parent: dict[int, tuple[Array, Array]]

    @cached_property
    def in_base(self) -> dict[int, tuple[Array, Array]]:
        """(R, p) of each body in the base frame, by index."""
        result: dict[int, tuple[Array, Array]] = {}
        for i, (R, p) in self.in_parent.items():
            parent = self.linkage.bodies[i].parent
            if parent != BASE:
                R0, p0 = result[parent]
                R, p = R0 @ R, apply(R0, p) + p0
            result[i] = R, p
        return result

    @cached_property
    def jacobians(self) -> dict[int, Array]:
        """Body Jacobian of each body, (..., 6, len(path)), with the columns of the joints on its path.

        Jᵢ = [Ad⁻¹ J_parent, ξᵢ].  [Murray, Li, Sastry 1994, eq. 3.56]
        """
        J: dict[int, Array] = {}
        for i, (R, p) in self.in_parent.items():
            body = self.linkage.bodies[i]
            J[i] = np.broadcast_to(body.screw[:, None], (*self.batch, 6, 1))
            if body.parent != BASE:
                J[i] = np.concatenate([adjoint_inverse(R, p) @ J[body.parent], J[i]], axis=-1)
        return J


def linkage_of(tree: Tree, joint_names: tuple[str, ...], arithmetic: Arithmetic) -> Linkage:
    """Convert a tree to numbers, with coordinates in the order of `joint_names`; call it in the arithmetic's scope."""
    mimics = {joint.name: joint.mimic for joint in tree.joints if joint.mimic and joint.kind != "fixed"}
    locked = {joint.name: arithmetic.number(joint.locked) for joint in tree.joints if joint.locked is not None}
    sources = {joint.name: resolve(joint.name, mimics, arithmetic) for joint in tree.joints}
    identity = Pose(np.eye(3, dtype=arithmetic.dtype), np.zeros(3, dtype=arithmetic.dtype))
    placements: dict[str, tuple[int, Pose]] = {tree.root: (BASE, identity)}
    bodies: list[Body] = []
    for joint in tree.joints:
        parent, pose = placements[joint.parent]
        pose = pose @ Pose(rotation_rpy(arithmetic.array(joint.rpy)), arithmetic.array(joint.xyz))
        if joint.kind != "fixed":
            path = bodies[parent].path if parent != BASE else ()
            body = Body(
                joint.name, parent, pose, _unit(joint, arithmetic), joint.kind != "prismatic", (*path, len(bodies))
            )
            source, ratio, offset = sources[joint.name]
            if source in locked:
                pose = Pose(*body.placement(np.asarray(ratio * locked[source] + offset, dtype=arithmetic.dtype)))
            else:
                bodies.append(body)
                parent, pose = len(bodies) - 1, identity
        placements[joint.child] = parent, pose
    links = {
        link.name: (*placements[link.name], _inertia(link, placements[link.name][1], arithmetic)) for link in tree.links
    }
    armature = {joint.name: joint.armature for joint in tree.joints}
    carriers = [body.joint for body in bodies]
    return Linkage(
        tuple(bodies),
        links,
        _couplings(bodies, sources, joint_names, arithmetic),
        arithmetic.array(tree.gravity),
        arithmetic.array([armature[name] for name in carriers]),
        tuple(map(carriers.index, ordered(joint_names, carriers))),
        joint_names,
    )


def _unit(joint: Joint, arithmetic: Arithmetic) -> Array:
    axis = arithmetic.array(joint.axis)
    return axis / sqrt((axis * axis).sum())


def _inertia(link: Link, pose: Pose, arithmetic: Arithmetic) -> Array:
    """Return 𝓜 of a link in its body's frame: the sum of 𝓜_b = Ad⁻ᵀ 𝓜_c Ad⁻¹ of its parts."""
    total = np.zeros((6, 6), dtype=arithmetic.dtype)
    for part in link.inertials:
        at = pose @ Pose(rotation_rpy(arithmetic.array(part.rpy)), arithmetic.array(part.xyz))
        Ixx, Ixy, Ixz, Iyy, Iyz, Izz = arithmetic.array(part.moments)
        about_com = np.array([[Ixx, Ixy, Ixz], [Ixy, Iyy, Iyz], [Ixz, Iyz, Izz]], dtype=arithmetic.dtype)
        part_inertia = spatial_inertia(arithmetic.number(part.mass), at.p, at.R @ about_com @ at.R.T)
        total = total + arithmetic.number(part.scale) * part_inertia
    return total


def _couplings(
    bodies: list[Body], sources: dict[str, Any], joint_names: tuple[str, ...], arithmetic: Arithmetic
) -> Couplings:
    S = np.zeros((len(bodies), len(joint_names)), dtype=arithmetic.dtype)
    s0 = np.zeros(len(bodies), dtype=arithmetic.dtype)
    for row, body in enumerate(bodies):
        source, ratio, s0[row] = sources[body.joint]
        S[row, joint_names.index(source)] = ratio
    return Couplings(S, s0)
