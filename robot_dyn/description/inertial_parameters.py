"""Inertial parameters of a rigid body: θ = (m, m c, I) about the origin of its frame, ten numbers.

    θ = (m, m cx, m cy, m cz, Ixx, Ixy, Iyy, Ixz, Iyz, Izz),   𝓜 = Σ θ_k E_k

Torques are linear in θ: τ = Y(q, v, a) θ + armature · a.
[Atkeson, An, Hollerbach 1986; Siciliano et al. 2009, §7.2.2]
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Protocol

import numpy as np

from robot_dyn.foundations.arithmetic import Array
from robot_dyn.foundations.spatial import first_moment, hat

NAMES = ("m", "m cx", "m cy", "m cz", "Ixx", "Ixy", "Iyy", "Ixz", "Iyz", "Izz")
_MOMENTS = (0, 0, 1, 0, 1, 2), (0, 1, 1, 2, 2, 2)  # rows and columns of I


class Parametrised(Protocol):
    """A robot whose torques are linear in the inertial parameters of its bodies."""

    @property
    def body_names(self) -> tuple[str, ...]:
        """Names of the joints that carry the N bodies, in the order of the parameters.

        They are `joint_names`, then the names of coupled joints, sorted. Links without relative motion form one body.
        """
        ...

    @property
    def inertial_parameters(self) -> Array:
        """Parameters θ of the N bodies in sequence, (10 N,), in [kg], [kg m] and [kg m²].

        Each body has (m, m cx, m cy, m cz, Ixx, Ixy, Iyy, Ixz, Iyz, Izz) about the origin and along the axes of its
        joint's frame. Payloads and `mass_scale` are included, the armature is not.
        """
        ...


def ordered(joint_names: Sequence[str], moving: Iterable[str]) -> tuple[str, ...]:
    """Return all moving joints in the order of their bodies' parameters: independent joints, then coupled ones."""
    return (*joint_names, *sorted(set(moving) - set(joint_names)))


def parameter_names(body_names: Iterable[str]) -> tuple[str, ...]:
    """Return the name of each parameter, such as "elbow m cx"."""
    return tuple(f"{body} {name}" for body in body_names for name in NAMES)


def parameters(inertia: Array) -> Array:
    """Return θ (10,) of a spatial inertia 𝓜 (6, 6)."""
    return np.concatenate([inertia[:1, 0], first_moment(inertia), inertia[3:, 3:][_MOMENTS]])


def unit_inertias(dtype: np.dtype) -> Array:
    """Return E_k = ∂𝓜/∂θ_k, (10, 6, 6)."""
    E, one = np.zeros((10, 6, 6), dtype=dtype), np.eye(3, dtype=dtype)
    E[0, :3, :3] = one
    E[1:4, 3:, :3], E[1:4, :3, 3:] = hat(one), -hat(one)
    for k, (i, j) in enumerate(zip(*_MOMENTS, strict=True)):
        E[4 + k, 3 + i, 3 + j] = E[4 + k, 3 + j, 3 + i] = one[0, 0]
    return E
