"""Blocks of a sampled loop: y = output(x, s), s⁺ = next(x, s) at each tick, of a signal x with one entry a joint.

[Åström, Wittenmark, Computer-Controlled Systems, 3rd ed., 1997, ch. 1; Franklin, Powell, Workman, Digital Control of
Dynamic Systems, 3rd ed., 1998, ch. 1]
"""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from typing import ClassVar

from robot_dyn.arithmetic import Array
from robot_dyn.coefficients import check_coefficients
from robot_dyn.errors import ControlError
from robot_dyn.values import Value

SIGNAL = "signal"  # in a unit: that of the signal, which is rad, rad/s or N m by the line that a block stands in


class Block(Value, ABC):
    """A discrete-time block of a loop, y = output(x, s), s⁺ = next(x, s).

    Its methods are pure functions, called at ticks with

        x: signal, (n,), in [rad], [rad/s] or [N m], or [m], [m/s] or [N], by line and joint
        s: its states, (state_size(n),)
        period_s: of the loop, in [s]

    and with symbols in place of these where they are compiled, as of `Controller`.

    Attributes:
        term: Its equation in a few signs.
        linear: Whether it acts on small signals; one that does not is left out where a loop is linearised.
        rounds: Whether its output jumps where its input does not; a class that does not define it declares nothing.
        random: Whether its states are standard normal deviates, drawn anew at each tick.
    """

    term: ClassVar[str] = ""
    linear: ClassVar[bool] = True
    rounds: ClassVar[bool] = False
    random: ClassVar[bool] = False

    def __post_init__(self) -> None:
        check_coefficients(self, ControlError)

    @property
    def name(self) -> str:
        """Its name in sweeps and scenes."""
        return name_of(type(self))

    def check(self, period_s: float) -> None:
        """ControlError if it has no meaning at a period."""

    def state_size(self, n: int) -> int:
        """Number of its states."""
        return 0

    def start(self, x: Array, period_s: float) -> Array:
        """The states after x at all times, (state_size(n),)."""
        return x[:0]

    @abstractmethod
    def output(self, x: Array, s: Array, period_s: float) -> Array:
        """The signal behind it, (n,)."""

    def next_state(self, x: Array, s: Array, period_s: float) -> Array:
        """Its states after the tick, (state_size(n),)."""
        return s


def name_of(kind: type[Block]) -> str:
    """The name of a class of blocks in small letters, as "low_pass"."""
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", kind.__name__).lower()
