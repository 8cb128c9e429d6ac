"""A table as Parquet, by pyarrow: quantity, joint and unit of each column are its metadata."""

from __future__ import annotations

from collections.abc import Iterable
from typing import BinaryIO

from robot_dyn.foundations.extras import needs
from robot_dyn.simulation.columns import EXTRA, Column, by_heading
from robot_dyn.simulation.results.run_data import RunData, attributes


def write(run: RunData, columns: Iterable[Column], stream: BinaryIO) -> None:
    """Write the columns of `run.table()`, under the same names."""
    arrow = needs("pyarrow", extra=EXTRA)
    columns = list(columns)
    table = by_heading(columns)
    arrays = [arrow.array(values) for values in table.values()]
    fields = [
        arrow.field(name, array.type, metadata={"quantity": each.quantity, "of": each.of, "unit": each.unit})
        for name, array, each in zip(table, arrays, columns, strict=True)
    ]
    schema = arrow.schema(fields, metadata=attributes(run))
    needs("pyarrow.parquet", extra=EXTRA).write_table(arrow.Table.from_arrays(arrays, schema=schema), stream)
