"""The numbers with which a page moves an arm and computes its gravity torque: joints, bodies and couplings.

The recursions are in `web/sliders.js`, in double precision: g = Π gᵢ exp(ξ̂ᵢ qᵢ) and τ = Sᵀ ∂V/∂q_full, from the mass
and the first moment that each joint carries. [Murray, Li, Sastry 1994, ch. 3 and 4]
"""

from __future__ import annotations

from math import isfinite, pi
from typing import Any

import numpy as np

from robot_dyn.foundations.spatial import first_moment
from robot_dyn.queries.units import unit
from robot_dyn.view.stage import Stage

_TURN, _SLIDE = pi, 1.0  # [rad], [m]; range of sliders of joints without limits


def sliders(stage: Stage, q: np.ndarray) -> dict[str, Any]:
    """Return the entry `sliders` of the document of a robot shown at q (n,)."""
    robot, linkage = stage.robot, stage.linkage
    of_joints = zip(robot.joint_names, robot.joint_types, q, robot.lower, robot.upper, robot.effort_limit, strict=True)
    of_bodies = zip(linkage.bodies, linkage.inertias, stage.paths, strict=True)
    return {
        "joints": [_joint(*columns) for columns in of_joints],
        "bodies": [
            {
                "path": path,
                "parent": body.parent,
                "revolute": body.revolute,
                "R": body.pose.R.ravel().tolist(),
                "p": body.pose.p.tolist(),
                "axis": body.axis.tolist(),
                "mass": float(inertia[0, 0]),
                "moment": first_moment(inertia).tolist(),
            }
            for body, inertia, path in of_bodies
        ],
        "S": linkage.couplings.S.tolist(),
        "s0": linkage.couplings.s0.tolist(),
        "gravity": linkage.gravity.tolist(),
    }


def _joint(name: str, kind: str, q: float, lower: float, upper: float, limit: float) -> dict[str, Any]:
    far = _SLIDE if kind == "prismatic" else _TURN
    limited = isfinite(lower) and isfinite(upper)
    ends = (lower, upper) if limited else (min(-far, q), max(far, q))
    return {
        "name": name,
        "q": q,
        "lower": min(ends[0], q),
        "upper": max(ends[1], q),
        "limited": limited,
        "unit": unit("q", kind),
        "torque": unit("tau", kind),
        "limit": limit if isfinite(limit) and limit > 0 else None,
    }
