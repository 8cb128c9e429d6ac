"""A table as CSV, as Parquet by pyarrow, and as netCDF-3 with 64-bit offsets by xarray and SciPy."""

from __future__ import annotations

import csv
import io
from typing import BinaryIO

import numpy as np

from robot_dyn.foundations.extras import needs
from robot_dyn.foundations.files import table_cell
from robot_dyn.simulation.columns import EXTRA, Column, by_heading
from robot_dyn.simulation.results.run_data import RunData, attributes
from robot_dyn.simulation.results.run_file import RunFileError

_ROWS = 4096  # in a block: Python numbers take ten times the memory of arrays
_LARGEST = 2**31 - 1  # largest integer of netCDF-3, and largest variable that SciPy writes, in bytes


def write_csv(_: object, columns: list[Column], stream: BinaryIO) -> None:
    """Write `run.table()`; numbers as `repr` writes them, which float() returns."""
    table = by_heading(columns)
    values = list(table.values())
    text = io.TextIOWrapper(stream, encoding="utf-8", newline="")
    lines = csv.writer(text)
    lines.writerow(map(table_cell, table))
    for start in range(0, len(values[0]), _ROWS):
        lines.writerows(zip(*(_cells(column[start : start + _ROWS]) for column in values), strict=True))
    text.detach()


def _cells(column: np.ndarray) -> list[object]:
    cells = column.tolist()
    return cells if column.dtype.kind in "fiub" else [table_cell(cell) for cell in cells]


def write_parquet(run: RunData, columns: list[Column], stream: BinaryIO) -> None:
    """Write the columns of `run.table()`, under the same names."""
    arrow = needs("pyarrow", extra=EXTRA)
    table = by_heading(columns)
    arrays = [arrow.array(values) for values in table.values()]
    fields = [
        arrow.field(
            name, array.type, metadata={"quantity": column.quantity, "of": column.component, "unit": column.unit}
        )
        for name, array, column in zip(table, arrays, columns, strict=True)
    ]
    schema = arrow.schema(fields, metadata=attributes(run))
    needs("pyarrow.parquet", extra=EXTRA).write_table(arrow.Table.from_arrays(arrays, schema=schema), stream)


def write_netcdf(run: RunData, _: object, stream: BinaryIO) -> None:
    """Write the Dataset of a run or of a batch."""
    data = run.to_xarray()
    for name, x in data.data_vars.items():
        if x.dtype == np.int64:
            data[name] = x.astype(float if (np.abs(x) > _LARGEST).any() else np.int32)
    for name, x in data.variables.items():
        if x.nbytes > _LARGEST:
            size = f"{name} takes {x.nbytes / 2**30:.3g} GiB, more than the 2 GiB of netCDF-3"
            raise RunFileError(f"{size}; write .parquet, or a slice of the runs")
    data.to_netcdf(stream, engine="scipy", format="NETCDF3_64BIT")
