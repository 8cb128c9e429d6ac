"""Masses and moments compared with the distances between joints and with other links, where no shape can be used.

    k = √(½ tr I / m)

is the root-mean-square distance of a mass from its centre. In a link it is below the distance to the next joint, the
distance of its centre, or half the longest distance between joints of the arm, unless mass or moments are wrong.
"""

from __future__ import annotations

from collections.abc import Container, Iterator, Mapping
from dataclasses import dataclass
from math import hypot
from typing import Any, final

import numpy as np

from robot_dyn.description import GIMBAL, SEVERAL, StatedLink, Structure
from robot_dyn.foundations import QueryError, nearest, shown
from robot_dyn.model import findings as doctor
from robot_dyn.tools.doctor.document import Document
from robot_dyn.tools.doctor.finding import Change, Finding, Severity
from robot_dyn.tools.doctor.kinds import FindingKind
from robot_dyn.tools.doctor.repairs import KEYS, UNITS, scaled

_WIDE, _FAR = 3.0, 10.0  # [m] k and joint distances of arms with one or two joints: larger than any arm
_UNIT = 8.0  # median of k relative to the arm; 0.1 to 0.8 in 40 arms of the catalog, and 30 times that in g m²
_TYPICAL = 0.08, 0.8  # the same ratio in kg m²
_LIGHTER, _LIGHTEST = 30.0, 10.0  # times lighter than each neighbour, and than all other bodies
_STEEL, _LEAD = 8e3, 1.2e4  # [kg/m³]; above lead a shape covers part of its link, or `mass_density` reports it
_HEAVIER = 4.0  # times heavier than each neighbour
_DIFFERENT = 0.05  # relative difference of masses from those of a data sheet
_ASK = "compare with the data sheet: give --mass {}=KG or --total-mass KG (mass=, total_mass= in Python)"


@final
@dataclass(frozen=True)
class Sheet:
    """Masses of a data sheet: by link, and in total; None where not given."""

    by_link: Mapping[str, float]
    total: float | None


def wide_links(document: Document, stated: Structure, shaped: Container[str]) -> Iterator[Finding]:
    """Report links whose k exceeds the distances of the arm; `shaped` links are compared with their shapes instead."""
    small = len(stated.moving) < SEVERAL
    for name, ratio in _ratios(stated).items():
        link = stated.links[name]
        k = _gyration(link)
        far = stated.radius_beyond_reach(link.mass, link.inertia) is not None  # reported as inertia_far
        if name not in shaped and not far and (k > _WIDE if small else ratio > 1):
            most = (
                f"{_WIDE:g} m, the largest in arms of one or two joints"
                if small
                else f"{k / ratio:.3g} m, the size of this link in its arm"
            )
            yield document.finding(
                Severity.WARNING, FindingKind.INERTIA_WIDE, document.named("link", name).find("inertial"),
                f"for {link.mass:g} kg, its inertia needs mass at least {k:.3g} m from the centre, beyond {most}",
                f"correct the mass, the inertia, or its unit; {_ASK.format(name)}",
            )  # fmt: skip
    for name, joint in stated.joints.items() if small else ():
        if (length := hypot(*joint.xyz)) > _FAR:
            yield document.finding(
                Severity.WARNING, FindingKind.ORIGIN_FAR, document.named("joint", name),
                f"its origin is {length:.3g} m from its parent link, over {_FAR:g} m, the largest in arms of one or two"
                " joints",
                "correct it, or convert it to metres",
            )  # fmt: skip


def _ratios(stated: Structure) -> dict[str, float]:
    """Return k of each moving link with mass, relative to the size of the link in its arm."""
    sizes = {name: max(hypot(*link.com), stated.longest_link / 2) for name, link in stated.links.items()}
    for joint in stated.joints.values():
        sizes[joint.parent] = max(sizes[joint.parent], hypot(*joint.xyz))
    heavy = {
        name: link for name, link in stated.links.items() if link.mass >= doctor.LIGHTEST and name not in stated.base
    }
    return {
        name: _gyration(link) / max(sizes[name], GIMBAL) for name, link in heavy.items() if np.trace(link.inertia) > 0
    }


def _gyration(link: StatedLink) -> float:
    return float(np.sqrt(np.trace(link.inertia) / 2 / link.mass))


def common_unit(document: Document, stated: Structure, unit: str | None) -> Iterator[Finding]:
    """Report moments that are all too large by a common factor; with a unit that fits, convert them from it."""
    power, name = (0, "") if unit is None else _named(unit)
    ratios = [*_ratios(stated).values()]
    units: dict[int, str] = {}
    if len(ratios) >= 2 and np.median(ratios) > _UNIT and np.mean(np.array(ratios) > 1) >= 0.9:
        low, high = _TYPICAL
        fits = {factor: float(np.median(ratios)) / factor**0.5 for factor in UNITS}
        units = {round(np.log10(x)): UNITS[x] for x, ratio in fits.items() if low <= ratio <= high}
    if units:
        elements = [*document.root.iterfind("link/inertial/inertia")] if power in units else []
        changes = (Change(x, key, scaled(x.get(key), -power)) for x in elements for key in KEYS if _nonzero(x, key))
        yield Finding(
            Severity.ERROR, FindingKind.INERTIA_UNIT, "robot",
            "the moments of all links are too large by a common factor: their radii of gyration are typically"
            f" {np.median(ratios):.0f} times the size of the link: the unit {' or '.join(units.values())} is suspected",
            f"export in kg m², or convert all moments: {' or '.join(map(_option, units.values()))}",
            None, tuple(changes),
        )  # fmt: skip
    if unit is not None and power not in units:
        yield Finding(
            Severity.NOTE, FindingKind.INERTIA_UNIT, "robot",
            f"its moments do not look like {name} and were not converted",
            f"choose {' or '.join(units.values())}" if units else "remove inertia_unit, or correct single links",
        )  # fmt: skip


def _option(unit: str) -> str:
    return f'--fix --inertia-unit "{unit}"'


def checked_unit(unit: str) -> str:
    """Return the name of a unit, which may be written as in "kg mm2".

    Raises:
        QueryError: If it is not one of the units of inertia that can be converted.
    """
    return _named(unit)[1]


def _named(unit: Any) -> tuple[int, str]:
    """Return the power of ten by which a unit of inertia is smaller than kg m², and its name."""
    if not isinstance(unit, str):
        raise QueryError(f"inertia_unit must be text, for example 'kg mm2', got {shown(unit)}")
    plain = "".join(unit.replace("²", "2").replace("^", "").replace("*", "").replace("·", "").split())
    for factor, name in UNITS.items():
        if plain == name.replace("²", "2").replace(" ", ""):
            return round(np.log10(factor)), name
    raise QueryError(
        f"inertia_unit: {shown(unit)} is not a unit that can be converted; {nearest(unit, UNITS.values())}"
    )


def _nonzero(element: Any, key: str) -> bool:
    return float(element.get(key, "0")) != 0


def odd_masses(document: Document, stated: Structure, volumes: Mapping[str, float]) -> Iterator[Finding]:
    """Report moving bodies far lighter than their neighbours, or heavier and denser than steel.

    Args:
        document: The file.
        stated: Structure of the robot.
        volumes: Volume of the shapes of each link, in [m³].
    """
    mass_of = {joint: sum(stated.links[name].mass for name in links) for joint, links in stated.bodies.items()}
    body_of = {name: joint for joint, links in stated.bodies.items() for name in links}
    below = {joint: body_of.get(stated.joints[joint].parent) for joint in mass_of}
    for joint, mass in mass_of.items():
        near = [below[joint], *(other for other in mass_of if below[other] == joint)]
        masses = [mass_of[other] for other in near if other is not None]
        others = [x for other, x in mass_of.items() if other != joint]
        if mass <= 0 or not masses:
            continue
        alone = len(masses) > 1 or all(x > _LIGHTEST * mass for x in others)  # fingers of a hand are all light
        volume = sum(volumes.get(name, 0.0) for name in stated.bodies[joint])
        density = mass / volume if volume else 0.0
        if alone and min(masses) > _LIGHTER * mass:
            what = f"its body has {mass:.3g} kg, but its neighbours have {min(masses):.3g} kg or more"
        elif _STEEL < density <= _LEAD and mass > _HEAVIER * max(masses) > 0:
            what = (
                f"its body has {mass:.4g} kg, {mass / max(masses):.2g} times its heaviest neighbour, and"
                f" {density:.4g} kg/m³, more than steel"
            )
        else:
            continue
        name = stated.joints[joint].child
        element = document.named("link", name)
        yield document.finding(Severity.WARNING, FindingKind.MASS_NEIGHBOURS, element, what, _ASK.format(name))


def of_data_sheet(document: Document, stated: Structure, sheet: Sheet) -> Iterator[Finding]:
    """Report masses of the file that differ from those of a data sheet by more than 5 %."""
    for name, mass in sheet.by_link.items():
        own = stated.links[name].mass
        if abs(own - mass) > _DIFFERENT * mass:
            yield document.finding(
                Severity.WARNING, FindingKind.MASS_SHEET, document.named("link", name),
                f"its mass is {own:.4g} kg, but {mass:.4g} kg was given for it: a factor of {own / mass:.3g}",
                "correct the mass, and the moments with it if they have the same factor",
            )  # fmt: skip
    total = sum(link.mass for link in stated.links.values())
    if sheet.total is not None and abs(total - sheet.total) > _DIFFERENT * sheet.total:
        yield document.finding(
            Severity.WARNING, FindingKind.MASS_SHEET, document.root,
            f"all links together have {total:.4g} kg, but {sheet.total:.4g} kg was given: a factor of"
            f" {total / sheet.total:.3g}",
            "give --mass LINK=KG for links you know, to find the wrong one; correct its mass",
        )  # fmt: skip
