"""Losses of gears: the torque of motors at the joint, for a torque through the gear with an efficiency η.

    τ_motor = J a + (τ − J a) η^−s,   s = sign((τ − J a) v)

τ − J a is the torque through the gear: τ of the joint without the rotor, which turns before the gear. A motor that
drives (s = 1) also supplies the loss; one that is driven back (s = −1) is relieved by it. At rest, s = 0: friction of
the gear may help or hinder, and the motor is taken to hold the whole torque.

[Siciliano et al. 2009, sec. 5.2]
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, final

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

    def of(self, joints: Any) -> Gear:
        """Return the gears of joints, by index."""
        return Gear(self.efficiency[joints], self.rotor[joints])

    def factor(self, tau: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
        """Return η^−s, (..., n), for torques of joints or of motors: τ − J a has the same sign on both sides."""
        direction = np.where(np.abs(v) < _REST, 0.0, np.sign(v))
        return self.efficiency ** -(np.sign(tau - self.rotor * a) * direction)

    def loss(self, tau: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
        """Return τ_motor − τ at velocities v and accelerations a, (..., n)."""
        return (tau - self.rotor * a) * (self.factor(tau, v, a) - 1)

    def at_joint(self, tau_motor: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
        """Return τ for torques of motors, (..., n), which it increases with; infinite for infinite ones."""
        through = tau_motor - self.rotor * a
        return self.rotor * a + through / self.factor(tau_motor, v, a)


def with_loss(split: Causes, gear: Gear | None, v: np.ndarray, a: np.ndarray) -> Causes:
    """Return the torques of motors by cause, with the loss of gears as a cause."""
    if gear is None:
        return split
    loss = gear.loss(split.tau, v, a)
    return replace(split, tau=split.tau + loss, torques={**split.torques, LOSS: loss})
