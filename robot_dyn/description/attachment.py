"""Two descriptions as one: a gripper fastened to a link of an arm by a fixed joint.

The text of the gripper is added to the arm's, with a prefix before its names. Shapes, materials, transmissions and
elements of simulators are kept; addresses of meshes are adapted to the folder of the arm's file.
"""

from __future__ import annotations

import os
from contextlib import suppress
from dataclasses import replace
from pathlib import Path, PureWindowsPath

import numpy as np
from lxml import etree  # pyright: ignore[reportAttributeAccessIssue]

from robot_dyn.description import catalog
from robot_dyn.description.description import Description, check
from robot_dyn.description.edits import Edits
from robot_dyn.description.markup import parse, vector_text
from robot_dyn.description.structure import Structure, stands_on, structure_of
from robot_dyn.foundations.errors import CatalogError, EditError, nearest
from robot_dyn.foundations.validate import instance

# the attribute that names a part of the robot, by element
_NAMES = {
    "link": "name", "joint": "name", "material": "name", "transmission": "name", "actuator": "name",
    "parent": "link", "child": "link", "mimic": "joint", "gazebo": "reference",
}  # fmt: skip


def attached(
    arm: Description, gripper: Description, frame: str, prefix: str, xyz: np.ndarray, rpy: np.ndarray
) -> Description:
    """Return the arm with a gripper; `Robot.attach` documents the arguments and errors."""
    instance("frame", frame, str, "give the name of a link of the arm", error=EditError)
    instance("prefix", prefix, str, "give text that precedes the names of the gripper, such as 'g_'", error=EditError)
    if not prefix.isprintable():
        raise EditError(f"prefix must be printable text, got {prefix!r}; for example 'g_'")
    carrier, structure = structure_of(arm, Edits()), structure_of(gripper, Edits())
    _refuse(carrier, structure, frame, prefix)
    joint = f"{prefix}{structure.root}_attachment"
    while joint in {*carrier.joints, *(prefix + name for name in structure.joints)}:
        joint += "_"
    (robot, _), (tool, _) = parse(arm.text, arm.source), parse(gripper.text, gripper.source)
    for element in tool.iter(*_NAMES):
        if name := (element.get(_NAMES[element.tag]) or "").strip():
            element.set(_NAMES[element.tag], prefix + name)
    for element in tool.iter("mesh", "texture"):
        element.set("filename", _address(element.get("filename") or "", gripper, arm))
    if prefix + structure.root not in {link.get("name") for link in tool.iterfind("link")}:
        etree.SubElement(tool, "link", name=prefix + structure.root)  # a root that only a joint names
    fixed = etree.SubElement(tool, "joint", name=joint, type="fixed")
    etree.SubElement(fixed, "origin", xyz=vector_text(xyz), rpy=vector_text(rpy))
    etree.SubElement(fixed, "parent", link=frame)
    etree.SubElement(fixed, "child", link=prefix + structure.root)
    robot.extend(list(tool))
    robot.set("name", f"{arm.name}_{gripper.name}")
    merged = check(etree.tostring(robot, encoding="UTF-8"), arm.source)
    return replace(merged, findings=(*arm.findings, *gripper.findings))


def attached_edits(arm: Edits, gripper: Edits, description: Description, prefix: str) -> Edits:
    """Return the edits of both robots; the description is the gripper's.

    Raises:
        EditError: If the gripper was given another gravity than the arm and the standard one.
    """
    if gripper.gravity not in (Edits().gravity, arm.gravity):
        raise EditError(
            f"the gripper's gravity {gripper.gravity} m/s² differs from the arm's {arm.gravity} m/s²;"
            " give the gripper in standard gravity: the arm's acts on both"
        )
    pairs = {
        key: getattr(arm, key) + tuple((prefix + name, value) for name, value in getattr(gripper, key))
        for key in ("lock", "armature", "mass_scales", "masses", "inertias")
    }
    if (ratio := gripper.mass_scale / arm.mass_scale) != 1.0:
        scales = dict(gripper.mass_scales)
        links = [link.get("name") for link in description.element.iterfind("link[inertial]")]
        own = tuple((prefix + link, ratio * scales.get(link, 1.0)) for link in links)
        pairs["mass_scales"] = arm.mass_scales + own
    payloads = tuple(replace(payload, frame=prefix + payload.frame) for payload in gripper.payloads)
    return replace(arm, payloads=arm.payloads + payloads, **pairs)


def _refuse(arm: Structure, gripper: Structure, frame: str, prefix: str) -> None:
    """Refuse a frame that is not the arm's, a gripper that stands on a moving base, and names that occur twice."""
    if frame not in arm.links:
        if frame.removeprefix(prefix) in gripper.links:
            raise EditError(f"frame {frame!r} is a link of the gripper; name the link of the arm that carries it")
        raise EditError(f"no link {frame!r} in the arm; {nearest(frame, arm.links)}")
    if links := stands_on(gripper):
        raise EditError(
            f"the base of the gripper moves, to judge by its links ({', '.join(links[:3])});"
            " attach a robot with a fixed base"
        )
    for kind, taken, added in (("link", arm.links, gripper.links), ("joint", arm.joints, gripper.joints)):
        if both := [prefix + name for name in added if prefix + name in taken]:
            other = next(text for text in ("g_", "gripper_", "tool_", "attached_") if text != prefix)
            raise EditError(
                f"both robots have a {kind} {both[0]!r}{f', and {len(both) - 1} more' if both[1:] else ''};"
                f" give a prefix for the gripper's names, for example prefix={other!r}"
            )


def _address(address: str, gripper: Description, arm: Description) -> str:
    """Return the address of a mesh of the gripper as the folder of the arm's file needs it."""
    here, there = Path(gripper.source), Path(arm.source)
    if not address or not here.is_file() or not there.is_file():
        return address
    file: Path | None = None
    if address.startswith("package://"):
        with suppress(CatalogError):
            catalog.resolve(address, there)
            return address
        with suppress(CatalogError):
            file = catalog.resolve(address, here)
    elif "://" not in address and not (Path(address).is_absolute() or PureWindowsPath(address).drive):
        file = here.absolute().parent / address
    return address if file is None else Path(os.path.relpath(file, there.absolute().parent)).as_posix()
