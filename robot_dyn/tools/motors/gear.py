"""Losses of gears: the torque of motors at the joint, for a torque through the gear with an efficiency η.

    τ_motor = J a + (τ − J a) η^−s,   s = sign((τ − J a) v)

τ − J a is the torque through the gear: τ of the joint without the rotor, which turns before the gear. A motor that
drives (s = 1) also supplies the loss; one that is driven back (s = −1) is relieved by it. At rest, s = 0: friction of
the gear may help or hinder, and the motor is taken to hold the whole torque.

[Siciliano et al. 2009, sec. 5.2]
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import final

import numpy as np

from robot_dyn.effects import Causes

_REST = 1e-6  # [rad/s] or [m/s]: slower is rest; planned velocities at rest differ from 0 by rounding
LOSS = "gear loss"
"""Cause of the torque that the gears take."""


@final
@dataclass(frozen=True, eq=False)
class Gear:
    """The gears of n joints.

    Attributes:
        efficiency: η, (n,), above 0 and at most 1.
        rotor: Inertia J of the rotors at the joints, (n,), in [kg m²] or [kg].
    """

    efficiency: np.ndarray
    rotor: np.ndarray

    def loss(self, tau: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
        """Return τ_motor − τ at velocities v and accelerations a, (..., n)."""
        through, direction = tau - self.rotor * a, np.where(np.abs(v) < _REST, 0.0, np.sign(v))
        return through * (self.efficiency ** -(np.sign(through) * direction) - 1)


def with_loss(split: Causes, gear: Gear | None, v: np.ndarray, a: np.ndarray) -> Causes:
    """Return the torques of motors by cause, with the loss of gears as a cause."""
    if gear is None:
        return split
    loss = gear.loss(split.tau, v, a)
    return replace(split, tau=split.tau + loss, torques={**split.torques, LOSS: loss})
