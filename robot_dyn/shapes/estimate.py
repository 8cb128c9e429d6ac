"""Inertials missing from a file, estimated from the shapes of links and from masses.

A link without mass and moments gets both, and a centre of mass; a link with a mass but no moments gets only the
moments. The body is the solid of the link's shape, or the shell of its surfaces if the convex hull would have less than
200 kg/m³. Values stated by the file are not changed. Estimates are marked with <inertial estimated="…">, which later
reads report.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, final

from lxml import etree  # pyright: ignore[reportAttributeAccessIssue]

from robot_dyn.description.description import Description, check
from robot_dyn.description.edits import Edits
from robot_dyn.description.inertia import MassProperties
from robot_dyn.description.markup import parse
from robot_dyn.description.structure import StatedLink, Structure, structure_of
from robot_dyn.foundations.errors import DescriptionError, QueryError
from robot_dyn.shapes.link_shapes import LinkShape, link_shapes
from robot_dyn.shapes.masses import Masses

# [kg/m³] of the hull, below which a link is a thin housing; see docs/developers/decisions/estimated-inertias.md
_HOLLOW = 200.0
_MOMENTS = {"ixx": (0, 0), "ixy": (0, 1), "ixz": (0, 2), "iyy": (1, 1), "iyz": (1, 2), "izz": (2, 2)}


@final
@dataclass(frozen=True, eq=False)
class Estimate:
    """The estimated inertial of one link.

    Attributes:
        link: Name of the link.
        body: Mass properties in the frame of the link.
        basis: Shape and mass on which the estimate is based, as text.
        moments_only: True if mass and centre of mass are those of the file.
    """

    link: str
    body: MassProperties
    basis: str
    moments_only: bool = False

    def write(self, link: etree._Element) -> etree._Element:
        """Write the estimate into the <link> of a document and return its <inertial>."""
        inertial = link.find("inertial") if self.moments_only else None
        if inertial is None:
            for old in link.findall("inertial"):
                link.remove(old)
            inertial = etree.SubElement(link, "inertial")
            etree.SubElement(inertial, "origin", xyz=" ".join(map(repr, self.body.com.tolist())), rpy="0 0 0")
            etree.SubElement(inertial, "mass", value=repr(self.body.mass))
        for origin in inertial.findall("origin"):
            origin.set("rpy", "0 0 0")  # the moments are along the axes of the link
        for old in inertial.findall("inertia"):
            inertial.remove(old)
        etree.SubElement(inertial, "inertia", {key: repr(float(self.body.inertia[at])) for key, at in _MOMENTS.items()})
        inertial.set("estimated", self.basis)
        return inertial


def with_estimates(description: Description, masses: Masses, package_dirs: Iterable[str | Path] = ()) -> Description:
    """Return the description with estimates for all links that have a shape but lack mass or moments.

    Args:
        description: The file; its meshes are read.
        masses: Masses that the file does not state.
        package_dirs: Folders in which packages of meshes are searched first.

    Returns:
        The description; each estimate in its text is marked and follows a comment.

    Raises:
        QueryError: If a mass is given for an unknown link or for one that has a mass, no mass is left to share, or a
            moving body remains without mass.
        DescriptionError: If the shape of such a link cannot be read and the link moves. A link of the base, which does
            not affect the dynamics, is omitted with a finding.
    """
    shapes, unread = shapes_of_incomplete_links(description, package_dirs, masses.allow_overlap)
    new, left_out = estimates(description, shapes, masses, unread)
    return replace(marked(description, new), findings=tuple(dict.fromkeys((*description.findings, *left_out))))


def shapes_of_incomplete_links(
    description: Description, package_dirs: Iterable[str | Path] = (), allow_overlap: bool = False
) -> tuple[dict[str, LinkShape], dict[str, str]]:
    """Return the shapes of links without mass or moments, and read errors for links of the base.

    Raises:
        DescriptionError: If the shape of a moving link cannot be read.
    """
    stated = structure_of(description, Edits())
    lacking = [name for name, link in stated.links.items() if not any(link.moments)]
    shapes, failed = link_shapes(description, lacking, tuple(package_dirs), allow_overlap=allow_overlap)
    for name, why in failed.items():
        if name not in stated.base:
            raise DescriptionError(f"{description.source}: link {name!r}: its inertia cannot be estimated: {why}")
    return shapes, failed


def estimates(
    description: Description, shapes: Mapping[str, LinkShape], masses: Masses, unread: Mapping[str, str]
) -> tuple[tuple[Estimate, ...], tuple[str, ...]]:
    """Return the estimates of links with these shapes, and findings on links that get none.

    A mass given for a link whose shape cannot be read counts in the total only.
    """
    stated = structure_of(description, Edits())
    stated_masses = {name: link.mass for name, link in stated.links.items() if link.mass}
    masses.check_links(stated.links, stated_masses)
    for name in masses.by_link:
        if name not in shapes and name not in unread:
            raise QueryError(f"mass: link {name!r} has no <collision> or <visual> with a volume; add one")
    without = {name: shape for name, shape in shapes.items() if name not in stated_masses}
    mass_of = masses.shared(without, sum(stated_masses.values()))
    new = [_new(name, shapes[name], *mass_of[name]) for name in mass_of if name in shapes]
    new += [_moments(name, stated.links[name], shapes[name]) for name in shapes if name in stated_masses]
    _refuse_massless(stated, {estimate.link for estimate in new}, without)
    return tuple(new), (*_left_out(without, mass_of), *_unread(unread, masses, stated_masses))


def marked(description: Description, new: Iterable[Estimate]) -> Description:
    """Return the description with these estimates in its text, each marked and following a comment."""
    root, _ = parse(description.text, description.source, comments=True)
    links = {(link.get("name") or "").strip(): link for link in root.iterfind("link")}
    for estimate in new:
        inertial = estimate.write(links[estimate.link])
        inertial.addprevious(etree.Comment(f" estimated, not measured: {estimate.basis} "))
    text = etree.tostring(root.getroottree(), xml_declaration=True, encoding="UTF-8")
    return check(text, description.source)


def _new(name: str, shape: LinkShape, mass: float, origin: str) -> Estimate:
    """Return the estimate of a link without mass."""
    hollow = mass < _HOLLOW * shape.hull.mass
    body = shape.shell if hollow else shape.solid
    shell = f" as a shell, at less than {_HOLLOW:g} kg/m³" if hollow else ""
    return Estimate(name, _of_mass(mass, body), f"{shape.origin}{shell}; mass {origin}")


def _moments(name: str, link: StatedLink, shape: LinkShape) -> Estimate:
    """Return the estimate of the moments of a link whose file states its mass."""
    whole = _new(name, shape, link.mass, "of the file")
    return Estimate(name, whole.body, f"moments only, from {whole.basis}", moments_only=True)


def _of_mass(mass: float, body: MassProperties) -> MassProperties:
    return MassProperties(mass, body.com, mass / body.mass * body.inertia)


def _left_out(without: Mapping[str, LinkShape], mass_of: Mapping[str, Any]) -> Iterator[str]:
    for name in without:
        if name not in mass_of:
            yield f"link {name!r}: has a shape but no <inertial>, and no mass was given; it remains massless"


def _unread(unread: Mapping[str, str], masses: Masses, stated_masses: Mapping[str, float]) -> Iterator[str]:
    for name, why in unread.items():
        no_share = masses.total is not None and name not in masses.by_link and name not in stated_masses
        share = " and no share of the total mass, so the other links are too heavy" if no_share else ""
        remedy = f", or give mass={{{name!r}: …}}" if no_share else ""
        yield f"link {name!r}: its shape cannot be read, so it has no estimate{share}; {why}{remedy}"


def _refuse_massless(stated: Structure, estimated: set[str], without: Mapping[str, LinkShape]) -> None:
    """Raise QueryError if a moving body remains without mass although one of its links has a shape."""
    for joint, links in stated.bodies.items():
        if any(stated.links[name].mass for name in links) or estimated.intersection(links):
            continue
        if shaped := [name for name in links if name in without]:
            raise QueryError(
                f"mass: link {shaped[0]!r} moves with joint {joint!r} and has no mass; add it, or give total_mass or"
                " density"
            )
