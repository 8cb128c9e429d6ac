"""Levels of the state at which an effect switches from one smooth formula to another."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final


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
    """

    joint: int
    level: float
    name: str
    rising: str
    falling: str
    of_velocity: bool = False
