"""Summands of M, ∂M/∂q, C and N: what one rigid body adds to them, in the entries of the joints that carry it.

    M = Σ Jᵀ 𝓜 J,   ∂M/∂q = Σ ∂(Jᵀ 𝓜 J)/∂q,   C of their Christoffel symbols,   N = −Σ Jᵀ 𝓜 (Rᵀ g, 0)

All four are linear in 𝓜: the summand of a body of several links is the sum of theirs.
[Murray, Li, Sastry 1994, ch. 4 §2–3]
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from typing import final

import numpy as np

from robot_dyn.description.inertial_parameters import unit_inertias
from robot_dyn.foundations.arithmetic import Array, apply, transpose
from robot_dyn.lagrange.christoffel import christoffel, inertia_derivative
from robot_dyn.lagrange.linkage import BASE, Configuration


@final
@dataclass(frozen=True, eq=False)
class Summand:
    """One rigid body at one configuration, or a batch.

    Attributes:
        path: The p joints that carry it, from the base on.
        inertia: 𝓜 in the frame of its last joint, (6, 6); or several, (k, 6, 6), for J and R (..., 1, …).
        J: Body Jacobian there, (..., 6, p).
        R: Axes of that frame in the base, (..., 3, 3).
    """

    path: tuple[int, ...]
    inertia: Array
    J: Array
    R: Array

    def M(self) -> Array:
        """Of M, (..., p, p)."""
        return transpose(self.J) @ self.inertia @ self.J

    def dM(self) -> Array:
        """Of ∂M_ij/∂q_k, (..., p, p, p)."""
        return inertia_derivative(self.J, self.inertia)

    def C(self, v: Array) -> Array:
        """Of C at the rates v (..., N) of all joints, (..., p, p)."""
        return christoffel(self.dM(), v[..., self.path])

    def N(self, gravity: Array) -> Array:
        """Of N in a gravity (3,), (..., p)."""
        weight = apply(self.inertia[..., :3], gravity @ self.R)  # 𝓜 (Rᵀ g, 0)
        return -apply(transpose(self.J), weight)


def of_bodies(at: Configuration) -> Iterator[Summand]:
    """The summands of the bodies that move, each with all its links."""
    bodies = zip(at.linkage.bodies, at.linkage.inertias, at.jacobians.values(), at.in_base.values(), strict=True)
    return (Summand(body.path, inertia, J, R) for body, inertia, J, (R, _) in bodies)


def of_links(at: Configuration) -> Iterator[tuple[str, Summand]]:
    """The summands of the links that move and have mass, by name."""
    for name, (index, _, inertia) in at.linkage.links.items():
        if index != BASE and np.any(inertia):
            yield name, Summand(at.linkage.bodies[index].path, inertia, at.jacobians[index], at.in_base[index][0])


def mass_matrix(at: Configuration, summands: Iterable[Summand], armature: Array) -> Array:
    """M of the summands and of an armature (N,), (..., n, n)."""
    return at.linkage.couplings.matrix(_total(_zeros(at, 2) + np.diag(armature), 2, summands, Summand.M))


def mass_matrix_derivative(at: Configuration, summands: Iterable[Summand]) -> Array:
    """∂M_ij/∂q_k of the summands at index [..., i, j, k], (..., n, n, n)."""
    return at.linkage.couplings.cube(_total(_zeros(at, 3), 3, summands, Summand.dM))


def coriolis_matrix(at: Configuration, summands: Iterable[Summand], v: Array) -> Array:
    """C of the summands at v (..., n), (..., n, n)."""
    v = at.linkage.couplings.velocity(v)
    zeros = _zeros(at, 2)
    zeros = np.broadcast_to(zeros, np.broadcast_shapes(zeros.shape, (*v.shape[:-1], 1, 1))).copy()
    return at.linkage.couplings.matrix(_total(zeros, 2, summands, lambda each: each.C(v)))


def gravity_torque(at: Configuration, summands: Iterable[Summand]) -> Array:
    """N of the summands, (..., n)."""
    return at.linkage.couplings.torque(_total(_zeros(at, 1), 1, summands, lambda each: each.N(at.linkage.gravity)))


def regressor(at: Configuration, v: Array, a: Array) -> Array:
    """Y of M a + C v + N without armature, (..., n, 10 N): the summands of unit parameters."""
    linkage, couplings = at.linkage, at.linkage.couplings
    v, a = couplings.velocity(v)[..., None, :], couplings.velocity(a)[..., None, :]
    N, units = len(linkage.bodies), unit_inertias(linkage.gravity.dtype)
    batch = np.broadcast_shapes(at.batch, v.shape[:-2], a.shape[:-2])
    Y = np.zeros((*batch, N, N, len(units)), dtype=linkage.gravity.dtype)  # by joint, body and parameter
    for i, each in enumerate(of_bodies(at)):
        unit = Summand(each.path, units, each.J[..., None, :, :], each.R[..., None, :, :])
        torque = apply(unit.M(), a[..., each.path]) + apply(unit.C(v), v[..., each.path]) + unit.N(linkage.gravity)
        Y[..., each.path, i, :] = np.swapaxes(torque, -1, -2)
    return couplings.rows(Y[..., linkage.order, :].reshape(*batch, N, -1))


def _zeros(at: Configuration, axes: int) -> Array:
    return np.zeros((*at.batch, *(len(at.linkage.bodies),) * axes), dtype=at.linkage.gravity.dtype)


def _total(start: Array, axes: int, summands: Iterable[Summand], term: Callable[[Summand], Array]) -> Array:
    """`start`, with so many axes of the N joints, and each summand's term in the entries of its path."""
    for each in summands:
        entries = (..., *np.ix_(*[each.path] * axes))
        start[entries] = start[entries] + term(each)
    return start
