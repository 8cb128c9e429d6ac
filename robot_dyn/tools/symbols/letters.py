"""Letters for the numbers of a tree, named as in textbooks, each with its value and its place in the file.

    m2 mass · r2 centre of mass · I2 moments about it · l1 from joint 1 to the next · J1 armature · g gravity

Numbers that are zero stay zero. A vector with one nonzero component has one letter, another r2_x, r2_y, r2_z. Further
parts that move with a body, or further joints on it, are 2b, 2c, ….
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from fractions import Fraction
from typing import Any, final

from robot_dyn.foundations import QueryError
from robot_dyn.lagrange import Inertial, Joint, Tree
from robot_dyn.tools.symbols.polynomials import Angle, Component, Letter, twelfths_of

TOLERANCE = 1e-5  # rad: makers state right angles with five digits or more, as 1.5708
MOMENTS = ("xx", "xy", "xz", "yy", "yz", "zz")


@final
@dataclass(frozen=True)
class Meaning:
    """The number that a letter replaces.

    Attributes:
        value: The number, in SI units.
        where: Its place in the file, such as "mass of link 'bar_1'".
    """

    value: float
    where: str

    def __str__(self) -> str:
        return f"{self.value:.6g}: {self.where}"


@final
@dataclass(frozen=True)
class RoundedAngle:
    """An angle of the file that is read as a multiple of π/12.

    Attributes:
        where: Its place in the file.
        value: The angle as stated, in [rad].
        twelfths: k of the multiple k π/12.
    """

    where: str
    value: float
    twelfths: int

    @property
    def change(self) -> float:
        """The multiple minus the stated angle, in [rad]."""
        return self.twelfths * math.pi / 12 - self.value

    def __str__(self) -> str:
        return f"{self.where}: {self.value!r} read as {Fraction(self.twelfths, 12)} π ({self.change:+.0e} rad)"


@final
@dataclass
class Lettering:
    """A tree being lettered.

    Attributes:
        named: True if lengths, masses and moments become letters; general angles always do.
        with_g: True if the strength of gravity becomes the letter g.
        letters: Letters so far.
        angles: Names of letters that are angles.
        rounded: Angles read as multiples.
    """

    named: bool
    with_g: bool = False
    letters: dict[str, Meaning] = field(default_factory=dict)
    angles: list[str] = field(default_factory=list)
    rounded: list[RoundedAngle] = field(default_factory=list)
    _labels: dict[str, int] = field(default_factory=dict)

    def tree(self, tree: Tree, joint_names: tuple[str, ...]) -> Tree:
        """Return the tree with letters; its bodies are numbered by `body_numbers`."""
        numbers = body_numbers(tree, joint_names)
        body = {tree.root: 0}
        joints = []
        for joint in tree.joints:
            body[joint.child] = numbers.get(joint.name, body[joint.parent])
            joints.append(self._joint(joint, body))
        links = tuple(
            replace(link, inertials=tuple(self._inertial(part, body[link.name], link.name) for part in link.inertials))
            if body[link.name]
            else replace(link, inertials=())  # what does not move is in no equation
            for link in tree.links
        )
        return replace(tree, links=links, joints=tuple(joints), gravity=self._gravity(tree.gravity))

    def _joint(self, joint: Joint, body: dict[str, int]) -> Joint:
        where, parent = f"joint {joint.name!r}", body[joint.parent]
        moves = body[joint.child] != parent
        locked = None if joint.locked is None else self._position(joint, joint.locked, parent, "locked position")
        mimic = joint.mimic and replace(
            joint.mimic, offset=self._position(joint, joint.mimic.offset, parent, "mimic offset")
        )
        xyz = joint.xyz
        if not moves or parent:  # the first joint's place adds a constant to V only
            xyz = self._vector("l", parent, xyz, f"origin of {where}") if any(map(_value, xyz)) else xyz
        return replace(
            joint,
            xyz=xyz,
            rpy=self._rpy(joint.rpy, where),
            axis=self._axis(joint.axis, f"axis of {where}") if joint.kind != "fixed" else joint.axis,
            armature=self._number(f"J{body[joint.child]}", joint.armature, f"armature of {where}") if moves else "0",
            locked=locked,
            mimic=mimic,
        )

    def _position(self, joint: Joint, value: Any, parent: int, what: str) -> Any:
        where = f"{what} of joint {joint.name!r}"
        if joint.kind == "prismatic":
            return self._number(f"d{self._label('d', parent)}", value, where)
        return self._angle(value, where)

    def _inertial(self, part: Inertial, body: int, link: str) -> Inertial:
        where, label = f"link {link!r}", self._label("m", body)
        moments = zip(MOMENTS, part.moments, strict=True)
        return Inertial(
            self._number(f"m{label}", part.mass, f"mass of {where}", part.scale),
            tuple(self._number(f"I{label}_{k}", x, f"i{k} of {where}", part.scale) for k, x in moments),
            self._vector("r", label, part.xyz, f"centre of mass of {where}"),
            self._rpy(part.rpy, f"the inertia of {where}"),
        )

    def _gravity(self, gravity: Any) -> Any:
        """Return gravity by its strength g where it is along an axis: g is positive in textbooks."""
        values = [_value(x) for x in gravity]
        if not self.with_g or sum(map(bool, values)) != 1:
            return self._vector("g", "", gravity, "gravity")
        g = float(sum(map(abs, values)))
        self.letters["g"] = Meaning(g, "gravity")
        return tuple(Letter("g", g, 1 if x > 0 else -1) if x else "0" for x in values)

    def _label(self, kind: str, body: int) -> str:
        """Return the number of a body; of further parts on it with b, c, …."""
        key = f"{kind}{body}"
        self._labels[key] = n = self._labels.get(key, 0) + 1
        return f"{body}" if n == 1 else f"{body}{chr(96 + n)}" if n <= 26 else f"{body}n{n}"

    def _vector(self, letter: str, body: Any, values: Any, where: str) -> Any:
        label = self._label(letter, body) if letter == "l" else body
        count = sum(_value(x) != 0 for x in values)
        return tuple(
            self._number(f"{letter}{label}" + ("" if count == 1 else f"_{k}"), x, f"{k} of the {where}")
            for k, x in zip("xyz", values, strict=True)
        )

    def _number(self, name: str, literal: Any, where: str, scale: Any = "1") -> Any:
        exact = _value(literal) * _value(scale)
        if not exact or not self.named:
            return exact
        self.letters[name] = Meaning(float(exact), where)
        return Letter(name, float(exact))

    def _angle(self, literal: Any, where: str) -> Angle:
        angle = float(literal)
        k = twelfths_of(angle, TOLERANCE)
        if k is not None:
            if angle != k * math.pi / 12:
                self.rounded.append(RoundedAngle(where, angle, k))
            return Angle(k)
        name = f"alpha{len(self.angles) + 1}"
        self.angles.append(name)
        self.letters[name] = Meaning(angle, where)
        return Angle(name=name, value=angle)

    def _rpy(self, angles: Any, where: str) -> Any:
        names = zip(("roll", "pitch", "yaw"), angles, strict=True)
        return tuple(self._angle(x, f"{name} of {where}") for name, x in names)

    def _axis(self, axis: Any, where: str) -> Any:
        x, y, z = map(float, axis)
        across = math.hypot(x, y)
        azimuth = self._angle(math.atan2(y, x), f"azimuth of the {where}") if across > TOLERANCE * abs(z) else Angle()
        elevation = self._angle(math.atan2(z, across), f"elevation of the {where}")
        return tuple(Component(azimuth, elevation, k) for k in range(3))


def body_numbers(tree: Tree, joint_names: tuple[str, ...]) -> dict[str, int]:
    """Return the number of the body that each moving joint carries: its place in q; mimic joints follow."""
    mimics = [joint.name for joint in tree.joints if joint.mimic]
    return {name: k for k, name in enumerate((*joint_names, *mimics), 1)}


def readable(tree: Tree) -> Tree:
    """Return the tree with mimic joints locked where their drive is locked, and fixed ones without a mimic.

    Raises:
        QueryError: If a moving mimic joint has another kind than its drive, or turns by a fraction of its angle.
    """
    by_name = {joint.name: joint for joint in tree.joints}
    return replace(tree, joints=tuple(_placed(joint, by_name) for joint in tree.joints))


def _placed(joint: Joint, by_name: dict[str, Joint]) -> Joint:
    """Return a mimic joint locked, if its drive is; sines and cosines of k q are polynomials for whole numbers k."""
    if joint.mimic is None or joint.kind == "fixed":
        return replace(joint, mimic=None)
    drive, multiplier = _placed(by_name[joint.mimic.source], by_name), _value(joint.mimic.multiplier)
    if drive.locked is not None:
        return replace(joint, locked=multiplier * _value(drive.locked) + _value(joint.mimic.offset), mimic=None)
    slides = joint.kind == "prismatic"
    if slides != (drive.kind == "prismatic") or not (slides or multiplier.denominator == 1):
        raise QueryError(
            f"formulas need mimic joints that turn by whole multiples of their drive, or slide with it, but"
            f" {joint.name!r} follows {drive.name!r} {float(multiplier):g} times: lock the drive by"
            f" --lock {drive.name}=0 (in Python arm.with_(lock={{{drive.name!r}: 0.0}})), or remove the <mimic>"
        )
    return joint


def _value(literal: Any) -> Fraction:
    """Return a literal exactly; a float as its shortest decimal, as it was written."""
    return Fraction(literal) if isinstance(literal, str | int | Fraction) else Fraction(repr(float(literal)))
