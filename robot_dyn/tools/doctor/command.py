"""The commands about files of robots: check-urdf and diff-robots."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

import robot_dyn as rd
from robot_dyn import RobotDynError
from robot_dyn.cli import (
    AS_STATED,
    FILE_AS_STATED,
    FileOptions,
    Force,
    Json,
    RobotOptions,
    arguments,
    command,
    completion,
    progress,
    show,
    to_stderr,
)
from robot_dyn.description import package_folders
from robot_dyn.foundations import FileKind, QueryError, nearest, save, shown, target
from robot_dyn.tools.doctor.kinds import FindingKind

if TYPE_CHECKING:
    from robot_dyn.tools.doctor.checkup import Checkup
    from robot_dyn.tools.doctor.finding import Finding

_URDF = FileKind("a URDF", ".urdf")


class RepairError(RobotDynError):
    """A repaired file cannot be written."""


@command("Files")
def check_urdf(
    files: Annotated[list[str], typer.Argument(autocompletion=completion.robots)],
    /,
    fix: bool = False,
    units: bool = False,
    inertia_unit: str | None = None,
    all_: bool = False,
    force: Force = False,
    options: FileOptions = FILE_AS_STATED,
    as_json: Json = False,
) -> None:
    """Check URDF files, and repair them with --fix.

    Inertias, units, limits, names and shapes are checked. The exit code is 1 if errors remain. --mass and --total-mass
    are compared with the file; with --fix they complete links without inertia. --density, --allow-overlap, --units and
    --inertia-unit need --fix.

    Options:
        files (FILE...): URDF files, or names of robots.
        fix: Write NAME.fixed.urdf here; only the repaired values differ from the file.
        units: With --fix: convert values from suspected wrong units, such as kg mm².
        inertia_unit (UNIT): With --fix: convert the moments of all links from this unit, such as kg·mm2, if suspected.
        all_: Print each finding, not one line for each kind.
    """
    from robot_dyn.foundations import plain
    from robot_dyn.tools.doctor.finding import Severity

    changing = {"--units": units, "--inertia-unit": inertia_unit is not None}
    for option in [*options.stated, *(name for name, is_set in changing.items() if is_set)]:
        if option not in ("--package-dir", "--xacro", "--mass", "--total-mass") and not fix:
            raise QueryError(f"{option} needs --fix, which writes the changes; add it, or remove {option}")
    targets = {file: _target(file, force) for file in files} if fix else {}
    if len({*targets.values()}) < len(targets):
        raise QueryError("--fix: two of the files would get the same name; repair them one by one")
    checkups = [
        rd.tools.doctor.check_urdf(file, units=units, inertia_unit=inertia_unit, **options.reading)
        for file in progress(files, "checking")
    ]
    written = {}
    for file, checkup in zip(files, checkups, strict=True):
        if fix and checkup.repaired is not None:
            text, to = checkup.repaired, targets[file]
            written[file] = str(save(to, lambda stream, text=text: stream.write(text), RepairError))
    checked = [(file, checkup, written.get(file)) for file, checkup in zip(files, checkups, strict=True)]
    document = {"files": [{"file": file, "written": to} | plain(checkup) for file, checkup, to in checked]}
    show([line for result in checked for line in _lines(*result, all_)], as_json=as_json, document=document)
    if fix and not as_json:
        for file, checkup in zip(files, checkups, strict=True):
            if file not in written:
                suspected = {
                    "--units": not units and any(x.supposed for x in checkup.findings),
                    "--inertia-unit": inertia_unit is None
                    and any(x.kind == FindingKind.INERTIA_UNIT for x in checkup.findings),
                }
                options_left = " or ".join(name for name, applies in suspected.items() if applies)
                hint = f"; {options_left} converts values from a suspected unit" if options_left else ""
                to_stderr(f"{file}: nothing to repair{hint}")
    remaining = (finding for file, x, _ in checked for finding in (x.left if file in written else x.findings))
    if any(finding.severity is Severity.ERROR for finding in remaining):
        raise typer.Exit(1)


@command("Files")
def diff_robots(
    a: Annotated[str, typer.Argument(autocompletion=completion.robots)],
    b: Annotated[str, typer.Argument(autocompletion=completion.robots)],
    /,
    joint: list[str] | None = None,
    sign: list[str] | None = None,
    offset: list[str] | None = None,
    same_q: bool = False,
    tolerance: float = 0.01,
    samples: int = 1000,
    options: RobotOptions = AS_STATED,
    as_json: Json = False,
) -> None:
    """Compare two files of one robot: their values, in N m too.

    It prints the map q_b = s q_a + o that the joint axes show, the values that differ, and the largest differences
    found of N and M. The exit code is 1 if these exceed the tolerance, or if a joint has no counterpart. --lock applies
    to each file that has the joint, --xacro to xacro files.

    Options:
        a (A): A name of `robot-dyn list`, or the path of a URDF, MJCF or xacro file.
        b (B): Another description of the same robot.
        joint (A=B): Joint of A and its counterpart in B, where the names differ; may be repeated.
        sign (JOINT=S): Sign s of a joint of A, 1 or -1; may be repeated.
        offset (JOINT=VALUE): Offset o of a joint of A, in rad or m; may be repeated.
        same_q: Compare at equal q: propose no signs and no offsets.
        tolerance: Largest accepted difference of N, in N m or N, and of M at 1 rad/s² or 1 m/s².
        samples (COUNT): Number of random states from which the search starts.
    """
    locks = arguments.assignments("--lock", options.lock) if options.lock else {}
    robots = []
    for name in (a, b):
        expanded = options.xacro if name.endswith(".xacro") else None
        robots.append(replace(options, lock=None, xacro=expanded).load(name))
    joints = {name for robot in robots for name in robot.description.joint_kinds}
    for name in locks:
        if name not in joints:
            raise QueryError(f"--lock: no joint {shown(name)} in either file; {nearest(name, joints)}")
    locked = (
        robot.with_(lock={name: q for name, q in locks.items() if name in robot.description.joint_kinds})
        for robot in robots
    )
    difference = rd.tools.doctor.diff_robots(
        *locked,
        joints=arguments.pairs("--joint", joint, "A=B"),
        signs=arguments.assignments("--sign", sign or []),
        offsets=arguments.assignments("--offset", offset or []),
        same_q=same_q,
        tolerance=tolerance,
        samples=samples,
    )
    show(difference, as_json=as_json)
    if not difference.agrees:
        raise typer.Exit(1)


def _target(file: str, force: bool) -> Path:
    stem = Path(file).name.removesuffix(".xacro").removesuffix(".urdf")
    return target(f"{stem}.fixed.urdf", _URDF, RepairError, [file] if Path(file).is_file() else [], force)


def _lines(file: str, checkup: Checkup, written: str | None, every: bool) -> Iterator[str]:
    """Yield the lines about a file, its findings, and the repaired file."""
    from robot_dyn.tools.doctor.report import counted, grouped, sentence

    yield checkup.sentence.replace(checkup.source, file, 1)
    for group in grouped(checkup.findings):
        for line in ((finding,) for finding in group) if every else (group,):
            yield f"  {sentence(tuple(line))}{_repairable(line, written)}"
    if written:
        repaired, left = counted(checkup.gone) or "nothing", counted(checkup.left) or "nothing"
        yield f"  written to {written}: repaired {repaired}; left {left}"
        before = {(finding.kind, finding.where) for finding in checkup.findings}
        for group in grouped(finding for finding in checkup.left if (finding.kind, finding.where) not in before):
            yield f"  found in {written}: {sentence(group)}"
        if folders := _of_packages(Path(file), checkup.repaired or b""):
            yield f"  its meshes are found with {' '.join(f'--package-dir {folder}' for folder in folders)}"


def _of_packages(file: Path, text: bytes) -> list[Path]:
    """Return the folders of mesh packages that are found from a file's location, but not from a copy elsewhere."""
    if file.absolute().parent == Path.cwd():
        return []
    names = sorted(set(re.findall(rb'filename="package://([^/"]+)/', text)))
    candidates = (package_folders(name.decode(errors="replace"), file) for name in names)
    existing = (next((folder for folder in folders if folder.is_dir()), None) for folders in candidates)
    return list(dict.fromkeys(folder.parent for folder in existing if folder is not None))


def _repairable(findings: Iterable[Finding], written: str | None) -> str:
    """Return the option that repairs some of these findings; "" if they are repaired, or cannot be."""
    supposed = {finding.supposed for finding in findings if finding.changes and (finding.supposed or written is None)}
    return "" if not supposed else " [--fix --units]" if supposed == {True} else " [--fix]"
