"""The whole check of a URDF file: its findings, the gravest first, and the file with what can be repaired."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple, final

from lxml import etree  # pyright: ignore[reportAttributeAccessIssue]

from robot_dyn import Robot
from robot_dyn.description import catalog, description, searched
from robot_dyn.foundations import UNREPORTED, Answer, Block, DescriptionError, QueryError, reported, truth
from robot_dyn.shapes import Masses
from robot_dyn.tools.doctor import (
    axes,
    gravity_load,
    limits,
    literals,
    masses,
    names,
    proportions,
    report,
    shapes,
    spelling,
)  # fmt: skip
from robot_dyn.tools.doctor.document import Document
from robot_dyn.tools.doctor.estimate import missing_inertials
from robot_dyn.tools.doctor.finding import Finding, Severity

_OF_TEXT = (
    spelling.misspelt, literals.decimal_commas, literals.line_breaks, literals.angles_in_degrees,
    literals.near_right_angles, proportions.far_origins, axes.missing_axes, limits.limits, names.names, names.leftovers,
)  # fmt: skip
_ORDER = [*Severity]
_DECLARATION = ("the XML declaration", "XML version")  # how findings about the first line of a file begin


@final
@dataclass(frozen=True, eq=False, repr=False)
class Checkup(Answer):
    """What a check found.

    Attributes:
        source: The file.
        loads: Whether it is read as it stands; why not is among the findings.
        findings: The gravest first.
        repaired: The file with all repairs, each change in a comment before its element: repairing it again changes
            nothing. None if the file is not XML, or nothing can be repaired.
        left: The findings of a check of the repaired file, with its lines; `findings` if there is none.
        gone: The findings that the repaired file no longer has.
        examined: Whether masses, inertias and shapes were checked, which takes a file, or a repaired one, that is read.
    """

    source: str
    loads: bool
    findings: tuple[Finding, ...]
    repaired: bytes | None = field(metadata=UNREPORTED)
    left: tuple[Finding, ...] = field(metadata=UNREPORTED)
    gone: tuple[Finding, ...] = field(default=(), metadata=UNREPORTED)
    examined: bool = field(default=False, metadata=UNREPORTED)

    @reported
    def ok(self) -> bool:
        """Whether there is no error among the findings."""
        return not any(each.severity is Severity.ERROR for each in self.findings)

    @property
    def sentence(self) -> str:
        """How many findings of each severity there are, and whether the file is read."""
        unread = "" if self.loads else "; it does not load"
        unread += "" if self.examined else "; masses, inertias and shapes were not checked"
        return f"{catalog.abbreviated(self.source)}: {report.counted(self.findings) or 'nothing found'}{unread}"

    def blocks(self) -> Iterator[Block]:
        """The sentence, and a line for each kind of finding; `findings` has all of them."""
        yield self.sentence
        yield from (f"  {report.sentence(each)}" for each in report.grouped(self.findings))

    def _repr_html_(self) -> str:
        from robot_dyn.foundations import page, table

        rows = ((x.severity.value, x.where, str(x.line or ""), x.what, x.remedy) for x in self.findings)
        heading = ("", "where", "line", "what", "remedy")
        return page(self.sentence, table(heading, rows, right=("line",)) if self.findings else "")


def check(
    name_or_path: str | Path, *, package_dirs: Iterable[str | Path] = (), mass: Mapping[str, float] | None = None,
    total_mass: float | None = None, density: float | None = None, allow_overlap: bool = False, units: bool = False,
    xacro: Mapping[str, str | float | bool] | None = None,
) -> Checkup:  # fmt: skip
    """Check a URDF file: its numbers, names, limits and units, and its inertias against the shapes of its links.

    Args:
        name_or_path: As of `load`.
        package_dirs: Folders in which packages of meshes are searched first.
        mass: Masses by link, in [kg]: links with a shape and no inertial get one among the repairs, as in `load`.
        total_mass: Of the robot, in [kg]: likewise; what the known masses leave is shared by volume.
        density: In [kg/m³]: likewise, in place of total_mass.
        allow_overlap: With masses: of meshes whose closed parts overlap, as in `load`.
        units: Whether masses, inertias and shapes in units that are suspected are converted among the repairs. Numbers
            that nobody measured look like these as well.
        xacro: Expand the file by xacro first, as `load` does; findings are those of the expanded text, without lines.

    Raises:
        CatalogError: If there is no such file, or an entry of `package_dirs` is not a folder.
        DescriptionError: If it cannot be opened, or expanded; a file that is refused is a finding. If masses are given
            and the shape of a link without inertial cannot be read.
        QueryError: If a mass, the total or the density is not allowed, as in `load`.
    """
    package_dirs = searched(package_dirs)
    path, units = catalog.find(name_or_path, package_dirs), truth("units", units)
    nothing = mass is None and total_mass is None and density is None
    if nothing and truth("allow_overlap", allow_overlap):
        raise QueryError("allow_overlap is for estimates; give mass, total_mass or density, or leave it out")
    known = None if nothing else Masses({} if mass is None else mass, total_mass, density, allow_overlap)
    if xacro is not None:
        from robot_dyn.description import expand

        text, warned = expand(path, xacro, package_dirs)
        return _without_lines(checked(text, str(path), package_dirs, known, units), map(_assumed, warned))
    try:
        description.refuse_xacro(path)
    except DescriptionError as error:
        return _refused(str(path), error)
    return checked(description.content(path), str(path), package_dirs, known, units)


def checked(
    text: bytes, source: str, package_dirs: tuple[Path, ...] = (), known: Masses | None = None, units: bool = False
) -> Checkup:
    """Check the text of a file, and repair it until a check finds nothing that it can repair.

    One repair may uncover the next: limits in degrees, once in radians, turn out to be crossed.
    """
    first = step = _examined(text, source, package_dirs, known, units)
    texts = [text]
    while step.repaired is not None and step.repaired not in texts:
        texts.append(step.repaired)
        known = None if step.estimated else known
        step = _examined(step.repaired, source, package_dirs, known, units)
    repaired = texts[-1] if len(texts) > 1 else None
    gone = _gone(first.findings, step.findings)
    return Checkup(source, first.loads, first.findings, repaired, step.findings, gone, first.examined)


class _Examined(NamedTuple):
    """One check of a text, and one round of repairs; `estimated` is True once masses have been assigned."""

    loads: bool
    findings: tuple[Finding, ...]
    repaired: bytes | None
    examined: bool
    estimated: bool


def _examined(text: bytes, source: str, package_dirs: tuple[Path, ...], known: Masses | None, units: bool) -> _Examined:
    refusal = _refusal(text, source)
    try:
        document = written = Document(text, source)
    except DescriptionError as error:
        return _Examined(False, (_of_refusal(source, str(error)),), None, False, False)
    found = [_assumed(each) for each in document.assumed]
    found += [finding for find in _OF_TEXT for finding in find(document)]
    explained = any(each.severity is Severity.ERROR for each in found)
    repairs = [each for each in found if each.changes]
    if repairs or any(line.startswith(_DECLARATION) for line in document.assumed):  # which is written again
        document = _rewritten(document, repairs)
    still = _refusal(document.text, source)
    if refusal is not None and (still is not None or not explained):
        found.append(_of_refusal(source, str(refusal if still is None else still), written))
    robot = None if still is not None else _loaded(document, found)
    estimated = robot is not None and not repairs
    if robot is not None:
        found += [_assumed(each) for each in robot.description.findings if not _reported(each, found)]
        of, unread = shapes.shapes(robot, package_dirs)
        found += [_of_mesh(each) for each in unread]
        # shapes may stand elsewhere after the next round of repairs, therefore masses wait for the last one
        missing = [*missing_inertials(document, robot.description, of, known if estimated else None, package_dirs)]
        found += missing
        if made := [finding for finding in missing if finding.changes]:
            document = _rewritten(document, made)
            robot = Robot(description.check(document.text, source))
        found += [*masses.masses(document, robot), *shapes.of_one_density(document, robot, of)]
        doubtful = shapes.doubtful(document, robot, of, package_dirs)
        found += doubtful
        found += masses.beyond_reach(document, robot, found)
        found += gravity_load.weak_joints(document, robot, found)
        if made := [finding for finding in doubtful if finding.changes and (units or not finding.supposed)]:
            document = _rewritten(document, made)
    loads = refusal is None and not any(each.kind == "refused" for each in found)
    repaired = None if document is written or document.text == text else document.text
    return _Examined(loads, _gravest_first(found), repaired, robot is not None, estimated)


def _gone(before: Iterable[Finding], after: Iterable[Finding]) -> tuple[Finding, ...]:
    """The findings of a text that a later one does not have: of each kind and place as many as are fewer."""
    left, gone = Counter((finding.kind, finding.where) for finding in after), []
    for finding in before:
        if left[finding.kind, finding.where]:
            left[finding.kind, finding.where] -= 1
        else:
            gone.append(finding)
    return tuple(gone)


def _gravest_first(findings: Iterable[Finding]) -> tuple[Finding, ...]:
    return tuple(sorted(findings, key=lambda each: _ORDER.index(each.severity)))


def _refused(source: str, error: DescriptionError) -> Checkup:
    """Of a text that is not read at all."""
    found = (_of_refusal(source, str(error)),)
    return Checkup(source, False, found, None, found)


def _without_lines(checkup: Checkup, more: Iterable[Finding]) -> Checkup:
    """The checkup of an expanded text, whose lines are not those of the file, with the warnings of the expansion.

    These are about the xacro file: a check of the repaired file does not find them.
    """
    more = tuple(more)
    found = [replace(finding, line=None) for finding in checkup.findings]
    gone = [replace(finding, line=None) for finding in checkup.gone]
    found = _gravest_first((*found, *more))
    left = found if checkup.repaired is None else checkup.left
    return replace(checkup, findings=found, left=left, gone=tuple(gone))


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
    where, _, said = note.partition(": ")
    what, _, remedy = said.partition("; ")
    return Finding(Severity.WARNING, "shape_missing", where, what, remedy or "correct its address, or name its folder")


def _rewritten(document: Document, findings: Iterable[Finding]) -> Document:
    """The document with their changes, each in a comment before its element.

    Of two findings that change one attribute the first is repaired; the next round checks what it left.
    """
    changed = set[tuple[Any, str]]()
    for finding in findings:
        places = {place for change in finding.changes for place in change.places}
        if places & changed:
            continue
        changed |= places
        for change in finding.changes:
            comment = etree.Comment(f" robot-dyn check: {_plain(f'{change.text}: {finding.what}')} ")
            comment.tail = _indent(change.element)
            change.apply()
            change.element.addprevious(comment)
    return document.mended()


def _plain(text: str) -> str:
    """A text that may stand in a comment of XML."""
    return " ".join(text.split()).replace("--", "- -").rstrip("-")


def _indent(element: etree._Element) -> str:
    """The blanks before an element."""
    before = element.getprevious()
    text = element.getparent().text if before is None else before.tail
    return "\n" + (text or "").rpartition("\n")[2] if "\n" in (text or "") else " "
