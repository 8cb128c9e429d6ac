"""Mass distribution of a rigid body, I = ∫ ρ r̂ᵀ r̂ dx about the centre of mass, and its physical consistency.

A mass distribution exists exactly if m ≥ 0 and the principal moments are not negative and satisfy I₁ + I₂ ≥ I₃.
[Wensing, Kim, Slotine, Linear Matrix Inequalities for Physically Consistent Inertial Parameter Identification, 2018]
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import TYPE_CHECKING, final

import numpy as np

from robot_dyn.foundations.errors import QueryError
from robot_dyn.foundations.spatial import hat, spatial_inertia
from robot_dyn.foundations.validate import number, numbers, rows

if TYPE_CHECKING:
    from numpy.typing import ArrayLike


_SLACK = 1e-9  # relative to the largest moment: rounding of printed digits
_LEVER_SLACK = 1e-12  # relative to m c² and to m (1 m)²: rounding of merged bodies
_ROTATION_SLACK = 1e-6  # largest entry of RᵀR − 1: drift of an integrated R


def rotation_matrix(R: ArrayLike) -> np.ndarray:
    """Return R as float64 of shape (..., 3, 3); raise QueryError unless RᵀR = 1 and det R = 1."""
    array = rows("R", R, 3, 3)
    with np.errstate(over="ignore", invalid="ignore"):
        deviation = np.abs(np.swapaxes(array, -1, -2) @ array - np.eye(3)).max(initial=0)
    if not deviation <= _ROTATION_SLACK or np.any(np.linalg.det(array) < 0):
        raise QueryError(f"R must be a rotation, RᵀR = 1 and det R = 1; RᵀR − 1 has an entry of {deviation:.3g}")
    return array


@final
@dataclass(frozen=True, eq=False)
class MassProperties:
    """Mass, centre of mass and rotational inertia of one rigid body.

        I = ∫ ρ r̂ᵀ r̂ dx,   r = x − c

    Attributes:
        mass: m, positive, in [kg].
        com: Centre of mass c in the body's frame, shape (3,), in [m].
        inertia: I about the centre of mass, along the axes of the body's frame, shape (3, 3), in [kg m²].

    Raises:
        QueryError: If a shape is wrong, a value is not finite, or no mass distribution has these properties.

    Source: Murray, Li, Sastry 1994, ch. 4 §2.2.
    """

    mass: float
    com: np.ndarray
    inertia: np.ndarray

    def __post_init__(self) -> None:
        mass, com = number("mass", self.mass, above=0), numbers("com", self.com, (3,))
        inertia = numbers("inertia", self.inertia, (3, 3))
        if np.abs(inertia - inertia.T).max() > _SLACK * np.abs(inertia).max():
            raise QueryError("inertia must be symmetric; a URDF's six moments fill both triangles")
        if why := implausibility(mass, com, inertia):
            raise QueryError(f"the mass properties are not physical: {why}")
        object.__setattr__(self, "mass", mass)
        for name, array in (("com", com.copy()), ("inertia", (inertia + inertia.T) / 2)):
            array.setflags(write=False)
            object.__setattr__(self, name, array)

    def moved(self, R: ArrayLike, p: ArrayLike) -> MassProperties:
        """Return the same body as seen from a frame in which its own frame has the placement g = (R, p).

            c' = R c + p,   I' = R I Rᵀ

        Args:
            R: Rotation, shape (3, 3).
            p: Origin of the body's frame, shape (3,), in [m].

        Raises:
            QueryError: If R is not a rotation, or a shape is wrong.
        """
        R, p = rotation_matrix(R), numbers("p", p, (3,))
        return MassProperties(self.mass, R @ self.com + p, R @ self.inertia @ R.T)

    def about(self, point: ArrayLike) -> np.ndarray:
        """Return the inertia about a point of the body's frame, I + m d̂ᵀ d̂ with d = c − point; (3, 3), [kg m²].

        Source: the parallel-axis theorem; Featherstone 2008, §2.13.
        """
        d = hat(self.com - numbers("point", point, (3,)))
        return self.inertia + self.mass * d.T @ d

    @property
    def spatial(self) -> np.ndarray:
        """Spatial inertia 𝓜 of ½ Vᵀ 𝓜 V in the body's frame, twists linear first, shape (6, 6)."""
        return spatial_inertia(self.mass, self.com, self.inertia)


def combined(bodies: Iterable[MassProperties]) -> MassProperties:
    """Combine bodies of one frame rigidly: m = Σ mᵢ, c = Σ mᵢ cᵢ / m, I = Σ Iᵢ + mᵢ d̂ᵢᵀ d̂ᵢ with dᵢ = cᵢ − c.

    Raises:
        QueryError: If there are none.
    """
    bodies = list(bodies)
    if not bodies:
        raise QueryError("no bodies to combine; give at least one")
    mass = sum(body.mass for body in bodies)
    com = sum((body.mass / mass * body.com for body in bodies), np.zeros(3))
    return MassProperties(mass, com, sum((body.about(com) for body in bodies), np.zeros((3, 3))))


def implausibility(mass: float, com: np.ndarray, inertia: np.ndarray) -> str | None:
    """Return the reason why no body has this mass and inertia about its centre of mass; None if one has.

    Args:
        mass: Mass in [kg].
        com: Centre of mass in the frame in which bodies were merged, shape (3,), in [m].
        inertia: Symmetric, shape (3, 3), in [kg m²].
    """
    I1, I2, I3 = np.linalg.eigvalsh(inertia)
    slack = _SLACK * max(abs(I1), abs(I3)) + _LEVER_SLACK * abs(mass) * max(1.0, np.dot(com, com))
    moments = f"one of the principal moments {I1:.3g}, {I2:.3g}, {I3:.3g} kg m²"
    if mass < 0:
        return f"its mass is {mass:.3g} kg"
    if -slack > I1:
        return f"its inertia is indefinite: {moments} is negative"
    if I3 - slack > I1 + I2:
        return f"its inertia breaks the triangle inequality: {moments} exceeds the sum of the others"
    return None
