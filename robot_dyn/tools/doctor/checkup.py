"""The whole check of a URDF file: its findings, most severe first, and the file with all possible repairs."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, final

from robot_dyn import Robot
from robot_dyn.description import Structure, catalog, description, parse, searched, structure_of
from robot_dyn.foundations import UNREPORTED, Answer, Block, DescriptionError, QueryError, reported, truth
from robot_dyn.shapes import Masses
from robot_dyn.tools.doctor import (
    axes,
    gravity_load,
    limits,
    literals,
    masses,
    names,
    neighbours,
    proportions,
    report,
    shapes,
    spelling,
)  # fmt: skip
from robot_dyn.tools.doctor.document import Document
from robot_dyn.tools.doctor.estimate import missing_inertials
from robot_dyn.tools.doctor.finding import Finding, Severity
from robot_dyn.tools.doctor.kinds import FindingKind

if TYPE_CHECKING:
    from robot_dyn.description import Expansion

_OF_TEXT = (
    spelling.misspelt, literals.decimal_commas, literals.line_breaks, literals.angles_in_degrees,
    literals.near_right_angles, proportions.far_origins, axes.missing_axes, limits.limits, names.names, names.leftovers,
)  # fmt: skip
_ORDER = [*Severity]
_DECLARATION = ("the XML declaration", "XML version")  # start of findings about the first line of a file


@final
@dataclass(frozen=True, eq=False, repr=False)
class Checkup(Answer):
    """Result of a check.

    Attributes:
        source: Path of the file.
        loads: True if the file can be loaded without repairs; otherwise a finding gives the reason.
        findings: All findings, most severe first.
        repaired: The file with all repairs; everything else in it is unchanged, and repairing it again changes nothing.
            None if the file is not XML, or nothing can be repaired.
        left: Findings in the repaired file, with its lines; `findings` if there is no repaired file.
        gone: Findings that the repaired file no longer has.
        examined: True if masses, inertias and shapes were checked, which requires a file that loads, possibly after
            repairs.
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
        """True if no finding is an error."""
        return not any(finding.severity is Severity.ERROR for finding in self.findings)

    @property
    def sentence(self) -> str:
        """Number of findings of each severity, and a note if the file does not load."""
        unread = "" if self.loads else "; it does not load"
        unread += "" if self.examined else "; masses, inertias and shapes were not checked"
        return f"{catalog.abbreviated(self.source)}: {report.counted(self.findings) or 'nothing found'}{unread}"

    def blocks(self) -> Iterator[Block]:
        """Yield the sentence, and a line for each kind of finding; `findings` has all of them."""
        yield self.sentence
        yield from (f"  {report.sentence(group)}" for group in report.grouped(self.findings))

    def _repr_html_(self) -> str:
        from robot_dyn.foundations import page, table

        rows = ((x.severity.value, x.where, str(x.line or ""), x.message, x.remedy) for x in self.findings)
        heading = ("", "where", "line", "message", "remedy")
        return page(self.sentence, table(heading, rows, right=("line",)) if self.findings else "")


def check_urdf(
    name_or_path: str | Path, *, package_dirs: Iterable[str | Path] = (), mass: Mapping[str, float] | None = None,
    total_mass: float | None = None, density: float | None = None, allow_overlap: bool = False, units: bool = False,
    inertia_unit: str | None = None, xacro: Mapping[str, str | float | bool] | None = None,
) -> Checkup:  # fmt: skip
    """Check a URDF file: its numbers, names, limits and units, and its inertias against the shapes of its links.

    Args:
        name_or_path: Name of a robot, or path or package:// address of a file, as in `load`.
        package_dirs: Folders in which packages of meshes are searched first.
        mass: Masses by link, in [kg], for example from a data sheet. A mass that the file states is compared with it.
            Repairs add inertials to links with a shape but no inertial, as in `load`.
        total_mass: Mass of the robot, in [kg]; mass not stated elsewhere is shared by volume. If the file states all
            masses, their sum is compared with it.
        density: Density in [kg/m³] for the same repairs, instead of total_mass.
        allow_overlap: With masses: accept meshes whose closed parts overlap, as in `load`.
        units: Convert masses, inertias and shapes from suspected wrong units. Invented numbers can look like these.
        inertia_unit: Unit from which repairs convert the moments of all links, for example "kg mm2", if the doctor
            suspects it.
        xacro: Expand the file by xacro first, as `load` does; findings name its lines and macro calls.

    Raises:
        CatalogError: If there is no such file, or an entry of `package_dirs` is not a folder.
        DescriptionError: If the file cannot be opened or expanded (a refused file is a finding); or if masses are given
            and the shape of a link without inertial cannot be read.
        QueryError: If a mass, the total or the density is not allowed, as in `load`, or the unit is unknown.
    """
    package_dirs = searched(package_dirs)
    path, units = catalog.find(name_or_path, package_dirs), truth("units", units)
    nothing = mass is None and total_mass is None and density is None
    if nothing and truth("allow_overlap", allow_overlap):
        raise QueryError("allow_overlap applies to estimates; give mass, total_mass or density, or remove it")
    estimates = None if nothing else Masses({} if mass is None else mass, total_mass, density, allow_overlap)
    unit = None if inertia_unit is None else neighbours.checked_unit(inertia_unit)
    if xacro is not None:
        from robot_dyn.description import expand

        expansion = expand(path, xacro, package_dirs)
        return _of_xacro(checked(expansion.text, str(path), package_dirs, estimates, units, unit), expansion)
    try:
        description.refuse_xacro(path)
    except DescriptionError as error:
        return _refused(str(path), error)
    return checked(description.content(path), str(path), package_dirs, estimates, units, unit)


def checked(
    text: bytes, source: str, package_dirs: tuple[Path, ...] = (), estimates: Masses | None = None,
    units: bool = False, inertia_unit: str | None = None,
) -> Checkup:  # fmt: skip
    """Check the text of a file, and repair it until a check finds nothing more to repair.

    One repair may reveal the next: limits in degrees, once converted to radians, may turn out to be crossed.
    """
    first = step = _examined(text, source, package_dirs, estimates, units, inertia_unit)
    texts = [text]
    while step.repaired is not None and step.repaired not in texts:
        texts.append(step.repaired)
        estimates = None if step.estimated else estimates
        inertia_unit = None if step.examined else inertia_unit  # converted once
        step = _examined(step.repaired, source, package_dirs, estimates, units, inertia_unit)
    repaired = texts[-1] if len(texts) > 1 else None
    gone = _gone(first.findings, step.findings)
    return Checkup(source, first.loads, first.findings, repaired, step.findings, gone, first.examined)


class _Examined(NamedTuple):
    """One check of a text and one round of repairs; `estimated` is True once masses have been assigned."""

    loads: bool
    findings: tuple[Finding, ...]
    repaired: bytes | None
    examined: bool
    estimated: bool


def _examined(
    text: bytes, source: str, package_dirs: tuple[Path, ...], estimates: Masses | None, units: bool,
    inertia_unit: str | None,
) -> _Examined:  # fmt: skip
    """Check a text once, and apply one round of repairs."""
    refusal = _refusal(text, source)
    try:
        document = written = Document(text, source)
    except DescriptionError as error:
        return _Examined(False, (_of_refusal(source, str(error)),), None, False, False)
    findings = [_assumed(text) for text in document.assumed]
    findings += [finding for find in _OF_TEXT for finding in find(document)]
    explained = any(finding.severity is Severity.ERROR for finding in findings)
    repairs = [finding for finding in findings if finding.changes]
    if repairs or any(line.startswith(_DECLARATION) for line in document.assumed):  # rewriting replaces it
        document = _rewritten(document, repairs)
    still = _refusal(document.text, source)
    if refusal is not None and (still is not None or not explained):
        findings.append(_of_refusal(source, str(refusal if still is None else still), written))
    robot = None if still is not None else _loaded(document, findings)
    estimated = robot is not None and not repairs
    if robot is not None:
        stated = structure_of(robot.description, robot.edits)
        findings += neighbours.common_unit(document, stated, inertia_unit)
        findings += [_assumed(text) for text in robot.description.findings if not _reported(text, findings)]
        shape_of, unread = shapes.shapes(robot, package_dirs)
        findings += [_of_mesh(note) for note in unread]
        sheet, estimates = _compared(estimates, stated, set(shape_of))
        # shapes may change in the next round of repairs, so masses are estimated in the last one
        missing = [
            *missing_inertials(document, robot.description, shape_of, estimates if estimated else None, package_dirs)
        ]
        findings += missing
        if additions := [finding for finding in missing if finding.changes]:
            document = _rewritten(document, additions)
            robot = Robot(description.check(document.text, source))
        findings += [*masses.masses(document, robot), *shapes.of_one_density(document, robot, shape_of)]
        findings += shapes.doubtful(document, robot, shape_of, package_dirs)
        findings += [*shapes.directions(document, robot, shape_of, package_dirs, findings)]
        findings = shapes.with_repairs(document, robot, shape_of, package_dirs, findings)
        findings += masses.beyond_reach(document, robot, findings)
        findings += neighbours.wide_links(document, stated, shape_of)
        volumes = {name: shape.unit.mass for name, shape in shape_of.items() if shape.unit is not None}
        findings += neighbours.odd_masses(document, stated, volumes)
        findings += () if sheet is None else neighbours.of_data_sheet(document, stated, sheet)
        findings += gravity_load.weak_joints(document, robot, findings)
        conversions = [
            x for x in findings if x.changes and ((x.supposed and units) or x.kind == FindingKind.INERTIA_UNIT)
        ]
        if conversions:
            document = _rewritten(document, conversions)
    loads = refusal is None and not any(finding.kind == FindingKind.REFUSED for finding in findings)
    findings = [x if x.line else replace(x, line=written.line(x.where, x.message)) for x in findings]
    repaired = None if document is written or document.text == text else document.text
    return _Examined(loads, _gravest_first(findings), repaired, robot is not None, estimated)


def _compared(
    masses: Masses | None, stated: Structure, shaped: set[str]
) -> tuple[neighbours.Sheet | None, Masses | None]:
    """Split masses into those to compare with the file's and those for links that lack them; None without any."""
    if masses is None:
        return None, None
    known = {name: mass for name, mass in masses.by_link.items() if name in stated.links and stated.links[name].mass}
    lacking = {name: mass for name, mass in masses.by_link.items() if name not in known}
    complete = not lacking and all(stated.links[name].mass for name in shaped)
    sheet = neighbours.Sheet(known, masses.total if complete else None)
    total = None if complete else masses.total
    if not lacking and total is None and masses.density is None:
        return sheet, None
    return sheet, replace(masses, by_link=lacking, total=total)


def _gone(before: Iterable[Finding], after: Iterable[Finding]) -> tuple[Finding, ...]:
    """Return the findings that a later text no longer has: as many of each kind and place as it has fewer."""
    left, gone = Counter((finding.kind, finding.where) for finding in after), []
    for finding in before:
        if left[finding.kind, finding.where]:
            left[finding.kind, finding.where] -= 1
        else:
            gone.append(finding)
    return tuple(gone)


def _gravest_first(findings: Iterable[Finding]) -> tuple[Finding, ...]:
    return tuple(sorted(findings, key=lambda finding: _ORDER.index(finding.severity)))


def _refused(source: str, error: DescriptionError) -> Checkup:
    """Return the checkup of a text that is not read at all."""
    findings = (_of_refusal(source, str(error)),)
    return Checkup(source, False, findings, None, findings)


def _of_xacro(checkup: Checkup, expansion: Expansion) -> Checkup:
    """Return the checkup of an expanded text with the places of the xacro file, and with xacro's warnings.

    The warnings concern the xacro file: a check of the repaired file does not repeat them.
    """
    try:
        elements = parse(expansion.text, checkup.source)[0].iter("*")
    except DescriptionError:
        elements = ()
    places = dict(zip((element.sourceline for element in elements), expansion.places, strict=False))

    def placed(finding: Finding) -> Finding:
        where, _, line = finding.where.rpartition("line ")
        if not line.isdecimal():
            return replace(finding, line=None, expanded_from=places.get(finding.line, ""))
        return replace(
            finding, where=where.removesuffix(" in ") or "file", line=None, expanded_from=places.get(int(line), "")
        )

    findings = _gravest_first((*map(placed, checkup.findings), *map(_assumed, expansion.warnings)))
    left = findings if checkup.repaired is None else checkup.left
    return replace(checkup, findings=findings, left=left, gone=tuple(map(placed, checkup.gone)))


def _refusal(text: bytes, source: str) -> DescriptionError | None:
    try:
        description.check(text, source)
    except DescriptionError as error:
        return error
    return None


def _loaded(document: Document, findings: list[Finding]) -> Robot | None:
    """Return the robot; None, and a finding, if it has no moving joint."""
    try:
        return Robot(description.check(document.text, document.source))
    except DescriptionError as error:
        findings.append(_of_refusal(document.source, str(error)))
        return None


def _of_refusal(source: str, message: str, written: Document | None = None) -> Finding:
    """Return the finding for a refusal by the reader, with its line if it names an element of the document."""
    where, _, rest = message.removeprefix(f"{source}: ").partition(": ")
    if not rest or not where.startswith(("link ", "joint ", "line ", "<")):
        where, rest = "file", message.removeprefix(f"{source}: ")
    what, _, remedy = rest.rpartition("; ")
    what, remedy = (what, remedy) if what else (remedy, "correct the file")
    return Finding(Severity.ERROR, FindingKind.REFUSED, where, what, remedy, written and written.line(where, what))


def _assumed(text: str) -> Finding:
    """Return the finding for a departure from the format that is read in a defined way."""
    where, _, rest = text.partition(": ") if text.startswith(("line", "link", "joint")) else ("file", "", text)
    what, _, remedy = rest.partition("; ")
    return Finding(Severity.WARNING, FindingKind.FORMAT, where, what, remedy)


def _reported(text: str, findings: Iterable[Finding]) -> bool:
    """Return True if the check has already reported a finding of the reader, in other words."""
    reported_limits = {finding.where for finding in findings if finding.kind.startswith("limit")}
    same = {finding.message for finding in findings}
    return text.partition(": ")[0] in reported_limits or any(what in text for what in same)


def _of_mesh(note: str) -> Finding:
    where, _, message = note.partition(": ")
    what, _, remedy = message.partition("; ")
    if where == "file":
        return Finding(Severity.NOTE, FindingKind.SHAPE_ELSEWHERE, where, what, f"{remedy}; correct the paths")
    return Finding(
        Severity.WARNING, FindingKind.SHAPE_MISSING, where, what, remedy or "correct its address, or add its folder"
    )


def _rewritten(document: Document, findings: Iterable[Finding]) -> Document:
    """Return the document with all changes.

    If two findings change the same attribute, only the first is repaired; the next round checks the rest.
    """
    changed = set[tuple[Any, str]]()
    for finding in findings:
        places = {place for change in finding.changes for place in change.places}
        if places & changed:
            continue
        changed |= places
        for change in finding.changes:
            change.apply()
    return document.mended(changed)
