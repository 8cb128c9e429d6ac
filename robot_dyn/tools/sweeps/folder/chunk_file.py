"""A chunk as the bytes of a file: rows and a footer, as .npz or Parquet; and back, within bounds, nothing unpickled."""

from __future__ import annotations

import io
import json
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, final

import numpy as np

from robot_dyn.foundations import StoreError, SweepError, needs, read_arrays, reading
from robot_dyn.tools.sweeps.folder.rows import TEXTS, Rows

_FOOTER = "footer"
_REMEDY = "run the sweep again, after removing this file"


@final
@dataclass(frozen=True)
class Columns:
    """Names of the columns of the files of a sweep.

    Attributes:
        varied: What varies.
        figures: Of each run.
    """

    varied: tuple[str, ...]
    figures: tuple[str, ...]


@final
@dataclass(frozen=True)
class Format:
    """A format of chunks.

    Attributes:
        suffix: Of its files.
        packed: From rows and footer to bytes.
        table: Columns of a file by name, of some names or all, and its footer.
    """

    suffix: str
    packed: Callable[[Rows, dict[str, Any]], bytes]
    table: Callable[[Path, Sequence[str] | None], tuple[dict[str, np.ndarray], dict[str, Any]]]

    def rows(self, path: Path, names: Columns) -> tuple[Rows, dict[str, Any]]:
        """The rows and the footer of a file.

        Raises:
            SweepError: If it is damaged, or of other columns.
        """
        table, footer = self.table(path, None)
        missing = {"outcome", "ended", *TEXTS, *names.varied, *names.figures} ^ table.keys()
        if missing:
            raise SweepError(f"{path}: its columns are not those of the sweep: {min(missing)!r}; {_REMEDY}")
        varied, figures = ({name: table[name] for name in each} for each in (names.varied, names.figures))
        outcome, ended, reason, remarks = (table[name] for name in ("outcome", "ended", *TEXTS))
        return Rows(int(footer["start"]), outcome, ended, reason, remarks, varied, figures), footer

    def footer(self, path: Path) -> dict[str, Any]:
        """The footer of a file; SweepError if it is damaged."""
        return self.table(path, ())[1]


@contextmanager
def _of(path: Path) -> Iterator[None]:
    """What is wrong with a file, as a SweepError with its path."""
    try:
        yield
    except SweepError:
        raise
    except Exception as error:  # pyarrow, json and zipfile promise no kinds
        what = str(error) if isinstance(error, StoreError) else f"{type(error).__name__}"
        raise SweepError(f"{path}: is not a complete chunk ({what}); {_REMEDY}") from None


def _dictionary(column: np.ndarray) -> tuple[list[str], np.ndarray]:
    """The texts that occur, and the place of each row's among them."""
    texts = sorted(set(column.tolist()))
    places = {text: k for k, text in enumerate(texts)}
    return texts, np.array([places[text] for text in column.tolist()], np.int32)


def _npz(rows: Rows, footer: dict[str, Any]) -> bytes:
    of = {name: _dictionary(getattr(rows, name)) for name in TEXTS}
    columns: dict[str, Any] = {f"column {name}": x for name, x in rows.columns.items()}
    columns |= {f"column {name}": codes for name, (_, codes) in of.items()}
    stream = io.BytesIO()
    about = json.dumps(footer | {"texts": {name: texts for name, (texts, _) in of.items()}})
    columns[_FOOTER] = np.array(about)
    np.savez(stream, **columns)
    return stream.getvalue()


def _read_npz(path: Path, names: Sequence[str] | None) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
    with reading(path, SweepError, _REMEDY) as stream, _of(path):
        found = read_arrays(stream, None if names is None else [_FOOTER, *(f"column {name}" for name in names)])
        footer = json.loads(str(found.pop(_FOOTER)))
        table = {name.removeprefix("column "): x for name, x in found.items()}
        for name in table.keys() & set(TEXTS):
            table[name] = np.array(footer["texts"][name], object)[table[name]]
        _check_lengths(table, footer)
        return table, footer


def _parquet(rows: Rows, footer: dict[str, Any]) -> bytes:
    pa, parquet = needs("pyarrow", extra="sweeps"), needs("pyarrow.parquet", extra="data")
    columns = {"run": np.arange(rows.start, rows.start + len(rows))} | rows.columns
    for name in TEXTS:
        texts, codes = _dictionary(getattr(rows, name))
        columns[name] = pa.DictionaryArray.from_arrays(codes, pa.array(texts, pa.string()))
    table = pa.table(columns)
    table = table.replace_schema_metadata({_FOOTER: json.dumps(footer)})
    stream = io.BytesIO()
    parquet.write_table(
        table, stream, compression="zstd", compression_level=1, use_dictionary=list(TEXTS), write_page_checksum=True
    )
    return stream.getvalue()


def _read_parquet(path: Path, names: Sequence[str] | None) -> tuple[dict[str, np.ndarray], dict[str, Any]]:
    parquet = needs("pyarrow.parquet", extra="sweeps")
    with reading(path, SweepError, _REMEDY) as stream, _of(path):
        file = parquet.ParquetFile(stream, page_checksum_verification=True)
        footer = json.loads(file.schema_arrow.metadata[_FOOTER.encode()])
        wanted = [name for name in file.schema_arrow.names if name != "run"] if names is None else list(names)
        read = file.read(columns=wanted, use_threads=False)
        table = {name: read[name].combine_chunks().to_numpy(zero_copy_only=False).copy() for name in wanted}
        for name in table.keys() & set(TEXTS):
            table[name] = table[name].astype(object)
        _check_lengths(table, footer)
        return table, footer


def _check_lengths(table: dict[str, np.ndarray], footer: dict[str, Any]) -> None:
    count = footer["stop"] - footer["start"]
    for name, x in table.items():
        if x.shape != (count,):
            raise SweepError(f"column {name!r} has shape {x.shape}, not {count} rows")


FORMAT = {"npz": Format(".npz", _npz, _read_npz), "parquet": Format(".parquet", _parquet, _read_parquet)}
