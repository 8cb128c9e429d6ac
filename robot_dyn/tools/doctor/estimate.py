"""Inertials that a file does not state, and those that were estimated; with masses they are estimated from shapes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from robot_dyn.description import Description
from robot_dyn.shapes import Estimate, Masses, estimates, shapes_of_lacking
from robot_dyn.tools.doctor.document import Document
from robot_dyn.tools.doctor.finding import Change, Finding, Severity

if TYPE_CHECKING:
    from robot_dyn.tools.doctor.shapes import Shape


def missing_inertials(
    document: Document,
    description: Description,
    of: Mapping[str, Shape],
    masses: Masses | None,
    package_dirs: tuple[Path, ...],
) -> Iterator[Finding]:
    """Links without an inertial that have a shape: with masses each gets one; and those whose inertial is marked.

    Raises:
        QueryError: As `robot_dyn.shapes.estimate.with_estimates`; DescriptionError likewise.
    """
    found = dict[str, Estimate]()
    if masses is not None:
        shapes, unread = shapes_of_lacking(description, package_dirs, masses.allow_overlap)
        found = {each.link: each for each in estimates(description, shapes, masses, unread)[0]}
    for name, shape in of.items():
        if name not in found and shape.unit is not None and document.named("link", name).find("inertial") is None:
            yield _finding(
                document, name, "inertial_missing",
                f"has a shape of {1e3 * shape.unit.mass:.3g} litres and no <inertial>: it has no mass",
                "add one, or have it estimated: --fix with --mass, --total-mass or --density",
            )  # fmt: skip
    for name, each in found.items():
        what = "a mass and no moments of inertia" if each.moments_only else "a shape and no mass"
        inertial = each.write(document.named("link", name))
        del inertial.attrib["estimated"]  # which the change writes
        yield _finding(
            document, name, "inertial_missing", f"has {what}; estimated, not measured: {each.basis}",
            "replace it by measured values where you have them", (Change(inertial, "estimated", each.basis),),
        )  # fmt: skip
    for name, basis in description.estimated.items():
        yield _finding(
            document, name, "inertial_estimated", f"its inertial is estimated, not measured: {basis}",
            "replace it by measured values where you have them",
        )  # fmt: skip


def _finding(
    document: Document, link: str, kind: str, what: str, remedy: str, changes: tuple[Change, ...] = ()
) -> Finding:
    line = document.named("link", link).sourceline
    return Finding(Severity.NOTE, kind, f"link {link!r}", what, remedy, line, changes)
