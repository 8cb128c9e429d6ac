"""What happened in a run: an effect switched, or a function of the user vanished."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final


@final
@dataclass(frozen=True)
class Occurrence:
    """An event of a run.

    Attributes:
        t: When, in [s].
        name: What happened, as "upper stop of panda_joint2 touched" or the name of the user's event.
        direction: 1 where the switching function grows, −1 where it falls.
        q: Position then, n numbers, in [rad] or [m].
        v: Velocity then, in [rad/s] or [m/s].
        joint: The joint that it is of; empty for a user-defined event.
    """

    t: float
    name: str
    direction: int
    q: tuple[float, ...]
    v: tuple[float, ...]
    joint: str = ""
