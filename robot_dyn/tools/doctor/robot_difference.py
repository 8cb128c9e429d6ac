"""Difference of two descriptions of one robot: in bodies, axes and limits, and its effect on N and M."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from math import degrees, pi
from pathlib import Path
from typing import final

import numpy as np
from numpy.typing import ArrayLike

from robot_dyn import Lagrangian, Robot
from robot_dyn.description import catalog, structure_of
from robot_dyn.foundations import (
    Answer,
    Block,
    QueryError,
    Table,
    first_moment,
    hat,
    instance,
    integer,
    number,
    reported,
    shown,
    truth,
)
from robot_dyn.queries import of_joint, unit
from robot_dyn.tools.doctor.coordinate_map import (
    Basis,
    JointMap,
    Laid,
    Obstacle,
    Unmapped,
    laid_bodies,
    matched_names,
    position_limits,
)
from robot_dyn.tools.doctor.largest_difference import LargestDifference, largest_differences, mapped_pair

_DIFFERENT = 1e-5  # of the size of a value: rounded angles such as 1.5708 cause smaller differences
_LISTED = 4  # bodies, and joints without counterpart, that are printed
_MEANING = {"N": "N (torques at rest)", "M": "M (mass matrix)"}
_BOTH = " and ".join(_MEANING.values())
_REMEDIES = {
    Obstacle.MISSING: "name the counterpart (joints=, --joint A=B), or lock it (with_(lock=…), --lock NAME=0)",
    Obstacle.TYPE: "correct the type in one file, or name another counterpart with joints=",
    Obstacle.CARRIER: "name counterparts with joints=, or lock the joints in between",
    Obstacle.COUPLED: "lock it in both, or correct its <mimic>",
    Obstacle.AXIS: "correct the axis or origin in one file, or state the sign and offset of the joints before it",
}


@final
@dataclass(frozen=True)
class Difference:
    """A value that differs between two descriptions.

    Attributes:
        joint: Joint of a whose axis, limits or body differ; empty for the whole robot.
        quantity: Name of the value. Mass, centre and moments are those of the joint's body: all links without relative
            motion. Centre and moments are in the joint's frame of a, moments about the centre of mass. Links fixed to
            the base have no joint and are not compared.
        unit: Its unit.
        a, b: Components of the value; those of b are converted to the coordinates and axes of a. Empty if absent.
    """

    joint: str
    quantity: str
    unit: str
    a: tuple[float, ...]
    b: tuple[float, ...]


@final
@dataclass(frozen=True, eq=False, repr=False)
class RobotDifference(Answer):
    """The difference of two descriptions of one robot.

    Attributes:
        names: Names of the two descriptions.
        sources: Their files.
        joints: The map q_b = s q_a + o, by joint.
        unmapped: Joints that prevent a comparison of torques; then `largest` is empty.
        not_compared: Moving joints of a, and of b, whose values are not compared: they have no counterpart, or a joint
            that carries them has none.
        differences: Values of the other joints that differ by more than 1e-5 of their size.
        order: Joint names of q_a and of q_b, each in the names of a, if their order differs; otherwise empty.
        largest: Largest differences found of N and of M, by joint.
        tolerance: Largest accepted difference, in [N m] or [N]; entries of M are multiplied by 1 rad/s² or 1 m/s².
        samples: Number of random states of the search.
    """

    names: tuple[str, str]
    sources: tuple[str, str]
    joints: tuple[JointMap, ...]
    unmapped: tuple[Unmapped, ...]
    not_compared: tuple[tuple[str, ...], tuple[str, ...]]
    differences: tuple[Difference, ...]
    order: tuple[tuple[str, ...], ...]
    largest: tuple[LargestDifference, ...]
    tolerance: float
    samples: int

    @reported
    def agrees(self) -> bool:
        """True if no difference found of N or M exceeds the tolerance, and every joint has a counterpart."""
        return not self.unmapped and all(abs(row.difference) <= self.tolerance for row in self.largest)

    @property
    def worst(self) -> LargestDifference | None:
        """The largest difference found of N; None without a map of all joints."""
        return self._worst("N")

    def _worst(self, quantity: str) -> LargestDifference | None:
        rows = (row for row in self.largest if row.quantity == quantity)
        return max(rows, key=lambda row: abs(row.difference), default=None)

    @property
    def sentence(self) -> str:
        """The result in one sentence."""
        a, b = self.names
        if self.unmapped:
            groups = dict.fromkeys((x.file, x.obstacle) for x in self.unmapped)
            return f"no torques of {a} and {b} are compared: {'; '.join(self._unmapped(*group) for group in groups)}"
        found = [
            f"{abs(row.difference):.3g} {row.unit} at {row.joint}{_of_effort(row)}, in {_MEANING[row.quantity]}"
            for row in (self.worst, self._worst("M"))
            if row is not None and row.difference
        ]
        what = f"largest differences found {'; '.join(found)}" if found else f"no difference found in {_BOTH}"
        if not found and self.differences:
            what += f", but these values differ: {', '.join(dict.fromkeys(x.quantity for x in self.differences))}"
        moved = ", ".join(x.a for x in self.joints if (x.sign, x.offset) != (1, 0.0))
        converted = f"; q is converted at {moved}: another sign or zero position" * bool(moved)
        return f"{a} and {b} {'agree' if self.agrees else 'differ'}: {what}{converted}"

    def blocks(self) -> Iterator[Block]:
        a, b = self.names
        yield self.sentence
        yield ""
        yield from (f"{name}: {source}" for name, source in zip(self.names, self.sources, strict=True))
        if self.joints:
            yield ""
            yield from self._map()
        if self.order:
            yield ""
            yield f"the order of q differs: {', '.join(self.order[0])} in {a}; {', '.join(self.order[1])} in {b}"
        yield ""
        if self.differences:
            yield (
                f"values that differ, converted to the coordinates and joint frames of {a}; masses, centres and moments"
                " are those of the link that the joint moves, with all links fixed to it:"
            )
            rows = tuple(
                (x.joint or "(robot)", x.quantity + f" [{x.unit}]" * bool(x.unit), *_numbers(x.a, x.b))
                for x in self.differences
            )
            yield Table(("joint", "value", a, b), rows, right=(a, b))
        elif self.joints:
            of = "" if self._compares_all else f" of {_joined(x.a for x in self.joints)}"
            yield (
                f"no values{of} differ in the coordinates of {a}: masses, centres and moments of moving links, axes and"
                " limits; links fixed to the base are not compared"
            )
        if not self._compares_all:
            pairs = zip(self.not_compared, self.names, strict=True)
            yield f"not compared: {'; '.join(f'{_joined(joints)} of {name}' for joints, name in pairs if joints)}"
        if self.largest:
            yield ""
            yield from self._cost()

    @property
    def _compares_all(self) -> bool:
        return not any(self.not_compared)

    def _unmapped(self, file: str, obstacle: Obstacle) -> str:
        """Return the unmapped joints of a file with one obstacle, and the remedy."""
        own, other = self.names[:: 1 if file == "a" else -1]
        joints = [x.joint for x in self.unmapped if (x.file, x.obstacle) == (file, obstacle)]
        listed = ", ".join(joints[:_LISTED]) + f", … ({len(joints)} in all)" * (len(joints) > _LISTED)
        where = f" in {other}" if obstacle is Obstacle.MISSING else ""
        return f"{listed} of {own}: {obstacle}{where}; {_REMEDIES[obstacle]}"

    def _map(self) -> Iterator[Block]:
        a, b = self.names
        if all((x.a, x.sign, x.offset) == (x.b, 1, 0.0) for x in self.joints):
            given = [x.a for x in self.joints if x.basis is Basis.GIVEN]
            shown_by = "as names and joint axes show"
            if given:
                all_given = len(given) == len(self.joints)
                shown_by = "as given" if all_given else f"as given at {_joined(given)}, otherwise {shown_by}"
            of = "" if self._compares_all else f" at {_joined(x.a for x in self.joints)}"
            yield f"equal coordinates{of}: q of {b} = q of {a}, {shown_by}"
            return
        yield f"map of coordinates: q of {b} = s · q of {a} + o"
        yield "correct a row by signs= or offsets= (--sign, --offset); compare at equal q by same_q=True (--same-q)"
        rows = tuple((x.a, x.b, f"{x.sign:+d}", _offset(x.offset), x.basis.value) for x in self.joints)
        yield Table(
            (f"joint of {a}", f"joint of {b}", "s", "o [rad] or [m]", "known from"), rows, right=("s", "o [rad] or [m]")
        )

    def _cost(self) -> Iterator[Block]:
        a, b = self.names
        yield (
            f"largest differences found, |{b} − {a}|, in {_BOTH}, from {self.samples} random postures within the joint"
            " limits of both; larger ones may exist:"
        )
        M = {row.joint: row for row in self.largest if row.quantity == "M"}
        rows = tuple(
            (row.joint, f"{abs(row.difference):.3g} {row.unit}", _percent(row.effort_fraction),
             f"{abs((m := M[row.joint]).difference):.3g} {m.unit}", m.column if m.difference else "")
            for row in self.largest if row.quantity == "N"
        )  # fmt: skip
        yield Table(
            ("joint", "N", "of its effort limit", "M", "column of M"), rows, right=("N", "of its effort limit", "M")
        )
        yield f"tolerance: {self.tolerance:g} N m or N; M counts at 1 rad/s² or 1 m/s²"
        for row in (self.worst, self._worst("M")):
            if row is not None and row.difference:
                entry = row.joint if row.quantity == "N" else f"{row.joint}, {row.column}"
                yield ""
                yield (
                    f"{row.quantity} at {entry}: {row.a:.4g} {row.unit} in {a}, {row.b:.4g} {row.unit} in {b}, where q"
                    f" of {a} = {', '.join(f'{round(x, 3) + 0.0:g}' for x in row.q)}"
                )
                listed = ", ".join(f"{share.link} {share.value:+.3g}" for share in row.shares[:_LISTED])
                rest = sum(share.value for share in row.shares[_LISTED:])
                others = f", others {rest:+.3g}" if len(row.shares) > _LISTED else ""
                yield f"  by link, with the links fixed to it, this difference is [{row.unit}]: {listed}{others}"


def diff_robots(
    a: Robot,
    b: Robot,
    *,
    joints: Mapping[str, str] | None = None,
    signs: Mapping[str, float] | None = None,
    offsets: Mapping[str, float] | None = None,
    same_q: bool = False,
    tolerance: float = 0.01,
    samples: int = 1000,
    seed: int = 0,
) -> RobotDifference:
    """Compare two descriptions of one robot: their values, and the largest differences of N and M that these cause.

    Joints are matched by name. Signs and zero positions may differ: the map q_b = s q_a + o is proposed from the joint
    axes. Torques are compared only if all moving joints have a counterpart; `unmapped` lists the others. The largest
    differences are searched by random states and local ascent within the limits that both files allow: they are lower
    bounds.

    Args:
        a: A robot.
        b: The robot of another file.
        joints: Joint of b by joint of a, where the names differ.
        signs: s by joint of a, 1 or −1, where the proposal is wrong; the other joints keep their proposals.
        offsets: o by joint of a, in [rad] or [m], where the proposal is wrong.
        same_q: Compare at equal q, without proposals: s = 1 and o = 0, except where given.
        tolerance: Largest accepted difference of N, in [N m] or [N], and of M at 1 rad/s² or 1 m/s².
        samples: Number of random states.
        seed: Seed of the random generator.

    Raises:
        QueryError: If a joint is unknown, a sign is not ±1 or another argument is not allowed.

    Example:
        >>> import robot_dyn as rd
        >>> arm = rd.load("planar_2r")
        >>> rd.tools.doctor.diff_robots(arm, arm).agrees
        True
    """
    for label, robot in (("a", a), ("b", b)):
        instance(label, robot, Robot, "give a robot, for example rd.load('ur5')")
    tolerance, samples = number("tolerance", tolerance, least=0), integer("samples", samples, least=1, most=10**6)
    seed = integer("seed", seed, most=2**128 - 1)
    for label, values in (("joints", joints), ("signs", signs), ("offsets", offsets)):
        if not isinstance(values, Mapping | None):
            raise QueryError(f"{label} must be values by joint of a, such as {{'joint_1': …}}, got {shown(values)}")
    names = matched_names(a, b, joints or {})
    signs, offsets = dict(signs or {}), dict(offsets or {})
    if truth("same_q", same_q):
        signs, offsets = dict.fromkeys(names, 1.0) | signs, dict.fromkeys(names, 0.0) | offsets
    laid, unmapped = laid_bodies(a, b, names, signs, offsets)
    maps = tuple(body.map for body in laid)
    largest, order, differences = (), (), [*_of_robot(a, b), *_of_bodies(a, b, laid), *_of_followers(a, b, laid)]
    differences += _of_coordinates(a, b, maps)
    if not unmapped:
        pair = mapped_pair(a, b, maps)
        in_b = tuple(pair.bodies[name] for name in b.joint_names)
        order = () if in_b == a.joint_names else (a.joint_names, in_b)
        structure = structure_of(a.description, a.edits)
        links = {name: joint.child for name, joint in structure.joints.items()}
        largest = tuple(largest_differences(pair, links, samples, seed))
    place = {name: i for i, name in enumerate(("", *(x.a for x in maps)))}
    differences.sort(key=lambda x: place.get(x.joint, len(place)))
    sources = catalog.abbreviated(a.description.source), catalog.abbreviated(b.description.source)
    return RobotDifference(
        names=_labels(a, b),
        sources=sources,
        joints=maps,
        unmapped=unmapped,
        not_compared=(_others(a, {x.a for x in maps}), _others(b, {x.b for x in maps})),
        differences=tuple(differences),
        order=order,
        largest=largest,
        tolerance=tolerance,
        samples=samples,
    )


def _others(robot: Robot, compared: set[str]) -> tuple[str, ...]:
    return tuple(body.joint for body in Lagrangian(robot).linkage.bodies if body.joint not in compared)


def _labels(a: Robot, b: Robot) -> tuple[str, str]:
    """Return distinct names of the two descriptions: robots, files, or a and b."""
    stems = [Path(robot.description.source).name.partition(".")[0] for robot in (a, b)]
    pairs = ((a.name, b.name), (stems[0], stems[1]), ("a", "b"))
    return next(pair for pair in pairs if pair[0] != pair[1])


def _of_robot(a: Robot, b: Robot) -> Iterator[Difference]:
    yield from _differing("", "gravity", "m/s²", a.gravity, b.gravity)


def _of_bodies(a: Robot, b: Robot, laid: tuple[Laid, ...]) -> Iterator[Difference]:
    """Yield the differences of axes and of merged bodies."""
    linkage, other = Lagrangian(a).linkage, Lagrangian(b).linkage
    length = max((float(np.linalg.norm(body.pose.p)) for body in linkage.bodies), default=0.0) or 1.0
    for x in laid:
        name, frame = x.map.a, x.a
        if x.turn > _DIFFERENT:
            yield Difference(name, "axis turned by", "deg", (0.0,), (degrees(x.turn),))
        if (shift := float(np.linalg.norm(x.shift))) > _DIFFERENT * length:
            yield Difference(name, "axis moved by", "m", (0.0,), (shift,))
        (m, c, moments), (m_b, c_b, moments_b) = _body(linkage.inertias[x.i]), _body(other.inertias[x.k])
        R = frame.R.T @ x.b.R
        c_b = R @ c_b + frame.R.T @ (x.b.p - frame.p)
        moments_b = R @ moments_b @ R.T
        yield from _differing(name, "mass", "kg", [m], [m_b])
        if m > 0 and m_b > 0:
            yield from _differing(name, "centre of mass x, y, z", "m", c, c_b, length)
        size = float(max(np.trace(moments), np.trace(moments_b)))
        yield from _differing(name, "moments Ixx, Iyy, Izz", "kg m²", np.diag(moments), np.diag(moments_b), size)
        products = np.triu_indices(3, 1)
        yield from _differing(name, "products Ixy, Ixz, Iyz", "kg m²", moments[products], moments_b[products], size)


def _of_followers(a: Robot, b: Robot, laid: tuple[Laid, ...]) -> Iterator[Difference]:
    """Yield the differences of q_follower = ratio · q + offset of a, and the followers that only one file has."""
    of_a, of_b = ({x.joint: row for x, *row in zip(y.bodies, y.couplings.S, y.couplings.s0, strict=True)}
                  for y in (Lagrangian(a).linkage, Lagrangian(b).linkage))  # fmt: skip
    maps = {x.map.a: x.map for x in laid}
    quantity, matched = "ratio and offset to the joint it follows", {x.b for x in maps.values()}
    for name in sorted(of_a.keys() - {*a.joint_names}):
        row, offset = of_a[name]
        source = int(np.argmax(row != 0))
        value: tuple[float, ...] = ()
        if name in maps and a.joint_names[source] in maps:
            own, free = maps[name], maps[a.joint_names[source]]
            row_b, offset_b = of_b[own.b]
            ratio = float(row_b[b.joint_names.index(free.b)])
            value = own.sign * ratio * free.sign, own.sign * (ratio * free.offset + float(offset_b) - own.offset)
            yield from _differing(name, quantity, "", [row[source], offset], value, 1.0)
        else:
            yield Difference(name, quantity, "", (float(row[source]), float(offset)), ())
    for name in sorted(of_b.keys() - {*b.joint_names} - matched):
        row, offset = of_b[name]
        yield Difference("", f"follower {name}, ratio and offset", "", (), (float(row[row != 0][0]), float(offset)))


def _body(inertia: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
    """Return mass, centre of mass and moments about it of a spatial inertia (6, 6)."""
    m = float(inertia[0, 0])
    c = first_moment(inertia) / m if m > 0 else np.zeros(3)
    return m, c, inertia[3:, 3:] + m * hat(c) @ hat(c)


def _of_coordinates(a: Robot, b: Robot, maps: tuple[JointMap, ...]) -> Iterator[Difference]:
    """Yield the differences of limits, friction and armature."""
    for joint in maps:
        name = joint.a
        if name not in a.joint_names:  # a follower
            continue
        j, k = a.joint_names.index(name), b.joint_names.index(joint.b)
        kind = a.joint_types[j]
        yield from _differing(name, "position limits", unit("q", kind), *position_limits(joint, a, b), pi)
        for quantity, symbol, x, y in (
            ("effort limit", "N m", a.effort_limit, b.effort_limit),
            ("velocity limit", "rad/s", a.velocity_limit, b.velocity_limit),
            ("viscous friction", "N m s/rad", a.damping, b.damping),
            ("dry friction", "N m", a.friction, b.friction),
            ("armature", "kg m²", a.armature, b.armature),
        ):
            yield from _differing(name, quantity, of_joint(symbol, kind), [x[j]], [y[k]])


def _differing(
    joint: str, quantity: str, unit: str, a: ArrayLike, b: ArrayLike, size: float = 0.0
) -> Iterator[Difference]:
    """Yield the difference of two values if it exceeds a fraction of their size."""
    x, y = np.asarray(a, dtype=float), np.asarray(b, dtype=float)
    equal = x == y  # infinite limits
    scale = max(size, *np.abs(np.where(equal, 0.0, x)), *np.abs(np.where(equal, 0.0, y)))
    change = np.abs(np.where(equal, 0.0, x) - np.where(equal, 0.0, y))
    if np.any(change > _DIFFERENT * (scale if np.isfinite(scale) else 1.0)):
        tiny = 1e-12 * (scale if np.isfinite(scale) else 1.0)
        rounded = (tuple(0.0 if abs(value) <= tiny else float(value) for value in values) for values in (x, y))
        yield Difference(joint, quantity, unit, *rounded)


def _joined(names: Iterable[str]) -> str:
    return ", ".join(names)


def _of_effort(row: LargestDifference) -> str:
    return f", {_percent(row.effort_fraction)} of its effort limit" if np.isfinite(row.effort_fraction) else ""


def _percent(fraction: float) -> str:
    return f"{100 * fraction:.2g} %" if np.isfinite(fraction) else "—"


def _offset(offset: float) -> str:
    turns = offset / (pi / 4)
    exact = {-4: "−π", -3: "−3π/4", -2: "−π/2", -1: "−π/4", 1: "π/4", 2: "π/2", 3: "3π/4", 4: "π"}
    return exact[round(turns)] if round(turns) in exact and abs(turns - round(turns)) < 1e-9 else f"{offset:.6g}"


def _numbers(*values: tuple[float, ...]) -> list[str]:
    """Return values as texts of 4 digits, of more if they would read alike."""
    for digits in (4, 7, 17):
        texts = [", ".join(f"{x + 0.0:.{digits}g}" if np.isfinite(x) else "none" for x in row) for row in values]
        if len({*texts}) > 1:
            break
    return [text or "absent" for text in texts]
