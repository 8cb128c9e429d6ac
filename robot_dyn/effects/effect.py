"""What an effect is: a torque τ_effect(t, q, v) exerted on the joints, so that N = ∂V/∂q − Σ τ_effect.

Its class says what it does to the energy, and a contract test holds it to that. An effect that a plant does not name
is not evaluated at all.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

import numpy as np

from robot_dyn.arithmetic import Array
from robot_dyn.errors import EffectError
from robot_dyn.model.dynamics import Dynamics


class Effect(ABC):
    """A torque on the joints besides actuation and gravity. Subclass one of the three kinds below."""

    @abstractmethod
    def torque(self, dynamics: Dynamics, t: float, q: Array, v: Array) -> Array:
        """The torque this effect exerts on the joints, shape (..., n), in [N m] or [N]."""


class Conservative(Effect):
    """An effect with a potential: torque = −∂E/∂q."""

    @abstractmethod
    def potential(self, dynamics: Dynamics, t: float, q: Array) -> Array:
        """Its energy E(q), shape (...), in [J]."""


class Dissipative(Effect):
    """An effect that only takes energy: torqueᵀ v ≤ 0."""


class Active(Effect):
    """An effect whose power has no sign."""


def coefficient(name: str, values: Any) -> np.ndarray:
    """A coefficient that is not negative: a scalar or (n,), frozen.

    Raises:
        EffectError: If it is anything else.
    """
    try:
        array = np.array(values, dtype=float)
    except (TypeError, ValueError):
        raise EffectError(f"{name} must be a number or one for each joint, got {values!r}") from None
    if array.ndim > 1 or not np.isfinite(array).all() or (array < 0).any():
        raise EffectError(f"{name} must be finite and not negative, a scalar or (n,), got {values!r}")
    array.setflags(write=False)
    return array
