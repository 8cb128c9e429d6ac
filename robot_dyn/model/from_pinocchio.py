"""Conversion of a `pinocchio.Model`: it is written as a URDF, which is read like any other.

Masses, inertias, axes and positions are exact: each literal is the shortest one of its float64. Rotations are converted
to roll, pitch and yaw and may change in the last bits.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, NoReturn

import numpy as np
import pinocchio as pin  # pyright: ignore[reportMissingImports]
from lxml import etree  # pyright: ignore[reportAttributeAccessIssue]

from robot_dyn.description.description import Description, check
from robot_dyn.description.edits import Edits
from robot_dyn.description.markup import vector_text
from robot_dyn.description.urdf import UNBOUNDED
from robot_dyn.foundations.errors import DescriptionError, shorten
from robot_dyn.model.pinocchio_model import build

_KINDS = {
    f"JointModel{prefix}{axis}": kind
    for prefix, kind in (("R", "revolute"), ("P", "prismatic"), ("RUB", "continuous"))
    for axis in "XYZ"
} | {
    "JointModelRevoluteUnaligned": "revolute",
    "JointModelPrismaticUnaligned": "prismatic",
    "JointModelRevoluteUnboundedUnaligned": "continuous",
}
_FRAMES = (pin.FrameType.BODY, pin.FrameType.OP_FRAME, pin.FrameType.SENSOR)
_UNBOUNDED = float(UNBOUNDED)
_UNIT_SLACK = 1e-12  # error of a unit axis: rounding of normalisation


def described(model: pin.Model) -> tuple[Description, Edits]:
    """Return the description of a `pinocchio.Model`, and gravity and armature as edits; see `Robot.from_pinocchio`."""
    if not isinstance(model, pin.Model):
        raise DescriptionError(f"from_pinocchio needs a pinocchio.Model, got {type(model).__name__}")
    writer = _Writer(model)
    description, names = check(writer.urdf(), writer.source, writer.findings), tuple(model.names.tolist()[1:])
    joints = build(description, Edits()).joint_names
    if joints != names:
        order = f"the joint order differs from the model's: {shorten(', '.join(joints), 300)}"
        description = replace(
            description, findings=(*description.findings, f"{order}; arrange q, v and torques by these names")
        )
    drives = zip(names, model.idx_vs.tolist()[1:], strict=True)
    armature = {name: model.armature[v] for name, v in drives if model.armature[v]}
    return description, Edits().with_(joints, gravity=model.gravity.linear, armature=armature)


class _Writer:
    """Writer of the URDF of one model."""

    def __init__(self, model: pin.Model) -> None:
        self.model, self.source = model, f"pinocchio.Model {shorten(model.name)!r}" if model.name else "pinocchio.Model"
        self.findings: list[str] = []
        if np.any(model.gravity.angular):
            self.refuse("gravity", "has an angular part; give only a linear one")

    def refuse(self, where: str, why: str) -> NoReturn:
        raise DescriptionError(f"{self.source}: {where}: {why}")

    def urdf(self) -> bytes:
        model = self.model
        out = etree.Element("robot", name=self.text(model.name) or "robot")
        frames = [frame for frame in model.frames if frame.type in _FRAMES]
        link = self.joint_links(frames)
        for i, name in enumerate(link):
            self.inertial(etree.SubElement(out, "link", name=name), model.inertias[i])
        for i in range(1, model.njoints):
            self.joint(out, i, link)
        taken, joints = set(link), set(model.names)
        for frame in frames:
            if (name := self.text(frame.name)) not in taken:
                taken.add(name)
                joints.add(fixed := _new(name, joints))
                etree.SubElement(out, "link", name=name)
                joint = etree.SubElement(out, "joint", name=fixed, type="fixed")
                self.ends(joint, frame.placement, link[frame.parentJoint], name)
        return etree.tostring(out)

    def joint_links(self, frames: list[Any]) -> list[str]:
        """Return the link name of the universe and of each joint: a frame at the joint, or else the joint's name."""
        links: list[str] = []
        frame_names = {self.text(frame.name) for frame in frames}
        for i, name in enumerate(self.model.names):
            at = (f.name for f in frames if f.parentJoint == i and f.placement.isIdentity(0) and f.name not in links)
            links.append(next(at, None) or _new(self.text(name), frame_names | set(links)))
        return links

    def joint(self, out: etree._Element, i: int, link: list[str]) -> None:
        model = self.model
        name, joint = self.text(model.names[i]), model.joints[i].extract()
        where, kind = f"joint {name!r}", type(joint).__name__
        if kind not in _KINDS:
            remedy = "only revolute, continuous and prismatic joints are supported"
            if kind == "JointModelMimic":
                remedy = "load its URDF by rd.load, which handles mimic joints"
            self.refuse(where, f"is a {kind.removeprefix('JointModel')} joint; {remedy}")
        kind = _KINDS[kind]
        data = joint.createData()
        joint.calc(data, pin.neutral(model))
        axis = np.asarray(data.S)[slice(3) if kind == "prismatic" else slice(3, 6)]
        if abs(np.linalg.norm(axis) - 1) > _UNIT_SLACK:
            self.refuse(where, f"its axis {axis} is not of length 1; normalise it")
        element = etree.SubElement(out, "joint", name=name, type=kind)
        self.ends(element, model.jointPlacements[i], link[model.parents[i]], link[i])
        etree.SubElement(element, "axis", xyz=vector_text(axis))
        etree.SubElement(element, "limit", self.limits(i, where, kind == "continuous"))
        v = model.idx_vs[i]
        friction = self.symmetric(where, "dry friction", model.lowerDryFrictionLimit[v], model.upperDryFrictionLimit[v])
        friction = friction if np.isfinite(friction) else 0.0
        etree.SubElement(element, "dynamics", damping=repr(float(model.damping[v])), friction=repr(float(friction)))

    def limits(self, i: int, where: str, continuous: bool) -> dict[str, str]:
        model, q, v = self.model, self.model.idx_qs[i], self.model.idx_vs[i]
        ranges = {
            "effort": (model.lowerEffortLimit[v], model.upperEffortLimit[v]),
            "velocity": (model.lowerVelocityLimit[v], model.upperVelocityLimit[v]),
        }
        bounds = {key: self.symmetric(where, f"{key} limits", *both) for key, both in ranges.items()}
        if not continuous:
            bounds |= {"lower": model.lowerPositionLimit[q], "upper": model.upperPositionLimit[q]}
        return {key: repr(float(np.clip(value, -_UNBOUNDED, _UNBOUNDED))) for key, value in bounds.items()}

    def symmetric(self, where: str, quantity: str, lower: float, upper: float) -> float:
        """Return the bound of a range symmetric about 0; for any other range, add a finding and return inf."""
        if abs(lower) in (abs(upper), 0.0) or abs(lower) >= _UNBOUNDED:  # both signs occur; 0 and ∞ if unset
            return upper
        self.findings.append(f"{where}: its {quantity} {lower:g}, {upper:g} are not symmetric about 0 and are ignored")
        return np.inf

    def ends(self, joint: etree._Element, placement: Any, parent: str, child: str) -> None:
        rpy = pin.rpy.matrixToRpy(placement.rotation)
        etree.SubElement(joint, "origin", xyz=vector_text(placement.translation), rpy=vector_text(rpy))
        etree.SubElement(joint, "parent", link=parent)
        etree.SubElement(joint, "child", link=child)

    def inertial(self, link: etree._Element, body: Any) -> None:
        if body.mass == 0 and not body.inertia.any():
            return
        inertial, moments = etree.SubElement(link, "inertial"), {}
        etree.SubElement(inertial, "origin", xyz=vector_text(body.lever))
        etree.SubElement(inertial, "mass", value=repr(float(body.mass)))
        for row, i in enumerate("xyz"):
            moments |= {f"i{i}{j}": repr(float(body.inertia[row, "xyz".index(j)])) for j in "xyz"[row:]}
        etree.SubElement(inertial, "inertia", moments)

    def text(self, name: str) -> str:
        if not name.isprintable():
            self.refuse("names", f"{shorten(name)!a} has control characters; rename it")
        return name.strip()


def _new(name: str, taken: set[str]) -> str:
    while name in taken:
        name += "_"
    return name
