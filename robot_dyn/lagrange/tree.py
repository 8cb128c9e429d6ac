"""The Tree: joints and links of the file, with numbers as literals, for the library's own implementation.

Each arithmetic converts the decimal literals of the file itself. No code is shared with Pinocchio or its URDF parser;
`cross_check.second_reading` compares the checked description with the original file.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any, Protocol, final

from lxml import etree  # pyright: ignore[reportAttributeAccessIssue]

from robot_dyn.description.couplings import Mimic
from robot_dyn.description.description import Description
from robot_dyn.description.edits import Edits
from robot_dyn.foundations.arithmetic import Numeral


class Described(Protocol):
    """Input of the library's own implementation: file, edits and the order of q, but no computed numbers."""

    @property
    def description(self) -> Description:
        """Checked file."""
        ...

    @property
    def edits(self) -> Edits:
        """Gravity, locks, payloads, armature."""
        ...

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the n joints, in the order of q."""
        ...


Triple = tuple[Numeral, Numeral, Numeral]
_ZERO: Triple = ("0", "0", "0")


@final
@dataclass(frozen=True)
class Inertial:
    """A rigid body fixed to a link: mass [kg], centre of mass [m], inertia about it [kg m²] in axes rotated by rpy.

    `moments` are Ixx, Ixy, Ixz, Iyy, Iyz, Izz; mass and moments are multiplied by `scale`.
    """

    mass: Numeral
    moments: tuple[Numeral, ...]
    xyz: Triple = _ZERO
    rpy: Triple = _ZERO
    scale: Numeral = "1"


@final
@dataclass(frozen=True)
class Link:
    """A link: its name and the bodies fixed to it."""

    name: str
    inertials: tuple[Inertial, ...]


@final
@dataclass(frozen=True)
class Joint:
    """A joint: the child's frame is the parent's, moved by (xyz, rpy), then by q along or about the axis.

    Attributes:
        kind: "revolute", "continuous", "prismatic" or "fixed".
        mimic: Coupling to the joint that it follows, or None.
        locked: Value at which it is locked, or None.
        armature: Armature in [kg m²] or [kg].
    """

    name: str
    kind: str
    parent: str
    child: str
    xyz: Triple
    rpy: Triple
    axis: Triple
    mimic: Mimic | None = None
    locked: Numeral | None = None
    armature: Numeral = "0"


@final
@dataclass(frozen=True)
class Tree:
    """Links and joints, parents before children.

    Attributes:
        root: Name of the link fixed to the world.
        gravity: Acceleration of free fall in base axes, in [m/s²].
    """

    root: str
    links: tuple[Link, ...]
    joints: tuple[Joint, ...]
    gravity: Triple


def tree_of(description: Description, edits: Edits) -> Tree:
    """Return the tree of a description with its edits."""
    file = description.element
    links = (Link(link.get("name"), _inertials(link)) for link in file.iterfind("link"))
    joints = (_joint(joint) for joint in file.iterfind("joint"))
    root, ordered = _from_the_root({joint.child: joint for joint in joints})
    return Tree(
        root,
        tuple(_loaded(link, edits) for link in links),
        tuple(_edited(joint, edits) for joint in ordered),
        edits.gravity,
    )


def _inertials(link: etree._Element) -> tuple[Inertial, ...]:
    inertial = link.find("inertial")
    if inertial is None:
        return ()
    moments = inertial.find("inertia")
    return (
        Inertial(
            inertial.find("mass").get("value"),
            tuple(moments.get(key) for key in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")),
            *_origin(inertial),
        ),
    )


def _joint(joint: etree._Element) -> Joint:
    axis, mimic = joint.find("axis"), joint.find("mimic")
    return Joint(
        joint.get("name"),
        joint.get("type"),
        joint.find("parent").get("link"),
        joint.find("child").get("link"),
        *_origin(joint),
        _ZERO if axis is None else _triple(axis, "xyz"),
        None if mimic is None else Mimic(mimic.get("joint"), mimic.get("multiplier"), mimic.get("offset")),
    )


def _origin(element: etree._Element) -> tuple[Triple, Triple]:
    origin = element.find("origin")
    return _triple(origin, "xyz"), _triple(origin, "rpy")


def _triple(element: etree._Element, key: str) -> Triple:
    x, y, z = element.get(key).split()
    return x, y, z


def _from_the_root(joint_of_child: dict[str, Joint]) -> tuple[str, list[Joint]]:
    """Return the root link, and the joints with each parent before its children."""
    children: dict[str, list[Joint]] = {}
    for joint in joint_of_child.values():
        children.setdefault(joint.parent, []).append(joint)
    (root,) = children.keys() - joint_of_child.keys()
    ordered, stack = [], [root]
    while stack:
        below = children.get(stack.pop(), [])
        ordered += below
        stack += [joint.child for joint in below]
    return root, ordered


def _loaded(link: Link, edits: Edits) -> Link:
    """Return the link with edited masses and with the payloads it carries."""
    mass, inertia = dict(edits.masses).get(link.name), dict(edits.inertias).get(link.name)
    scale, factor = edits.mass_scale, dict(edits.mass_scales).get(link.name)
    scale = scale if factor is None else scale * factor
    more = [replace(part, scale=scale) for part in link.inertials]
    if mass is not None:
        more = [replace(part, mass=mass) for part in more]
    if inertia is not None:
        more = [replace(part, moments=_moments(inertia)) for part in more]
    for payload in edits.payloads:
        if payload.frame == link.name:
            more.append(Inertial(payload.mass, _moments(payload.inertia), payload.com))
    return replace(link, inertials=tuple(more))


def _moments(inertia: Any) -> tuple[Numeral, ...]:
    (Ixx, Ixy, Ixz), (_, Iyy, Iyz), (_, _, Izz) = inertia
    return Ixx, Ixy, Ixz, Iyy, Iyz, Izz


def _edited(joint: Joint, edits: Edits) -> Joint:
    return replace(
        joint, locked=dict(edits.lock).get(joint.name), armature=dict(edits.armature).get(joint.name, joint.armature)
    )
