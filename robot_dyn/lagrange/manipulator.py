"""Lagrangian of a manipulator: M(q) a + C(q, v) v + N(q) = τ from L = K − V, in closed form and any arithmetic.

    M = Σ Jᵢᵀ 𝓜ᵢ Jᵢ,   C_ij = Σ_k ½ (∂M_ij/∂q_k + ∂M_ik/∂q_j − ∂M_kj/∂q_i) v_k,   N = ∂V/∂q,   V = −Σ mᵢ gᵀ pᵢ

Columns of a body Jacobian obey ∂J_j/∂q_k = [J_j, J_k] for joint j before joint k and 0 otherwise: ∂M/∂q is exact.
[Murray, Li, Sastry 1994, ch. 4 §2–3]
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, final

import numpy as np

from robot_dyn.arithmetic import (
    Arithmetic,
    Array,
    apply,
    arithmetic_of,
    in_arithmetic,
    transpose,
)
from robot_dyn.errors import QueryError
from robot_dyn.lagrange.linkage import BASE, Configuration, Linkage, linkage
from robot_dyn.model.description import Description
from robot_dyn.model.dynamics import Axes, acceleration, check_batches, checked, entry
from robot_dyn.model.tree import Described, tree
from robot_dyn.spatial import adjoint, adjoint_inverse, block_diagonal, bracket, first_moment, hat, homogeneous


@final
@dataclass(frozen=True)
class Lagrangian:
    """The own road to a robot's dynamics; shares neither parser nor algorithm with Pinocchio.

    Attributes:
        robot: The robot; its file, edits and order of joints are used, none of its numbers.
        dtype: float32, float64, np.longdouble, or `Ball(bits)` for results with a proven radius.
    """

    robot: Described
    dtype: Any = np.float64

    def __post_init__(self) -> None:
        if not isinstance(getattr(self.robot, "description", None), Description):
            raise QueryError(f"robot: give a Robot, such as rd.load('ur5'), got {self.robot!r}")
        _ = self.linkage

    def __reduce__(self) -> tuple[Any, ...]:
        return Lagrangian, (self.robot, self.dtype)

    @cached_property
    def arithmetic(self) -> Arithmetic:
        """The numbers it runs in."""
        return arithmetic_of(self.dtype)

    @cached_property
    @in_arithmetic
    def linkage(self) -> Linkage:
        """The tree in these numbers."""
        return linkage(tree(self.robot.description, self.robot.edits), self.joint_names, self.arithmetic)

    @cached_property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the n joints, in the order of q."""
        return self.robot.joint_names

    @property
    def n(self) -> int:
        """Number of degrees of freedom."""
        return len(self.joint_names)

    @in_arithmetic
    def M(self, q: Array) -> Array:
        (q,) = self._numbers(q=q)
        return self._M(self.linkage.at(q))

    @in_arithmetic
    def C(self, q: Array, v: Array) -> Array:
        q, v = self._numbers(q=q, v=v)
        return self._C(self.linkage.at(q), v)

    @in_arithmetic
    def N(self, q: Array) -> Array:
        (q,) = self._numbers(q=q)
        return self._N(self.linkage.at(q))

    @in_arithmetic
    def mass_matrix_derivative(self, q: Array) -> Array:
        """∂M_ij/∂q_k at index [..., i, j, k], exact; shape (..., n, n, n)."""
        (q,) = self._numbers(q=q)
        at = self.linkage.at(q)
        total = self._zeros(at, 3)
        for body, inertia, J in at.bodies():
            block = (..., *np.ix_(body.path, body.path, body.path))
            total[block] = total[block] + inertia_derivative(J, inertia)
        return self.linkage.ties.cube(total)

    @in_arithmetic
    def coriolis_torque(self, q: Array, v: Array) -> Array:
        q, v = self._numbers(q=q, v=v)
        return apply(self._C(self.linkage.at(q), v), v)

    @in_arithmetic
    def coriolis_transpose(self, q: Array, v: Array) -> Array:
        q, v = self._numbers(q=q, v=v)
        return apply(transpose(self._C(self.linkage.at(q), v)), v)

    @in_arithmetic
    def inverse_dynamics(self, q: Array, v: Array, a: Array) -> Array:
        q, v, a = self._numbers(q=q, v=v, a=a)
        at = self.linkage.at(q)
        return apply(self._M(at), a) + apply(self._C(at, v), v) + self._N(at)

    @in_arithmetic
    def forward_dynamics(self, q: Array, v: Array, tau: Array) -> Array:
        q, v, tau = self._numbers(q=q, v=v, tau=tau)
        at = self.linkage.at(q)
        rest = tau - apply(self._C(at, v), v) - self._N(at)
        return acceleration(self._M(at), rest, self.joint_names)

    @in_arithmetic
    def kinetic_energy(self, q: Array, v: Array) -> Array:
        q, v = self._numbers(q=q, v=v)
        return (v * apply(self._M(self.linkage.at(q)), v)).sum(axis=-1) / 2

    @in_arithmetic
    def potential_energy(self, q: Array) -> Array:
        (q,) = self._numbers(q=q)
        at, g = self.linkage.at(q), self.linkage.gravity
        V = 0
        for inertia, (R, p) in zip(self.linkage.inertias, at.in_base, strict=True):
            V = V - (inertia[0, 0] * p + R @ first_moment(inertia)) @ g
        return V

    @in_arithmetic
    def momentum(self, q: Array, v: Array) -> Array:
        q, v = self._numbers(q=q, v=v)
        return apply(self._M(self.linkage.at(q)), v)

    @in_arithmetic
    def placement(self, q: Array, frame: str) -> Array:
        (q,) = self._numbers(q=q)
        return homogeneous(*self._placement(self.linkage.at(q), frame))

    @in_arithmetic
    def jacobian(self, q: Array, frame: str, *, expressed_in: str = Axes.WORLD_ALIGNED) -> Array:
        (q,) = self._numbers(q=q)
        at = self.linkage.at(q)
        return self.linkage.ties.columns(self._change(at, frame, expressed_in) @ self._body_jacobian(at, frame))

    @in_arithmetic
    def jacobian_rate(self, q: Array, v: Array, frame: str, *, expressed_in: str = Axes.WORLD_ALIGNED) -> Array:
        q, v = self._numbers(q=q, v=v)
        at, v = self.linkage.at(q), self.linkage.ties.velocity(v)
        J, rate = self._body_jacobian(at, frame), self._body_jacobian(at, frame, v)
        V = apply(J, v)
        if expressed_in == Axes.WORLD_ALIGNED:  # d/dt diag(R, R) = diag(R, R) diag(ω̂, ω̂)
            rate = rate + block_diagonal(hat(V[..., 3:])) @ J
        elif expressed_in == Axes.WORLD:  # d/dt Ad_g = Ad_g ad_V
            rate = rate + bracket(V) @ J
        return self.linkage.ties.columns(self._change(at, frame, expressed_in) @ rate)

    # --- the equations, at a configuration

    def _M(self, at: Configuration) -> Array:
        M = self._zeros(at, 2) + np.diag(self.linkage.armature)
        for body, inertia, J in at.bodies():
            M[body.block] = M[body.block] + transpose(J) @ inertia @ J
        return self.linkage.ties.matrix(M)

    def _C(self, at: Configuration, v: Array) -> Array:
        v = self.linkage.ties.velocity(v)
        C = self._zeros(at, 2)
        C = np.broadcast_to(C, np.broadcast_shapes(C.shape, (*v.shape[:-1], 1, 1))).copy()
        for body, inertia, J in at.bodies():
            C[body.block] = C[body.block] + christoffel(inertia_derivative(J, inertia), v[..., body.path])
        return self.linkage.ties.matrix(C)

    def _N(self, at: Configuration) -> Array:
        N = self._zeros(at, 1)
        for (body, inertia, J), (R, _) in zip(at.bodies(), at.in_base, strict=True):
            weight = (self.linkage.gravity @ R) @ transpose(inertia[:, :3])  # 𝓜 (Rᵀ g, 0)
            N[..., body.path] = N[..., body.path] - apply(transpose(J), weight)
        return self.linkage.ties.torque(N)

    # --- frames

    def _placement(self, at: Configuration, frame: str) -> tuple[Array, Array]:
        body, pose, _ = entry(self.linkage.links, frame)
        if body == BASE:
            return np.broadcast_to(pose.R, (*at.batch, 3, 3)), np.broadcast_to(pose.p, (*at.batch, 3))
        R, p = at.in_base[body]
        return R @ pose.R, R @ pose.p + p

    def _body_jacobian(self, at: Configuration, frame: str, v: Array | None = None) -> Array:
        """Body Jacobian of a frame over all N joints, or its rate along the full velocity v."""
        body, pose, _ = entry(self.linkage.links, frame)
        J = self._zeros(at, 1)[..., None, :] + np.zeros((6, 1), dtype=self.arithmetic.dtype)
        if body == BASE:
            return J
        path, columns = self.linkage.bodies[body].path, at.jacobians[body]
        if v is not None:
            columns = apply(jacobian_derivative(columns), v[..., None, path])
            J = np.broadcast_to(J, (*columns.shape[:-1], J.shape[-1])).copy()
        J[..., path] = adjoint_inverse(pose.R, pose.p) @ columns
        return J

    def _change(self, at: Configuration, frame: str, expressed_in: str) -> Array:
        """Matrix that takes a body twist to the axes asked for."""
        R, p = self._placement(at, frame)
        axes = Axes.of(expressed_in)
        if axes is Axes.WORLD:
            return adjoint(R, p)
        return block_diagonal(R) if axes is Axes.WORLD_ALIGNED else np.eye(6, dtype=R.dtype)

    # --- arguments

    def _numbers(self, **arguments: Array) -> list[Array]:
        arrays = {name: checked(name, x, self.joint_names, self.arithmetic) for name, x in arguments.items()}
        check_batches(**arrays)
        return list(arrays.values())

    def _zeros(self, at: Configuration, axes: int) -> Array:
        return np.zeros((*at.batch, *(len(self.linkage.bodies),) * axes), dtype=self.arithmetic.dtype)


def jacobian_derivative(J: Array) -> Array:
    """∂J_j/∂q_k = [J_j, J_k] for j < k, else 0, at index [..., :, j, k]; from columns J (..., 6, p) of one path."""
    p = J.shape[-1]
    brackets = bracket(transpose(J)) @ J[..., None, :, :]  # at index [..., j, :, k]
    return np.swapaxes(brackets, -3, -2) * np.triu(np.ones((p, p), dtype=J.dtype), 1)


def inertia_derivative(J: Array, inertia: Array) -> Array:
    """∂(Jᵀ 𝓜 J)_ij/∂q_k at index [..., i, j, k], shape (..., p, p, p)."""
    dJ = np.moveaxis(jacobian_derivative(J), -3, -1)  # [..., i, k, :]
    half = np.swapaxes(dJ @ (inertia @ J)[..., None, :, :], -1, -2)  # ∂J_iᵀ/∂q_k 𝓜 J_j at [..., i, j, k]
    return half + np.swapaxes(half, -3, -2)


def christoffel(dM: Array, v: Array) -> Array:
    """C_ij = Σ_k ½ (∂M_ij/∂q_k + ∂M_ik/∂q_j − ∂M_kj/∂q_i) v_k, from ∂M (..., n, n, n) and v (..., n)."""
    v = v[..., None, :, None]
    rate = (dM @ v)[..., 0]  # Ṁ
    W = (transpose(dM) @ v)[..., 0]  # W_ij = Σ_k ∂M_ik/∂q_j v_k, and its transpose is the last term
    return (rate + W - transpose(W)) / 2
