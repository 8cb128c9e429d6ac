"""Export of a robot with its edits as a URDF, for other programs.

Locked joints, and joints that follow them, are fixed at T · exp(ξ̂ q); payloads become separate links; edited masses
and inertias replace the file's. Other literals are unchanged; rotations of locked joints are converted to roll, pitch
and yaw. Shapes, materials and soft limits are copied; other elements, for example transmissions, are left out.
"""

from __future__ import annotations

import os
import warnings
from copy import deepcopy
from pathlib import Path, PureWindowsPath
from typing import Any

import numpy as np
from lxml import etree  # pyright: ignore[reportAttributeAccessIssue]

from robot_dyn.description.couplings import resolve
from robot_dyn.description.description import Description
from robot_dyn.description.edits import STANDARD_GRAVITY, Edits, Payload
from robot_dyn.description.markup import parse, vector_text
from robot_dyn.description.structure import stated_mimics
from robot_dyn.description.urdf import UNBOUNDED
from robot_dyn.foundations.arithmetic import FLOAT64
from robot_dyn.foundations.errors import DescriptionError, ModelWarning
from robot_dyn.foundations.files import FileKind, save, target
from robot_dyn.foundations.spatial import rotation, rotation_rpy, rpy_of
from robot_dyn.model.pinocchio_model import scale_inertial, write_edits

_URDF = FileKind("a URDF", ".urdf", b"<?xml")
_DRAWN = ("visual", "collision")
_UNIT_SLACK = 1e-15  # rounding of a unit axis


def write_urdf(description: Description, edits: Edits, path: str | Path) -> Path:
    """Write the file of `Robot.to_urdf`, where arguments, errors and warnings are documented; return its path."""
    source = Path(description.source)
    path = target(path, _URDF, DescriptionError, [source] if source.is_file() else [])
    lacking = _not_stated(edits)
    text = _urdf_text(description, edits, lacking, path.parent)
    save(path, lambda stream: stream.write(text), DescriptionError)
    if lacking:
        warnings.warn(f"{description.name}: {'; '.join(lacking)}", ModelWarning, stacklevel=3)
    return path


def _urdf_text(description: Description, edits: Edits, lacking: list[str], folder: Path) -> bytes:
    """Return the bytes of the file, with mesh addresses relative to `folder`."""
    out = description.element
    write_edits(out, edits)
    for inertial in out.iterfind("link/inertial") if edits.mass_scale != 1.0 else ():
        scale_inertial(inertial, edits.mass_scale)
    _fix_locked(out, dict(edits.lock))
    for joint in out.iterfind("joint"):
        _restate(joint)
    _draw(out, description, folder)
    for payload in edits.payloads:
        _add_payload(out, payload)
    for text in lacking:
        out.insert(0, etree.Comment(f" {text.replace('--', '- -')} "))
    etree.indent(out)
    return etree.tostring(out, xml_declaration=True, encoding="UTF-8") + b"\n"


def _not_stated(edits: Edits) -> list[str]:
    """Return a message for each edit that URDF cannot express."""
    armature = {name: value for name, value in edits.armature if value}
    messages = [f"armature is not in the URDF, which cannot express it: {armature}"] if armature else []
    if edits.gravity != STANDARD_GRAVITY:
        messages.append(f"gravity is not in the URDF, which cannot express it: {edits.gravity} m/s²")
    return messages


def _fix_locked(out: Any, values: dict[str, float]) -> None:
    """Make locked joints and their followers fixed, and let followers of followers refer to the first joint."""
    mimics = stated_mimics(out)
    for joint in out.iterfind("joint"):
        name, mimic = joint.get("name"), joint.find("mimic")
        source, ratio, offset = resolve(name, mimics, FLOAT64)
        if source in values and joint.get("type") != "fixed":
            _fix(joint, ratio * values[source] + offset)
        elif mimic is not None and mimic.get("joint") != source:
            for key, value in (("joint", source), ("multiplier", repr(float(ratio))), ("offset", repr(float(offset)))):
                mimic.set(key, value)


def _fix(joint: Any, value: float) -> None:
    """Make a joint fixed at a value."""
    origin, axis = joint.find("origin"), _numbers(joint.find("axis").get("xyz"))
    axis, R, p = axis / np.linalg.norm(axis), rotation_rpy(_numbers(origin.get("rpy"))), _numbers(origin.get("xyz"))
    if joint.get("type") == "prismatic":
        origin.set("xyz", vector_text(p + R @ axis * value))
    else:
        origin.set("rpy", vector_text(rpy_of(R @ rotation(axis, np.float64(value)))))
    joint.set("type", "fixed")
    for tag in ("axis", "limit", "dynamics", "mimic"):
        if (element := joint.find(tag)) is not None:
            joint.remove(element)


def _restate(joint: Any) -> None:
    """Normalise the axis of a joint, as some programs require, and remove limits that its file does not state."""
    limit, axis = joint.find("limit"), joint.find("axis")
    if axis is not None and abs((length := np.linalg.norm(_numbers(axis.get("xyz")))) - 1) > _UNIT_SLACK:
        axis.set("xyz", vector_text(_numbers(axis.get("xyz")) / length))
    if limit is None or joint.get("type") != "continuous":
        return
    for key in ("lower", "upper"):
        del limit.attrib[key]
    if {limit.get("effort"), limit.get("velocity")} == {UNBOUNDED}:
        joint.remove(limit)


def _draw(out: Any, description: Description, folder: Path) -> None:
    """Copy the shapes of links, the materials and the soft limits from the original text."""
    read, _ = parse(description.text, description.source)
    shapes = {(link.get("name") or "").strip(): link for link in read.iterfind("link")}
    for link in out.iterfind("link"):
        if (drawn := shapes.get(link.get("name"))) is not None:
            link.extend(deepcopy(element) for element in drawn if element.tag in _DRAWN)
    moving = {joint.get("name"): joint for joint in out.iterfind("joint") if joint.get("type") != "fixed"}
    for joint in read.iterfind("joint[safety_controller]"):
        if (written := moving.get((joint.get("name") or "").strip())) is not None:
            written.append(deepcopy(joint.find("safety_controller")))
    for material in reversed(read.findall("material")):
        out.insert(0, deepcopy(material))
    source = Path(description.source)
    for element in out.iter("mesh", "texture") if source.is_file() else ():
        address = element.get("filename") or ""
        rooted = Path(address).is_absolute() or PureWindowsPath(address).drive or address.startswith("file:")
        if address and "://" not in address and not rooted:
            element.set("filename", Path(os.path.relpath(source.absolute().parent / address, folder)).as_posix())


def _add_payload(out: Any, payload: Payload) -> None:
    """Add a payload as a separate link, fixed to its frame."""
    taken = {element.get("name") for element in out.iter("link", "joint")}
    name = next(free for k in range(len(taken) + 1) if (free := f"payload_{k}") not in taken)
    inertial = etree.SubElement(etree.SubElement(out, "link", name=name), "inertial")
    etree.SubElement(inertial, "origin", xyz=vector_text(payload.com), rpy="0 0 0")
    etree.SubElement(inertial, "mass", value=repr(payload.mass))
    moments = {f"i{a}{b}": (i, j) for i, a in enumerate("xyz") for j, b in enumerate("xyz") if j >= i}
    etree.SubElement(inertial, "inertia", {key: repr(float(payload.inertia[i][j])) for key, (i, j) in moments.items()})
    joint = etree.SubElement(out, "joint", name=f"{name}_joint", type="fixed")
    etree.SubElement(joint, "origin", xyz="0 0 0", rpy="0 0 0")
    etree.SubElement(joint, "parent", link=payload.frame)
    etree.SubElement(joint, "child", link=name)


def _numbers(text: str) -> np.ndarray:
    return np.array(text.split(), dtype=float)
