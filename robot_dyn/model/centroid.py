"""Centre of mass and momentum about it, summed over bodies: 𝓜_b J_b is the momentum of a body, by joint.

    ∂c/∂q = Σ R_b (𝓜_b J_b)_linear / m,   A_G = Σ (R_b f_b, R_b m_b + (p_b − c) × R_b f_b),   (f_b, m_b) = 𝓜_b J_b

Pinocchio's own functions sum moments about the origin of the base, so that small links of long arms lose digits.
[Orin, Goswami, Lee 2013]
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

import numpy as np
import pinocchio as pin  # pyright: ignore[reportMissingImports]
from numpy import ndarray

from robot_dyn.foundations.errors import QueryError
from robot_dyn.foundations.spatial import hat
from robot_dyn.model.coriolis import Bodies, jacobian_rate


@final
@dataclass(frozen=True, eq=False)
class Centroid:
    """Centre of mass of the moving bodies of a model, at one state.

    Attributes:
        bodies: Bodies, each in its body axes.
        model: The `pinocchio.Model`.
        near_base: The model with the first joint at the origin, so that positions keep all digits.
        mass: Mass of the moving bodies, in [kg].
    """

    bodies: Bodies
    model: pin.Model
    near_base: pin.Model
    mass: float

    @classmethod
    def from_model(cls, model: pin.Model, bodies: Bodies) -> Centroid:
        """Return the centroid of the bodies of a model.

        Raises:
            QueryError: If no moving link has a mass.
        """
        mass = float(bodies.inertia[:, 0, 0].sum())
        if mass <= 0:
            raise QueryError("no centre of mass: the moving links have no mass; give them masses")
        near_base = model.copy()
        first = model.jointPlacements[1].translation.copy()
        for j, parent in enumerate(model.parents):
            if j and not parent:
                near_base.jointPlacements[j].translation = model.jointPlacements[j].translation - first
        return cls(bodies, model, near_base, mass)

    def position(self, data: pin.Data, q: ndarray) -> ndarray:
        """Return the centre of mass c, (3,)."""
        return pin.centerOfMass(self.model, data, q).copy()

    def jacobian(self, data: pin.Data, q: ndarray) -> ndarray:
        """Return ∂c/∂q, (3, N)."""
        J = self.bodies.jacobians(data, q)
        return (self._rotations(data, q) @ (self.bodies.inertia[:, :3] @ J)).sum(axis=0) / self.mass

    def jacobian_rate(self, data: pin.Data, q: ndarray, v: ndarray) -> ndarray:
        """Return d/dt ∂c/∂q, (3, N): the axes of a body turn at ω, d/dt R f = R (ω × f + df/dt)."""
        J, inertia = self.bodies.jacobians(data, q), self.bodies.inertia[:, :3]
        rate, twist = jacobian_rate(J, v)
        change = hat(twist[:, 3:]) @ (inertia @ J) + inertia @ rate
        return (self._rotations(data, q) @ change).sum(axis=0) / self.mass

    def momentum_matrix(self, data: pin.Data, q: ndarray) -> ndarray:
        """Return A_G, (6, N): linear momentum, and angular momentum about the centre of mass."""
        R, J = self._rotations(data, q), self.bodies.jacobians(data, q)
        p = np.array([placement.translation for placement in data.oMi[1:]])
        momentum = R[:, None] @ (self.bodies.inertia @ J).reshape(len(J), 2, 3, -1)
        from_centre = p - pin.centerOfMass(self.near_base, data, q)
        angular = momentum[:, 1] + hat(from_centre) @ momentum[:, 0]
        return np.concatenate([momentum[:, 0].sum(axis=0), angular.sum(axis=0)])

    def _rotations(self, data: pin.Data, q: ndarray) -> ndarray:
        """Return R_b of each body, (N, 3, 3); `data` then has the placements of `near_base`."""
        pin.forwardKinematics(self.near_base, data, q)
        return np.array([placement.rotation for placement in data.oMi[1:]])
