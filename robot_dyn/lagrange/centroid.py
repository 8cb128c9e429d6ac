"""Centre of mass of the moving bodies, and momentum about it, from 𝓜 J of each body, in base axes.

c = Σ (m p + R m c_b) / Σ m,   ∂c/∂q = Σ R (𝓜 J)_linear / Σ m,   h_G = A_G v   [Orin, Goswami, Lee 2013]
"""

from __future__ import annotations

from collections.abc import Callable
from functools import reduce
from operator import add

import numpy as np

from robot_dyn.foundations.arithmetic import Array, apply
from robot_dyn.foundations.spatial import block_diagonal, first_moment, hat
from robot_dyn.lagrange.christoffel import jacobian_derivative
from robot_dyn.lagrange.linkage import Configuration
from robot_dyn.lagrange.summand import Summand, summands_of_bodies


def centre_of_mass(at: Configuration) -> Array:
    """Return the centre of mass c, (..., 3)."""
    placed = zip(at.linkage.inertias, at.in_base.values(), strict=True)
    return sum(inertia[0, 0] * p + apply(R, first_moment(inertia)) for inertia, (R, p) in placed) / _mass(at)


def centre_of_mass_jacobian(at: Configuration) -> Array:
    """Return ∂c/∂q, (..., 3, n)."""
    return _columns(at, 3, lambda body, _: body.R @ body.inertia[:3] @ body.J, at.batch) / _mass(at)


def centre_of_mass_jacobian_rate(at: Configuration, v: Array) -> Array:
    """Return d/dt ∂c/∂q, (..., 3, n): d/dt R f = R (ω × f + df/dt)."""
    v = at.linkage.couplings.velocity(v)

    def terms(body: Summand, _: Array) -> Array:
        rates, linear = v[..., body.path], body.inertia[:3]
        turning = hat(apply(body.J, rates)[..., 3:])
        return body.R @ (turning @ (linear @ body.J) + linear @ apply(jacobian_derivative(body.J), rates[..., None, :]))

    return _columns(at, 3, terms, np.broadcast_shapes(at.batch, v.shape[:-1])) / _mass(at)


def centroidal_momentum_matrix(at: Configuration) -> Array:
    """Return A_G, (..., 6, n): momentum of each body about its origin p, moved to the centre of mass c."""
    c = centre_of_mass(at)

    def terms(body: Summand, p: Array) -> Array:
        momentum = block_diagonal(body.R) @ body.inertia @ body.J
        linear, angular = momentum[..., :3, :], momentum[..., 3:, :]
        return np.concatenate([linear, angular + hat(p - c) @ linear], axis=-2)

    return _columns(at, 6, terms, at.batch)


def _columns(at: Configuration, rows: int, terms: Callable[[Summand, Array], Array], batch: tuple[int, ...]) -> Array:
    """Return the sum over bodies of terms (..., rows, p) in the columns of their paths, (..., rows, n)."""
    total = np.zeros((*batch, rows, len(at.linkage.bodies)), dtype=at.linkage.gravity.dtype)
    for body, (_, p) in zip(summands_of_bodies(at), at.in_base.values(), strict=True):
        total[..., body.path] = total[..., body.path] + terms(body, p)
    return at.linkage.couplings.columns(total)


def _mass(at: Configuration) -> Array:
    return reduce(add, (inertia[0, 0] for inertia in at.linkage.inertias))
