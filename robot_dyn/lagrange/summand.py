"""Summands of M, ∂M/∂q, C and N: the contribution of one rigid body, in the entries of the joints that carry it.

    M = Σ Jᵀ 𝓜 J,   ∂M/∂q = Σ ∂(Jᵀ 𝓜 J)/∂q,   C of their Christoffel symbols,   N = −Σ Jᵀ 𝓜 (Rᵀ g, 0)

All four are linear in 𝓜: the summand of a body is the sum of the summands of its links.
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
        path: Indices of the p joints that carry it, from the base on.
        inertia: Spatial inertia 𝓜 in the frame of the last joint, (6, 6); or several, (k, 6, 6), for J, R (..., 1, …).
        J: Body Jacobian of that frame, (..., 6, p).
        R: Rotation from that frame to the base, (..., 3, 3).
    """

    path: tuple[int, ...]
    inertia: Array
    J: Array
    R: Array

    def M(self) -> Array:
        """Return the terms of M, (..., p, p)."""
        return transpose(self.J) @ self.inertia @ self.J

    def dM(self) -> Array:
        """Return the terms of ∂M_ij/∂q_k, (..., p, p, p)."""
        return inertia_derivative(self.J, self.inertia)

    def C(self, v: Array) -> Array:
        """Return the terms of C at the rates v (..., N) of all joints, (..., p, p)."""
        return christoffel(self.dM(), v[..., self.path])

    def N(self, gravity: Array) -> Array:
        """Return the terms of N in a gravity (3,), (..., p)."""
        weight = apply(self.inertia[..., :3], gravity @ self.R)  # 𝓜 (Rᵀ g, 0)
        return -apply(transpose(self.J), weight)


def summands_of_bodies(at: Configuration) -> Iterator[Summand]:
    """Return the summands of the moving bodies, each including all its links."""
    bodies = zip(at.linkage.bodies, at.linkage.inertias, at.jacobians.values(), at.in_base.values(), strict=True)
    return (Summand(body.path, inertia, J, R) for body, inertia, J, (R, _) in bodies)


def summands_of_links(at: Configuration) -> Iterator[tuple[str, Summand]]:
    """Return the summands of the moving links with mass, by name."""
    for name, (index, _, inertia) in at.linkage.links.items():
        if index != BASE and np.any(inertia):
            yield name, Summand(at.linkage.bodies[index].path, inertia, at.jacobians[index], at.in_base[index][0])


def mass_matrix(at: Configuration, summands: Iterable[Summand], armature: Array) -> Array:
    """Return M of the summands and of an armature (N,), (..., n, n)."""
    return at.linkage.couplings.matrix(_total(_zeros(at, 2) + np.diag(armature), 2, summands, Summand.M))


def mass_matrix_derivative(at: Configuration, summands: Iterable[Summand]) -> Array:
    """Return ∂M_ij/∂q_k of the summands at index [..., i, j, k], (..., n, n, n)."""
    return at.linkage.couplings.cube(_total(_zeros(at, 3), 3, summands, Summand.dM))


def coriolis_matrix(at: Configuration, summands: Iterable[Summand], v: Array) -> Array:
    """Return C of the summands at v (..., n), (..., n, n)."""
    v = at.linkage.couplings.velocity(v)
    zeros = _zeros(at, 2)
    zeros = np.broadcast_to(zeros, np.broadcast_shapes(zeros.shape, (*v.shape[:-1], 1, 1))).copy()
    return at.linkage.couplings.matrix(_total(zeros, 2, summands, lambda summand: summand.C(v)))


def gravity_torque(at: Configuration, summands: Iterable[Summand]) -> Array:
    """Return N of the summands, (..., n)."""
    return at.linkage.couplings.torque(
        _total(_zeros(at, 1), 1, summands, lambda summand: summand.N(at.linkage.gravity))
    )


def regressor(at: Configuration, v: Array, a: Array) -> Array:
    """Return Y of M a + C v + N without armature, (..., n, 10 N), from summands of unit parameters."""
    linkage, couplings = at.linkage, at.linkage.couplings
    v, a = couplings.velocity(v)[..., None, :], couplings.velocity(a)[..., None, :]
    N, units = len(linkage.bodies), unit_inertias(linkage.gravity.dtype)
    batch = np.broadcast_shapes(at.batch, v.shape[:-2], a.shape[:-2])
    Y = np.zeros((*batch, N, N, len(units)), dtype=linkage.gravity.dtype)  # by joint, body and parameter
    for i, body in enumerate(summands_of_bodies(at)):
        unit = Summand(body.path, units, body.J[..., None, :, :], body.R[..., None, :, :])
        torque = apply(unit.M(), a[..., body.path]) + apply(unit.C(v), v[..., body.path]) + unit.N(linkage.gravity)
        Y[..., body.path, i, :] = np.swapaxes(torque, -1, -2)
    return couplings.rows(Y[..., linkage.order, :].reshape(*batch, N, -1))


def _zeros(at: Configuration, axes: int) -> Array:
    return np.zeros((*at.batch, *(len(at.linkage.bodies),) * axes), dtype=at.linkage.gravity.dtype)


def _total(start: Array, axes: int, summands: Iterable[Summand], term: Callable[[Summand], Array]) -> Array:
    """Add each summand's term to `start`, in the entries of its path along the last `axes` axes."""
    for summand in summands:
        entries = (..., *np.ix_(*[summand.path] * axes))
        start[entries] = start[entries] + term(summand)
    return start
