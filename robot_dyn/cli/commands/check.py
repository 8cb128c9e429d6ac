"""The command that checks URDF files: check."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

import robot_dyn as rd
from robot_dyn.cli import arguments, completion
from robot_dyn.cli.app import Force, Json, PackageDir, app, progress
from robot_dyn.cli.terminal import say, say_json, to_stderr
from robot_dyn.errors import QueryError, RobotDynError
from robot_dyn.files import Kind, save

if TYPE_CHECKING:
    from robot_dyn.studies.doctor.check import Checkup

_URDF = Kind("a URDF", ".urdf", b"<?xml")


class RepairError(RobotDynError):
    """A repaired file that cannot be written."""


@app.command()
def check(
    files: Annotated[
        list[str],
        typer.Argument(metavar="FILE...", help="URDF files, or names of robots.", autocompletion=completion.robots),
    ],
    fix: Annotated[
        bool, typer.Option("--fix", help="Write NAME.fixed.urdf here, with every change in a comment.")
    ] = False,
    density: Annotated[
        float | None,
        typer.Option(metavar="KG/M³", help="With --fix: inertias of this density for links without any, from shapes."),
    ] = None,
    units: Annotated[
        bool, typer.Option("--units", help="With --fix: convert what seems to be in another unit, such as kg mm².")
    ] = False,
    force: Force = False,
    package_dir: PackageDir = None,
    as_json: Json = False,
) -> None:
    """Check URDF files: inertias, units, limits, names, shapes; exit code 1 if there are errors in one."""
    from robot_dyn.result import plain

    for option, given in (("--density", density is not None), ("--units", units)):
        if given and not fix:
            raise QueryError(f"{option} is for --fix, which writes the changes; add it, or leave {option} out")
    targets = {file: _target(file, force) for file in files} if fix else {}
    if len({*targets.values()}) < len(targets):
        raise QueryError("--fix: two of the files would be written under one name; repair them one by one")
    checkups = [
        rd.check(file, package_dirs=package_dir or (), density=density, units=units)
        for file in progress(files, "checking")
    ]
    written = {}
    for file, each in zip(files, checkups, strict=True):
        if fix and each.repaired is not None:
            text, to = each.repaired, targets[file]
            written[file] = str(save(to, lambda stream, text=text: stream.write(text), RepairError))
    checked = [(file, each, written.get(file)) for file, each in zip(files, checkups, strict=True)]
    if as_json:
        say_json({"files": [{"file": file, "written": to} | plain(each) for file, each, to in checked]})
    else:
        say(*(line for each in checked for line in _lines(*each)))
    if fix and not as_json:
        for file in files:
            if file not in written:
                to_stderr(f"{file}: nothing that can be repaired")
    if not all(each.ok for each in checkups):
        raise typer.Exit(1)


def _target(file: str, force: bool) -> Path:
    stem = Path(file).name.removesuffix(".urdf")
    return arguments.output(f"{stem}.fixed.urdf", _URDF, RepairError, [file] if Path(file).is_file() else [], force)


def _lines(file: str, checkup: Checkup, written: str | None) -> Iterator[str]:
    """A file, its findings, and what was written."""
    from robot_dyn.studies.doctor.finding import Severity

    counts = Counter(each.severity for each in checkup.findings)
    said = [f"{counts[each]} {each.value}{'s' * (counts[each] > 1)}" for each in Severity if counts[each]]
    yield f"{file}: {', '.join(said) or 'nothing found'}{'' if checkup.loads else '; it does not load'}"
    for each in checkup.findings:
        line = f" (line {each.line})" if each.line else ""
        by = "[--fix --units]" if each.supposed else "[--fix]"
        fixed = f" {by}" if each.changes and (each.supposed or written is None) else ""
        yield f"  {each.severity.value}: {each.where}{line}: {each.what}; {each.remedy}{fixed}"
    if written:
        yield f"  written to {written}"
