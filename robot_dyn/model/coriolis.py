"""The Coriolis matrix in the axes of each body: C = Σ J_bᵀ (𝓜_b J̇_b + 𝓖_b J_b), 𝓖 linear in the angular velocity ω_b.

A point r of a body moves by ∂ṙ/∂v_j along joint j, and the Christoffel symbols of points are

    C_ij = ∫ ∂ṙ/∂v_i · d/dt(∂ṙ/∂v_j) dm.

In the body's axes ∂ṙ/∂v = (1, −r̂) J and d/dt adds ω̂, so that

    𝓖 = ∫ (1, −r̂)ᵀ ω̂ (1, −r̂) dm = [[m ω̂, −m ω̂ ĉ], [m ĉ ω̂, (Σ ω)^]],   Σ = ∫ r rᵀ dm = ½ tr(I) 1 − I,

a skew matrix: Ṁ = C + Cᵀ. [The factorisation of Echeandia, Wensing 2021, in the axes of each body]

The only distances in it are those from a joint to the bodies it moves. Pinocchio's own Coriolis matrix is computed in
world axes; it is used where a bound on its rounding error is small (`regrouped`).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import final

import numpy as np
import pinocchio as pin  # pyright: ignore[reportMissingImports]
from numpy import ndarray

from robot_dyn.description.couplings import Couplings
from robot_dyn.foundations.spatial import bracket, first_moment, hat
from robot_dyn.model.regrouped import regrouped, rounding, slides

# ad_X is linear in X: its 36 entries, (6, 36)
_AD = bracket(np.eye(6)).reshape(6, 36)

MAX_ROUNDING = 1e-13  # largest ε for which C is computed in world axes, in the units √M_ii of the joints


@final
@dataclass(frozen=True, eq=False)
class Coriolis:
    """C of all joints of a model, by Pinocchio if its rounding error is at most 1e-13, otherwise by `Bodies`.

    Attributes:
        bodies: Bodies of the model, each in its body axes.
        regrouped: Model from which Pinocchio computes C; None if the bound is larger than 1e-13.
        slides: Index and largest |q| of each prismatic joint for which the bound holds.
        rounding: Bound ε in |δC_ij| ≤ ε Ω √(M_ii M_jj), see `regrouped`.
    """

    bodies: Bodies = field(repr=False)
    regrouped: pin.Model = field(repr=False)
    slides: tuple[tuple[int, float], ...]
    rounding: float

    @classmethod
    def from_model(cls, model: pin.Model, couplings: Couplings) -> Coriolis:
        """Choose the computation of C for a model with these couplings."""
        with np.errstate(all="ignore"):  # overflowing masses give a NaN bound, which fails the test below
            near_base = regrouped(model)
            bound = rounding(model, near_base, couplings)
        return cls(Bodies.from_model(model), near_base if bound <= MAX_ROUNDING else None, slides(model), bound)

    def matrix(self, data: pin.Data, q: ndarray, v: ndarray) -> ndarray:
        """Return C of the Christoffel symbols at one state, (N, N)."""
        if self.regrouped is None:
            return self.bodies.coriolis_matrix(data, q, v)
        for j, most in self.slides:
            if not abs(q.item(j)) <= most:
                return self.bodies.coriolis_matrix(data, q, v)
        return pin.computeCoriolisMatrix(self.regrouped, data, q, v)


@final
@dataclass(frozen=True, eq=False)
class Bodies:
    """The n moving bodies of a Pinocchio model, each in the frame of its joint.

    Attributes:
        model: The `pinocchio.Model`; every joint has one degree of freedom.
        inertia: Spatial inertias 𝓜, (n, 6, 6).
        wrench: Coefficients of 𝓜 [X, Y] + 𝓖(ω) X in the products of the 6 components of X and the 9 of (Y, ω),
            (n, 6, 54).
        sums: Matrix that sums the columns after each joint, and those of all joints, (n, 2 n).
    """

    model: pin.Model
    inertia: ndarray
    wrench: ndarray
    sums: ndarray

    @classmethod
    def from_model(cls, model: pin.Model) -> Bodies:
        """Return the bodies of a model."""
        inertia = np.array([body.matrix() for body in model.inertias[1:]])
        of_brackets = (inertia[:, None] @ bracket(np.eye(6))).swapaxes(1, 2)
        of_spin = np.array([[_gyroscopic(body, axis) for axis in np.eye(3)] for body in inertia]).transpose(0, 2, 3, 1)
        wrench = np.concatenate((of_brackets, of_spin), axis=-1).reshape(-1, 6, 54)
        n = len(inertia)
        return cls(model, inertia, wrench, np.hstack((np.tri(n, k=-1), np.ones((n, n)))))

    def jacobians(self, data: pin.Data, q: ndarray) -> ndarray:
        """Return J_b of each body at its frame, in body axes, (n, 6, n); columns of unrelated joints are 0."""
        n = len(self.inertia)
        return np.array([pin.computeJointJacobian(self.model, data, q, i + 1) for i in range(n)]).reshape(n, 6, n)

    def coriolis_matrix(self, data: pin.Data, q: ndarray, v: ndarray) -> ndarray:
        """Return C of the Christoffel symbols at one state, (n, n)."""
        J, n = self.jacobians(data, q), len(v)
        rows = J.reshape(6 * n, n)
        twists = (rows * v).dot(self.sums).reshape(n, 6, 2, n)
        factors = np.concatenate((twists[:, :, 0], twists[:, 3:, 1]), axis=1)
        products = (J[:, :, None] * factors[:, None]).reshape(n, 54, n)
        return rows.T.dot((self.wrench @ products).reshape(6 * n, n))


def jacobian_rate(J: ndarray, v: ndarray) -> tuple[ndarray, ndarray]:
    """Return J̇ of body Jacobians J (..., 6, n) along v (n,), and the body twist J v (..., 6).

    ∂J_j/∂q_k = [J_j, J_k] for joint j before joint k, and 0 otherwise: J̇_j = [J_j, Σ_{k after j} J_k v_k].
    """
    parts = J * v
    return columnwise_bracket(J, parts @ np.tri(len(v), k=-1)), parts.sum(axis=-1)


def columnwise_bracket(X: ndarray, Y: ndarray) -> ndarray:
    """Return [X_j, Y_j] of the columns of X and Y, (..., 6, n)."""
    return (_ad(X) @ Y.mT[..., None])[..., 0].mT


def columnwise_dual(X: ndarray, F: ndarray) -> ndarray:
    """Return ad_{X_j}ᵀ F of the columns of X (..., 6, n) and one wrench F (..., 6), (..., 6, n)."""
    return (_ad(X).mT @ F[..., None, :, None])[..., 0].mT


def _ad(X: ndarray) -> ndarray:
    """Return ad of each column of X (..., 6, n), (..., n, 6, 6)."""
    return (X.mT @ _AD).reshape(*X.mT.shape, 6)


def _gyroscopic(inertia: ndarray, omega: ndarray) -> ndarray:
    """Return 𝓖 of a body of spatial inertia 𝓜 (6, 6) at angular velocity ω (3,); (6, 6)."""
    mass, mc, moments, spin = inertia[0, 0], hat(first_moment(inertia)), inertia[3:, 3:], hat(omega)
    second_moment = np.trace(moments) / 2 * np.eye(3) - moments
    return np.block([[mass * spin, -spin @ mc], [mc @ spin, hat(second_moment @ omega)]])
