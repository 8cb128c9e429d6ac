"""What an effect is: a torque τ_effect(t, q, v) exerted on the joints, so that N = ∂V/∂q − Σ τ_effect.

Its class says what it does to the energy, and a contract test holds it to that. An effect that a plant does not name
is not evaluated at all.
"""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from typing import Any

import numpy as np

from robot_dyn.arithmetic import FLOAT64, Array
from robot_dyn.errors import EffectError
from robot_dyn.model.dynamics import Dynamics


class Effect:
    """Something that acts on the joints. Subclass one of the four kinds below."""

    @property
    def name(self) -> str:
        """Its name in a scene and in a ledger: that of its class, in small letters."""
        return re.sub(r"(?<!^)(?=[A-Z])", "_", type(self).__name__).lower()

    @property
    def switches(self) -> tuple[float, ...]:
        """Times in [s] at which it starts or stops: a step of integration ends there."""
        return ()


class Force(Effect, ABC):
    """An effect that is a torque on the joints, besides actuation and gravity."""

    @abstractmethod
    def torque(self, dynamics: Dynamics, t: float, q: Array, v: Array) -> Array:
        """The torque this effect exerts on the joints, shape (..., n), in [N m] or [N]."""


class Conservative(Force):
    """An effect with a potential: torque = −∂E/∂q."""

    @abstractmethod
    def potential(self, dynamics: Dynamics, t: float, q: Array) -> Array:
        """Its energy E(q), shape (...), in [J]."""


class Dissipative(Force):
    """An effect that only takes energy: torqueᵀ v ≤ 0."""


class Active(Force):
    """An effect whose power has no sign."""


class Bound(Effect, ABC):
    """An effect that bounds the actuation."""

    @abstractmethod
    def actuation(self, u: Array) -> Array:
        """What is left of the actuation u, (..., n)."""


def coefficient(name: str, values: Any) -> np.ndarray:
    """A coefficient that is not negative: a scalar or (n,), frozen; EffectError if it is anything else."""
    array = number(name, values)
    if (array < 0).any():
        raise EffectError(f"{name} must not be negative, got {values!r}")
    return array


def number(name: str, values: Any, infinite: bool = False) -> np.ndarray:
    """A parameter of any sign: a scalar or (n,), finite unless said, frozen; EffectError if it is anything else."""
    try:
        array = np.array(FLOAT64.asarray(values))
    except (TypeError, ValueError):
        raise EffectError(f"{name} must be a number or one for each joint, got {values!r}") from None
    if array.ndim > 1 or np.isnan(array).any() or not (infinite or np.isfinite(array).all()):
        raise EffectError(f"{name} must be finite, a scalar or (n,), got {values!r}")
    array.setflags(write=False)
    return array
