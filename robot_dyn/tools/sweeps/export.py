"""The table of all runs as one file, a chunk at a time."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from functools import partial
from pathlib import Path
from typing import BinaryIO

import numpy as np

from robot_dyn.foundations import FileKind, SweepError, file_path, needs, save, table_cell, target
from robot_dyn.tools.sweeps.folder.folder import Folder, read_all
from robot_dyn.tools.sweeps.folder.rows import TEXTS
from robot_dyn.tools.sweeps.plan.specification import specification
from robot_dyn.tools.sweeps.plan.sweep import OUTCOMES, Sweep, heading

_CSV, _PARQUET = FileKind("a table of runs", ".csv", b"run,"), FileKind("a table", ".parquet", b"PAR1")


def export(sweep: Sweep, folder: Folder, path: str | Path, force: bool) -> Path:
    """Write the rows of a complete folder to a .csv or .parquet file; SweepError if it cannot be written."""
    path = target(path, (_CSV, _PARQUET), SweepError, inputs_of(folder, path), force)
    write = partial(_parquet, sweep) if path.suffix.lower() == ".parquet" else _csv
    return save(path, lambda stream: write(_tables(sweep, folder), stream), SweepError)


def inputs_of(folder: Folder, path: str | Path) -> list[Path]:
    """Return files that an export or a report may not replace: those of the folder, even under another name."""
    chunks = filter(Path.exists, map(folder.file, range(folder.count))) if file_path(path, SweepError).exists() else ()
    return [folder.path, *chunks]


def _tables(sweep: Sweep, folder: Folder) -> Iterator[Mapping[str, np.ndarray]]:
    """Of each chunk, with units in the headings."""
    for rows in read_all(folder):
        run = {"run": np.arange(rows.start, rows.start + len(rows))}
        ends = {"outcome": np.array(OUTCOMES)[rows.outcome], "ended": rows.ended}
        ends |= {name: getattr(rows, name) for name in TEXTS}
        table = run | rows.varied | rows.figures | ends
        yield {heading(sweep, name): column for name, column in table.items()}


def _csv(tables: Iterator[Mapping[str, np.ndarray]], stream: BinaryIO) -> None:
    heading = False
    for table in tables:
        if not heading:
            stream.write((",".join(map(_cell, table)) + "\n").encode())
            heading = True
        columns = [[_cell(x) for x in column.tolist()] for column in table.values()]
        stream.write("".join(",".join(row) + "\n" for row in zip(*columns, strict=True)).encode())


def _cell(value: object) -> str:
    text = str(table_cell(value)) if isinstance(value, str) else repr(value)
    return '"' + text.replace('"', '""') + '"' if any(mark in text for mark in ',"\r\n') else text


def _parquet(sweep: Sweep, tables: Iterator[Mapping[str, np.ndarray]], stream: BinaryIO) -> None:
    pa, parquet = needs("pyarrow", extra="sweeps"), needs("pyarrow.parquet", extra="data")
    writer = None
    for each in tables:
        strings = {name: pa.array(each[name].astype(str).tolist(), pa.string()) for name in ("outcome", *TEXTS)}
        table = pa.table(dict(each) | strings)
        if writer is None:
            about = _about_columns(sweep)
            fields = [field.with_metadata(about.get(field.name, {})) for field in table.schema]
            schema = pa.schema(fields, metadata={"title": "runs of robot_dyn", "sweep": _about(sweep)})
            writer = parquet.ParquetWriter(stream, schema)
        writer.write_table(table.cast(writer.schema))
    if writer is not None:
        writer.close()


def _about(sweep: Sweep) -> str:
    """The specification as JSON, with the name of the scene in place of its path."""
    return json.dumps(specification(sweep).data | {"scene": Path(sweep.source).name}, ensure_ascii=False)


def _about_columns(sweep: Sweep) -> dict[str, dict[str, str]]:
    """By heading: unit, distribution of what varies, and how a figure is computed."""
    varied = {name: name if name in sweep.vary else name.rpartition("[")[0] for name in sweep.columns}
    parts = {column: {"distribution": sweep.vary[name]} for column, name in varied.items()}
    parts |= {name: {"computed by": figure} for name, figure in sweep.figures.items()}
    of = {name: {key: json.dumps(part.to_dict()) for key, part in each.items()} for name, each in parts.items()}
    return {heading(sweep, name): {"unit": sweep.units.get(name, "")} | of.get(name, {}) for name in (*of, "ended")}
