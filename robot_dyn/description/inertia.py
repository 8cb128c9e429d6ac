"""Mass distribution of a rigid body: I = ∫ ρ r̂ᵀ r̂ dx about the centre of mass, and whether any body can have it.

A body exists exactly if m ≥ 0 and the principal moments are not negative and obey I₁ + I₂ ≥ I₃.
[Wensing, Kim, Slotine, Linear Matrix Inequalities for Physically Consistent Inertial Parameter Identification, 2018]
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, final

import numpy as np

from robot_dyn.foundations.errors import QueryError
from robot_dyn.foundations.spatial import hat, spatial_inertia
from robot_dyn.foundations.validate import number, numbers, rows

_SLACK = 1e-9  # of the largest moment: printed digits
_LEVER_SLACK = 1e-12  # of m c², and of m (1 m)²: rounding left behind by merging bodies
_ROTATION_SLACK = 1e-6  # of RᵀR − 1: what integrating R leaves behind


def rotation_matrix(R: Any) -> np.ndarray:
    """R as float64 of shape (..., 3, 3); raises QueryError if it is not a rotation: RᵀR = 1, det R = 1."""
    array = rows("R", R, 3, 3)
    with np.errstate(over="ignore", invalid="ignore"):
        off = np.abs(np.swapaxes(array, -1, -2) @ array - np.eye(3)).max(initial=0)
    if not off <= _ROTATION_SLACK or np.any(np.linalg.det(array) < 0):
        raise QueryError(f"R must be a rotation, RᵀR = 1 and det R = 1; RᵀR − 1 has an entry of {off:.3g}")
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
        QueryError: If a shape is wrong, a value is not finite, or no body has these properties.

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
            raise QueryError(f"no body has these mass properties: {why}")
        object.__setattr__(self, "mass", mass)
        for name, array in (("com", com.copy()), ("inertia", (inertia + inertia.T) / 2)):
            array.setflags(write=False)
            object.__setattr__(self, name, array)

    def moved(self, R: Any, p: Any) -> MassProperties:
        """The same body seen from a frame in which its own frame has the placement g = (R, p).

            c' = R c + p,   I' = R I Rᵀ

        Args:
            R: Rotation, shape (3, 3).
            p: Origin of the body's frame, shape (3,), in [m].

        Raises:
            QueryError: If R is not a rotation, or a shape is wrong.
        """
        R, p = rotation_matrix(R), numbers("p", p, (3,))
        return MassProperties(self.mass, R @ self.com + p, R @ self.inertia @ R.T)

    def about(self, point: Any) -> np.ndarray:
        """Rotational inertia about a point of the body's frame, I + m d̂ᵀ d̂ with d = c − point; (3, 3), [kg m²].

        Source: the parallel-axis theorem; Featherstone 2008, §2.13.
        """
        d = hat(self.com - numbers("point", point, (3,)))
        return self.inertia + self.mass * d.T @ d

    @property
    def spatial(self) -> np.ndarray:
        """𝓜 of ½ Vᵀ 𝓜 V in the body's frame, twists linear first, shape (6, 6)."""
        return spatial_inertia(self.mass, self.com, self.inertia)


def combined(bodies: Iterable[MassProperties]) -> MassProperties:
    """Bodies of one frame, rigidly joined: m = Σ mᵢ, c = Σ mᵢ cᵢ / m, I = Σ Iᵢ + mᵢ d̂ᵢᵀ d̂ᵢ with dᵢ = cᵢ − c.

    Raises:
        QueryError: If there are none.
    """
    bodies = list(bodies)
    if not bodies:
        raise QueryError("no bodies to combine; give one at least")
    mass = sum(body.mass for body in bodies)
    com = sum((body.mass / mass * body.com for body in bodies), np.zeros(3))
    return MassProperties(mass, com, sum((body.about(com) for body in bodies), np.zeros((3, 3))))


def implausibility(mass: float, com: Any, inertia: Any) -> str | None:
    """Why no body has this mass and rotational inertia about its centre of mass, or None if one has.

    Args:
        mass: In [kg].
        com: Centre of mass in the frame where bodies were merged, shape (3,), in [m].
        inertia: Symmetric, shape (3, 3), in [kg m²].
    """
    I1, I2, I3 = np.linalg.eigvalsh(inertia)
    slack = _SLACK * max(abs(I1), abs(I3)) + _LEVER_SLACK * abs(mass) * max(1.0, np.dot(com, com))
    moments = f"principal moments {I1:.3g}, {I2:.3g}, {I3:.3g} kg m²"
    if mass < 0:
        return f"its mass is {mass:.3g} kg"
    if -slack > I1:
        return f"its inertia is indefinite ({moments})"
    if I3 - slack > I1 + I2:
        return f"its inertia breaks the triangle inequality ({moments})"
    return None
