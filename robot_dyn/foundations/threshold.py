"""Levels at which an effect, or a controller, switches between smooth formulas, and layers within which it bends."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

from robot_dyn.foundations.errors import EffectError
from robot_dyn.foundations.validate import instance, integer, number, truth

_MOST = 10**6  # joints


@final
@dataclass(frozen=True)
class Threshold:
    """A level of the position or the velocity of a joint, or of its actuation.

    Attributes:
        joint: Its index.
        level: In [rad] or [m], [rad/s] or [m/s], or [N m] or [N].
        name: What it is, as "upper stop".
        rising, falling: What happens where the coordinate grows through it, or falls, as "touched" and "left".
        of_velocity: Whether the velocity passes it.
        of_actuation: Whether the actuation passes it: what reaches a bound, or what a controller asks for.
        state: Index of the state of the effect that passes it, in place of a coordinate of the joint; None for none.
        slack: By how much a position or a velocity passes it before that counts, in its unit; no less than rounding.

    Raises:
        EffectError: If an attribute is of another type, the level is not finite, or it is of both.
    """

    joint: int
    level: float
    name: str
    rising: str
    falling: str
    of_velocity: bool = False
    of_actuation: bool = False
    slack: float = 0.0
    state: int | None = None

    def __post_init__(self) -> None:
        integer("joint", self.joint, most=_MOST, error=EffectError)
        object.__setattr__(self, "level", number("level", self.level, error=EffectError))
        object.__setattr__(self, "slack", number("slack", self.slack, least=0, error=EffectError))
        if self.state is not None:
            integer("state", self.state, most=_MOST, error=EffectError)
        for name in ("name", "rising", "falling"):
            instance(name, getattr(self, name), str, "give a text", error=EffectError)
        for name in ("of_velocity", "of_actuation"):
            truth(name, getattr(self, name), error=EffectError)
        if self.of_velocity + self.of_actuation + (self.state is not None) > 1:
            raise EffectError(f"{self.name}: a threshold is of the velocity, the actuation or a state, not of both")

    @property
    def own(self) -> bool:
        """Whether it is of what belongs to its effect, and of no coordinate, which effects share."""
        return self.of_actuation or self.state is not None


@final
@dataclass(frozen=True)
class Layer:
    """A range of a coordinate of a joint, or of a state of an effect, over which a smooth formula bends.

    Attributes:
        joint: Index of the joint.
        width: Change of the coordinate over which the formula bends, positive, in its unit.
        level: The middle of the layer, in the unit of the coordinate; None if the formula bends everywhere.
        of_velocity: True for a layer of the velocity of the joint.
        state: Index of the state of the effect that passes the layer; None for a coordinate of the joint.

    Raises:
        EffectError: If an attribute has another type, the width is not positive, or the layer has two coordinates.
    """

    joint: int
    width: float
    level: float | None = 0.0
    of_velocity: bool = False
    state: int | None = None

    def __post_init__(self) -> None:
        integer("joint", self.joint, most=_MOST, error=EffectError)
        object.__setattr__(self, "width", number("width", self.width, above=0, error=EffectError))
        if self.level is not None:
            object.__setattr__(self, "level", number("level", self.level, error=EffectError))
        if self.state is not None:
            integer("state", self.state, most=_MOST, error=EffectError)
        truth("of_velocity", self.of_velocity, error=EffectError)
        if self.of_velocity and self.state is not None:
            raise EffectError("a layer is of the velocity of a joint or of a state, not of both")


def smooth(self: object, n: int = 0) -> tuple[Threshold, ...]:
    """No thresholds: with `thresholds = smooth` a class declares that its formulas are smooth everywhere."""
    return ()
