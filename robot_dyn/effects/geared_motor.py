"""Base class of geared drives: the driven joints, and the rotor inertia reflected through the gear, n² J."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar, Self

import numpy as np

from robot_dyn.effects.effect import Drive
from robot_dyn.foundations.arithmetic import Array
from robot_dyn.foundations.coefficients import CoefficientField, OptionalCoefficientField, with_values
from robot_dyn.foundations.errors import EffectError
from robot_dyn.queries.dynamics import Dynamics


class GearedMotor(Drive):
    """Geared motors, one for each joint at which the coefficient named by `through` is positive.

    Attributes:
        inertia: J of the rotor, a scalar or (n,).
        ratio: n of the gear, a scalar or (n,); None for 1.
        joints: Indices of the driven joints; None outside a plant.
        through: Name of the coefficient that couples a motor to its joint.
    """

    inertia: CoefficientField
    ratio: OptionalCoefficientField
    joints: tuple[int, ...] | None
    through: ClassVar[str]

    def on(self, dynamics: Dynamics) -> Self:
        resolved: Any = super().on(dynamics)
        driven = np.flatnonzero(np.broadcast_to(getattr(resolved, self.through), dynamics.n) > 0)
        if not len(driven):
            raise EffectError(
                f"{self.name}: {self.through} is 0 for all joints; give a positive value, or remove the effect"
            )
        return with_values(resolved, {"joints": tuple(driven.tolist())})

    @property
    def _driven(self) -> list[int]:
        if self.joints is None:
            raise EffectError(
                f"{self.name}: the driven joints are determined by a plant; use rd.Plant(robot, [effect])"
            )
        return list(self.joints)

    def driven(self, n: int) -> Sequence[int]:
        return self._driven

    def per_joint(self, name: str, n: int) -> Array:
        """Return the values of a coefficient at the driven joints, (k,)."""
        return np.broadcast_to(getattr(self, name), (n,), subok=True)[self._driven]

    def reflected(self, n: int) -> Array:
        """Return the rotor inertia reflected through the gear, n² J, (k,)."""
        J = self.per_joint("inertia", n)
        return J if self.ratio is None else self.per_joint("ratio", n) ** 2 * J
