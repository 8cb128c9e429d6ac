"""Lengths out of proportion to the robot: origins and centres of mass, most often in millimetres.

    |xyz| > 100 times the median distance between a joint that moves and the link before it

A centre of mass of an arm of several joints is out of proportion, too, beyond the sum of all distances: its reach.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from robot_dyn.studies.doctor.document import Document, parsed
from robot_dyn.studies.doctor.finding import Finding, Severity

_FAR = 100.0
_SEVERAL = 3
_MOVING = ("revolute", "continuous", "prismatic")


def far_origins(document: Document) -> Iterator[Finding]:
    """Origins of joints and of inertials that are far beyond the lengths of the robot."""
    joints = [(each, each.find("origin")) for each in document.root.iterfind("joint")]
    lengths = [(joint, origin, _length(origin)) for joint, origin in joints if origin is not None]
    typical = [length for joint, _, length in lengths if joint.get("type") in _MOVING and length > 0]
    if not typical:
        return
    median = float(np.median(typical))
    for _, origin, length in lengths:
        if length > _FAR * median:
            yield _finding(document, origin, length, median)
    reach = sum(length for *_, length in lengths if length <= _FAR * median)
    most = min(_FAR * median, reach) if len(typical) >= _SEVERAL else _FAR * median
    for inertial in document.root.iterfind("link/inertial"):
        if (origin := inertial.find("origin")) is not None:
            length = _length(origin)
            if length > most:
                yield _finding(document, origin, length, median)


def _length(origin: Any) -> float:
    """|xyz| in [m]; 0 where it is not three numbers."""
    values = [parsed(word) for word in (origin.get("xyz") or "").split()]
    length = float(np.linalg.norm(values)) if len(values) == 3 else 0.0
    return length if np.isfinite(length) else 0.0


def _finding(document: Document, origin: Any, length: float, median: float) -> Finding:
    what = "centre of mass" if origin.getparent().tag == "inertial" else "origin"
    return document.finding(
        Severity.WARNING, "origin_far", origin,
        f'its {what}, xyz "{" ".join(origin.get("xyz").split())}", lies {length:.3g} m away, on a robot whose links'
        f" are {median:.3g} m long at the median",
        "correct it, or its unit: metres",
    )  # fmt: skip
