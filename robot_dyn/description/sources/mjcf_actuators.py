"""Contributions of the actuators of an MJCF file to its joints: force limits, and armature and damping times gear².

    τ_joint = gear · force

Servos and other control laws belong to a controller and are left out.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, final

import numpy as np


@final
@dataclass(frozen=True)
class Actuators:
    """Actuators of a compiled model.

    Attributes:
        mujoco: The module `mujoco`.
        model: The `MjModel`.
    """

    mujoco: Any
    model: Any

    def at(self, joint: int) -> list[int]:
        """Return the actuators that act at a joint."""
        model, kinds = self.model, self.mujoco.mjtTrn
        types = (int(kinds.mjTRN_JOINT), int(kinds.mjTRN_JOINTINPARENT))
        return [
            a for a in range(model.nu) if model.actuator_trntype[a] in types and model.actuator_trnid[a, 0] == joint
        ]

    def stated(self, quantity: str) -> np.ndarray:
        """Return armature, damping or another value of each actuator; zeros before MuJoCo 4."""
        return getattr(self.model, f"actuator_{quantity}", np.zeros(self.model.nu))

    def added(self, quantity: str, joint: int) -> float:
        """Return the actuators' armature or damping at a joint, Σ gear² · value."""
        return sum(float(self.model.actuator_gear[a, 0]) ** 2 * float(self.stated(quantity)[a]) for a in self.at(joint))

    def not_at_joints(self, quantity: str) -> bool:
        """Return True if an actuator of a tendon, a site or a body has armature or damping."""
        others = {*range(self.model.nu)}.difference(*map(self.at, range(self.model.njnt)))
        return any(bool(self.stated(quantity)[a]) for a in others)

    def range(self, joint: int) -> tuple[float, float] | None:
        """Return the least and greatest torque or force at a joint; None if unlimited."""
        model, ranges = self.model, []
        if model.jnt_actfrclimited[joint]:
            ranges.append(tuple(map(float, model.jnt_actfrcrange[joint])))
        forces = [self._range(a) for a in self.at(joint)]
        if forces and None not in forces:
            ranges.append(tuple(map(sum, zip(*forces, strict=True))))  # pyright: ignore[reportArgumentType]
        return (max(low for low, _ in ranges), min(high for _, high in ranges)) if ranges else None

    def _range(self, actuator: int) -> tuple[float, float] | None:
        """Return an actuator's force range, or the control range of a motor; None if unlimited."""
        model, gear = self.model, float(self.model.actuator_gear[actuator, 0])
        motor = model.actuator_biastype[actuator] == int(self.mujoco.mjtBias.mjBIAS_NONE)
        motor = motor and model.actuator_dyntype[actuator] == int(self.mujoco.mjtDyn.mjDYN_NONE)
        if model.actuator_forcelimited[actuator]:
            ends = model.actuator_forcerange[actuator] * gear
        elif motor and model.actuator_ctrllimited[actuator]:
            ends = model.actuator_ctrlrange[actuator] * model.actuator_gainprm[actuator, 0] * gear
        else:
            return None
        return float(min(ends)), float(max(ends))
