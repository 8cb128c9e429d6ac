"""Effort limits against gravity: a joint that cannot hold its own arm.

    |N_i(q)| > τ_max,i    at q = 0, or the position within the limits that is nearest to it

It is an error of the limit; a note where the masses or lengths of the file are doubtful themselves.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from robot_dyn import Robot
from robot_dyn.tools.doctor.document import Document
from robot_dyn.tools.doctor.finding import Finding, Severity

_CAUSES = {"mass_density", "inertia_small", "mass_ratio", "com_outside", "origin_far", "length_long"}


def weak_joints(document: Document, robot: Robot, found: Iterable[Finding]) -> Iterator[Finding]:
    """Joints whose effort limit gravity alone passes, given all other findings; a limit of 0 is one of these."""
    explained = any(each.kind in _CAUSES and each.severity is not Severity.NOTE for each in found)
    q = np.clip(0.0, robot.lower, robot.upper)
    N = robot.N(q, errors="nan")
    for name, load, limit in zip(robot.joint_names, np.abs(N), robot.effort_limit, strict=True):
        if 0 < limit < load:
            joint = document.named("joint", name)
            stated = joint.find("limit").get("effort").strip()
            yield document.finding(
                Severity.NOTE if explained else Severity.ERROR, "effort_gravity", joint,
                f'its effort limit "{stated}" is below the {load:.3g} that gravity alone asks of it at q = 0, or as'
                " near to it as the limits allow",
                "correct the limit, or the masses of what it carries",
            )  # fmt: skip
