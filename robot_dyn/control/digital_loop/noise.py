"""White noise: y_k = x_k + σ ξ_k, with standard normal deviates ξ of the counter (seed, run, tick, channel).

The deviates are drawn by the time loop of a run, which knows the tick; see `robot_dyn.simulation.run.philox`.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, final

from robot_dyn.arithmetic import Array
from robot_dyn.coefficients import coefficient
from robot_dyn.control.digital_loop.block import SIGNAL, Block


@final
@dataclass(frozen=True, eq=False)
class Noise(Block):
    """Normal noise, independent from tick to tick and from joint to joint: y = x + σ ξ.

    Attributes:
        deviation: σ, the standard deviation, a scalar or (n,), in the unit of the signal, not negative.
    """

    term = "y = x + σ ξ"
    linear, rounds, random = False, False, True

    deviation: Any = field(metadata=coefficient(SIGNAL, symbol="σ", least=0))

    def state_size(self, n: int) -> int:
        return n

    def output(self, x: Array, s: Array, period_s: float) -> Array:
        return x + self.deviation * s
