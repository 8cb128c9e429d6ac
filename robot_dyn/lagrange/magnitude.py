"""Magnitudes: for each entry of M, C, N the sum of the absolute values of its terms.

The rounding error of an entry is proportional to its terms, not to their sum. Magnitudes are therefore the scale on
which two implementations must agree, and u times a magnitude is the size of a rounding error. A term is bounded by the
lengths of its vectors: in body b, the column of joint i has an angular part aᵢ ≤ 1 and a linear part lᵢ, at most the
lever from i to b. Links fixed to each other are separate terms, because rounding leaves some of m c if they balance.

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
        carried: Terms of each row of m ∂c/∂q for the centre of mass c, (n,); equal to N in unit gravity.
        moment: Terms of m c, a number.
        V: Terms of the potential energy, a number.
        lever: Length of the linear part of each column of each link's Jacobian, by name, (n,).
        reach: Distance from the base to each link along the joints, by name.
        linkage: The linkage.
        columns: Lengths of the linear and angular parts of the columns of each body's Jacobian, (2, p).
        reaches: Distance from the base to each body along the joints.
    """

    M: np.ndarray
    dM: np.ndarray
    N: np.ndarray
    carried: np.ndarray
    moment: float
    V: float
    lever: dict[str, np.ndarray]
    reach: dict[str, float]
    linkage: Linkage
    columns: tuple[np.ndarray, ...]
    reaches: tuple[float, ...]

    def C(self, v: np.ndarray) -> np.ndarray:
        """Return the terms of the Coriolis matrix, (n, n)."""
        return _coriolis(self.dM, np.abs(v))

    def inverse_dynamics(self, v: np.ndarray, a: np.ndarray) -> np.ndarray:
        """Return the terms of M a + C v + N, (n,)."""
        return self.M @ np.abs(a) + self.C(v) @ np.abs(v) + self.N

    @property
    def mass(self) -> float:
        """Mass of the moving bodies."""
        return sum(abs(float(inertia[0, 0])) for inertia in self.linkage.inertias)

    def derivatives(self, v: np.ndarray, a: np.ndarray) -> np.ndarray:
        """Return the terms of ∂τ/∂q, ∂τ/∂v, ∂τ/∂a, (3, n, n); every joint counts as preceding the others."""
        couplings, N = _absolute(self.linkage.couplings), len(self.linkage.bodies)
        full_v, full_a = couplings.velocity(np.abs(v)), couplings.velocity(np.abs(a))
        by_q, fall = np.zeros((N, N)), np.array([float(np.linalg.norm(self.linkage.gravity)), 0.0])
        for body, block, J in zip(self.linkage.bodies, _blocks(self.linkage), self.columns, strict=True):
            path = list(body.path)
            V = J @ full_v[path]
            A = fall + J @ full_a[path] + _bracket(V, V)
            momentum = block @ V
            F = block @ A + _dual(V, momentum)
            dV = _bracket(V[:, None], J)
            dA = _bracket(A[:, None], J) + _bracket(dV, V[:, None])
            dF = block @ dA + _dual(V[:, None], block @ dV) + _dual(dV, momentum[:, None])
            by_q[np.ix_(path, path)] += np.tensordot(F, _derivative(J), axes=(0, 0)) + J.T @ dF
        return np.stack([couplings.matrix(by_q), 2 * self.C(v), self.M])

    def carried_rate(self, v: np.ndarray) -> np.ndarray:
        """Return the terms of each row of m d/dt ∂c/∂q, (n,)."""
        couplings = _absolute(self.linkage.couplings)
        v, rate = couplings.velocity(np.abs(v)), np.zeros(len(self.linkage.bodies))
        for body, block, J in zip(self.linkage.bodies, _blocks(self.linkage), self.columns, strict=True):
            path = list(body.path)
            rate[path] += block[0] @ (_derivative(J) @ v[path] + J * (J[1] @ v[path]))
        return couplings.torque(rate)

    def momentum_matrix(self) -> np.ndarray:
        """Return the terms of A_G, (6, n): distances from the centre of mass are differences of positions."""
        couplings, terms = _absolute(self.linkage.couplings), np.zeros((2, len(self.linkage.bodies)))
        for body, block, J, reach in zip(
            self.linkage.bodies, _blocks(self.linkage), self.columns, self.reaches, strict=True
        ):
            linear, angular = block @ J
            terms[:, list(body.path)] += [linear, angular + (reach + self.moment / self.mass) * linear]
        return np.repeat(couplings.columns(terms), 3, axis=0)

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
    M, dM, carried, moment = np.diag(linkage.armature), np.zeros((N, N, N)), np.zeros(N), 0.0
    g = float(np.linalg.norm(linkage.gravity))
    columns = tuple(_columns(linkage.bodies, body, steps) for body in linkage.bodies)
    for body, block, J in zip(linkage.bodies, _blocks(linkage), columns, strict=True):
        M_terms, dM_terms, weight = _terms(J, block)
        M[np.ix_(body.path, body.path)] += M_terms
        dM[np.ix_(body.path, body.path, body.path)] += dM_terms
        carried[list(body.path)] += weight
        moment += block[0, 0] * _reach(linkage.bodies, body, steps) + block[0, 1]
    lever, reach = {}, {}
    for name, (index, pose, _) in linkage.links.items():
        lever[name], reach[name] = np.zeros(N), float(np.linalg.norm(pose.p))
        if index != BASE:
            body = linkage.bodies[index]
            lin, ang = columns[index]
            lever[name][list(body.path)] = lin + ang * reach[name]
            reach[name] += _reach(linkage.bodies, body, steps)
        lever[name] = couplings.torque(lever[name])
    carried = couplings.torque(carried)
    reaches = tuple(_reach(linkage.bodies, body, steps) for body in linkage.bodies)
    return Magnitudes(
        M=couplings.matrix(M), dM=couplings.cube(dM), N=g * carried, carried=carried, moment=moment, V=g * moment,
        lever=lever, reach=reach, linkage=linkage, columns=columns, reaches=reaches,
    )  # fmt: skip


def _absolute(couplings: Couplings) -> Couplings:
    return Couplings(np.abs(couplings.S), np.abs(couplings.s0))


def _terms(J: np.ndarray, block: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the terms of M (p, p), ∂M (p, p, p), and N in unit gravity (p,), for a body with columns J (2, p)."""
    half = np.tensordot(block @ J, _derivative(J), axes=(0, 0))  # [i, j, k]
    return J.T @ block @ J, half + half.swapaxes(0, 1), block[0] @ J


def _derivative(J: np.ndarray) -> np.ndarray:
    """Return the lengths of ∂J_j/∂q_k = [J_j, J_k], (2, p, p)."""
    return _bracket(J[:, :, None], J[:, None, :])


def _bracket(X: np.ndarray, Y: np.ndarray) -> np.ndarray:
    """Return the lengths of [X, Y] from those of twists (linear, angular), (2, ...)."""
    return np.stack([X[1] * Y[0] + X[0] * Y[1], X[1] * Y[1]])


def _dual(X: np.ndarray, F: np.ndarray) -> np.ndarray:
    """Return the lengths of ad_Xᵀ F from those of a twist and a wrench (force, moment), (2, ...)."""
    return np.stack([X[1] * F[0], X[0] * F[0] + X[1] * F[1]])


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
