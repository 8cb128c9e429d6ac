"""Magnitudes: for each entry of M, C, N the sum of the absolute values of its terms.

The rounding error of an entry is proportional to its terms, not to their sum. Magnitudes are therefore the scale on
which two implementations must agree, and u times a magnitude is the size of a rounding error. A term is bounded by the
lengths of its vectors: in body b the column of joint i turns at rate aᵢ ≤ 1 and moves the frame at lᵢ ≤ the lever from
i to b. Links fixed to each other are separate terms: if they balance, rounding leaves some of m c.

    ‖Jᵢᵀ 𝓜 Jⱼ‖ ≤ m lᵢ lⱼ + m c (lᵢ aⱼ + aᵢ lⱼ) + I aᵢ aⱼ       ‖[Jⱼ, J_k]‖: l = aⱼ l_k + lⱼ a_k, a = aⱼ a_k
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np

from robot_dyn.description.couplings import Couplings
from robot_dyn.foundations.spatial import first_moment
from robot_dyn.lagrange.linkage import BASE, Body, Linkage

_UNITS = (  # slices of the ten parameters, and the blocks [[m, m c], [m c, I]] of a unit value
    (slice(0, 1), np.array([[1.0, 0.0], [0.0, 0.0]])),
    (slice(1, 4), np.array([[0.0, 1.0], [1.0, 0.0]])),
    (slice(4, 10), np.array([[0.0, 0.0], [0.0, 1.0]])),
)


@final
@dataclass(frozen=True, eq=False)
class Magnitudes:
    """Bounds of the terms at one configuration q (n,) of a float64 linkage; entries as in the quantities.

    Attributes:
        M: Terms of M, (n, n).
        dM: Terms of ∂M_ij/∂q_k, (n, n, n).
        N: Terms of N, (n,).
        V: Terms of the potential energy, a number.
        lever: Length of the linear part of each column of each link's Jacobian, by name, (n,).
        reach: Distance from the base to each link along the joints, by name.
        linkage: The linkage.
        columns: Lengths of the linear and angular parts of the columns of each body's Jacobian, (2, p).
    """

    M: np.ndarray
    dM: np.ndarray
    N: np.ndarray
    V: float
    lever: dict[str, np.ndarray]
    reach: dict[str, float]
    linkage: Linkage
    columns: tuple[np.ndarray, ...]

    def C(self, v: np.ndarray) -> np.ndarray:
        """Return the terms of the Coriolis matrix, (n, n)."""
        return _coriolis(self.dM, np.abs(v))

    def inverse_dynamics(self, v: np.ndarray, a: np.ndarray) -> np.ndarray:
        """Return the terms of M a + C v + N, (n,)."""
        return self.M @ np.abs(a) + self.C(v) @ np.abs(v) + self.N

    def regressor(self, v: np.ndarray, a: np.ndarray) -> np.ndarray:
        """Return the terms of Y, (n, 10 N)."""
        couplings, N = _absolute(self.linkage.couplings), len(self.linkage.bodies)
        v, a = couplings.velocity(np.abs(v)), couplings.velocity(np.abs(a))
        g, Y = float(np.linalg.norm(self.linkage.gravity)), np.zeros((N, N, 10))
        for i, (body, J) in enumerate(zip(self.linkage.bodies, self.columns, strict=True)):
            path = list(body.path)
            for parameters, block in _UNITS:
                M, dM, weight = _terms(J, block)
                torque = M @ a[path] + _coriolis(dM, v[path]) @ v[path] + g * weight
                Y[path, i, parameters] = torque[:, None]
        return couplings.rows(Y[:, self.linkage.order].reshape(N, -1))


def magnitudes(linkage: Linkage, q: np.ndarray) -> Magnitudes:
    """Compute the magnitudes of a linkage at q."""
    N, couplings = len(linkage.bodies), _absolute(linkage.couplings)
    steps = np.abs(linkage.couplings.position(q))
    M, dM, gravity, V = np.diag(linkage.armature), np.zeros((N, N, N)), np.zeros(N), 0.0
    g = float(np.linalg.norm(linkage.gravity))
    columns = tuple(_columns(linkage.bodies, body, steps) for body in linkage.bodies)
    for body, block, J in zip(linkage.bodies, _blocks(linkage), columns, strict=True):
        M_terms, dM_terms, weight = _terms(J, block)
        M[np.ix_(body.path, body.path)] += M_terms
        dM[np.ix_(body.path, body.path, body.path)] += dM_terms
        gravity[list(body.path)] += g * weight
        V += g * (block[0, 0] * _reach(linkage.bodies, body, steps) + block[0, 1])
    lever, reach = {}, {}
    for name, (index, pose, _) in linkage.links.items():
        lever[name], reach[name] = np.zeros(N), float(np.linalg.norm(pose.p))
        if index != BASE:
            body = linkage.bodies[index]
            lin, ang = columns[index]
            lever[name][list(body.path)] = lin + ang * reach[name]
            reach[name] += _reach(linkage.bodies, body, steps)
        lever[name] = couplings.torque(lever[name])
    reduced = couplings.matrix(M), couplings.cube(dM), couplings.torque(gravity)
    return Magnitudes(*reduced, V, lever, reach, linkage, columns)


def _absolute(couplings: Couplings) -> Couplings:
    return Couplings(np.abs(couplings.S), np.abs(couplings.s0))


def _terms(J: np.ndarray, block: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the terms of M (p, p), ∂M (p, p, p), and N in unit gravity (p,), for a body with columns J (2, p)."""
    lin, ang = J
    dJ = np.stack([np.outer(ang, lin) + np.outer(lin, ang), np.outer(ang, ang)])  # [:, j, k]
    half = np.tensordot(block @ J, dJ, axes=(0, 0))  # [i, j, k]
    return J.T @ block @ J, half + half.swapaxes(0, 1), block[0] @ J


def _coriolis(dM: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Return the terms of the Christoffel symbols of ∂M at |v|."""
    W = np.swapaxes(dM, -1, -2) @ v
    return (dM @ v + W + W.T) / 2


def _blocks(linkage: Linkage) -> np.ndarray:
    """Return [[m, m c], [m c, I]] of each body, summed over its links in absolute values; (N, 2, 2)."""
    blocks = np.zeros((len(linkage.bodies), 2, 2))
    for body, pose, inertia in linkage.links.values():
        if body != BASE:
            m, offset = abs(inertia[0, 0]), float(np.linalg.norm(pose.p))
            mc = float(np.linalg.norm(first_moment(inertia) - inertia[0, 0] * pose.p)) + m * offset
            blocks[body] += [[m, mc], [mc, np.linalg.norm(inertia[3:, 3:], 2)]]
    return blocks


def _step(body: Body, steps: np.ndarray) -> float:
    """Return the distance from the parent's frame to this body's."""
    return float(np.linalg.norm(body.pose.p)) + (0.0 if body.revolute else steps[body.path[-1]])


def _columns(bodies: tuple[Body, ...], body: Body, steps: np.ndarray) -> np.ndarray:
    """Return the lengths of the linear and angular parts of the columns of a body's Jacobian, (2, p)."""
    ang = np.array([1.0 if bodies[i].revolute else 0.0 for i in body.path])
    steps_along = np.array([_step(bodies[i], steps) for i in body.path])
    lever = np.append(np.cumsum(steps_along[:0:-1])[::-1], 0.0)
    return np.stack([ang * lever + (1 - ang), ang])


def _reach(bodies: tuple[Body, ...], body: Body, steps: np.ndarray) -> float:
    """Return the distance from the base to a body along the joints."""
    return sum(_step(bodies[i], steps) for i in body.path)
