"""The action of a stepper as a controller: a torque that each lane holds for a period."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import final

import numpy as np

from robot_dyn.control import Stateless
from robot_dyn.foundations import Array, coefficient

TORQUE = "torque_of_lane"  # its name as a parameter, which no part of the library has


@final
@dataclass(frozen=True, eq=False)
class HeldTorque(Stateless):
    """A torque τ_a in zero-order hold.

    Attributes:
        torque_of_lane: τ_a, (n,), in [N m] or [N].
        period_s: Time for which it is held, in [s].
    """

    torque_of_lane: np.ndarray = field(metadata=coefficient("N m", symbol="τ_a"))
    period_s: float

    term = "τ_a"

    @property
    def n(self) -> int:
        return len(self.torque_of_lane)

    def torque(self, t: float, q: Array, v: Array, z: Array) -> Array:
        return self.torque_of_lane + 0 * q

    def thresholds(self) -> tuple[()]:
        return ()
