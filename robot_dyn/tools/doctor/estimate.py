"""Missing and estimated inertials; with masses, missing ones are estimated from shapes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

from robot_dyn.description import Description
from robot_dyn.shapes import Estimate, Masses, estimates, shapes_of_incomplete_links
from robot_dyn.tools.doctor.document import Document
from robot_dyn.tools.doctor.finding import Change, Finding, Severity
from robot_dyn.tools.doctor.kinds import FindingKind

if TYPE_CHECKING:
    from robot_dyn.tools.doctor.shapes import Shape


def missing_inertials(
    document: Document,
    description: Description,
    shapes: Mapping[str, Shape],
    masses: Masses | None,
    package_dirs: tuple[Path, ...],
) -> Iterator[Finding]:
    """Report links with a shape but no inertial, which get one if masses are given; and estimated inertials.

    Raises:
        QueryError, DescriptionError: See `robot_dyn.shapes.estimate.with_estimates`.
    """
    new = dict[str, Estimate]()
    if masses is not None:
        lacking, unread = shapes_of_incomplete_links(description, package_dirs, masses.allow_overlap)
        new = {estimate.link: estimate for estimate in estimates(description, lacking, masses, unread)[0]}
    for name, shape in shapes.items():
        if name not in new and shape.unit is not None and document.named("link", name).find("inertial") is None:
            yield _finding(
                document, name, FindingKind.INERTIAL_MISSING,
                f"has a shape of {1e3 * shape.unit.mass:.3g} litres but no <inertial>, so it has no mass",
                "add one, or estimate it: --fix with --mass, --total-mass or --density",
            )  # fmt: skip
    for name, estimate in new.items():
        lack = "a mass but no moments of inertia" if estimate.moments_only else "a shape but no mass"
        inertial = estimate.write(document.named("link", name))
        del inertial.attrib["estimated"]  # the change adds it again
        yield _finding(
            document, name, FindingKind.INERTIAL_MISSING, f"has {lack}; estimated, not measured: {estimate.basis}",
            "replace it by measured values where you have them", (Change(inertial, "estimated", estimate.basis),),
        )  # fmt: skip
    for name, basis in description.estimated.items():
        yield _finding(
            document, name, FindingKind.INERTIAL_ESTIMATED, f"its inertial is estimated, not measured: {basis}",
            "replace it by measured values where you have them",
        )  # fmt: skip


def _finding(
    document: Document, link: str, kind: FindingKind, what: str, remedy: str, changes: tuple[Change, ...] = ()
) -> Finding:
    line = document.named("link", link).sourceline
    return Finding(Severity.NOTE, kind, f"link {link!r}", what, remedy, line, changes)
