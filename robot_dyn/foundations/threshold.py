"""Levels at which an effect or controller switches between smooth formulas, and layers in which a formula bends."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

from robot_dyn.foundations.errors import EffectError
from robot_dyn.foundations.validate import instance, integer, number, truth

_MAX = 10**6  # largest index of a joint or a state


@final
@dataclass(frozen=True)
class Threshold:
    """A level of the position, the velocity or the actuation of a joint, or of a state of an effect.

    Attributes:
        joint: Index of the joint.
        level: Level in [rad] or [m], [rad/s] or [m/s], or [N m] or [N].
        name: Name of the level, such as "upper stop".
        rising, falling: Names of the events when the coordinate rises or falls through it, such as "touched", "left".
        of_velocity: True for a level of the velocity.
        of_actuation: True for a level of the actuation before a bound, or of a controller's demand.
        state: Index of the effect's state that passes the level; None for a coordinate of the joint.
        slack: Distance beyond the level that counts as past it; never less than rounding.

    Raises:
        EffectError: If an attribute has another type, the level is not finite, or it is a level of two coordinates.
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
        integer("joint", self.joint, most=_MAX, error=EffectError)
        object.__setattr__(self, "level", number("level", self.level, error=EffectError))
        object.__setattr__(self, "slack", number("slack", self.slack, least=0, error=EffectError))
        if self.state is not None:
            integer("state", self.state, most=_MAX, error=EffectError)
        for name in ("name", "rising", "falling"):
            instance(name, getattr(self, name), str, "give a text", error=EffectError)
        for name in ("of_velocity", "of_actuation"):
            truth(name, getattr(self, name), error=EffectError)
        if self.of_velocity + self.of_actuation + (self.state is not None) > 1:
            raise EffectError(
                f"{self.name}: a threshold has one coordinate; set at most one of of_velocity, of_actuation and state"
            )

    @property
    def own(self) -> bool:
        """True if the level belongs to one effect: to its actuation or a state, not to a shared coordinate."""
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
        integer("joint", self.joint, most=_MAX, error=EffectError)
        object.__setattr__(self, "width", number("width", self.width, above=0, error=EffectError))
        if self.level is not None:
            object.__setattr__(self, "level", number("level", self.level, error=EffectError))
        if self.state is not None:
            integer("state", self.state, most=_MAX, error=EffectError)
        truth("of_velocity", self.of_velocity, error=EffectError)
        if self.of_velocity and self.state is not None:
            raise EffectError("a layer has one coordinate; set at most one of of_velocity and state")


def smooth(self: object, n: int = 0) -> tuple[Threshold, ...]:
    """Return no thresholds: `thresholds = smooth` declares that the formulas of a class are smooth everywhere."""
    return ()
