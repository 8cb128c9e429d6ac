"""The corrected URDF: the text of the file with other inertias and friction, and comments with intervals."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from robot_dyn import Robot
from robot_dyn.tools.doctor import Document
from robot_dyn.tools.identify.physical import Links, centred

_CHANGED = 1e-3  # change of a number that is written, relative to its size


def corrected(arm: Robot, links: Links, theta: np.ndarray, friction: np.ndarray, notes: Mapping[str, str]) -> bytes:
    """Return the text of the arm's file with new values; all else in it, comments included, is unchanged.

    Args:
        arm: The arm of the file.
        links: Its links.
        theta: Their new parameters, (N, 10).
        friction: Viscous and Coulomb friction of the joints, (2, n), not negative.
        notes: A comment in ASCII for links and joints, by name.
    """
    document = Document(arm.description.text, arm.description.source)
    rewritten: set[tuple[Any, str]] = set()
    for name, old, new, size in zip(links.names, links.theta, theta, links.sizes, strict=True):
        link = document.named("link", name)
        inertial = None if link is None else link.find("inertial")
        if inertial is None or (np.abs(new - old) <= _CHANGED * size).all():
            continue
        m, c, I = centred(new)  # noqa: E741
        _set(inertial, "mass", {"value": f"{m:.8g}"}, rewritten)
        _set(inertial, "origin", {"xyz": " ".join(f"{x:.8g}" for x in c), "rpy": "0 0 0"}, rewritten)
        moments = {f"i{'xyz'[i]}{'xyz'[j]}": f"{I[i, j]:.8g}" for i in range(3) for j in range(i, 3)}
        _set(inertial, "inertia", moments, rewritten)
    for joint, viscous, coulomb in zip(arm.joint_names, *friction, strict=True):
        if (element := document.named("joint", joint)) is not None:
            _set(element, "dynamics", {"damping": f"{viscous:.5g}", "friction": f"{coulomb:.5g}"}, rewritten)
    return _with_notes(document.mended(rewritten).text, notes)


def _set(parent: Any, tag: str, attributes: Mapping[str, str], rewritten: set[tuple[Any, str]]) -> None:
    element = parent.find(tag)
    if element is None:
        element = parent.makeelement(tag)
        parent.append(element)
    for key, value in attributes.items():
        if element.get(key) != value:
            element.set(key, value)
            rewritten.add((element, key))


def _with_notes(text: bytes, notes: Mapping[str, str]) -> bytes:
    """Return the text with a comment in a separate line above each named link and joint."""
    document, lines = Document(text, "the corrected URDF"), text.split(b"\n")
    above = {}
    for name, note in notes.items():
        for kind in ("link", "joint"):
            if (element := document.named(kind, name)) is not None:
                above[element.sourceline - 1] = note
    for k in sorted(above, reverse=True):
        indent = lines[k][: len(lines[k]) - len(lines[k].lstrip())]
        if lines[k].lstrip().startswith((b"<link", b"<joint")):
            lines.insert(k, indent + f"<!-- {above[k]} -->".encode("ascii"))
    return b"\n".join(lines)
