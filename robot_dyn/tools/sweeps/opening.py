"""The folder of a sweep, opened or begun, with the work that fills it."""

from __future__ import annotations

from pathlib import Path
from shutil import disk_usage

from robot_dyn.foundations import SceneError, SweepError, integer, needs
from robot_dyn.tools.sweeps.folder.folder import (
    Folder,
    begin,
    folder_of,
    has_specification,
    read_design,
    read_specification,
)
from robot_dyn.tools.sweeps.imported import NOTHING, Named, check_places
from robot_dyn.tools.sweeps.plan.pilot import pilot
from robot_dyn.tools.sweeps.plan.specification import (
    Specification,
    parsed,
    processor,
    specification,
    sweep_of,
    versions,
)
from robot_dyn.tools.sweeps.plan.sweep import Sweep
from robot_dyn.tools.sweeps.plan.work import Work


def opened(path: Path, names: Named = NOTHING) -> tuple[Folder, Work]:
    """The folder of a sweep, and its work; arguments and errors as of `read`."""
    check_places(path)
    where = str(path / "sweep.json")
    stored = parsed(read_specification(path), where)
    try:
        sweep = sweep_of(stored.data, read_design(path, stored.rows_digest), where, names, path)
    except SceneError as error:
        raise SweepError(f"{where}: {error}; sw.read(folder, scene=…), --scene, where it lies now") from None
    stored.check_same(specification(sweep).with_chunk(stored.chunk), where, versions=False)
    return _folder(path, sweep, stored), Work(sweep)


def begun(sweep: Sweep, path: Path, chunk: int | None = None) -> Folder:
    """The folder of a sweep, begun now unless it was; arguments and errors as of `run`."""
    if chunk is not None:
        chunk = integer("chunk", chunk, least=1, most=2**31, error=SweepError)
    needs("pyarrow", extra="sweeps")
    own, where = specification(sweep), str(path / "sweep.json")
    if not has_specification(path):
        _check_room(sweep, path)
        stated = own.with_chunk(pilot(sweep, chunk))
        begin(path, stated.text, sweep.points.rows, stated.rows_digest)
    stored = parsed(read_specification(path), where)
    stored.check_same(own.with_chunk(chunk or stored.chunk), where)
    folder = _folder(path, sweep, stored)
    if folder.samples is not None and not folder.present().any():
        folder.samples.create(Work(sweep).times(), sweep.setup.plant.dynamics.joint_names)
    return folder


def _check_room(sweep: Sweep, path: Path) -> None:
    """Raise SweepError if the disk has not as much room as the sweep will take."""
    there = next(each for each in (path.absolute(), *path.absolute().parents) if each.exists())
    free = disk_usage(there).free
    if sweep.bytes_expected > free:
        sizes = f"{sweep.bytes_expected / 2**30:.3g} GiB, and {there} has {free / 2**30:.3g} GiB"
        raise SweepError(f"{path}: the sweep will take {sizes}; give another folder, fewer runs or fewer samples")


def _folder(path: Path, sweep: Sweep, stated: Specification) -> Folder:
    names = (*sweep.columns, *sweep.figures)
    return folder_of(path, stated.data, stated.digest, names, {"versions": versions()} | processor())
