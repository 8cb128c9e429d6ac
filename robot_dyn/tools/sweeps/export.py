"""The table of all runs as one file, a chunk at a time."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from robot_dyn.foundations import FileKind, SweepError, file_path, needs, save, table_cell
from robot_dyn.tools.sweeps.folder import Folder
from robot_dyn.tools.sweeps.rows import FIXED, TEXTS, schema
from robot_dyn.tools.sweeps.specification import specification
from robot_dyn.tools.sweeps.sweep import Sweep, heading, parameter_of

KINDS = (
    FileKind("a table of runs", ".csv", b'"run",'),
    FileKind("a table of runs", ".parquet", b"PAR1"),
    FileKind("a page", ".html", b"<!doctype html>"),
)


def write_table(sweep: Sweep, folder: Folder, path: Path) -> Path:
    """Write the rows of a complete folder to a .csv or .parquet file; raise a SweepError if that fails."""
    is_csv = path.suffix.lower() == ".csv"
    return save(path, lambda stream: _write(sweep, folder, stream, is_csv), SweepError)


def inputs_of(folder: Folder, path: str | Path) -> list[Path]:
    """Return files that must not be replaced: the files of the folder, even under other names."""
    chunks = filter(Path.exists, map(folder.file, range(folder.count))) if file_path(path, SweepError).exists() else ()
    return [folder.path, *chunks]


def _write(sweep: Sweep, folder: Folder, stream: BinaryIO, is_csv: bool) -> None:
    """Write the rows with their units in the headings; texts of a .csv cannot be formulas."""
    pa, of_files, about = (
        needs("pyarrow", extra="sweeps"),
        schema((*sweep.columns, *sweep.figures)),
        _about_columns(sweep),
    )
    cell = table_cell if is_csv else str
    fields = [
        field.with_name(cell(heading(sweep, field.name))).with_metadata(about.get(field.name)) for field in of_files
    ]
    stated_sweep = specification(sweep, folder.chunk).model_dump() | {"scene": Path(sweep.scene).name}  # not its folder
    metadata = {"title": "runs of robot_dyn", "sweep": json.dumps(stated_sweep, ensure_ascii=False)}
    stated = pa.schema(fields, metadata=metadata)
    with _writer(stream, stated, is_csv) as writer:
        for chunk in range(folder.count):
            rows = folder.read(chunk) | {"run": np.arange(*folder.run_range(chunk))}
            rows |= {name: np.array(list(map(cell, rows[name])), object) for name in TEXTS}
            writer.write_table(pa.table([rows[name] for name in of_files.names], stated))


def _writer(stream: BinaryIO, stated: Any, is_csv: bool) -> Any:
    if is_csv:
        csv = needs("pyarrow.csv", extra="sweeps")
        return csv.CSVWriter(stream, stated, write_options=csv.WriteOptions(quoting_style="needed"))
    return needs("pyarrow.parquet", extra="sweeps").ParquetWriter(stream, stated)


def _about_columns(sweep: Sweep) -> dict[str, dict[str, str]]:
    """Return units and meanings of columns, distributions of parameters, and definitions of figures."""
    varied = {name: name if name in sweep.vary else parameter_of(name) for name in sweep.columns}
    about = {column: {"distribution": json.dumps(sweep.vary[name].to_dict())} for column, name in varied.items()}
    about |= {name: {"computed by": json.dumps(figure.to_dict())} for name, figure in sweep.figures.items()}
    about |= {column.name: {"meaning": column.meaning} for column in FIXED}
    return {name: {"unit": sweep.units.get(name, "")} | more for name, more in about.items()}
