"""What a controller is: τ = τ(t, q, v, z), with a memory ż = rate(t, q, v, z) where it needs one.

The memory is a state like q and v: a continuous controller (`period_s` 0) has it integrated with the plant, a sampled
one takes z⁺ = z + period · rate at its ticks and holds its torque between them. [Siciliano et al. 2009, ch. 8]
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any

import numpy as np

from robot_dyn.arithmetic import Array
from robot_dyn.errors import RobotDynError


class ControlError(RobotDynError):
    """A controller or reference with values that are not allowed, or of the wrong shape."""


class Controller(ABC):
    """A control law: a pure function of time, state and memory. Subclass `Memoryless` if it has no memory.

    Attributes:
        period_s: Time between samples in [s], with the torque constant between them; 0 for continuous control.
    """

    period_s: float

    @property
    @abstractmethod
    def n(self) -> int:
        """Number of joints it drives."""

    @property
    @abstractmethod
    def memory_size(self) -> int:
        """Number of states in the memory z, which starts at zero."""

    @property
    def knots(self) -> tuple[float, ...]:
        """Times in [s] at which its reference passes to another polynomial: a step of integration ends there."""
        reference = getattr(self, "reference", None)
        return () if reference is None else tuple(reference.knots.tolist())

    @abstractmethod
    def torque(self, t: float, q: Array, v: Array, z: Array) -> Array:
        """Torque it asks of the joints, shape (n,), in [N m] or [N]; z has shape (memory_size,)."""

    @abstractmethod
    def memory_rate(self, t: float, q: Array, v: Array, z: Array) -> Array:
        """Rate ż of the memory, shape (memory_size,)."""

    def next_memory(self, t: float, q: Array, v: Array, z: Array) -> Array:
        """Memory of a sampled controller after its tick at t: z⁺ = z + period · ż, shape (memory_size,)."""
        return z + self.period_s * self.memory_rate(t, q, v, z)


class Memoryless(Controller):
    """A controller whose torque depends on time and state alone."""

    @property
    def memory_size(self) -> int:
        return 0

    def memory_rate(self, t: float, q: Array, v: Array, z: Array) -> Array:
        return z


def numbers(name: str, values: Any, *shapes: tuple[int | str, ...]) -> np.ndarray:
    """Finite numbers of one of the shapes, copied and frozen; a length with a name such as "n" may be any but 0.

    Raises:
        ControlError: If they are anything else.
    """
    try:
        array = np.array(values, dtype=float)
    except (TypeError, ValueError):
        raise ControlError(f"{name} must be an array of numbers, got {values!r}") from None
    if not any(_fits(array.shape, shape) for shape in shapes):
        wanted = " or ".join(str(shape).replace("'", "") for shape in shapes)
        raise ControlError(f"{name} must have shape {wanted}, got {array.shape}")
    if not np.isfinite(array).all():
        raise ControlError(f"{name} must be finite, got {values!r}")
    array.setflags(write=False)
    return array


def _fits(shape: tuple[int, ...], wanted: tuple[int | str, ...]) -> bool:
    """Whether lengths are as wanted."""
    if len(shape) != len(wanted):
        return False
    return all(a > 0 if isinstance(b, str) else a == b for a, b in zip(shape, wanted, strict=True))


def positive(name: str, value: Any) -> float:
    """A positive number; ControlError if it is none."""
    number = float(numbers(name, value, ()))
    if not number > 0:
        raise ControlError(f"{name} must be positive, got {number}")
    return number


def gain(name: str, values: Any, *shapes: tuple[int | str, ...]) -> np.ndarray:
    """Numbers that are not negative, a scalar or of one of the shapes, frozen; ControlError if they are none."""
    array = numbers(name, values, (), *shapes)
    if (array < 0).any():
        raise ControlError(f"{name} must not be negative, got {values!r}")
    return array


def freeze(controller: Controller, n: int, *gains: str) -> None:
    """Check the period and the named gains of a controller under construction, and freeze them.

    Raises:
        ControlError: If one is negative, not finite or of the wrong shape.
    """
    for name in gains:
        object.__setattr__(controller, name, gain(name, getattr(controller, name), (n,)))
    object.__setattr__(controller, "period_s", float(gain("period_s", controller.period_s)))
