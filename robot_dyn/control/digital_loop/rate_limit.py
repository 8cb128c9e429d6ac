"""Rate limit: a signal that changes by no more than r T from one tick to the next.

y_k = y_{k−1} + min(max(x_k − y_{k−1}, −r T), r T)
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, final

import numpy as np

from robot_dyn.arithmetic import Array
from robot_dyn.coefficients import coefficient
from robot_dyn.control.digital_loop.block import SIGNAL, Block


@final
@dataclass(frozen=True, eq=False)
class RateLimit(Block):
    """Follows a signal by at most r T in a period T: y_k = y_{k−1} + min(max(x_k − y_{k−1}, −r T), r T).

    Torques start at 0.

    Attributes:
        rate: r, a scalar or (n,), in the unit of the signal per [s], positive.
    """

    term = "y = y₋ + sat(x − y₋, r T)"
    linear, rounds = False, False

    rate: Any = field(metadata=coefficient(f"{SIGNAL}/s", symbol="r", above=0))

    def state_size(self, n: int) -> int:
        return n

    def start(self, x: Array, period_s: float) -> Array:
        return x

    def output(self, x: Array, s: Array, period_s: float) -> Array:
        most = self.rate * period_s
        return s + np.minimum(np.maximum(x - s, -most), most)

    def next_state(self, x: Array, s: Array, period_s: float) -> Array:
        return self.output(x, s, period_s)
