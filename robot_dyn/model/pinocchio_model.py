"""Construction of a `pinocchio.Model` from a description and its edits."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations_with_replacement
from types import MappingProxyType
from typing import Any, final

import numpy as np
import pinocchio as pin  # pyright: ignore[reportMissingImports]
from lxml import etree  # pyright: ignore[reportAttributeAccessIssue]

from robot_dyn.description.couplings import Couplings, Mimic, resolve
from robot_dyn.description.description import Description
from robot_dyn.description.edits import Edits
from robot_dyn.description.inertial_parameters import NAMES, ordered
from robot_dyn.description.structure import stated_mimics
from robot_dyn.foundations.arithmetic import FLOAT64
from robot_dyn.foundations.errors import DescriptionError, EditError, nearest
from robot_dyn.model.centroid import Centroid
from robot_dyn.model.coriolis import Coriolis

MAX_MOVING = 250  # Pinocchio's working memory for n joints is 63 n³ bytes: 1 GB at this limit
_MARK = "joint:"  # prefix during building: a joint may share a link's name or be called "universe"


@final
@dataclass(frozen=True, eq=False)
class Built:
    """A Pinocchio model and the values that its calls need.

    Attributes:
        model: The `pinocchio.Model` of all moving joints.
        couplings: Map from q to the positions of all moving joints.
        joint_names: Names of the n independent joints, in the order of q.
        description: Checked file, without the edits.
    """

    model: pin.Model
    couplings: Couplings
    joint_names: tuple[str, ...]
    description: Description

    @cached_property
    def coriolis(self) -> Coriolis:
        """Coriolis matrix of `model`, with the bound on its rounding error."""
        return Coriolis.from_model(self.model, self.couplings)

    @cached_property
    def centroid(self) -> Centroid:
        """Centre of mass and centroidal momentum of `model`."""
        return Centroid.from_model(self.model, self.coriolis.bodies)

    @cached_property
    def sizes(self) -> Mapping[str, int]:
        """Values of the letters n and p in the shapes of quantities."""
        return MappingProxyType({"n": len(self.joint_names), "p": len(NAMES) * self.model.nv})

    @property
    def body_names(self) -> tuple[str, ...]:
        """Names of the joints that carry the bodies, in the order of their inertial parameters."""
        return ordered(self.joint_names, self.model.names[1:])


def build(description: Description, edits: Edits) -> Built:
    """Build the Pinocchio model of a description with its edits.

    Raises:
        DescriptionError: If Pinocchio rejects it, or no joint or more than `MAX_MOVING` joints move.
        EditError: If the link of an edit is unknown, or all joints are locked.
    """
    robot = description.element
    mimics = stated_mimics(robot)
    model = _model(robot, description.source, edits)
    if model.nv == 0:
        raise DescriptionError(
            f"{description.source}: no joint moves, so the robot has no dynamics;"
            " make a joint revolute, continuous or prismatic, or attach a rigid tool to an arm by its path:"
            " arm.attach('tool.urdf', frame='tool0')"
        )
    if model.nv > MAX_MOVING:
        raise DescriptionError(
            f"{description.source}: {model.nv} joints move, more than the maximum of {MAX_MOVING}: Pinocchio's working"
            " memory grows with the cube of their number; make some fixed, or split the robot"
        )
    _apply(edits, model)
    model = _locked(model, edits, mimics)
    _unmark(model)
    return Built(model, *_couplings(tuple(model.names[1:]), mimics), description)


def every_joint(description: Description, edits: Edits, joint_names: tuple[str, ...]) -> tuple[pin.Model, Couplings]:
    """Return a model in which fixed and locked joints may move, and the map from q to the positions of its joints.

    Joint 1 of the model carries the root link.

    Raises:
        DescriptionError: If there are more than `MAX_MOVING` joints, fixed ones included.
    """
    robot = description.element
    mimics = stated_mimics(robot)
    if (count := len(robot.findall("joint"))) >= MAX_MOVING:
        raise DescriptionError(
            f"{description.source}: {count} joints, fixed ones included, are too many for joint wrenches: working"
            f" memory grows with the cube of their number; merge links until there are fewer than {MAX_MOVING}"
        )
    for joint in robot.iterfind("joint[@type='fixed']"):
        joint.set("type", "revolute")
        etree.SubElement(joint, "axis", xyz="0 0 1")
        etree.SubElement(joint, "limit", effort="0", velocity="0")
    model = _model(robot, description.source, edits, pin.JointModelRZ())
    _apply(edits, model)
    _unmark(model)
    couplings, names = _couplings(tuple(model.names[1:]), mimics)
    locked = np.zeros(len(names))
    for name, value in edits.lock:
        locked[names.index(name)] = value
    S, s0 = couplings.S[:, [names.index(name) for name in joint_names]], couplings.S @ locked + couplings.s0
    return model, Couplings(S, s0)


def _model(robot: etree._Element, source: str, edits: Edits, *root: Any) -> pin.Model:
    """Return the model of a file with edited links and marked joint names; a root joint is optional."""
    write_edits(robot, edits)
    for joint in robot.iterfind("joint"):
        joint.set("name", _MARK + joint.get("name"))
        if joint.get("type") == "continuous":
            joint.set("type", "revolute")  # with limits of ±1e308, so that q is one number, like v
    try:
        return pin.buildModelFromXML(etree.tostring(robot, encoding="unicode"), *root)
    except Exception as error:  # Pinocchio raises bare Exceptions of several kinds
        raise DescriptionError(f"{source}: Pinocchio rejects it: {error}") from None


def write_edits(robot: etree._Element, edits: Edits) -> None:
    """Replace masses and inertias of links in the file by edited values, and scale both by link."""
    links = {link.get("name"): link.find("inertial") for link in robot.iterfind("link")}
    with_mass = [name for name, inertial in links.items() if inertial is not None]
    for edit in ("mass_scales", "masses", "inertias"):
        for name, _ in getattr(edits, edit):
            if name not in with_mass:
                raise EditError(f"{edit}: no link {name!r} with a mass in the file; {nearest(name, with_mass)}")
    for name, mass in edits.masses:
        links[name].find("mass").set("value", repr(float(mass)))
    for name, inertia in edits.inertias:
        for i, j in combinations_with_replacement(range(3), 2):
            links[name].find("inertia").set(f"i{'xyz'[i]}{'xyz'[j]}", repr(float(inertia[i][j])))
    for name, factor in edits.mass_scales:
        scale_inertial(links[name], factor)


def scale_inertial(inertial: etree._Element, factor: float) -> None:
    """Multiply the mass and the moments of an <inertial> of a checked file by a factor."""
    for element in (inertial.find("mass"), inertial.find("inertia")):
        for key, text in element.items():
            element.set(key, repr(float(factor) * float(text)))


def _unmark(model: pin.Model) -> None:
    """Restore the names of the joints."""
    for i, name in enumerate(model.names):
        model.names[i] = name.removeprefix(_MARK)
    for frame in model.frames:
        if frame.type != pin.FrameType.BODY:
            frame.name = frame.name.removeprefix(_MARK)


def joint_ids(model: pin.Model, mark: str = "") -> dict[str, int]:
    """Return the index of each joint by name, even of one called "universe"; the prefix `mark` is removed."""
    return {name.removeprefix(mark): i for i, name in enumerate(model.names) if i}


def _apply(edits: Edits, model: pin.Model) -> None:
    """Apply gravity, armature, mass scale and payloads to a model."""
    model.gravity = pin.Motion(np.array(edits.gravity), np.zeros(3))
    ids = joint_ids(model, _MARK)
    for name, value in edits.armature:
        model.armature[model.idx_vs[ids[name]]] = value
    if edits.mass_scale != 1.0:
        for i, body in enumerate(model.inertias):
            scaled = pin.Inertia(body)  # its other constructors reject non-physical moments
            scaled.mass, scaled.inertia = edits.mass_scale * body.mass, edits.mass_scale * body.inertia
            model.inertias[i] = scaled
    links = link_frames(model)
    for payload in edits.payloads:
        if payload.frame not in links:
            raise EditError(f"payload: no frame {payload.frame!r}; {nearest(payload.frame, links)}")
        frame = model.frames[links[payload.frame]]
        body = pin.Inertia(payload.mass, np.array(payload.com), np.array(payload.inertia))
        model.appendBodyToJoint(frame.parentJoint, body, frame.placement)


def _locked(model: pin.Model, edits: Edits, mimics: dict[str, Mimic]) -> Any:
    """Return the model without locked joints and the joints that mimic them."""
    values = dict(edits.lock)
    q, locked, ids = np.zeros(model.nq), [], joint_ids(model, _MARK)
    for name, index in ids.items():
        source, ratio, offset = resolve(name, mimics, FLOAT64)
        if source in values:
            locked.append(index)
            q[model.idx_qs[index]] = ratio * values[source] + offset
    if len(locked) == model.nv:
        raise EditError(f"lock: all joints are locked ({', '.join(ids)}); leave at least one free")
    return pin.buildReducedModel(model, locked, q) if locked else model


def _couplings(joints: tuple[str, ...], mimics: dict[str, Mimic]) -> tuple[Couplings, tuple[str, ...]]:
    independent = tuple(name for name in joints if name not in mimics)
    S, s0 = np.zeros((len(joints), len(independent))), np.zeros(len(joints))
    for row, name in enumerate(joints):
        source, ratio, s0[row] = resolve(name, mimics, FLOAT64)
        S[row, independent.index(source)] = ratio
    return Couplings(S, s0), independent


def link_frames(model: pin.Model) -> dict[str, int]:
    """Return the index of the frame of each link, by name."""
    return {frame.name: i for i, frame in enumerate(model.frames) if frame.type == pin.FrameType.BODY}
