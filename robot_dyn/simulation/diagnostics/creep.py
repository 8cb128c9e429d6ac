"""Creep of regularised friction: a load below its level, which dry friction would hold, moves a joint steadily.

v = v_s artanh(τ / f)   under a load τ < f
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from robot_dyn.effects.friction import RegularisedCoulombFriction
from robot_dyn.simulation.observation.remarks import Remark, RemarkKind
from robot_dyn.simulation.setup.setup import Setup

_LAST, _LEAST = 0.1, 5  # part of the run that is looked at, and samples in it
_STEADY = 0.1  # of a velocity, by which it may change there
_LOADED = 0.01, 0.96  # of the level: less is rest, and with more a joint slides


def creeping(setup: Setup, t: np.ndarray, v: np.ndarray, units: list[tuple[str, str, str]]) -> Iterator[Remark]:
    """The joints that creep at the end of a run.

    Args:
        setup: What ran.
        t: Times of its samples, (m,), in [s].
        v: Velocities there, (m, n).
        units: Of q, v and u of each joint.
    """
    late = t >= t[-1] - _LAST * setup.duration_s
    if late.sum() < _LEAST:
        return
    v, start = v[late], float(t[late][0])
    lasted, mean = float(t[-1]) - start, v.mean(axis=0)
    steady = np.ptp(v, axis=0) < _STEADY * np.abs(mean)
    for effect in setup.plant.effects:
        if not isinstance(effect, RegularisedCoulombFriction):
            continue
        level, part = np.broadcast_to(effect.friction, mean.shape), np.abs(np.tanh(mean / effect.velocity_scale))
        for i in np.flatnonzero(steady & (level > 0) & (part > _LOADED[0]) & (part < _LOADED[1])):
            name, (_, of_v, of_u) = setup.plant.dynamics.joint_names[i], units[i]
            text = f"{name} at {mean[i]:.3g} {of_v}, under {part[i] * level[i]:.3g} of {level[i]:.3g} {of_u}"
            yield Remark(
                RemarkKind.CREEPS, name, "v", start, lasted, float(t[-1]), float(mean[i]), None, text,
                "dry_friction would hold what is below its level",
            )  # fmt: skip
