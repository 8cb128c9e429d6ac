"""Save a run, or the runs of a batch, in the format that the suffix of the path selects."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar, final

from robot_dyn.foundations.extras import needs
from robot_dyn.foundations.files import FileKind, file_path, save, target
from robot_dyn.simulation.columns import EXTRA
from robot_dyn.simulation.results.formats import mcap_log, tables
from robot_dyn.simulation.results.run_data import RunData, TrajectoryData
from robot_dyn.simulation.results.run_file import RUN, RunFileError

Run = TypeVar("Run", bound=RunData)


@final
@dataclass(frozen=True)
class Format:
    """A format for other programs.

    Attributes:
        kind: Kind of the files.
        write: Function of a run, its columns and a stream.
        packages: Packages that `write` needs.
    """

    kind: FileKind
    write: Callable[..., object]
    packages: tuple[str, ...] = ()


TABLE = FileKind("a table of a run", ".csv", b"t [s]")
_SHARED = (
    Format(FileKind("a Parquet file", ".parquet", b"PAR1"), tables.write_parquet, ("pyarrow",)),
    Format(FileKind("a netCDF file", ".nc", b"CDF\x02"), tables.write_netcdf, ("xarray",)),
)
_LOG = Format(FileKind("an MCAP log", ".mcap", b"\x89MCAP0\r\n"), mcap_log.write, ("mcap", "mcap_ros2.writer"))
_FOR_ONE_RUN = (Format(TABLE, tables.write_csv), *_SHARED, _LOG)
_FOR_BATCHES = (Format(FileKind("a table of runs", ".csv", b"run,"), tables.write_csv), *_SHARED)


def kinds(run_type: type[RunData]) -> tuple[FileKind, ...]:
    """Return the kinds of file in which runs of a type can be saved; the first is that of run files."""
    return RUN, *(form.kind for form in _formats(run_type).values())


def save_data(run: Run, path: str | Path, write_run_file: Callable[[Run, Path], Path]) -> Path:
    """Save a run or a batch, in the format of the suffix of `path`; `write_run_file` writes a run file."""
    path = file_path(path, RunFileError)
    if not isinstance(run, TrajectoryData) and path.suffix.lower() == _LOG.kind.suffix:
        raise RunFileError(f"{path}: a log contains one run, and this is a batch; save one of them: runs[0].save(path)")
    path = target(path, kinds(type(run)), RunFileError)
    form = _formats(type(run)).get(path.suffix.lower())
    if form is None:
        return write_run_file(run, path)
    for package in form.packages:
        needs(package, extra=EXTRA)
    columns = list(run._columns())
    return save(path, lambda stream: form.write(run, columns, stream), RunFileError)


def _formats(run_type: type[RunData]) -> Mapping[str, Format]:
    """Return formats for other programs by suffix."""
    formats = _FOR_ONE_RUN if issubclass(run_type, TrajectoryData) else _FOR_BATCHES
    return {form.kind.suffix: form for form in formats}
