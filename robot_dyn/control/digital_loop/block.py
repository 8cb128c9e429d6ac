"""Blocks of a sampled loop: y = output(x, s), s⁺ = next(x, s) at each tick, for a signal x with one entry per joint.

This module holds the base class and the blocks with one-line equations: quantisation, noise, rate limit, differences.

[Åström, Wittenmark, Computer-Controlled Systems, 3rd ed., 1997, ch. 1; Franklin, Powell, Workman, Digital Control of
Dynamic Systems, 3rd ed., 1998, ch. 1]
"""

from __future__ import annotations

import re
from abc import ABC, abstractmethod
from dataclasses import dataclass, field
from typing import ClassVar, final

import numpy as np

from robot_dyn.foundations.arithmetic import Array
from robot_dyn.foundations.coefficients import CoefficientField, check_coefficients, coefficient
from robot_dyn.foundations.errors import ControlError
from robot_dyn.foundations.values import Value

SIGNAL = "signal"  # placeholder in a unit: rad, rad/s or N m, depending on the line of the block


class Block(Value, ABC):
    """A discrete-time block of a loop, y = output(x, s), s⁺ = next(x, s).

    To write one, define

        def output(self, x, s, period_s): ...          # y, (n,), in the unit of x
        def next_state(self, x, s, period_s): ...      # s⁺, (state_size(n),)

    and `state_size`; the last two are not needed without states. The methods are pure functions, called at ticks with

        x: signal, (n,), in [rad], [rad/s] or [N m], or [m], [m/s] or [N], depending on line and joint
        s: states of the block, (state_size(n),)
        period_s: period of the loop, in [s]

    and with symbols instead of numbers when the block is compiled; see `Controller`.

    Attributes:
        term: Equation in short form.
        linear: True if the block affects small signals; otherwise linearised loops omit it.
        rounds: True if the output may jump where the input does not.
        random: True if the states are standard normal deviates, redrawn at each tick.
        differentiates: True if it derives the velocity from the measured position, as the first velocity block.
    """

    term: ClassVar[str] = ""
    linear: ClassVar[bool] = True
    rounds: ClassVar[bool] = False
    random: ClassVar[bool] = False
    differentiates: ClassVar[bool] = False

    def __post_init__(self) -> None:
        check_coefficients(self, ControlError)

    @property
    def name(self) -> str:
        """Name in sweeps and scenes."""
        return name_of(type(self))

    def check(self, period_s: float) -> None:
        """Raise a ControlError if the block is not defined for a period."""

    def state_size(self, n: int) -> int:
        """Return the number of states for a signal of n entries."""
        return 0

    def start(self, x: Array, period_s: float) -> Array:
        """Return the states in the steady state of a constant signal x, (state_size(n),)."""
        return x[:0]

    @abstractmethod
    def output(self, x: Array, s: Array, period_s: float) -> Array:
        """Return the output signal, (n,)."""

    def next_state(self, x: Array, s: Array, period_s: float) -> Array:
        """Return the states after the tick, (state_size(n),)."""
        return s


def name_of(kind: type[Block]) -> str:
    """Return the name of a class of blocks in snake case, such as "low_pass"."""
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", kind.__name__).lower()


@final
@dataclass(frozen=True, eq=False)
class Quantisation(Block):
    """Rounding to the nearest multiple of a resolution, as in an encoder or a converter: y = Δ ⌊x/Δ + ½⌋.

    Attributes:
        resolution: Δ, a scalar or (n,), in the unit of the signal, positive.
    """

    term = "y = Δ ⌊x/Δ + ½⌋"
    linear, rounds = False, True

    resolution: CoefficientField = field(metadata=coefficient(SIGNAL, symbol="Δ", exclusive_minimum=0))

    def output(self, x: Array, s: Array, period_s: float) -> Array:
        return self.resolution * np.floor(x / self.resolution + 0.5)


@final
@dataclass(frozen=True, eq=False)
class Noise(Block):
    """Normal noise, independent from tick to tick and from joint to joint: y = x + σ ξ.

    Attributes:
        deviation: σ, the standard deviation, a scalar or (n,), in the unit of the signal, not negative.
    """

    # the time loop draws the deviates ξ from the counter (seed, run, tick, channel)
    term = "y = x + σ ξ"
    linear, rounds, random = False, False, True

    deviation: CoefficientField = field(metadata=coefficient(SIGNAL, symbol="σ", minimum=0))

    def state_size(self, n: int) -> int:
        return n

    def output(self, x: Array, s: Array, period_s: float) -> Array:
        return x + self.deviation * s


@final
@dataclass(frozen=True, eq=False)
class RateLimit(Block):
    """Limit on the change of a signal per period T: y_k = y_{k−1} + min(max(x_k − y_{k−1}, −r T), r T).

    Torques start at 0.

    Attributes:
        rate: r, a scalar or (n,), in the unit of the signal per [s], positive.
    """

    term = "y = y₋ + sat(x − y₋, r T)"
    linear, rounds = False, False

    rate: CoefficientField = field(metadata=coefficient(f"{SIGNAL}/s", symbol="r", exclusive_minimum=0))

    def state_size(self, n: int) -> int:
        return n

    def start(self, x: Array, period_s: float) -> Array:
        return x

    def output(self, x: Array, s: Array, period_s: float) -> Array:
        most = self.rate * period_s
        return s + np.minimum(np.maximum(x - s, -most), most)

    def next_state(self, x: Array, s: Array, period_s: float) -> Array:
        return self.output(x, s, period_s)


@final
@dataclass(frozen=True, eq=False)
class Differences(Block):
    """Backward difference of a signal over the period T: y_k = (x_k − x_{k−1}) / T.

    The output is 0 at the first tick. As the first velocity block of a `Loop`, its input is the output of the position
    blocks. For a quantised position, the output is a multiple of Δ/T.
    """

    term = "y = (x − x₋)/T"
    rounds, differentiates = False, True

    def state_size(self, n: int) -> int:
        return n

    def start(self, x: Array, period_s: float) -> Array:
        return x

    def output(self, x: Array, s: Array, period_s: float) -> Array:
        return (x - s) / period_s

    def next_state(self, x: Array, s: Array, period_s: float) -> Array:
        return x
