"""Inertials that a file does not state, estimated from the shapes of links at a density."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

from lxml import etree  # pyright: ignore[reportAttributeAccessIssue]

from robot_dyn.studies.doctor.document import Document
from robot_dyn.studies.doctor.finding import Change, Finding, Severity
from robot_dyn.validate import number

if TYPE_CHECKING:
    from robot_dyn.studies.doctor.shapes import Shape

_MOMENTS = {"ixx": (0, 0), "ixy": (0, 1), "ixz": (0, 2), "iyy": (1, 1), "iyz": (1, 2), "izz": (2, 2)}


def estimates(document: Document, of: Mapping[str, Shape], density: float | None) -> Iterator[Finding]:
    """Links with a shape of some volume and without an inertial; each gets one if a density is given, in [kg/m³]."""
    if density is not None:
        density = number("density", density, above=0)
    for name, shape in of.items():
        link, unit = document.named("link", name), shape.unit
        if link.find("inertial") is not None or unit is None:
            continue
        changes = ()
        if density is not None:
            inertial = etree.SubElement(link, "inertial")
            etree.SubElement(inertial, "origin", xyz=" ".join(map(repr, unit.com.tolist())), rpy="0 0 0")
            etree.SubElement(inertial, "mass", value="0")
            moments = {key: repr(float(density * unit.inertia[at])) for key, at in _MOMENTS.items()}
            etree.SubElement(inertial, "inertia", moments)
            changes = (Change(inertial.find("mass"), "value", repr(float(density * unit.mass))),)
        yield Finding(
            Severity.NOTE, "inertial_missing", f"link {name!r}",
            f"has a shape of {1e3 * unit.mass:.3g} litres and no <inertial>: it has no mass"
            + (f"; estimated at {density:g} kg/m³" if density is not None else ""),
            "add one, or have it estimated: --fix --density", link.sourceline, changes,
        )  # fmt: skip
