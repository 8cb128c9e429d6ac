"""The whole check of a URDF file: its findings, the gravest first, and the file with what can be repaired."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import final

from lxml import etree  # pyright: ignore[reportAttributeAccessIssue]

from robot_dyn.description import catalog, description
from robot_dyn.description.packages import searched
from robot_dyn.errors import DescriptionError
from robot_dyn.model.robot import Robot
from robot_dyn.result import UNREPORTED, reported
from robot_dyn.studies.doctor import limits, literals, masses, names, shapes, spelling
from robot_dyn.studies.doctor.document import Document
from robot_dyn.studies.doctor.estimate import estimates
from robot_dyn.studies.doctor.finding import Finding, Severity
from robot_dyn.validate import truth

_OF_TEXT = (
    spelling.misspelt, literals.decimal_commas, literals.line_breaks, literals.angles_in_degrees,
    literals.near_right_angles, limits.limits, names.names, names.leftovers,
)  # fmt: skip
_ORDER = [*Severity]


@final
@dataclass(frozen=True, eq=False)
class Checkup:
    """What a check found.

    Attributes:
        source: The file.
        loads: Whether it is read as it stands; why not is among the findings.
        findings: The gravest first.
        repaired: The file with all changes of the findings, each in a comment before its element; None if it is not
            XML, or nothing can be changed.
    """

    source: str
    loads: bool
    findings: tuple[Finding, ...]
    repaired: bytes | None = field(metadata=UNREPORTED)

    @reported
    def ok(self) -> bool:
        """Whether there is no error among the findings."""
        return not any(each.severity is Severity.ERROR for each in self.findings)


def check(
    name_or_path: str | Path, *, package_dirs: Iterable[str | Path] = (), density: float | None = None,
    units: bool = False,
) -> Checkup:  # fmt: skip
    """Check a URDF file: its numbers, names, limits and units, and its inertias against the shapes of its links.

    Args:
        name_or_path: As of `load`.
        package_dirs: Folders in which packages of meshes are searched first.
        density: In [kg/m³]: links with a shape and no inertial get the inertia of that shape among the repairs.
        units: Whether masses, inertias and shapes in units that are suspected are converted among the repairs. Numbers
            that nobody measured look like these as well.

    Raises:
        CatalogError: If there is no such file, or an entry of `package_dirs` is not a folder.
        DescriptionError: If it cannot be opened; a file that is refused is a finding.
        QueryError: If density is not positive.
    """
    package_dirs = searched(package_dirs)
    path = catalog.find(name_or_path, package_dirs)
    try:
        description.refuse_xacro(path)
    except DescriptionError as error:
        return Checkup(str(path), False, (_of_refusal(str(path), str(error)),), None)
    return checked(description.content(path), str(path), package_dirs, density, truth("units", units))


def checked(
    text: bytes, source: str, package_dirs: tuple[Path, ...] = (), density: float | None = None, units: bool = False
) -> Checkup:
    """Check the text of a file."""
    refusal = _refusal(text, source)
    try:
        document = written = Document(text, source)
    except DescriptionError as error:
        return Checkup(source, False, (_of_refusal(source, str(error)),), None)
    found = [_assumed(each) for each in document.assumed]
    found += [finding for find in _OF_TEXT for finding in find(document)]
    explained = any(each.severity is Severity.ERROR for each in found)
    repairs = [each for each in found if each.changes]
    declared = any("XML" in each for each in document.assumed)  # which is written again
    if repairs or declared:
        document = _rewritten(document, repairs)
    still = _refusal(document.text, source)
    if refusal is not None and (still is not None or not explained):
        found.append(_of_refusal(source, str(refusal if still is None else still), written))
    robot = None if still is not None else _loaded(document, found)
    if robot is not None:
        found += [_assumed(each) for each in robot.description.findings if not _reported(each, found)]
        found += masses.masses(robot)
        of, unread = shapes.shapes(robot, package_dirs)
        found += [_of_mesh(each) for each in unread]
        later = [*shapes.misfits(document, robot, of), *shapes.outside(robot, of), *estimates(document, of, density)]
        found += later
        if made := [each for each in later if each.changes and (units or not each.supposed)]:
            repairs += made
            document = _rewritten(document, made)
    found.sort(key=lambda each: _ORDER.index(each.severity))
    loads = refusal is None and not any(each.kind == "refused" for each in found)
    return Checkup(source, loads, tuple(found), document.text if repairs or declared else None)


def _refusal(text: bytes, source: str) -> DescriptionError | None:
    try:
        description.check(text, source)
    except DescriptionError as error:
        return error
    return None


def _loaded(document: Document, found: list[Finding]) -> Robot | None:
    """The robot; None, and a finding, if it has no joint that moves."""
    try:
        return Robot(description.check(document.text, document.source))
    except DescriptionError as error:
        found.append(_of_refusal(document.source, str(error)))
        return None


def _of_refusal(source: str, message: str, written: Document | None = None) -> Finding:
    """The finding of a message of the read; with its line, if it names an element of a document."""
    where, _, rest = message.removeprefix(f"{source}: ").partition(": ")
    if not rest or not where.startswith(("link ", "joint ", "line ", "<")):
        where, rest = "file", message.removeprefix(f"{source}: ")
    what, _, remedy = rest.rpartition("; ")
    what, remedy = (what, remedy) if what else (remedy, "correct the file")
    return Finding(Severity.ERROR, "refused", where, what, remedy, written and written.line(where, what))


def _assumed(text: str) -> Finding:
    """A departure from the format that is read in one way."""
    where, _, rest = text.partition(": ") if text.startswith(("line", "link", "joint")) else ("file", "", text)
    what, _, remedy = rest.partition("; ")
    return Finding(Severity.WARNING, "format", where, what, remedy)


def _reported(text: str, found: Iterable[Finding]) -> bool:
    """Whether the check has already found, with another text, what the read found."""
    limits_told = {each.where for each in found if each.kind.startswith("limit")}
    same = {each.what for each in found}
    return text.partition(": ")[0] in limits_told or any(what in text for what in same)


def _of_mesh(note: str) -> Finding:
    where, _, what = note.partition(": ")
    return Finding(Severity.WARNING, "shape_missing", where, what, "correct its address, or name its folder")


def _rewritten(document: Document, findings: Iterable[Finding]) -> Document:
    """The document with their changes, each in a comment before its element."""
    for finding in findings:
        for change in finding.changes:
            comment = etree.Comment(f" robot-dyn check: {_plain(f'{change.text}: {finding.what}')} ")
            comment.tail = _indent(change.element)
            change.apply()
            change.element.addprevious(comment)
    tree = document.root.getroottree()
    text = etree.tostring(tree, xml_declaration=True, encoding="UTF-8")
    return Document(text + b"\n" if not text.endswith(b"\n") else text, document.source)


def _plain(text: str) -> str:
    """A text that may stand in a comment of XML."""
    return " ".join(text.split()).replace("--", "- -").rstrip("-")


def _indent(element: etree._Element) -> str:
    """The blanks before an element."""
    before = element.getprevious()
    text = element.getparent().text if before is None else before.tail
    return "\n" + (text or "").rpartition("\n")[2] if "\n" in (text or "") else " "
