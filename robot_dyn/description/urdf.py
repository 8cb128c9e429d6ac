"""The elements of a URDF that dynamics needs, each checked and copied with its literals.

Elements are refused if the two parsers would silently read them differently or not at all.
"""

from __future__ import annotations

import re
from math import hypot, inf, isfinite, isnan
from typing import NoReturn

from lxml import etree  # pyright: ignore[reportAttributeAccessIssue]

from robot_dyn.description import connections
from robot_dyn.description.connections import LARGEST
from robot_dyn.description.markup import number_of
from robot_dyn.foundations.errors import DescriptionError, nearest, shorten

MAX_JOINTS = 1000  # Pinocchio crashes the process on chains of some thousands
MOVING = ("revolute", "continuous", "prismatic")
UNBOUNDED = "1e308"  # an unstated limit; urdfdom refuses "inf"

_LITERAL = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]{1,4})?")
_MAX_NAME, _MAX_LITERAL = 256, 64
_XACRO = re.compile(r"(\{[^}]*xacro[^}]*\}|xacro:)")
_EXPRESSION = re.compile(r"\$[{(]")
EXPAND = "expand the file: xacro={} of load, --xacro on the command line, or xacro robot.xacro > robot.urdf"
_OTHER_FORMATS = {
    "sdf": "it is SDF, not URDF; give a URDF exported by the program that wrote it: converters lose the inertias",
    "mujoco": "it is MJCF, not URDF; load reads MJCF from a file that ends with .xml",
}
_MOMENTS = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
_PRODUCTS = ("ixy", "ixz", "iyz")


def checked_robot(robot: etree._Element, source: str) -> tuple[etree._Element, tuple[str, ...]]:
    """Return a canonical copy of a `<robot>` element, and the assumptions made where it departs from the format.

    Raises:
        DescriptionError: If anything in it is undefined or ambiguous.
    """
    check = _Check(source)
    if robot.tag != "robot":
        check.refuse(f"line {robot.sourceline}", other_format(robot.tag))
    check.no_macros(robot)
    if robot.find("link") is None:  # a file of macro definitions, which often has no name
        check.refuse(
            "robot", "has no <link>; add at least one link, or give the file that calls the macros of this one"
        )
    out = etree.Element("robot", name=check.name(robot, "robot"))
    for tag, most in (("joint", MAX_JOINTS), ("link", MAX_JOINTS + 1)):
        count = len(robot.findall(tag))
        if count > most:
            check.refuse("robot", f"has {count} {tag}s, more than the maximum of {most}; split it")
    links = [check.link(link, out) for link in robot.iterfind("link")]
    check.distinct("link", links)
    names = frozenset(links)
    joints = [check.joint(joint, out, names) for joint in robot.iterfind("joint")]
    check.distinct("joint", joints)
    links += check.implicit_root(links, out)
    links = check.connected(links, out)
    connections.one_tree(links, out, check.refuse)
    connections.mimics(out, check.refuse)
    return out, tuple(check.findings)


def other_format(tag: str) -> str:
    """Return why a file that begins with this element is refused, and the remedy."""
    return _OTHER_FORMATS.get(tag, f"it begins with <{shorten(tag)}>, not <robot>; give a URDF file")


def _texts(element: etree._Element) -> tuple[str, ...]:
    """Return all text of an element: attribute values, content and tail."""
    return *map(str, element.attrib.values()), element.text or "", element.tail or ""


class _Check:
    """Copies elements and checks them; every refusal names the file and the link or joint."""

    def __init__(self, source: str) -> None:
        self.source = source
        self.findings: list[str] = []
        self.undefined: dict[str, str] = {}  # undefined parent links, and the joint that names each first

    def refuse(self, where: str, why: str) -> NoReturn:
        raise DescriptionError(f"{self.source}: {where}: {why}")

    def no_macros(self, robot: etree._Element) -> None:
        """Refuse a file with unexpanded expressions; leave out xacro elements in a file without them."""
        macros = [element for element in robot.iter() if _XACRO.match(str(element.tag))]
        if not macros:
            return
        computed = next((node for node in robot.iter() if any(map(_EXPRESSION.search, _texts(node)))), None)
        if computed is not None:
            self.refuse(f"line {computed.sourceline}", f"contains xacro macros; {EXPAND}")
        names = dict.fromkeys(_XACRO.sub("xacro:", element.tag) for element in macros)
        listed = ", ".join(shorten(name) for name in [*names][:6])
        elements = f"{len(macros)} xacro element{'s' * (len(macros) > 1)} ({listed})"
        self.findings.append(
            f"line {macros[0].sourceline}: {elements} left out, with everything they would add to the robot; {EXPAND}"
        )

    def connected(self, links: list[str], robot: etree._Element) -> list[str]:
        """Return the links that joints connect; remove the others from the robot, unless it has no joints."""
        ends = {end.get("link") for role in ("parent", "child") for end in robot.iterfind(f"joint/{role}")}
        free = [link for link in links if ends and link not in ends]
        for link in robot.findall("link") if free else ():
            if link.get("name") not in ends:
                robot.remove(link)
        self.findings += [
            f"link {name!r}: no joint connects it to the robot; it is left out; connect it by a joint, or remove it"
            for name in free
        ]
        return [link for link in links if link not in free]

    def implicit_root(self, links: list[str], robot: etree._Element) -> list[str]:
        """Return the undefined parent link, if it can only be the root; refuse the robot otherwise."""
        children = {child.get("link") for child in robot.iterfind("joint/child")}
        for link, where in self.undefined.items():
            sensible = len(link) <= _MAX_NAME and link.isprintable()
            if len(self.undefined) > 1 or not sensible or not children.issuperset(links):
                self.refuse(where, f"its parent link {shorten(link)!r} is not defined; {nearest(link, sorted(links))}")
            etree.SubElement(robot, "link", name=link)
            self.findings.append(
                f"{where}: its parent link {link!r} is not defined and is taken as the root; add <link name=…>"
            )
        return list(self.undefined)

    def name(self, element: etree._Element, where: str) -> str:
        name = (element.get("name") or "").strip()
        if not name:
            self.refuse(f"<{element.tag}> in line {element.sourceline}", 'has no name; write name="…"')
        if len(name) > _MAX_NAME or not name.isprintable():
            self.refuse(where, f"rename {name[:40]!r}: it has control characters, or more than {_MAX_NAME} characters")
        return name

    def distinct(self, kind: str, names: list[str]) -> None:
        seen: set[str] = set()
        for name in names:
            if name in seen:
                self.refuse(f"{kind} {name!r}", f"is defined twice; rename or remove one <{kind}>")
            seen.add(name)

    def one(self, parent: etree._Element, tag: str, where: str) -> etree._Element | None:
        """Return the only child of that tag, or None."""
        children = parent.findall(tag)
        if len(children) > 1:
            self.refuse(where, f"has {len(children)} <{tag}> elements; keep one")
        return children[0] if children else None

    def first(self, parent: etree._Element, tag: str, where: str) -> etree._Element | None:
        """Return the first child of that tag, as urdfdom does, or None."""
        children = parent.findall(tag)
        if len(children) > 1:
            self.findings.append(f"{where}: has {len(children)} <{tag}> elements; the first is taken; keep one")
        return children[0] if children else None

    def number(
        self,
        element: etree._Element,
        key: str,
        where: str,
        default: str | None = None,
        minimum: float | None = None,
        largest: float = LARGEST,
    ) -> str:
        """Return the literal of an attribute, checked to be one finite decimal number."""
        text = element.get(key, default)
        if text is None:
            self.refuse(where, f'<{element.tag}> has no {key}; write {key}="…"')
        return self.literal(text, f"<{element.tag}> {key}", where, minimum, largest)

    def literal(
        self, text: str | None, what: str, where: str, minimum: float | None = None, largest: float = LARGEST
    ) -> str:
        text = (text or "").strip()
        if len(text) > _MAX_LITERAL or not _LITERAL.fullmatch(text) or not isfinite(float(text)):
            limit = f" of at most {_MAX_LITERAL} characters" if len(text) > _MAX_LITERAL else ""
            remedy = EXPAND if "${" in text or "$(" in text else "correct it"
            self.refuse(where, f"{what} must be a finite decimal number{limit}, got {shorten(text)!r}; {remedy}")
        if abs(float(text)) > largest:
            self.refuse(where, f"{what} is {text}, beyond ±{largest:g} in SI units; correct it")
        if minimum is not None and float(text) < minimum:
            self.refuse(where, f"{what} must not be below {minimum:g}, got {text}; correct it")
        return text

    def triple(self, element: etree._Element | None, key: str, where: str, default: str) -> str:
        """Return three literals separated by single spaces."""
        text = default if element is None else element.get(key, default)
        tag = key if element is None else f"<{element.tag}> {key}"
        words = text.split()
        if len(words) != 3:
            self.refuse(where, f"{tag} must be three numbers, got {shorten(text)!r}; correct it")
        return " ".join(self.literal(word, tag, where) for word in words)

    def origin(self, parent: etree._Element, out: etree._Element, where: str) -> None:
        origin = self.one(parent, "origin", where)
        if origin is not None and (other := [key for key in origin.attrib if "quat" in key]):
            self.refuse(where, f"<origin> has {other[0]}, which is not read; give the rotation as rpy")
        xyz, rpy = (self.triple(origin, key, where, "0 0 0") for key in ("xyz", "rpy"))
        etree.SubElement(out, "origin", xyz=xyz, rpy=rpy)

    def link(self, link: etree._Element, robot: etree._Element) -> str:
        name = self.name(link, "link")
        where = f"link {name!r}"
        out = etree.SubElement(robot, "link", name=name)
        inertial = self.first(link, "inertial", where)
        if inertial is not None:
            mass = self.one(inertial, "mass", where)
            if mass is None:
                self.refuse(where, "<inertial> has no <mass>; add it")
            copy = etree.SubElement(out, "inertial")
            if (basis := inertial.get("estimated")) is not None:  # the mark of robot_dyn.shapes.estimate
                copy.set("estimated", shorten(basis, 200))
            self.origin(inertial, copy, where)
            etree.SubElement(copy, "mass", value=self.number(mass, "value", where, minimum=0.0))
            etree.SubElement(copy, "inertia", self.moments(inertial, where))
        return name

    def moments(self, inertial: etree._Element, where: str) -> dict[str, str]:
        """Return the six moments; unstated products of inertia are 0, and all moments without an <inertia>."""
        inertia = self.one(inertial, "inertia", where)
        if inertia is None:
            self.findings.append(f"{where}: <inertial> has a mass and no <inertia>; all moments are taken as 0; add it")
            return dict.fromkeys(_MOMENTS, "0")
        if left_out := [key for key in _PRODUCTS if inertia.get(key) is None]:
            self.findings.append(
                f"{where}: <inertia> has no {', '.join(left_out)}; taken as 0; add them, urdfdom requires all six"
            )
        return {key: self.number(inertia, key, where, "0" if key in _PRODUCTS else None) for key in _MOMENTS}

    def joint(self, joint: etree._Element, robot: etree._Element, links: frozenset[str]) -> str:
        name = self.name(joint, "joint")
        where, kind = f"joint {name!r}", joint.get("type")
        if kind in ("floating", "planar"):
            self.refuse(
                where, f"is {kind}; only joints with one degree of freedom are supported: {', '.join(MOVING)}, fixed"
            )
        if kind not in (*MOVING, "fixed"):
            what = f"has the unknown type {shorten(kind)!r}" if kind else "has no type"
            self.refuse(where, f"{what}; write one of {', '.join(MOVING)}, fixed")
        out = etree.SubElement(robot, "joint", name=name, type=str(kind))
        self.origin(joint, out, where)
        for role in ("parent", "child"):
            end = self.one(joint, role, where)
            link = "" if end is None else (end.get("link") or "").strip()
            if not link:
                self.refuse(where, f'has no {role} link; add <{role} link="…"/>')
            if link not in links and role == "parent":
                self.undefined.setdefault(link, where)
            elif link not in links:
                self.refuse(where, f"its {role} link {shorten(link)!r} is not defined; {nearest(link, sorted(links))}")
            etree.SubElement(out, role, link=link)
        if kind != "fixed":
            self.motion(joint, out, where)
        return name

    def motion(self, joint: etree._Element, out: etree._Element, where: str) -> None:
        """Copy axis, limits, friction and coupling of a moving joint."""
        axis = self.triple(self.one(joint, "axis", where), "xyz", where, "1 0 0")
        if not 1e-9 < hypot(*map(float, axis.split())) < 1e9:
            self.refuse(where, f"<axis> xyz must be a direction, got {axis!r}; write a unit vector")
        etree.SubElement(out, "axis", xyz=axis)
        self.limit(joint, out, where)
        self.soft_limits(joint, where)
        dynamics = self.one(joint, "dynamics", where)
        if dynamics is not None:
            terms = {key: self.number(dynamics, key, where, "0", minimum=0.0) for key in ("damping", "friction")}
            etree.SubElement(out, "dynamics", terms)
        mimic = self.one(joint, "mimic", where)
        if mimic is not None:
            ratio = self.number(mimic, "multiplier", where, "1")
            offset = self.number(mimic, "offset", where, "0")
            etree.SubElement(out, "mimic", joint=(mimic.get("joint") or "").strip(), multiplier=ratio, offset=offset)

    def limit(self, joint: etree._Element, out: etree._Element, where: str) -> None:
        """Copy the stated limits; write `UNBOUNDED` for unstated ones, because urdfdom requires all four."""
        limit = self.first(joint, "limit", where)
        unbounded = {"lower": "-" + UNBOUNDED, "upper": UNBOUNDED}
        bounds = unbounded | {"effort": UNBOUNDED, "velocity": UNBOUNDED}
        if limit is not None:
            stated = [key for key in bounds if limit.get(key) is not None]
            for key in stated:
                value = self.number(limit, key, where, largest=inf)
                if key in ("effort", "velocity") and float(value) < 0:
                    self.findings.append(f"{where}: its {key} limit {value} is negative and is ignored; correct it")
                else:
                    bounds[key] = value
            # the URDF reference: lower and upper default to 0 where the other one is stated
            for key in {"lower", "upper"} - set(stated) if {"lower", "upper"} & set(stated) else ():
                bounds[key] = "0"
        if joint.get("type") == "continuous":
            bounds |= unbounded
        if float(bounds["lower"]) > float(bounds["upper"]):
            crossed = f"its lower limit {bounds['lower']} is above its upper {bounds['upper']}"
            self.findings.append(f"{where}: {crossed}; both are ignored; exchange them")
            bounds |= unbounded
        etree.SubElement(out, "limit", bounds)

    def soft_limits(self, joint: etree._Element, where: str) -> None:
        """Report soft limits that are not numbers; they are not copied, because dynamics does not need them."""
        soft = self.first(joint, "safety_controller", where)
        for key, text in () if soft is None else soft.items():
            if key in ("soft_lower_limit", "soft_upper_limit") and isnan(number_of(text)):
                self.findings.append(
                    f"{where}: <safety_controller> {key} is {shorten(text)!r}, not a number; correct it, or remove it"
                )
