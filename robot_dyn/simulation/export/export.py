"""A run, or the runs of a batch, as a file that other programs read; its suffix says in which format."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import final

from robot_dyn.foundations.errors import shown
from robot_dyn.foundations.extras import needs
from robot_dyn.foundations.files import FileKind, file_path, save, target
from robot_dyn.simulation.columns import EXTRA
from robot_dyn.simulation.export import mcap_log, tables
from robot_dyn.simulation.results.run_data import RunData
from robot_dyn.simulation.results.run_file import RunFileError
from robot_dyn.simulation.rollouts.rollouts_data import RolloutsData


@final
@dataclass(frozen=True)
class Format:
    """A format: its kind of file, its writer, and the packages that the writer needs."""

    kind: FileKind
    write: Callable[..., object]  # of a run, its columns and a stream
    packages: tuple[str, ...] = ()


TABLE = FileKind("a table of a run", ".csv", b"t [s]")
_OF_BOTH = (
    Format(FileKind("a Parquet file", ".parquet", b"PAR1"), tables.write_parquet, ("pyarrow",)),
    Format(FileKind("a netCDF file", ".nc", b"CDF\x02"), tables.write_netcdf, ("xarray",)),
)
_LOG = Format(FileKind("an MCAP log", ".mcap", b"\x89MCAP0\r\n"), mcap_log.write, ("mcap", "mcap_ros2.writer"))
_OF_RUN = (Format(TABLE, tables.write_csv), *_OF_BOTH, _LOG)
_OF_RUNS = (Format(FileKind("a table of runs", ".csv", b"run,"), tables.write_csv), *_OF_BOTH)


def kinds(run: RunData) -> tuple[FileKind, ...]:
    """Return the kinds of file to which a run, or a batch, can be exported."""
    return tuple(form.kind for form in _formats(run).values())


def export(run: RunData, path: str | Path) -> Path:
    """Write a run, or a batch, completely or not at all, to a file for other programs; its suffix sets the format.

        .csv      run.table(): a row for each sample, or for each run of a batch; float() returns the numbers
        .parquet  the same columns, with quantity, joint and unit of each as metadata
        .nc       run.to_xarray() as netCDF-3, with units as attributes
        .mcap     one run as messages of ROS 2: q, v, u and its causes; desired q; power, energy

    All but .csv need robot-dyn[data]. Robot, settings, versions and the summary are metadata of the whole. Numbers are
    written to the bit, times of an MCAP log to 1 ns. Another file of the same format under that name is replaced; a
    file of another kind is not. The suffix .csv is added if the path has none.

    Raises:
        RunFileError: If it cannot be written.
        MissingExtraError: If the format needs a package that is not installed.
    """
    if not isinstance(run, RunData):
        raise RunFileError(f"export takes a Trajectory of rd.simulate, or Rollouts, got {shown(run)}")
    path = file_path(path, RunFileError)
    if isinstance(run, RolloutsData) and path.suffix.lower() == _LOG.kind.suffix:
        raise RunFileError(
            f"{path}: a log contains one run, and these are {len(run)}; pass one of them, for example runs[0]"
        )
    path = target(path, kinds(run), RunFileError)
    form = _formats(run)[path.suffix.lower()]
    for package in form.packages:
        needs(package, extra=EXTRA)
    columns = list(run._columns())
    return save(path, lambda stream: form.write(run, columns, stream), RunFileError)


def _formats(run: RunData) -> Mapping[str, Format]:
    """Return the formats by suffix."""
    return {form.kind.suffix: form for form in (_OF_RUNS if isinstance(run, RolloutsData) else _OF_RUN)}
