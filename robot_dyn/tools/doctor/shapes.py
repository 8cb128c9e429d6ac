"""Masses and inertias compared with the shapes of links: values impossible at any density, and suspected mistakes.

    ½ tr I ≤ m max |x − c|²   for a mass m with centre c anywhere within the shape

Shapes are taken from <collision>, or else from <visual>. `inertia_bounds` contains the bound in each direction.
[Wensing, Kim, Slotine 2018, §III-B]
"""

from __future__ import annotations

from collections.abc import Container, Iterable, Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from math import hypot
from pathlib import Path
from typing import Any, final

import numpy as np

from robot_dyn import Robot
from robot_dyn.description import MassProperties, StatedLink, combined, structure_of
from robot_dyn.foundations import rotation_rpy
from robot_dyn.shapes import MeshError, surface
from robot_dyn.tools.doctor.document import Document
from robot_dyn.tools.doctor.finding import Change, Finding, Severity
from robot_dyn.tools.doctor.inertia_bounds import SLACK, Body, excess
from robot_dyn.tools.doctor.kinds import FindingKind
from robot_dyn.tools.doctor.repairs import KEYS, repairs, scaled
from robot_dyn.view import Piece, solids

_SLACK = 1.1  # on a shape's extent: collision shapes omit screws
_LIGHT, _HEAVY = 2.0, 1.2e4  # [kg/m³] of a link in its convex hull: lighter than foam, heavier than lead
_CONCENTRATED = 0.15  # relative to a uniform body's inertia; the minimum of 20 arms in the catalog is 0.35
_LONG, _LEAST_LONG = 10.0, 10.0  # times the length of the arm, and [m]: longer shapes are in millimetres
_SIZE = FindingKind.SHAPE_IN_MM
_MATERIAL, _MOST, _FEWEST = (
    0.01,
    0.6,
    4,
)  # deviation from the median density; fraction of links; minimum number of different masses
IMPOSSIBLE = FindingKind.INERTIA_IMPOSSIBLE, FindingKind.INERTIA_SHAPE, FindingKind.INERTIA_DIRECTION
_EXPLAINED = (
    *IMPOSSIBLE,
    FindingKind.MASS_DENSITY,
    FindingKind.COM_OUTSIDE,
    FindingKind.INERTIA_SMALL,
    FindingKind.SHAPE_IN_MM,
)
_AXIS = 0.9999  # largest component of a direction that is an axis, within 0.8°
_GRAVE = 3.0  # ratio of ½ tr I to m d² above which M is wrong by a factor; below, values may be rounded


@final
@dataclass(frozen=True)
class Shape:
    """Shapes of a link.

    Attributes:
        points: Corners in the link's frame, (k, 3), in [m].
        unit: Mass properties at 1 kg/m³; None without a volume.
    """

    points: np.ndarray
    unit: MassProperties | None


def shapes(robot: Robot, package_dirs: Iterable[str | Path]) -> tuple[dict[str, Shape], tuple[str, ...]]:
    """Return the shape of each link that has one, and notes on unreadable shapes."""
    pieces, notes = solids(robot, package_dirs)
    return {name: _shape(own) for name, own in pieces.items() if own}, notes


def doubtful(
    document: Document, robot: Robot, of: dict[str, Shape], package_dirs: Iterable[str | Path]
) -> list[Finding]:
    """Report faulty masses, inertias and centres of mass, by the collision shape of a link and by its visual.

    A collision shape may cover only part of the link: findings that the visual shape explains are not reported.
    """
    findings = _by_shape(document, robot, of)
    doubted = {name for name in of if any(finding.where == f"link {name!r}" for finding in findings)}
    pieces, _ = solids(robot, package_dirs, ("visual",), doubted)
    again = _by_shape(document, robot, {name: _shape(drawn) for name, drawn in pieces.items() if drawn})
    by_visual = {(finding.kind, finding.where): finding for finding in again}
    visible = {f"link {name!r}" for name, drawn in pieces.items() if drawn}
    visible -= {x.where for x in again + findings if x.kind == _SIZE}  # a visual in a wrong unit explains nothing
    result = [finding for finding in findings if finding.where not in visible]
    for where in sorted(visible):
        both = [x for x in findings if x.where == where and (x.kind, where) in by_visual]
        result += [_milder(x, by_visual[x.kind, where]) for x in both] or [x for x in again if x.where == where]
    return result


def _by_shape(document: Document, robot: Robot, of: dict[str, Shape]) -> list[Finding]:
    return [*misfits(document, robot, of), *outside(document, robot, of)]


def _milder(one: Finding, other: Finding) -> Finding:
    order = [*Severity]
    return max(one, other, key=lambda finding: order.index(finding.severity))


def _shape(pieces: tuple[Piece, ...]) -> Shape:
    points = np.vstack([piece.mesh.vertices @ piece.pose[:3, :3].T + piece.pose[:3, 3] for piece in pieces])
    bodies = [body for piece in pieces if (body := _of_piece(piece)) is not None]
    return Shape(points, combined(bodies) if bodies else None)


def _of_piece(piece: Piece) -> MassProperties | None:
    body = _of_mesh(piece.mesh.vertices.astype(float).tobytes(), piece.mesh.faces.astype(int).tobytes())
    return None if body is None else body.moved(piece.pose[:3, :3], piece.pose[:3, 3])


@lru_cache(maxsize=32)
def _of_mesh(vertices: bytes, faces: bytes) -> MassProperties | None:
    """Return mass properties at 1 kg/m³: of the solid if closed without overlaps, else of the hull.

    Links share meshes, and repairs of the text leave them as they are: each is examined once.
    """
    points, corners = np.frombuffer(vertices).reshape(-1, 3), np.frombuffer(faces, dtype=int).reshape(-1, 3)
    try:
        closed = surface.solid(points, corners)
    except MeshError:
        closed = None
    return surface.hull(points) if closed is None else closed.body


def misfits(document: Document, robot: Robot, of: dict[str, Shape]) -> Iterator[Finding]:
    """Report oversized shapes, and masses and inertias that do not fit the shape of their link."""
    stated, reach = structure_of(robot.description, robot.edits), _reach(robot)
    links = stated.links
    for name, shape in of.items():
        link, size = links[name], float(np.ptp(shape.points, axis=0).max())
        element = document.named("link", name)
        if size > max(_LONG * reach, _LEAST_LONG):
            yield _oversized(document, name, element, size, reach)
            continue
        if link.mass <= 0:
            continue
        inertial = element.find("inertial")
        finding = _mass(name, link, shape, inertial)  # if the mass is doubtful, so is the inertia
        finding = finding or _inertia(name, link, shape, inertial) or _small(name, link, shape, inertial)
        if finding is not None:
            yield replace(finding, severity=Severity.NOTE) if name in stated.base else finding


def of_one_density(document: Document, robot: Robot, of: dict[str, Shape]) -> Iterator[Finding]:
    """Report if the masses of nearly all links are their volumes times one density, as CAD programs compute them."""
    links = structure_of(robot.description, robot.edits).links
    mass_of = {
        name: links[name].mass for name in of if links[name].mass > 0 and name not in robot.description.estimated
    }
    density = {name: mass / unit.mass for name, mass in mass_of.items() if (unit := of[name].unit) is not None}
    if len(density) < _FEWEST:
        return
    median = float(np.median([*density.values()]))
    alike = [name for name, x in density.items() if abs(x / median - 1) <= _MATERIAL]
    different = len({links[name].mass for name in alike})
    if different >= _FEWEST and different >= _MOST * len({links[name].mass for name in mass_of}):
        total = sum(link.mass for link in links.values())
        yield document.finding(
            Severity.NOTE, FindingKind.DENSITY_UNIFORM, document.root,
            f"{len(alike)} of {len(mass_of)} links have a density of {median:.4g} kg/m³ within 1 % ({total:.4g} kg in"
            " total): computed from one material, which is unlikely for an arm with motors and gears",
            "compare the total with the data sheet; Robot.with_(mass_scale=…) scales all masses",
        )  # fmt: skip


def _farthest(points: np.ndarray) -> float:
    """Return the largest distance of points (k, 3) from the origin, whose squares may overflow."""
    scale = float(np.abs(points).max()) or 1.0
    return scale * float(np.linalg.norm(points / scale, axis=1).max())


def _reach(robot: Robot) -> float:
    """Return the sum of the distances between joints, in [m]; 1 m if they coincide."""
    total = sum(hypot(*map(float, joint.xyz)) for joint in structure_of(robot.description, robot.edits).joints.values())
    return total or 1.0


def _oversized(document: Document, name: str, element: Any, size: float, reach: float) -> Finding:
    changes = tuple(
        Change(mesh, "scale", "0.001 0.001 0.001")
        for mesh in element.iterfind("*/geometry/mesh")
        if mesh.get("scale", "1 1 1").split() in (["1", "1", "1"], ["1.0", "1.0", "1.0"])
    )
    return Finding(
        Severity.WARNING, _SIZE, f"link {name!r}",
        f"its shape is {size:.3g} m long, on a robot of {reach:.3g} m: millimetres are suspected",
        'scale its mesh, scale="0.001 0.001 0.001"', element.sourceline, changes, True,
    )  # fmt: skip


def _mass(name: str, link: StatedLink, shape: Shape, inertial: Any) -> Finding | None:
    if shape.unit is None:
        return None
    density, mass = link.mass / shape.unit.mass, inertial.find("mass")
    if _LIGHT <= density <= _HEAVY:
        return None
    grams = density > _HEAVY and 100.0 <= density / 1e3 <= 2e4
    suspected = ": grams are suspected" if grams else ""
    changes = (Change(mass, "value", scaled(mass.get("value"), -3)),) if grams else ()
    return Finding(
        Severity.WARNING, FindingKind.MASS_DENSITY, f"link {name!r}",
        f'its mass of "{mass.get("value").strip()}" kg in its shape gives a density of {density:.3g} kg/m³{suspected}',
        "correct the mass, or its unit", inertial.sourceline, changes, True,
    )  # fmt: skip


def _inertia(name: str, link: StatedLink, shape: Shape, inertial: Any) -> Finding | None:
    Ixx, _, _, Iyy, _, Izz = link.moments
    half, far = (Ixx + Iyy + Izz) / 2, _farthest(shape.points - np.array(link.com))
    most = link.mass * far * far
    if half <= _SLACK * most:
        return None
    return Finding(
        Severity.ERROR if half >= _GRAVE * most else Severity.WARNING, FindingKind.INERTIA_SHAPE, f"link {name!r}",
        f"for {link.mass:g} kg, its inertia needs mass at least {np.sqrt(half / link.mass):.3g} m from the centre, but"
        f" its shape ends at {far:.3g} m: {half / most:.3g} times the largest inertia of this"
        " shape at any density",
        "correct the inertia, or its unit", inertial.sourceline,
    )  # fmt: skip


def _small(name: str, link: StatedLink, shape: Shape, inertial: Any) -> Finding | None:
    """Report a mass too large for its inertia, where neither alone is impossible."""
    uniform = 0.0 if shape.unit is None else float(np.trace(shape.unit.inertia)) * link.mass / shape.unit.mass
    ratio = float(np.trace(link.inertia)) / uniform if uniform else 1.0
    if not 0 < ratio < _CONCENTRATED:
        return None
    return Finding(
        Severity.WARNING, FindingKind.INERTIA_SMALL, f"link {name!r}",
        f'its inertia is {ratio:.2g} times that of {link.mass:g} kg spread over its shape: the mass is too large, or'
        " the inertia too small",
        "correct the mass or the inertia, or their units", inertial.sourceline,
    )  # fmt: skip


def directions(
    document: Document,
    robot: Robot,
    of: dict[str, Shape],
    package_dirs: Iterable[str | Path],
    findings: Iterable[Finding],
) -> Iterator[Finding]:
    """Report links with more second moment along a direction than their mass can have within their shapes.

    Links whose mass, centre or moments are doubtful for another reason are left out.
    """
    stated = structure_of(robot.description, robot.edits)
    doubtful = {finding.where for finding in findings if finding.kind in _EXPLAINED}
    names = {name for name in of if f"link {name!r}" not in doubtful}
    for name, body in bodies(robot, of, package_dirs, names).items():
        most = excess(body.mass, body.moments, body.points)
        if most.ratio > SLACK:
            severity = Severity.WARNING if most.ratio > _GRAVE and name not in stated.base else Severity.NOTE
            inertial = document.named("link", name).find("inertial")
            yield document.finding(
                severity, FindingKind.INERTIA_DIRECTION, inertial,
                f"along {_direction(most.n)} of its <inertial>, its moments need mass at least {most.needed:.3g} m from"
                f" the centre, but its shape ends at {most.extent:.3g} m: {most.ratio:.3g} times the largest second"
                " moment at any density",
                "compare its six moments with the CAD export: axes, signs of products, unit",
            )  # fmt: skip


def _direction(n: np.ndarray) -> str:
    """Return a direction in words: an axis, or its components in the axes."""
    k = int(np.abs(n).argmax())
    if abs(n[k]) > _AXIS:
        return f"the {'xyz'[k]} axis"
    return f"({', '.join(f'{x:.2g}' for x in n * np.sign(n[k]))}) in the axes"


def bodies(
    robot: Robot, of: dict[str, Shape], package_dirs: Iterable[str | Path], names: Container[str]
) -> dict[str, Body]:
    """Return the links with mass and moments as bodies, with the points of their shapes.

    If the moments do not fit the first shape, the points of the visual shape are added.
    """
    inertials = {link.get("name"): link.find("inertial") for link in robot.description.element.iterfind("link")}
    links = structure_of(robot.description, robot.edits).links
    result = {
        name: _body(links[name], inertials[name], shape, shape.points)
        for name, shape in of.items()
        if name in names and links[name].mass > 0 and any(links[name].moments)
    }
    exceeding = {name for name, body in result.items() if excess(body.mass, body.moments, body.points).ratio > SLACK}
    pieces, _ = solids(robot, package_dirs, ("visual",), exceeding) if exceeding else ({}, ())
    for name, drawn in pieces.items():
        if drawn:
            points = np.vstack([of[name].points, _shape(drawn).points])
            result[name] = _body(links[name], inertials[name], of[name], points)
    return result


def _body(link: StatedLink, inertial: Any, shape: Shape, points: np.ndarray) -> Body:
    """Return a link in the axes of its <inertial>."""
    R = rotation_rpy(np.array([float(x) for x in inertial.find("origin").get("rpy").split()]))
    com = np.array(link.com)
    uniform = None if shape.unit is None else (shape.unit.mass, R.T @ shape.unit.inertia @ R)
    return Body(link.mass, link.inertia, (points - com) @ R, -com @ R, uniform)


def with_repairs(
    document: Document, robot: Robot, of: dict[str, Shape], package_dirs: Iterable[str | Path], findings: list[Finding]
) -> list[Finding]:
    """Return the findings; those on impossible inertias name the mistakes that would explain them."""
    named = {f"link {name!r}": name for name in of}
    names = {named[x.where] for x in findings if x.kind in IMPOSSIBLE and x.where in named}
    of_links = bodies(robot, of, package_dirs, names) if names else {}
    result: list[Finding] = []
    for finding in findings:
        body = of_links.get(named.get(finding.where, "")) if finding.kind in IMPOSSIBLE else None
        result.append(finding if body is None else _explained(document, named[finding.where], body, finding))
    return result


def _explained(document: Document, name: str, body: Body, finding: Finding) -> Finding:
    inertial = document.named("link", name).find("inertial")
    moments, mass = inertial.find("inertia"), inertial.find("mass")
    candidates = repairs(body, {key: moments.get(key, "0") for key in KEYS}, mass.get("value"))
    if not candidates:
        return finding
    mistakes = ", or ".join(candidate.mistake for candidate in candidates)
    message = f"{finding.message}: possible mistake: {mistakes}"
    if len(candidates) > 1:
        return replace(finding, message=message)
    (texts,) = [candidate.texts for candidate in candidates]
    changes = tuple(
        Change(mass if key == "value" else moments, key, text)
        for key, text in texts.items()
        if text != (mass if key == "value" else moments).get(key, "0")
    )
    return replace(finding, message=message, changes=changes, supposed=True)


def outside(document: Document, robot: Robot, of: dict[str, Shape]) -> Iterator[Finding]:
    """Report centres of mass outside the bounding box of the shapes of their link."""
    stated = structure_of(robot.description, robot.edits)
    for name, shape in of.items():
        link, (low, high) = stated.links[name], (shape.points.min(axis=0), shape.points.max(axis=0))
        room = 0.1 * float(np.max(high - low)) + 0.01  # [m]: part of a thin flange is hidden in its neighbour
        away = hypot(*(np.maximum(low - room - link.com, 0) + np.maximum(link.com - high - room, 0)).tolist())
        light = (
            shape.unit is not None and link.mass < _LIGHT * shape.unit.mass
        )  # nearly massless, which `_mass` reports
        if link.mass > 0 and away > 0 and not light:
            inertial = document.named("link", name).find("inertial")
            xyz = inertial.find("origin").get("xyz", "0 0 0") if inertial.find("origin") is not None else "0 0 0"
            yield document.finding(
                Severity.NOTE if name in stated.base else Severity.WARNING, FindingKind.COM_OUTSIDE, inertial,
                f'its centre of mass "{" ".join(xyz.split())}" m is {away + room:.2g} m outside its'
                " shape",
                "correct the origin of its <inertial>: the position of the centre of mass in the frame of the link",
            )  # fmt: skip
