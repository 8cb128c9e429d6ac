"""Masses and inertias against the shapes of links: what fits at no density, and the units that would explain it.

    ½ tr I ≤ m max |x − c|²   for a mass m with centre c anywhere within the shape

Shapes are those of <collision>, else of <visual>. [Wensing, Kim, Slotine 2018, §III-B]
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from math import hypot
from pathlib import Path
from typing import Any, final

import numpy as np

from robot_dyn import Robot
from robot_dyn.description import MassProperties, StatedLink, combined, structure_of
from robot_dyn.shapes import MeshError, surface
from robot_dyn.tools.doctor.document import Document
from robot_dyn.tools.doctor.finding import Change, Finding, Severity
from robot_dyn.tools.doctor.literals import NUMBERS
from robot_dyn.view import Piece, solids

_SLACK = 1.1  # of a shape's extent: collision shapes leave out screws
_LIGHT, _HEAVY = 2.0, 1.2e4  # [kg/m³] of a link and its convex hull: below foam, above lead
_CONCENTRATED = 0.15  # of the inertia of a uniform body: of 20 arms of the catalog the least is 0.35
_UNITS = {1e3: "g m²", 1e4: "kg cm²", 1e6: "kg mm²", 1e7: "g cm²", 1e9: "g mm²"}
_WITHIN = 4.0  # a factor on either side, by which the inertia of a link is off that of a uniform body
_LONG, _LEAST_LONG = 10.0, 10.0  # times the length of the arm, and [m], that a shape is: millimetres
_SIZE = "shape_in_mm"
_MATERIAL, _MOST, _FEWEST = 0.01, 0.6, 4  # of the median density; part of the links; of different mass, at least
_GRAVE = 3.0  # of ½ tr I to m d², from which M is wrong by a factor: below, makers round


@final
@dataclass(frozen=True)
class Shape:
    """The shapes of a link.

    Attributes:
        points: Their corners in the link's frame, (k, 3), in [m].
        unit: Their mass properties at 1 kg/m³; None if they have no volume.
    """

    points: np.ndarray
    unit: MassProperties | None


def shapes(robot: Robot, package_dirs: Iterable[str | Path]) -> tuple[dict[str, Shape], tuple[str, ...]]:
    """The shape of each link that has one, and what cannot be read."""
    pieces, notes = solids(robot, package_dirs)
    return {name: _shape(of) for name, of in pieces.items() if of}, notes


def doubtful(
    document: Document, robot: Robot, of: dict[str, Shape], package_dirs: Iterable[str | Path]
) -> list[Finding]:
    """What is wrong with masses, inertias and centres of mass by the collision shape of a link, and by its visual too.

    A collision shape may be a part of the link alone: what the visual explains is not reported.
    """
    found = _by_shape(document, robot, of)
    doubted = {name for name in of if any(each.where == f"link {name!r}" for each in found)}
    pieces, _ = solids(robot, package_dirs, ("visual",), doubted)
    again = _by_shape(document, robot, {name: _shape(drawn) for name, drawn in pieces.items() if drawn})
    by_visual = {(each.kind, each.where): each for each in again}
    told = {f"link {name!r}" for name, drawn in pieces.items() if drawn}
    told -= {each.where for each in again + found if each.kind == _SIZE}  # in another unit: it explains nothing
    kept = [each for each in found if each.where not in told]
    for where in sorted(told):
        both = [each for each in found if each.where == where and (each.kind, where) in by_visual]
        kept += [_milder(each, by_visual[each.kind, where]) for each in both] or [x for x in again if x.where == where]
    return kept


def _by_shape(document: Document, robot: Robot, of: dict[str, Shape]) -> list[Finding]:
    return [*misfits(document, robot, of), *outside(document, robot, of)]


def _milder(one: Finding, other: Finding) -> Finding:
    order = [*Severity]
    return max(one, other, key=lambda each: order.index(each.severity))


def _shape(pieces: tuple[Piece, ...]) -> Shape:
    points = np.vstack([each.mesh.vertices @ each.pose[:3, :3].T + each.pose[:3, 3] for each in pieces])
    bodies = [body for each in pieces if (body := _of_piece(each)) is not None]
    return Shape(points, combined(bodies) if bodies else None)


def _of_piece(piece: Piece) -> MassProperties | None:
    """A closed surface as it is; any other, and one whose parts overlap, by its convex hull."""
    vertices, faces = piece.mesh.vertices.astype(float), piece.mesh.faces.astype(int)
    try:
        closed = surface.solid(vertices, faces)
    except MeshError:
        closed = None
    body = surface.hull(vertices) if closed is None else closed.body
    return None if body is None else body.moved(piece.pose[:3, :3], piece.pose[:3, 3])


def misfits(document: Document, robot: Robot, of: dict[str, Shape]) -> Iterator[Finding]:
    """Masses and inertias that their shapes have at no density."""
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
        found = _mass(name, link, shape, inertial)  # if it is doubtful, the inertia is as well
        found = found or _inertia(name, link, shape, inertial) or _small(name, link, shape, inertial)
        if found is not None:
            yield replace(found, severity=Severity.NOTE) if name in stated.base else found


def of_one_density(document: Document, robot: Robot, of: dict[str, Shape]) -> Iterator[Finding]:
    """A note if the masses of nearly all links are their volumes times one density, as programs of CAD write them."""
    links = structure_of(robot.description, robot.edits).links
    known = {name: links[name].mass for name in of if links[name].mass > 0 and name not in robot.description.estimated}
    density = {name: mass / unit.mass for name, mass in known.items() if (unit := of[name].unit) is not None}
    if len(density) < _FEWEST:
        return
    median = float(np.median([*density.values()]))
    alike = [name for name, x in density.items() if abs(x / median - 1) <= _MATERIAL]
    different = len({links[name].mass for name in alike})
    if different >= _FEWEST and different >= _MOST * len({links[name].mass for name in known}):
        total = sum(link.mass for link in links.values())
        yield document.finding(
            Severity.NOTE, "density_uniform", document.root,
            f"{len(alike)} of {len(known)} links weigh {median:.4g} kg/m³ of their shapes, to 1 %, {total:.4g} kg in"
            " all: computed from one material, as an arm with motors and gears hardly is",
            "compare the total with the data sheet; Robot.with_(mass_scale=…) scales all masses",
        )  # fmt: skip


def _farthest(points: np.ndarray) -> float:
    """The largest distance of points (k, 3) from the origin, whose squares may overflow."""
    scale = float(np.abs(points).max()) or 1.0
    return scale * float(np.linalg.norm(points / scale, axis=1).max())


def _reach(robot: Robot) -> float:
    """The sum of the distances between joints, in [m]; 1 m if they coincide."""
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
    changes = (Change(mass, "value", _scaled(mass.get("value"), -3)),) if grams else ()
    return Finding(
        Severity.WARNING, "mass_density", f"link {name!r}",
        f'its mass of "{mass.get("value").strip()}" kg in its shape is a density of {density:.3g} kg/m³{suspected}',
        "correct the mass, or its unit", inertial.sourceline, changes, True,
    )  # fmt: skip


def _inertia(name: str, link: StatedLink, shape: Shape, inertial: Any) -> Finding | None:
    Ixx, _, _, Iyy, _, Izz = link.moments
    half, far = (Ixx + Iyy + Izz) / 2, _farthest(shape.points - np.array(link.com))
    most = link.mass * far * far
    if half <= _SLACK * most:
        return None
    changes, suspected = (), ""
    if shape.unit is not None:
        ratio = half / link.mass / (np.trace(shape.unit.inertia) / 2 / shape.unit.mass)
        factor, unit = min(_UNITS.items(), key=lambda each: abs(np.log(ratio / each[0])))
        if factor / _WITHIN < ratio < factor * _WITHIN:
            suspected, inertia = f": {unit} is suspected", inertial.find("inertia")
            power = -round(np.log10(factor))
            moments = {key: inertia.get(key) for key in NUMBERS["inertia"]}
            changes = tuple(Change(inertia, key, _scaled(x, power)) for key, x in moments.items() if float(x))
    return Finding(
        Severity.ERROR if half >= _GRAVE * most else Severity.WARNING, "inertia_shape", f"link {name!r}",
        f"its inertia is that of {link.mass:g} kg at {np.sqrt(half / link.mass):.3g} m and more from the centre of"
        f" mass, and its shape ends at {far:.3g} m: {half / most:.3g} times the most of any density{suspected}",
        "correct the inertia, or its unit", inertial.sourceline, changes, True,
    )  # fmt: skip


def _small(name: str, link: StatedLink, shape: Shape, inertial: Any) -> Finding | None:
    """A mass too large for its inertia: neither of them alone is impossible."""
    uniform = 0.0 if shape.unit is None else float(np.trace(shape.unit.inertia)) * link.mass / shape.unit.mass
    ratio = float(np.trace(link.inertia)) / uniform if uniform else 1.0
    if not 0 < ratio < _CONCENTRATED:
        return None
    return Finding(
        Severity.WARNING, "inertia_small", f"link {name!r}",
        f'its inertia is {ratio:.2g} times that of {link.mass:g} kg spread over its shape: the mass is too large, or'
        " the inertia too small",
        "correct the mass or the inertia, or their units", inertial.sourceline,
    )  # fmt: skip


def _scaled(text: str, power: int) -> str:
    """A literal times a power of ten, digit by digit."""
    mantissa, _, exponent = text.strip().lower().partition("e")
    return f"{mantissa}e{int(exponent or 0) + power}"


def outside(document: Document, robot: Robot, of: dict[str, Shape]) -> Iterator[Finding]:
    """Centres of mass beyond the box around the shapes of their link."""
    stated = structure_of(robot.description, robot.edits)
    for name, shape in of.items():
        link, (low, high) = stated.links[name], (shape.points.min(axis=0), shape.points.max(axis=0))
        room = 0.1 * float(np.max(high - low)) + 0.01  # [m]: of a thin flange, the rest is hidden in its neighbour
        away = hypot(*(np.maximum(low - room - link.com, 0) + np.maximum(link.com - high - room, 0)).tolist())
        light = shape.unit is not None and link.mass < _LIGHT * shape.unit.mass  # hardly a mass, of which `_mass` tells
        if link.mass > 0 and away > 0 and not light:
            inertial = document.named("link", name).find("inertial")
            xyz = inertial.find("origin").get("xyz", "0 0 0") if inertial.find("origin") is not None else "0 0 0"
            yield document.finding(
                Severity.NOTE if name in stated.base else Severity.WARNING, "com_outside", inertial,
                f'its centre of mass "{" ".join(xyz.split())}" m lies {away + room:.2g} m outside its'
                " shape",
                "correct the origin of its <inertial>: it is that of the centre of mass in the frame of the link",
            )  # fmt: skip
