"""Levels of the state at which an effect switches from one smooth formula to another."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

from robot_dyn.errors import EffectError
from robot_dyn.validate import instance, integer, number, truth

_MOST = 10**6  # joints


@final
@dataclass(frozen=True)
class Threshold:
    """A level of the position or the velocity of a joint.

    Attributes:
        joint: Its index.
        level: In [rad] or [m], or [rad/s] or [m/s].
        name: What it is, as "upper stop".
        rising, falling: What happens where the coordinate grows through it, or falls, as "touched" and "left".
        of_velocity: Whether the velocity passes it.

    Raises:
        EffectError: If an attribute is of another type, or the level is not finite.
    """

    joint: int
    level: float
    name: str
    rising: str
    falling: str
    of_velocity: bool = False

    def __post_init__(self) -> None:
        integer("joint", self.joint, most=_MOST, error=EffectError)
        object.__setattr__(self, "level", number("level", self.level, error=EffectError))
        for name in ("name", "rising", "falling"):
            instance(name, getattr(self, name), str, "give a text", error=EffectError)
        truth("of_velocity", self.of_velocity, error=EffectError)
