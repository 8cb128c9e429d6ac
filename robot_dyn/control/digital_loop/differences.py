"""Velocity by differences of measured positions: v̂_k = (q̂_k − q̂_{k−1}) / T."""

from __future__ import annotations

from dataclasses import dataclass
from typing import final

from robot_dyn.arithmetic import Array
from robot_dyn.control.digital_loop.block import Block


@final
@dataclass(frozen=True, eq=False)
class Differences(Block):
    """Backward difference of a signal over the period T: y_k = (x_k − x_{k−1}) / T.

    At the first tick it is 0. As the first block of the velocity of a `Loop` it takes the measured position, behind
    all blocks of that. A quantised position makes it a multiple of Δ/T.
    """

    term = "y = (x − x₋)/T"
    rounds = False

    def state_size(self, n: int) -> int:
        return n

    def start(self, x: Array, period_s: float) -> Array:
        return x

    def output(self, x: Array, s: Array, period_s: float) -> Array:
        return (x - s) / period_s

    def next_state(self, x: Array, s: Array, period_s: float) -> Array:
        return x
