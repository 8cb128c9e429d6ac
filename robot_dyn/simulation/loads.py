"""Loads that a picture of a run shows: the wrench on each link, F = (f, τ), and the joints that bear on a stop."""

from __future__ import annotations

import numpy as np

from robot_dyn.effects.joint_limit import JointStopSpring
from robot_dyn.effects.plant import Plant
from robot_dyn.effects.wrench import ExternalWrench

_FAR = 1e9  # a run that diverged has samples beyond any placement


def wrenches(plant: Plant, t: np.ndarray, q: np.ndarray) -> dict[str, np.ndarray]:
    """External wrench on each link that has one, in base axes at the link's frame, (m, 6), in [N] and [N m]."""
    total: dict[str, np.ndarray] = {}
    for effect in plant.effects:
        if isinstance(effect, ExternalWrench):
            placement = plant.dynamics.placement(np.clip(np.nan_to_num(q), -_FAR, _FAR), effect.frame)
            acting = (effect.start_s <= t) & (t < effect.end_s)
            F = np.where(acting[:, None], effect.at(placement), 0.0)
            total[effect.frame] = total.get(effect.frame, 0.0) + F
    return total


def at_stop(plant: Plant, q: np.ndarray) -> np.ndarray | None:
    """Whether each joint bears on a stop, (m, n); None without stops."""
    stops = [effect for effect in plant.effects if isinstance(effect, JointStopSpring)]
    if not stops:
        return None
    return np.any([(q < stop.lower) | (q > stop.upper) for stop in stops], axis=0)
