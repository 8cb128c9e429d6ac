"""Closed formulas by the names of the queries: functions of a configuration, the rates, and a frame and its axes.

    M = Σ Jᵢᵀ 𝓜ᵢ Jᵢ,   C_ij = Σ_k ½ (∂M_ij/∂q_k + ∂M_ik/∂q_j − ∂M_kj/∂q_i) v_k,   N = ∂V/∂q,   V = −Σ mᵢ gᵀ pᵢ

Columns of a body Jacobian obey ∂J_j/∂q_k = [J_j, J_k] for joint j before joint k and 0 otherwise: ∂M/∂q is exact.
Every formula takes one state or a batch, in any arithmetic. [Murray, Li, Sastry 1994, ch. 4 §2–3]
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from robot_dyn.foundations.arithmetic import Array, Scalar, apply, transpose
from robot_dyn.foundations.spatial import (
    adjoint,
    adjoint_inverse,
    block_diagonal,
    bracket,
    first_moment,
    hat,
    homogeneous,
)
from robot_dyn.lagrange.centroid import (
    centre_of_mass,
    centre_of_mass_jacobian,
    centre_of_mass_jacobian_rate,
    centroidal_momentum_matrix,
)
from robot_dyn.lagrange.christoffel import jacobian_derivative
from robot_dyn.lagrange.inverse_dynamics_derivatives import position_derivative
from robot_dyn.lagrange.linkage import BASE, Configuration
from robot_dyn.lagrange.summand import (
    coriolis_matrix,
    gravity_torque,
    mass_matrix,
    regressor,
    summands_of_bodies,
)
from robot_dyn.queries.dynamics import Axes, acceleration


def _M(at: Configuration) -> Array:
    return mass_matrix(at, summands_of_bodies(at), at.linkage.armature)


def _C(at: Configuration, v: Array) -> Array:
    return coriolis_matrix(at, summands_of_bodies(at), v)


def _N(at: Configuration) -> Array:
    return gravity_torque(at, summands_of_bodies(at))


def _inverse_dynamics(at: Configuration, v: Array, a: Array) -> Array:
    return apply(_M(at), a) + apply(_C(at, v), v) + _N(at)


def _forward_dynamics(at: Configuration, v: Array, tau: Array) -> Array:
    return acceleration(_M(at), tau - apply(_C(at, v), v) - _N(at), at.linkage.joint_names)


def _inverse_dynamics_derivatives(at: Configuration, v: Array, a: Array) -> Array:
    return np.stack(np.broadcast_arrays(position_derivative(at, v, a), 2 * _C(at, v), _M(at)), axis=-3)


def _kinetic_energy(at: Configuration, v: Array) -> Array:
    return (v * apply(_M(at), v)).sum(axis=-1) / 2


def _potential_energy(at: Configuration) -> Scalar:
    V, g = 0, at.linkage.gravity
    for inertia, (R, p) in zip(at.linkage.inertias, at.in_base.values(), strict=True):
        V = V - (inertia[0, 0] * p + R @ first_moment(inertia)) @ g
    return V


def _jacobian(at: Configuration, link: str, axes: Axes) -> Array:
    return at.linkage.couplings.columns(_change(at, link, axes) @ _body_jacobian(at, link))


def _jacobian_rate(at: Configuration, v: Array, link: str, axes: Axes) -> Array:
    v = at.linkage.couplings.velocity(v)
    J, rate = _body_jacobian(at, link), _body_jacobian(at, link, v)
    V = apply(J, v)
    if axes is Axes.WORLD_ALIGNED:  # d/dt diag(R, R) = diag(R, R) diag(ω̂, ω̂)
        rate = rate + block_diagonal(hat(V[..., 3:])) @ J
    elif axes is Axes.WORLD:  # d/dt Ad_g = Ad_g ad_V
        rate = rate + bracket(V) @ J
    return at.linkage.couplings.columns(_change(at, link, axes) @ rate)


def _placement(at: Configuration, link: str) -> tuple[Array, Array]:
    body, pose, _ = at.linkage.links[link]
    if body == BASE:
        return np.broadcast_to(pose.R, (*at.batch, 3, 3)), np.broadcast_to(pose.p, (*at.batch, 3))
    R, p = at.in_base[body]
    return R @ pose.R, R @ pose.p + p


def _body_jacobian(at: Configuration, link: str, v: Array | None = None) -> Array:
    """Return the body Jacobian of a link over all N joints, or its rate along the full velocity v."""
    body, pose, _ = at.linkage.links[link]
    J = np.zeros((*at.batch, 6, len(at.linkage.bodies)), dtype=at.linkage.gravity.dtype)
    if body == BASE:
        return J
    path, columns = at.linkage.bodies[body].path, at.jacobians[body]
    if v is not None:
        columns = apply(jacobian_derivative(columns), v[..., None, path])
        J = np.broadcast_to(J, (*columns.shape[:-1], J.shape[-1])).copy()
    J[..., path] = adjoint_inverse(pose.R, pose.p) @ columns
    return J


def _change(at: Configuration, link: str, axes: Axes) -> Array:
    """Return the matrix that transforms a body twist to the requested axes."""
    R, p = _placement(at, link)
    if axes is Axes.WORLD:
        return adjoint(R, p)
    return block_diagonal(R) if axes is Axes.WORLD_ALIGNED else np.eye(6, dtype=R.dtype)


FORMULAS: dict[str, Callable[..., Scalar]] = {
    "M": _M,
    "C": _C,
    "N": _N,
    "coriolis_torque": lambda at, v: apply(_C(at, v), v),
    "coriolis_transpose": lambda at, v: apply(transpose(_C(at, v)), v),
    "inverse_dynamics": _inverse_dynamics,
    "forward_dynamics": _forward_dynamics,
    "kinetic_energy": _kinetic_energy,
    "potential_energy": _potential_energy,
    "momentum": lambda at, v: apply(_M(at), v),
    "inverse_dynamics_derivatives": _inverse_dynamics_derivatives,
    "centre_of_mass": centre_of_mass,
    "centre_of_mass_jacobian": centre_of_mass_jacobian,
    "centre_of_mass_jacobian_rate": centre_of_mass_jacobian_rate,
    "centroidal_momentum_matrix": centroidal_momentum_matrix,
    "regressor": regressor,
    "placement": lambda at, link: homogeneous(*_placement(at, link)),
    "jacobian": _jacobian,
    "jacobian_rate": _jacobian_rate,
}
