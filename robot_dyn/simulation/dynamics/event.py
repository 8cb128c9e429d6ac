"""Events: a function of the user that a run watches, and what happened in a run."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from inspect import signature
from typing import Any, final

from robot_dyn.foundations.errors import QueryError, shown
from robot_dyn.foundations.validate import instance, truth

_DIRECTIONS = (-1, 0, 1)


@final
@dataclass(frozen=True, eq=False)
class Event:
    """A user-defined event: g(t, q, v) = 0.

    A step of integration ends there. Within a step g is evaluated at its eighths on the dense output, and its least
    value near 0 is searched, so that g may pass 0 twice between two of them; two minima there may be missed.

    Attributes:
        function: g, a function of (t, q, v) that returns a number.
        direction: 1 if only growing g counts, −1 if only falling g does, 0 for both.
        terminal: Whether the run ends there.
        name: For messages; that of the function unless given.

    Raises:
        QueryError: If the function does not take three arguments, or an option is not allowed.
    """

    function: Callable[[Any, Any, Any], Any] = field(repr=False)
    direction: int = 0
    terminal: bool = False
    name: str = ""

    def __post_init__(self) -> None:
        if not callable(self.function):
            raise QueryError(f"function: give one of (t, q, v), got {shown(self.function)}")
        if type(self.direction) is not int or self.direction not in _DIRECTIONS:
            raise QueryError(f"direction must be -1, 0 or 1, got {shown(self.direction)}")
        truth("terminal", self.terminal)
        instance("name", self.name, str, "give a text")
        try:
            signature(self.function).bind(0.0, None, None)
        except TypeError:
            raise QueryError(f"event {self.function!r}: give a function of (t, q, v)") from None
        except ValueError:  # of some functions written in C the arguments are not known
            pass
        if not self.name:
            object.__setattr__(self, "name", getattr(self.function, "__name__", type(self.function).__name__))


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
