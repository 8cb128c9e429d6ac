"""Quantisation: a signal in whole numbers of a resolution, as of an encoder or of a converter.

y = Δ ⌊x/Δ + ½⌋,   |y − x| ≤ Δ/2
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
class Quantisation(Block):
    """Rounding to the nearest multiple of a resolution: y = Δ ⌊x/Δ + ½⌋.

    Attributes:
        resolution: Δ, a scalar or (n,), in the unit of the signal, positive.
    """

    term = "y = Δ ⌊x/Δ + ½⌋"
    linear, rounds = False, True

    resolution: Any = field(metadata=coefficient(SIGNAL, symbol="Δ", above=0))

    def output(self, x: Array, s: Array, period_s: float) -> Array:
        return self.resolution * np.floor(x / self.resolution + 0.5)
