"""Lagrangian of a manipulator: M(q) a + C(q, v) v + N(q) = τ from L = K − V, in closed form and any arithmetic.

    M = Σ Jᵢᵀ 𝓜ᵢ Jᵢ,   C_ij = Σ_k ½ (∂M_ij/∂q_k + ∂M_ik/∂q_j − ∂M_kj/∂q_i) v_k,   N = ∂V/∂q,   V = −Σ mᵢ gᵀ pᵢ

Columns of a body Jacobian obey ∂J_j/∂q_k = [J_j, J_k] for joint j before joint k and 0 otherwise: ∂M/∂q is exact.
[Murray, Li, Sastry 1994, ch. 4 §2–3]
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, final

import numpy as np

from robot_dyn.description.description import Description
from robot_dyn.description.inertial_parameters import NAMES as PARAMETERS
from robot_dyn.description.inertial_parameters import Parametrised, parameters
from robot_dyn.foundations.arithmetic import (
    Arithmetic,
    Array,
    apply,
    arithmetic_of,
    in_arithmetic,
    transpose,
)
from robot_dyn.foundations.errors import QueryError, shown
from robot_dyn.foundations.spatial import (
    adjoint,
    adjoint_inverse,
    block_diagonal,
    bracket,
    first_moment,
    hat,
    homogeneous,
)
from robot_dyn.foundations.validate import shaped
from robot_dyn.lagrange.christoffel import jacobian_derivative
from robot_dyn.lagrange.linkage import BASE, Configuration, Linkage, linkage_of
from robot_dyn.lagrange.summand import (
    coriolis_matrix,
    gravity_torque,
    mass_matrix,
    mass_matrix_derivative,
    of_bodies,
    regressor,
)
from robot_dyn.lagrange.tree import Described, tree_of
from robot_dyn.queries.batch import answered
from robot_dyn.queries.dynamics import Axes, Dynamics, acceleration, entry
from robot_dyn.queries.quantity import ALL


@final
@dataclass(frozen=True)
class Lagrangian(Dynamics, Parametrised):
    """The dynamics of a robot by the Lagrangian, independent of Pinocchio after the checks of the file.

    Attributes:
        robot: The robot; its file, edits and order of joints are used, none of its numbers.
        dtype: float32, float64, np.longdouble, or `Ball(bits)` for results with a proven radius.
    """

    robot: Described
    dtype: Any = np.float64

    def __post_init__(self) -> None:
        if not isinstance(getattr(self.robot, "description", None), Description):
            raise QueryError(f"robot: give a Robot, such as rd.load('ur5'), got {shown(self.robot)}")
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
        return linkage_of(tree_of(self.robot.description, self.robot.edits), self.joint_names, self.arithmetic)

    @cached_property
    def joint_names(self) -> tuple[str, ...]:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Names of the n joints, in the order of q."""
        return self.robot.joint_names

    @property
    def n(self) -> int:
        """Number of degrees of freedom."""
        return len(self.joint_names)

    @property
    def sizes(self) -> dict[str, int]:
        """The numbers that letters in the shapes of quantities stand for."""
        return {"n": self.n, "p": len(PARAMETERS) * len(self.linkage.bodies)}

    def M(self, q: Array, *, errors: str = "raise") -> Array:
        return self._answer("M", errors, self._M, q)

    def C(self, q: Array, v: Array, *, errors: str = "raise") -> Array:
        return self._answer("C", errors, self._C, q, v)

    def N(self, q: Array, *, errors: str = "raise") -> Array:
        return self._answer("N", errors, self._N, q)

    def mass_matrix_derivative(self, q: Array, *, errors: str = "raise") -> Array:
        """∂M_ij/∂q_k at index [..., i, j, k], exact; shape (..., n, n, n)."""
        return self._answer("mass_matrix_derivative", errors, lambda at: mass_matrix_derivative(at, of_bodies(at)), q)

    def coriolis_torque(self, q: Array, v: Array, *, errors: str = "raise") -> Array:
        return self._answer("coriolis_torque", errors, lambda at, v: apply(self._C(at, v), v), q, v)

    def coriolis_transpose(self, q: Array, v: Array, *, errors: str = "raise") -> Array:
        return self._answer("coriolis_transpose", errors, lambda at, v: apply(transpose(self._C(at, v)), v), q, v)

    def inverse_dynamics(self, q: Array, v: Array, a: Array, *, errors: str = "raise") -> Array:
        def equation(at: Configuration, v: Array, a: Array) -> Array:
            return apply(self._M(at), a) + apply(self._C(at, v), v) + self._N(at)

        return self._answer("inverse_dynamics", errors, equation, q, v, a)

    def forward_dynamics(self, q: Array, v: Array, tau: Array, *, errors: str = "raise") -> Array:
        def equation(at: Configuration, v: Array, tau: Array) -> Array:
            remaining = tau - apply(self._C(at, v), v) - self._N(at)
            return acceleration(self._M(at), remaining, self.joint_names)

        return self._answer("forward_dynamics", errors, equation, q, v, tau)

    def kinetic_energy(self, q: Array, v: Array, *, errors: str = "raise") -> Array:
        def equation(at: Configuration, v: Array) -> Array:
            return (v * apply(self._M(at), v)).sum(axis=-1) / 2

        return self._answer("kinetic_energy", errors, equation, q, v)

    def potential_energy(self, q: Array, *, errors: str = "raise") -> Array:
        return self._answer("potential_energy", errors, self._V, q)

    def momentum(self, q: Array, v: Array, *, errors: str = "raise") -> Array:
        return self._answer("momentum", errors, lambda at, v: apply(self._M(at), v), q, v)

    @property
    def body_names(self) -> tuple[str, ...]:  # pyright: ignore[reportIncompatibleMethodOverride]
        return tuple(self.linkage.bodies[i].joint for i in self.linkage.order)

    @property
    @in_arithmetic
    def inertial_parameters(self) -> Array:  # pyright: ignore[reportIncompatibleMethodOverride]
        return np.concatenate([parameters(self.linkage.inertias[i]) for i in self.linkage.order])

    def regressor(self, q: Array, v: Array, a: Array, *, errors: str = "raise") -> Array:
        return self._answer("regressor", errors, regressor, q, v, a)

    def placement(self, q: Array, frame: str, *, errors: str = "raise") -> Array:
        frame = self._link(frame)
        return self._answer("placement", errors, lambda at: homogeneous(*self._placement(at, frame)), q, link=frame)

    def jacobian(self, q: Array, frame: str, *, expressed_in: str = Axes.WORLD_ALIGNED, errors: str = "raise") -> Array:
        frame, axes = self._link(frame), Axes.of(expressed_in)

        def equation(at: Configuration) -> Array:
            return self.linkage.couplings.columns(self._change(at, frame, axes) @ self._body_jacobian(at, frame))

        return self._answer("jacobian", errors, equation, q, link=frame)

    def jacobian_rate(
        self, q: Array, v: Array, frame: str, *, expressed_in: str = Axes.WORLD_ALIGNED, errors: str = "raise"
    ) -> Array:
        frame, axes = self._link(frame), Axes.of(expressed_in)

        def equation(at: Configuration, v: Array) -> Array:
            v = self.linkage.couplings.velocity(v)
            J, rate = self._body_jacobian(at, frame), self._body_jacobian(at, frame, v)
            V = apply(J, v)
            if axes is Axes.WORLD_ALIGNED:  # d/dt diag(R, R) = diag(R, R) diag(ω̂, ω̂)
                rate = rate + block_diagonal(hat(V[..., 3:])) @ J
            elif axes is Axes.WORLD:  # d/dt Ad_g = Ad_g ad_V
                rate = rate + bracket(V) @ J
            return self.linkage.couplings.columns(self._change(at, frame, axes) @ rate)

        return self._answer("jacobian_rate", errors, equation, q, v, link=frame)

    # --- the equations, at a configuration

    def _M(self, at: Configuration) -> Array:
        return mass_matrix(at, of_bodies(at), self.linkage.armature)

    def _C(self, at: Configuration, v: Array) -> Array:
        return coriolis_matrix(at, of_bodies(at), v)

    def _N(self, at: Configuration) -> Array:
        return gravity_torque(at, of_bodies(at))

    def _V(self, at: Configuration) -> Array:
        V, g = 0, self.linkage.gravity
        for inertia, (R, p) in zip(self.linkage.inertias, at.in_base.values(), strict=True):
            V = V - (inertia[0, 0] * p + R @ first_moment(inertia)) @ g
        return V

    # --- frames

    def _link(self, frame: str) -> str:
        """The link of a frame, which may be called by its joint; raises QueryError if there is no such frame."""
        joints = self.robot.description.joint_frames
        entry(self.linkage.links | joints, frame)
        return joints.get(frame, frame)

    def _placement(self, at: Configuration, frame: str) -> tuple[Array, Array]:
        body, pose, _ = self.linkage.links[frame]
        if body == BASE:
            return np.broadcast_to(pose.R, (*at.batch, 3, 3)), np.broadcast_to(pose.p, (*at.batch, 3))
        R, p = at.in_base[body]
        return R @ pose.R, R @ pose.p + p

    def _body_jacobian(self, at: Configuration, frame: str, v: Array | None = None) -> Array:
        """Body Jacobian of a frame over all N joints, or its rate along the full velocity v."""
        body, pose, _ = self.linkage.links[frame]
        J = np.zeros((*at.batch, 6, len(self.linkage.bodies)), dtype=self.arithmetic.dtype)
        if body == BASE:
            return J
        path, columns = self.linkage.bodies[body].path, at.jacobians[body]
        if v is not None:
            columns = apply(jacobian_derivative(columns), v[..., None, path])
            J = np.broadcast_to(J, (*columns.shape[:-1], J.shape[-1])).copy()
        J[..., path] = adjoint_inverse(pose.R, pose.p) @ columns
        return J

    def _change(self, at: Configuration, frame: str, axes: Axes) -> Array:
        """Matrix that takes a body twist to the requested axes."""
        R, p = self._placement(at, frame)
        if axes is Axes.WORLD:
            return adjoint(R, p)
        return block_diagonal(R) if axes is Axes.WORLD_ALIGNED else np.eye(6, dtype=R.dtype)

    # --- arguments

    @in_arithmetic
    def _answer(
        self, quantity: str, errors: str, equation: Callable[..., Array], *state: Array, link: str | None = None
    ) -> Array:
        """The answer of an equation (at, …) of the configuration, or of the bodies that carry a link, and the rates."""

        def at_configuration(q: Array, *rates: Array) -> Array:
            return equation(self.linkage.at(q) if link is None else self.linkage.at_link(q, link), *rates)

        requested = ALL[quantity]
        arrays = {
            name: shaped(name, x, self.joint_names, self.arithmetic)
            for name, x in zip(requested.arguments, state, strict=True)
        }
        shape = requested.shape(self.sizes)
        return answered(at_configuration, arrays, shape, self.joint_names, errors, self.arithmetic)
