"""The torque of each joint by cause for the page: integer multiples of a step, at samples of a run."""

from __future__ import annotations

from math import isfinite
from typing import Any

import numpy as np

from robot_dyn.foundations.errors import RobotDynError
from robot_dyn.model.robot import Robot
from robot_dyn.queries.units import unit
from robot_dyn.simulation.results.causes import causes_of
from robot_dyn.simulation.results.run_data import TrajectoryData
from robot_dyn.view.series import effort_limits

_MAX = 2000  # samples; more than the pixels of any slider
_STEPS = 32767  # largest 16-bit integer, for the largest torque of a joint


def causes(run: TrajectoryData, robot: Robot) -> dict[str, Any] | None:
    """Return the entry `causes` of the document of a run; None if its torques cannot be split."""
    try:
        split = causes_of(run)
    except RobotDynError:
        return None
    parts = np.stack([*split.torques.values(), split.tau])
    known = np.flatnonzero(np.isfinite(parts).all(axis=(0, 2)))
    if not len(known):
        return None
    at = known[np.unique(np.linspace(0, len(known) - 1, min(len(known), _MAX)).round().astype(int))]
    limits = effort_limits(run, robot.effort_limit)
    of_joints = zip(split.joints, split.types, limits, np.moveaxis(parts[:, at], 2, 0), strict=True)
    return {"t": split.t[at], "names": list(split.torques), "joints": [_joint(*columns) for columns in of_joints]}


def resolution(entry: dict[str, Any]) -> str:
    """Return a note on the resolution of the torques by cause in time and value."""
    return (
        f"torques by cause are those of the latest of {len(entry['t'])} samples, rounded to 1/{2 * _STEPS} of the"
        " largest torque of the joint"
    )


def _joint(name: str, kind: str | None, limit: float, parts: np.ndarray) -> dict[str, Any]:
    """Return the entry of a joint with its torques (c + 1, k), those of the causes and their sum."""
    step = float(np.abs(parts).max()) / _STEPS or 1.0
    extent = max(float(parts[:-1].clip(0.0).sum(axis=0).max()), float((-parts[:-1]).clip(0.0).sum(axis=0).max()))
    return {
        "name": name,
        "unit": unit("tau", kind),
        "limit": limit if isfinite(limit) and limit > 0 else None,
        "extent": extent,
        "step": step,
        "values": (parts / step).round().astype(np.int16),
    }
