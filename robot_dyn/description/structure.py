"""Structure of a description in floats: its links as stated, its joints, and the links that move as one body."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from math import hypot
from typing import Any, final

import numpy as np
from lxml import etree  # pyright: ignore[reportAttributeAccessIssue]

from robot_dyn.description.couplings import Mimic, resolve
from robot_dyn.description.description import Description
from robot_dyn.description.edits import Edits
from robot_dyn.foundations.arithmetic import FLOAT64

_WORLD = ("world", "map", "odom")  # root links of a file that places its base itself
_BASE = re.compile(r"(?i:footprint|flying|quadrotor|hexarotor|drone)")
_PARTS = re.compile(
    r"(?i:foot(?!print)|feet|thigh|ankle|knee|shank|wheel|caster|propeller|rotor_?\d)"
    r"|(?i:leg|toe|shin|calf)[sS]?(?![a-z])"  # whole words only: allegro contains "leg"
)

_MOMENTS = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
_FAR = 10.0  # times the longest distance between joints
BEYOND, TOOL, SEVERAL = 2.0, 0.3, 3  # factor on that distance and [m], for centres of mass; moving joints
GIMBAL = 0.01  # [m], below which that distance is unrelated to the size of the robot
Triple = tuple[float, ...]


@final
@dataclass(frozen=True)
class StatedLink:
    """A link as stated by its file or an edit, before fixed links are merged; zeros without an <inertial>.

    Attributes:
        mass: Mass in [kg].
        com: Centre of mass in the link's frame, in [m].
        moments: Ixx, Ixy, Ixz, Iyy, Iyz, Izz about the centre of mass, along the axes of the <inertial>, in [kg m²].
    """

    mass: float = 0.0
    com: Triple = (0.0, 0.0, 0.0)
    moments: Triple = (0.0,) * 6

    @property
    def inertia(self) -> np.ndarray:
        """Moments of inertia as a matrix, (3, 3)."""
        Ixx, Ixy, Ixz, Iyy, Iyz, Izz = self.moments
        return np.array([[Ixx, Ixy, Ixz], [Ixy, Iyy, Iyz], [Ixz, Iyz, Izz]])


@final
@dataclass(frozen=True)
class StatedJoint:
    """A joint as stated by its file: origin in [m]; limits in SI units, 1e308 where unstated, None if fixed."""

    kind: str
    parent: str
    child: str
    xyz: Triple
    lower: float | None = None
    upper: float | None = None
    effort: float | None = None
    velocity: float | None = None


@final
@dataclass(frozen=True)
class Structure:
    """Links and joints of a description by name, with its edits."""

    links: dict[str, StatedLink]
    joints: dict[str, StatedJoint]
    mimics: dict[str, Mimic]
    edits: Edits

    @cached_property
    def root(self) -> str:
        """Name of the link fixed to the world."""
        (root,) = self.links.keys() - {joint.child for joint in self.joints.values()}
        return root

    @cached_property
    def moving(self) -> tuple[str, ...]:
        """Joints that are not fixed, not locked, and do not follow a locked joint."""
        locked = dict(self.edits.lock)
        return tuple(
            name
            for name, joint in self.joints.items()
            if joint.kind != "fixed" and resolve(name, self.mimics, FLOAT64)[0] not in locked
        )

    @cached_property
    def free(self) -> tuple[str, ...]:
        """Moving joints that do not follow another joint."""
        return tuple(name for name in self.moving if name not in self.mimics)

    @cached_property
    def bodies(self) -> dict[str, tuple[str, ...]]:
        """Links that each moving joint carries as one rigid body, by joint."""
        return {name: self._body(self.joints[name].child) for name in self.moving}

    @cached_property
    def base(self) -> tuple[str, ...]:
        """Links fixed to the world."""
        return self._body(self.root)

    @cached_property
    def _fixed_below(self) -> dict[str, list[str]]:
        """Links fixed to each link by a joint below it."""
        below: dict[str, list[str]] = {name: [] for name in self.links}
        for name, joint in self.joints.items():
            if name not in self.moving:
                below[joint.parent].append(joint.child)
        return below

    @cached_property
    def longest_link(self) -> float:
        """Longest distance between the origins of neighbouring joints, in [m]."""
        return max((hypot(*map(float, joint.xyz)) for joint in self.joints.values()), default=0.0)

    def radius_beyond_reach(self, mass: float, inertia: np.ndarray) -> float | None:
        """Return √(½ tr I / m), the rms distance of a mass from its centre, if beyond 10 `longest_link`, in [m].

        Return None otherwise, and if `longest_link` is below 1 cm: the axes of a gimbal nearly meet at any size.
        """
        reach = _FAR * self.longest_link
        half = float(np.trace(inertia)) / 2
        far = self.longest_link >= GIMBAL and mass > 0 and half > mass * reach**2
        return (half / mass) ** 0.5 if far else None

    def beyond_reach(self, place: np.ndarray | tuple[float, ...]) -> float | None:
        """Return a point's distance from its link's origin, in [m], if it exceeds what fits this robot.

        The limit is twice `longest_link`, and at least the length of a tool. Return None otherwise, and for gimbals and
        robots of one or two moving joints, whose links may have any length.
        """
        distance = hypot(*map(float, place))
        far = distance > max(BEYOND * self.longest_link, TOOL) and self.longest_link >= GIMBAL
        return distance if far and len(self.moving) >= SEVERAL else None

    def _body(self, first: str) -> tuple[str, ...]:
        """Return a link and all links fixed to it from below."""
        links = [first]
        for link in links:
            links += self._fixed_below[link]
        return tuple(links)

    def ancestors(self, joint: str) -> Iterator[str]:
        """Return the joints that carry a joint, nearest first."""
        above = {stated.child: name for name, stated in self.joints.items()}
        while joint := above.get(self.joints[joint].parent, ""):
            yield joint


def structure_of(description: Description, edits: Edits) -> Structure:
    """Return the structure of a description with its edits."""
    file = description.element
    links = {link.get("name"): _link(link.find("inertial")) for link in file.iterfind("link")}
    for name in links.keys() & dict(edits.masses):
        links[name] = replace(links[name], mass=dict(edits.masses)[name])
    for name in links.keys() & dict(edits.inertias):
        (Ixx, Ixy, Ixz), (_, Iyy, Iyz), (_, _, Izz) = dict(edits.inertias)[name]
        links[name] = replace(links[name], moments=(Ixx, Ixy, Ixz, Iyy, Iyz, Izz))
    for name in links.keys() & dict(edits.mass_scales):
        link, factor = links[name], dict(edits.mass_scales)[name]
        links[name] = replace(link, mass=factor * link.mass, moments=tuple(factor * x for x in link.moments))
    joints = {joint.get("name"): _joint(joint) for joint in file.iterfind("joint")}
    return Structure(links, joints, stated_mimics(file), edits)


def stated_mimics(file: etree._Element) -> dict[str, Mimic]:
    """Return the mimic joints of a checked file, as literals."""
    return {
        joint.get("name"): Mimic(mimic.get("joint"), mimic.get("multiplier"), mimic.get("offset"))
        for joint in file.iterfind("joint")
        if (mimic := joint.find("mimic")) is not None
    }


def _link(inertial: etree._Element | None) -> StatedLink:
    if inertial is None:
        return StatedLink()
    mass, moments = float(inertial.find("mass").get("value")), inertial.find("inertia")
    return StatedLink(mass, _triple(inertial), tuple(float(moments.get(key)) for key in _MOMENTS))


def _joint(joint: etree._Element) -> StatedJoint:
    limit: Any = joint.find("limit")
    limits = {} if limit is None else {key: float(limit.get(key)) for key in ("lower", "upper", "effort", "velocity")}
    parent, child = (joint.find(role).get("link") for role in ("parent", "child"))
    return StatedJoint(joint.get("type"), parent, child, _triple(joint), **limits)


def _triple(element: etree._Element) -> Triple:
    return tuple(map(float, element.find("origin").get("xyz").split()))


def stands_on(robot: Structure) -> tuple[str, ...]:
    """Return the links whose names show that a robot stands, rolls or flies; none for an arm or a hand.

    A URDF does not state whether its base is bolted down: a hand has the same tree as a quadruped. Names are used
    instead: a link named after a moving base (footprint, flying, drone, …), or at least two bodies at the ends of
    different branches with a link named after a part of a leg, a wheel or a rotor. A root link called `world` shows
    that the base is fixed on purpose.
    """
    if robot.root.lower() in _WORLD:
        return ()
    if base := next(filter(_BASE.search, robot.links), ""):
        return (base,)
    marked = {joint: hit for joint, links in robot.bodies.items() if (hit := next(filter(_PARTS.search, links), None))}
    inner = {ancestor for joint in marked for ancestor in robot.ancestors(joint)}
    outer = tuple(link for joint, link in marked.items() if joint not in inner)
    return outer if len(outer) > 1 else ()
