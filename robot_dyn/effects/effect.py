"""What an effect is: a torque τ_effect(t, q, v) exerted on the joints, so that N = ∂V/∂q − Σ τ_effect.

Its class says what it does to the energy, and a contract test holds it to that. An effect that a plant does not name
is not evaluated at all.
"""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import fields, is_dataclass, replace
from math import inf
from typing import Any, ClassVar

import numpy as np

from robot_dyn.arithmetic import Array
from robot_dyn.errors import EffectError, nearest
from robot_dyn.model.dynamics import Dynamics
from robot_dyn.validate import numbers

URDF = "urdf"  # in place of a coefficient: what the robot's file states
_ELSEWHERE = {"limit": np.inf, "lower": -np.inf, "upper": np.inf}  # for joints not named; 0 for other coefficients
_STATED = {"limit": "effort_limit"}  # the attribute of a Robot, where it is not called as that of the effect


class Effect:
    """Something that acts on the joints: a `Force` or a `Bound`; a plant refuses anything else.

    Subclass one of the four kinds below. Its methods are pure functions, called with

        dynamics: the rigid bodies of the plant, a `Dynamics`
        t: time, a number, in [s]
        q: position, (..., n), in [rad] or [m] by joint
        v: velocity, (..., n), in [rad/s] or [m/s]

    and with symbols in place of these numbers where it is compiled: written in `robot_dyn.arithmetic` and NumPy's
    operators it runs in both engines.

    Attributes:
        coefficients: Names of those of its attributes that are one number, or one for each joint.
    """

    coefficients: ClassVar[tuple[str, ...]] = ()

    @property
    def name(self) -> str:
        """Its name in a scene and in a ledger: that of its class, in small letters."""
        return re.sub(r"(?<!^)(?=[A-Z])", "_", type(self).__name__).lower()

    def on(self, dynamics: Any) -> Effect:
        """This effect with coefficients given by joint name, or "urdf", made arrays (n,) of these joints.

        Raises:
            EffectError: If a joint is unknown, no file states the coefficient, or one is of another number of joints.
        """
        for key in self.coefficients:
            values = getattr(self, key)
            if isinstance(values, np.ndarray) and values.ndim and values.shape != (dynamics.n,):
                count = f"{len(values)} joint{'s' if len(values) > 1 else ''}"
                raise EffectError(
                    f"{self.name}: {key} is of {count}, the arm has {dynamics.n}; give one number for all, or one for"
                    " each joint"
                )
        if not is_dataclass(self):
            return self
        named = {field.name: getattr(self, field.name) for field in fields(self) if field.init}
        made = {key: _of(dynamics, key, x) for key, x in named.items() if isinstance(x, Mapping) or x is URDF}
        return replace(self, **made) if made else self

    @property
    def switches(self) -> tuple[float, ...]:
        """Times in [s] at which it starts or stops: a step of integration ends there."""
        return ()

    @property
    def widths(self) -> tuple[Any, Any]:
        """Changes of q and of v over which its torque bends, each a scalar or (n,); inf where it is smooth.

        An implicit method takes its Jacobian from differences inside them.
        """
        return inf, inf


class Force(Effect, ABC):
    """An effect that is a torque on the joints, besides actuation and gravity."""

    @abstractmethod
    def torque(self, dynamics: Dynamics, t: float, q: Array, v: Array) -> Array:
        """The torque this effect exerts on the joints, shape (..., n), in [N m] or [N]."""


class Conservative(Force):
    """An effect with a potential E(t, q), which the energy ledger counts: torque = −∂E/∂q. Contract as of `Effect`."""

    @abstractmethod
    def potential(self, dynamics: Dynamics, t: float, q: Array) -> Array:
        """Its energy E(t, q), shape (...), in [J]."""


class Dissipative(Force):
    """An effect that only takes energy: torqueᵀ v ≤ 0 at all t, q, v. Contract as of `Effect`."""


class Active(Force):
    """An effect whose power torqueᵀ v may have either sign. Contract as of `Effect`."""


class Bound(Effect, ABC):
    """An effect that bounds the actuation, by the order of a plant's effects. Contract as of `Effect`."""

    @abstractmethod
    def actuation(self, u: Array) -> Array:
        """What is left of the actuation u, (..., n), in [N m] or [N]; same shape and unit."""


def coefficient(name: str, values: Any, *, least: float | None = None, infinite: bool = False) -> np.ndarray:
    """A parameter: a scalar or (n,), frozen; EffectError if it is anything else, or less than `least`.

    Values by joint name, and "urdf", stay until the plant that the effect acts on is known.
    """
    if isinstance(values, Mapping):
        if not values:
            raise EffectError(f"{name} names no joint; give values by joint, or one for all")
        return values  # pyright: ignore[reportReturnType]
    if isinstance(values, str) and values == URDF:
        return URDF  # pyright: ignore[reportReturnType]
    return numbers(name, values, (), ("n",), error=EffectError, least=least, infinite=infinite)


def _of(dynamics: Any, key: str, values: Any) -> Any:
    """The n values by joint name, or of what the file states, which must not be nothing."""
    names = dynamics.joint_names
    if values is URDF:
        try:
            stated = getattr(dynamics, _STATED.get(key, key))
        except AttributeError:
            raise EffectError(f"{key}='urdf' needs a Robot, got {type(dynamics).__name__}") from None
        if np.all(stated == _ELSEWHERE.get(key, 0.0)):
            raise EffectError(
                f"{key}='urdf' has no effect: the file of {dynamics.name} states no {key} for any joint; give numbers,"
                " or leave the effect out"
            )
        return stated
    for name in values.keys() - set(names):
        raise EffectError(f"{key}: no joint {name!r}; {nearest(str(name), names)}")
    return [values.get(name, _ELSEWHERE.get(key, 0.0)) for name in names]
