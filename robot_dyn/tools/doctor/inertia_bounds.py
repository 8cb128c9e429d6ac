"""Bounds on the moments of a mass within a shape, in each direction.

    nᵀ Σ n ≤ m max ((x − c)·n)²,   Σ = ½ tr I · 1 − I = ∫ ρ (x − c) (x − c)ᵀ dx

for a mass m with centre c whose parts lie among the points x. The bound on ½ tr I alone misses moments exchanged
between axes and products of inertia of the wrong sign. [Wensing, Kim, Slotine 2018, §III-B]
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, final

import numpy as np

from robot_dyn.description import implausibility

SLACK = 1.21  # on each bound: shapes omit screws and cables, a tenth in length
_THINNEST = 0.01  # fraction of the distance of the farthest point: drawn sheets may have no thickness
_NEAR = 3.0  # largest factor between moments and those of the uniform body, in each direction
_DENSITIES = 50.0, 8e3  # [kg/m³] of a plausible link in its shape: hollow plastics to steel


@final
@dataclass(frozen=True, eq=False)
class Body:
    """A link for the bounds, in axes of its inertial frame.

    Attributes:
        mass: Mass m, in [kg].
        moments: Matrix I about the centre of mass, (3, 3), in [kg m²].
        points: Corners of its shape relative to the centre of mass, (k, 3), in [m].
        origin: Origin of the link relative to the centre of mass, (3,), in [m].
        uniform: The solid of its shape at 1 kg/m³ about its own centre: volume in [m³] and inertia (3, 3) in [m⁵]; None
            without a volume.
    """

    mass: float
    moments: np.ndarray
    points: np.ndarray
    origin: np.ndarray
    uniform: tuple[float, np.ndarray] | None

    def impossible(self) -> bool:
        """Return True if no mass distribution within the shape has these moments, up to the slack."""
        if implausibility(self.mass, np.zeros(3), self.moments):
            return True
        return excess(self.mass, self.moments, self.points).ratio > SLACK

    def plausible(self) -> bool:
        """Return True if the moments are possible and near a uniform body's, and the density is that of a link."""
        if self.uniform is None or self.impossible():
            return False
        volume, inertia = self.uniform
        try:
            L = np.linalg.inv(np.linalg.cholesky(second_moments(inertia)))
        except np.linalg.LinAlgError:  # a flat shape
            return False
        density = self.mass / volume
        ratio = np.linalg.eigvalsh(L @ second_moments(self.moments) @ L.T) / density
        near = ratio[0] >= 1 / _NEAR and ratio[2] <= _NEAR
        return bool(near and _DENSITIES[0] <= density <= _DENSITIES[1])


def second_moments(inertia: np.ndarray) -> np.ndarray:
    """Return Σ = ½ tr I · 1 − I, the integral ∫ ρ r rᵀ dx of the mass distribution."""
    return np.trace(inertia) / 2 * np.eye(3) - inertia


class Excess(NamedTuple):
    """The direction in which moments exceed the bound of a shape most.

    Attributes:
        ratio: nᵀΣn / (m max (x·n)²); above 1 the moments are impossible.
        n: Unit vector, (3,).
        needed: √(nᵀΣn / m), the least distance of mass from its centre along n, in [m].
        extent: max |x·n| of the shape, in [m].
    """

    ratio: float
    n: np.ndarray
    needed: float
    extent: float


def excess(mass: float, inertia: np.ndarray, points: np.ndarray) -> Excess:
    """Return the excess among the eigenvectors n of Σ and the axes.

    The mass m lies within the points x, so its second moment along n is at most that of m at the farthest point.
    """
    directions = np.hstack([np.linalg.eigh(second_moments(inertia))[1], np.eye(3)])
    spread = np.einsum("in,ij,jn->n", directions, second_moments(inertia), directions)
    thickness = _THINNEST * np.linalg.norm(points, axis=1).max()
    extent = np.maximum(np.abs(points @ directions).max(axis=0), max(thickness, np.finfo(float).tiny))
    ratio = spread / (mass * extent**2)
    k = int(np.argmax(ratio))
    needed = float(np.sqrt(max(spread[k], 0.0) / mass))
    return Excess(float(ratio[k]), directions[:, k], needed, float(extent[k]))


def matrix(moments: list[float]) -> np.ndarray:
    """Return the matrix of Ixx, Ixy, Ixz, Iyy, Iyz, Izz."""
    Ixx, Ixy, Ixz, Iyy, Iyz, Izz = moments
    return np.array([[Ixx, Ixy, Ixz], [Ixy, Iyy, Iyz], [Ixz, Iyz, Izz]])
