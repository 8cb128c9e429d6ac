"""Effort limits against gravity: a joint that cannot hold its own arm.

    |N_i(q)| > τ_max,i    at q = 0, or at the nearest position within the limits

It is an error of the limit; only a note if masses or lengths of the file are doubtful.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from robot_dyn import Robot
from robot_dyn.queries import of_joint
from robot_dyn.tools.doctor.document import Document
from robot_dyn.tools.doctor.finding import Finding, Severity
from robot_dyn.tools.doctor.kinds import FindingKind

_AFTER = "correct the doubtful masses and lengths of other findings first, then compare again"
_CAUSES = {
    FindingKind.MASS_DENSITY,
    FindingKind.INERTIA_SMALL,
    FindingKind.MASS_RATIO,
    FindingKind.COM_OUTSIDE,
    FindingKind.ORIGIN_FAR,
    FindingKind.LENGTH_LONG,
}


def weak_joints(document: Document, robot: Robot, others: Iterable[Finding]) -> Iterator[Finding]:
    """Report joints whose effort limit, if not 0, is below the gravity load; `others` are all other findings."""
    explained = any(other.kind in _CAUSES and other.severity is not Severity.NOTE for other in others)
    q = np.clip(0.0, robot.lower, robot.upper)
    N = robot.nan_rows.N(q)
    for name, load, limit in zip(robot.joint_names, np.abs(N), robot.effort_limit, strict=True):
        if 0 < limit < load:
            joint = document.named("joint", name)
            stated, unit = joint.find("limit").get("effort").strip(), of_joint("N m", joint.get("type"))
            yield document.finding(
                Severity.NOTE if explained else Severity.ERROR, FindingKind.EFFORT_GRAVITY, joint,
                f'its effort limit "{stated}" is below the {load:.3g} {unit} that gravity alone requires at q = 0, or'
                " at the nearest position within the limits",
                _AFTER if explained else "correct the limit, or the masses of the links it carries",
            )  # fmt: skip
