"""The map q_b = s q_a + o between the coordinates of two descriptions of one robot, proposed from their joint axes.

From the base outwards, each body of b is laid on its counterpart in a: its joint axis on that of a, which gives the
sign s; then turned about it until the axes of the joints that it carries coincide, which gives the offset o. An axis is
a line, so some angles are ambiguous by π: the best of up to 64 combinations is kept, measured by the misfit of the
axes, then of the centres of mass and of links of one name, then by the number of joints without q_b = q_a. Whole turns,
which no axis shows, are chosen by the position limits. Values that are given replace the proposal of their joint alone.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from enum import StrEnum
from itertools import takewhile
from math import atan2, pi
from typing import NamedTuple, final

import numpy as np

from robot_dyn import Lagrangian, Robot
from robot_dyn.foundations import QueryError, first_moment, nearest, number, rotation, shown
from robot_dyn.lagrange import Linkage, Pose

_LARGEST_TURN = 0.35  # [rad]; axes farther apart are not those of one joint
_SNAP = 0.02  # [rad]; offsets this close to a multiple of π/4 are rounded to it: calibrated files differ by less
_LEAST = 1e-3  # [m], or sine of an angle: shorter vectors give no direction
_BEAM = 64
_BODY, _PLAIN = 0.1, 1e-3  # weights of centres of mass and links, and of joints that are not mapped by q_b = q_a


class Basis(StrEnum):
    """Origin of the sign and the offset of a joint."""

    AXES = "joint axes"
    ASSUMED = "assumed: no joint axis shows o"
    GIVEN = "given"


class Obstacle(StrEnum):
    """Reason why a joint of one description has no counterpart in the other."""

    MISSING = "no joint of this name"
    TYPE = "one is revolute, the other prismatic"
    CARRIER = "it is carried by different joints"
    COUPLED = "only one of them follows another joint"
    AXIS = "its axes differ by more than 20°"


@final
@dataclass(frozen=True)
class JointMap:
    """The map q_b = s q_a + o of a joint.

    Attributes:
        a, b: Names of the joint in the two descriptions.
        sign: s, 1 or −1.
        offset: o, in [rad] or [m].
        basis: Origin of both.
    """

    a: str
    b: str
    sign: int
    offset: float
    basis: Basis


@final
@dataclass(frozen=True)
class Unmapped:
    """A joint that prevents a comparison of torques.

    Attributes:
        file: "a" or "b".
        joint: Name of the joint in that file.
        obstacle: The reason.
    """

    file: str
    joint: str
    obstacle: Obstacle


class Laid(NamedTuple):
    """A body of b laid on a body of a, with a at q = 0.

    Attributes:
        i, k: Indices of the bodies of a and b.
        map: Map of their joint.
        turn: Angle between the axes, in [rad].
        shift: Offset of the axis of b from that of a, in the base of a, (3,) in [m].
        a, b: Placements of the frames of both bodies in the base of a.
    """

    i: int
    k: int
    map: JointMap
    turn: float
    shift: np.ndarray
    a: Pose
    b: Pose


def matched_names(a: Robot, b: Robot, given: Mapping[str, str]) -> dict[str, str]:
    """Return the moving joint of b for each of a: as given, by equal names, then by names that differ in a prefix.

    Raises:
        QueryError: If a given name is unknown, or given twice.
    """
    of_a, of_b = ([body.joint for body in Lagrangian(robot).linkage.bodies] for robot in (a, b))
    for side, names, known in (("a", given.keys(), of_a), ("b", given.values(), of_b)):
        for name in names:
            if name not in known:
                raise QueryError(f"joints: {side} has no moving joint {shown(name)}; {nearest(str(name), known)}")
    if len({*given.values()}) < len(given):
        raise QueryError("joints: two joints of a have the same counterpart in b; name each joint of b once")
    names = dict(given)
    names |= {name: name for name in of_a if name in of_b and name not in given and name not in given.values()}
    rest_a, rest_b = ([x for x in of_a if x not in names], [x for x in of_b if x not in names.values()])
    ends = _without_prefix(rest_b)
    return names | {name: ends[end] for end, name in _without_prefix(rest_a).items() if end in ends}


def _without_prefix(names: list[str]) -> dict[str, str]:
    """Return names by their letters after the common prefix; none for a single name, which is its own prefix."""
    prefix = sum(1 for _ in takewhile(lambda letters: len({*letters}) == 1, zip(*names, strict=False)))
    return {name[prefix:]: name for name in names} if len(names) > 1 else {}


def laid_bodies(
    a: Robot, b: Robot, names: Mapping[str, str], signs: Mapping[str, float], offsets: Mapping[str, float]
) -> tuple[tuple[Laid, ...], tuple[Unmapped, ...]]:
    """Return the bodies of b laid on those of a, parents first, and the joints that prevent a map of all coordinates.

    Args:
        a: A robot.
        b: The robot of another file.
        names: Joint of b for each joint of a.
        signs: s that are given, by joint of a.
        offsets: o that are given, by joint of a.

    Raises:
        QueryError: If a joint is unknown, a sign is not ±1 or an offset is not a number.
    """
    for label, values in (("signs", signs), ("offsets", offsets)):
        for name, value in values.items():
            if name not in names:
                raise QueryError(f"{label}: {shown(name)} is not a matched joint of a; {nearest(str(name), names)}")
            if number(f"{label}[{name!r}]", value) not in (1, -1) and values is signs:
                raise QueryError(f"signs[{name!r}] must be 1 or -1, got {shown(value)}")
    of_a, of_b = Lagrangian(a).linkage, Lagrangian(b).linkage
    pairs, obstacles = _pairs(of_a, of_b, names)
    laid = tuple(
        x._replace(map=_turned(x.map, a, b)) if of_a.bodies[x.i].revolute and x.map.a in a.joint_names else x
        for x in _best(of_a, of_b, pairs, {})
    )
    if signs or offsets:  # joints without given values keep their proposals
        maps = {
            x.a: x if x.a not in {**signs, **offsets} else JointMap(
                x.a, x.b, int(signs.get(x.a, x.sign)), float(offsets.get(x.a, x.offset)), Basis.GIVEN
            )
            for x in (body.map for body in laid)
        }  # fmt: skip
        laid = _best(of_a, of_b, pairs, maps)
    obstacles += [
        Unmapped("a", body.map.a, Obstacle.AXIS)
        for body in laid
        if body.turn > _LARGEST_TURN and body.map.basis is not Basis.GIVEN
    ]
    return laid, tuple(obstacles)


def position_limits(joint: JointMap, a: Robot, b: Robot) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return the position limits of a joint in a, and those in b converted to the coordinate of a."""
    j, k = a.joint_names.index(joint.a), b.joint_names.index(joint.b)
    low, high = sorted(joint.sign * (float(end[k]) - joint.offset) for end in (b.lower, b.upper))
    return (float(a.lower[j]), float(a.upper[j])), (low, high)


def _turned(joint: JointMap, a: Robot, b: Robot) -> JointMap:
    """Return the map with o + 2πk: the smallest |o| of those at which the position limits overlap most."""
    overlaps = dict[JointMap, float]()
    for k in range(-3, 4):
        turned = replace(joint, offset=joint.offset + 2 * pi * k)
        (low, high), (low_b, high_b) = position_limits(turned, a, b)
        overlaps[turned] = min(high, high_b) - max(low, low_b)
    largest = max(overlaps.values()) - _SNAP
    return min((x for x in overlaps if overlaps[x] >= largest), key=lambda x: (round(abs(x.offset), 9), -x.offset))


def _best(a: Linkage, b: Linkage, pairs: Mapping[int, int], maps: Mapping[str, JointMap]) -> tuple[Laid, ...]:
    """Return the bodies of b laid on those of a by these maps; without maps, by those of the least misfit."""
    size = max((float(np.linalg.norm(body.pose.p)) for body in a.bodies), default=0.0) or 1.0
    beam: list[tuple[float, tuple[Laid, ...]]] = [(0.0, ())]
    for i in pairs:
        beam = [
            (cost + _misfit(a, b, body, size), (*laid, body))
            for cost, laid in beam
            for body in _laid(a, b, pairs, i, laid, maps.get(a.bodies[i].joint))
        ]
        beam = sorted(beam, key=lambda entry: entry[0])[:_BEAM]
    return beam[0][1]


def _pairs(a: Linkage, b: Linkage, names: Mapping[str, str]) -> tuple[dict[int, int], list[Unmapped]]:
    """Return the body of b for each of a whose joint and carrier are matched, and the first obstacles of each chain."""
    index = {body.joint: k for k, body in enumerate(b.bodies)}
    pairs, obstacles = {-1: -1}, list[Unmapped]()
    for i, body in enumerate(a.bodies):
        is_free = body.joint in a.joint_names
        if body.joint not in names:
            if is_free:
                obstacles.append(Unmapped("a", body.joint, Obstacle.MISSING))
            continue
        other = b.bodies[index[names[body.joint]]]
        if body.revolute != other.revolute:
            obstacles.append(Unmapped("a", body.joint, Obstacle.TYPE))
        elif is_free != (other.joint in b.joint_names):
            obstacles.append(Unmapped("a", body.joint, Obstacle.COUPLED))
        elif pairs.get(body.parent) == other.parent:
            pairs[i] = index[other.joint]
        elif (body.parent in pairs and other.parent in pairs.values()) or not obstacles:
            obstacles.append(Unmapped("a", body.joint, Obstacle.CARRIER))
    matched = {*names.values()}
    obstacles += [Unmapped("b", name, Obstacle.MISSING) for name in b.joint_names if name not in matched]
    del pairs[-1]
    return pairs, obstacles


def _laid(
    a: Linkage, b: Linkage, pairs: Mapping[int, int], i: int, laid: tuple[Laid, ...], stated: JointMap | None
) -> Iterator[Laid]:  # fmt: skip
    """Yield body i of b laid on that of a by a stated map, or for each candidate of its offset."""
    body, other = a.bodies[i], b.bodies[pairs[i]]
    below = {x.i: x for x in laid}
    still = Pose(np.eye(3), np.zeros(3))
    carrier, carrier_b = (below[body.parent].a, below[body.parent].b) if body.parent in below else (still, still)
    here, there = carrier @ body.pose, carrier_b @ other.pose
    axis, other_axis = here.R @ body.axis, there.R @ other.axis
    sign = 1 if axis @ other_axis >= 0 else -1
    turn, R = _between(sign * other_axis, axis)
    gap = there.p - here.p
    gap = gap - (gap @ axis) * axis if body.revolute else np.zeros(3)
    there = Pose(R @ there.R, there.p - gap)
    children = [(here @ a.bodies[j].pose, a.bodies[j], there @ b.bodies[pairs[j]].pose, b.bodies[pairs[j]])
                for j in pairs if a.bodies[j].parent == i]  # fmt: skip
    lines = [((x.p - here.p, x.R @ u.axis), (y.p - here.p, y.R @ w.axis)) for x, u, y, w in children]
    if body.parent not in below and body.revolute:  # the base of b may stand elsewhere
        feet = (_foot(axis, *line_b) - _foot(axis, *line_a) for line_a, line_b in lines if _is_crossed(axis, line_a[1]))
        slide = next(feet, 0.0) * axis
        gap, there = gap + slide, Pose(there.R, there.p - slide)
    basis = Basis.AXES
    if stated is not None:
        candidates = [sign * stated.offset]
    else:
        candidates = [*_candidates(axis, lines, body.revolute)]
        if not candidates:
            basis = Basis.ASSUMED
            candidates = [_snapped(_about(axis, here.R @ there.R.T)), *np.arange(-1, 3) * (pi / 2)] * body.revolute
        candidates.append(0.0)
    for x in dict.fromkeys(candidates):
        turned = rotation(axis, x) if body.revolute else np.eye(3)
        slid = np.zeros(3) if body.revolute else x * axis
        placed = Pose(turned @ there.R, here.p + turned @ (there.p - here.p) + slid)
        offset = float(sign * x) + 0.0
        offset += 2 * pi if body.revolute and offset <= -pi + 1e-9 else 0.0
        own = stated or JointMap(body.joint, other.joint, sign, offset, basis)
        angle = turn if own.sign == sign else pi - turn
        yield Laid(i, pairs[i], own, angle, gap, here, placed)


def _candidates(axis: np.ndarray, lines: list, revolute: bool) -> Iterator[float]:
    """Yield angles about an axis, or slides along it, that lay lines (point, direction) of b on those of a."""
    for (p, d), (r, e) in lines:
        if not revolute:
            if _is_crossed(axis, d) and _is_crossed(axis, e):
                yield float(_foot(axis, p, d) - _foot(axis, r, e))
            continue
        if _is_crossed(axis, d) and _is_crossed(axis, e):
            angle = _angle(axis, e, d)
            yield from (_snapped(angle), _snapped(angle + pi))
        n, m = _normal(axis, p, d), _normal(axis, r, e)
        if min(np.linalg.norm(n), np.linalg.norm(m)) > _LEAST:
            yield _snapped(_angle(axis, m, n))


def _misfit(a: Linkage, b: Linkage, body: Laid, size: float) -> float:
    """Return the cost of a laid body in [m]: axis, centre of mass, links; a little for maps other than q_b = q_a."""
    at_base = a.bodies[body.i].parent < 0
    cost = body.turn * size + (0.0 if at_base else float(np.linalg.norm(body.shift)))
    (m, c), (other_m, other_c) = (
        (inertia[0, 0], first_moment(inertia)) for inertia in (a.inertias[body.i], b.inertias[body.k])
    )
    if m > 0 and other_m > 0:
        centre, other = body.a.R @ (c / m) + body.a.p, body.b.R @ (other_c / other_m) + body.b.p
        cost += _BODY * float(np.linalg.norm(centre - other))
    for name, (index, pose, _) in a.links.items():  # frames such as tool0
        if index == body.i and name in b.links and b.links[name][0] == body.k:
            cost += _BODY * float(np.linalg.norm((body.a @ pose).p - (body.b @ b.links[name][1]).p))
    return cost + _PLAIN * size * ((body.map.sign < 0) + (body.map.offset != 0))


def _between(u: np.ndarray, w: np.ndarray) -> tuple[float, np.ndarray]:
    """Return the angle from one unit vector to another, and the rotation about their common normal."""
    normal = np.cross(u, w)
    sine, cosine = float(np.linalg.norm(normal)), float(u @ w)
    angle = atan2(sine, cosine)
    return angle, rotation(normal / sine, angle) if sine > 0 else np.eye(3)


def _angle(axis: np.ndarray, u: np.ndarray, w: np.ndarray) -> float:
    """Return the angle about an axis from the plane of u to that of w."""
    u, w = u - (u @ axis) * axis, w - (w @ axis) * axis
    return atan2(axis @ np.cross(u, w), u @ w)


def _about(axis: np.ndarray, R: np.ndarray) -> float:
    """Return the angle about an axis that is closest to a rotation."""
    skew = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    return atan2(float(axis @ skew), float(np.trace(R) - axis @ R @ axis))


def _is_crossed(axis: np.ndarray, d: np.ndarray) -> bool:
    return bool(np.linalg.norm(np.cross(axis, d)) > _LEAST)


def _foot(axis: np.ndarray, p: np.ndarray, d: np.ndarray) -> float:
    """Return the place on an axis through 0 that is nearest to the line p + x d."""
    c = axis @ d
    return float((axis @ p - c * (d @ p)) / (1 - c * c))


def _normal(axis: np.ndarray, p: np.ndarray, d: np.ndarray) -> np.ndarray:
    """Return the shortest vector from an axis through 0 to the line p + x d."""
    if not _is_crossed(axis, d):
        return p - (p @ axis) * axis
    n = np.cross(axis, d)
    return (p @ n) / (n @ n) * n


def _snapped(angle: float) -> float:
    """Return an angle in (−π, π], rounded to a multiple of π/4 if close to it."""
    angle = pi - (pi - angle) % (2 * pi)
    near = round(angle / (pi / 4)) * (pi / 4)
    return angle if abs(angle - near) >= _SNAP else near if near > -pi else pi
