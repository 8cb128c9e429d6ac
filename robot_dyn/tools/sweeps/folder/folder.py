"""The folder of a sweep: its specification, and a file for each chunk that is done. What has no file is left to do.

sweep.json                   the specification
design-0123456789abcdef.npy  rows of the design, with the start of their SHA-256
rows/000123.parquet          a chunk; of more than 20 000 chunks rows/0004/080123.parquet
samples/                     samples of runs, where they are kept
"""

from __future__ import annotations

import io
import json
import os
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from hashlib import sha256
from pathlib import Path
from types import MappingProxyType
from typing import Any, final

import numpy as np

from robot_dyn.foundations import SweepError, needs, read, reading, shown, why
from robot_dyn.tools.sweeps.folder.files import make_folder, remove_abandoned, write
from robot_dyn.tools.sweeps.folder.rows import OUTCOMES, TEXTS, Rows, digest_of, schema, type_of
from robot_dyn.tools.sweeps.folder.samples import SampleStore

MOST_FILES = 20_000  # of a folder
_MOST_TEXT, _MOST_TABLE = 2**26, 2**34
_SPECIFICATION = "sweep.json"
_SUFFIX, _FOOTER = ".parquet", b"footer"
_REMEDY = "run the sweep again, after removing this file"
_AGAIN = "run the sweep into this folder again, which writes the file"
_NONE = "run one into it with robot-dyn sweep SCENE.toml … -o FOLDER"


@final
@dataclass(frozen=True)
class Folder:
    """Chunks of the runs 0, …, N − 1 as files.

    Attributes:
        path: Of the folder.
        runs: N.
        chunk: Runs of a chunk; the last one may have fewer.
        digest: Of the specification.
        names: Of varied parameters and of figures.
        about: What footers state beside the digest: versions and processor.
        samples: Where samples of runs are; None where none are kept.
    """

    path: Path
    runs: int
    chunk: int
    digest: str
    names: tuple[str, ...]
    about: dict[str, Any] = field(default_factory=dict)
    samples: SampleStore | None = None

    @property
    def count(self) -> int:
        """Number of chunks."""
        return -(-self.runs // self.chunk)

    def of(self, chunk: int) -> tuple[int, int]:
        """The first run of a chunk, and that after its last."""
        return chunk * self.chunk, min((chunk + 1) * self.chunk, self.runs)

    def file(self, chunk: int) -> Path:
        """The file of a chunk."""
        return self._subfolder(chunk) / f"{chunk:06d}{_SUFFIX}"

    @property
    def subfolders(self) -> list[Path]:
        """The folders of files."""
        return [self._subfolder(chunk) for chunk in range(0, self.count, MOST_FILES)]

    def _subfolder(self, chunk: int) -> Path:
        rows = self.path / "rows"
        return rows if self.count <= MOST_FILES else rows / f"{chunk // MOST_FILES:04d}"

    def present(self) -> np.ndarray:
        """Whether each chunk has a file, (count,)."""
        found = np.zeros(self.count, bool)
        for folder in self.subfolders:
            try:
                names = os.listdir(folder)
            except FileNotFoundError:
                continue
            except OSError as error:
                raise SweepError(
                    f"{folder}: is not a folder of rows ({why(error)}); remove it, and run again"
                ) from None
            for name in names:
                stem = name.removesuffix(_SUFFIX)
                if stem.isdigit() and stem != name and int(stem) < self.count:
                    found[int(stem)] = True
        return found

    def missing(self) -> np.ndarray:
        """Numbers of the chunks without a file."""
        return np.flatnonzero(~self.present())

    def prepare(self) -> None:
        """Make the folders, and remove what dead writers left."""
        for folder in self.subfolders:
            make_folder(folder)
        remove_abandoned((self.path, *self.subfolders))

    def write(self, chunk: int, rows: Rows, samples: Mapping[str, np.ndarray] = MappingProxyType({})) -> None:
        """Write a chunk, its samples first; SweepError if it cannot be written, with what is there unchanged."""
        start, stop = self.of(chunk)
        footer = {"sweep": self.digest, "chunk": chunk, "start": start, "stop": stop, "rows": digest_of([rows])}
        try:
            kept = {} if self.samples is None else self.samples.write(chunk, samples)
            write(self.file(chunk), self._packed(rows, footer | {"samples": kept} | self.about))
        except OSError as error:
            raise SweepError(
                f"chunk {chunk} (runs {start} to {stop - 1}) cannot be written to {self.file(chunk)} ({why(error)});"
                " the chunks that are there are kept: make room, and run the sweep again"
            ) from None

    def _packed(self, rows: Rows, footer: dict[str, Any]) -> bytes:
        """Return rows and a footer as the bytes of a Parquet file with checksums of its pages."""
        pa, parquet = needs("pyarrow", extra="sweeps"), needs("pyarrow.parquet", extra="sweeps")
        stated = schema(self.names).with_metadata({_FOOTER: json.dumps(footer)})
        table = pa.table(rows | {"run": np.arange(footer["start"], footer["stop"])}, stated)
        stream = io.BytesIO()
        parquet.write_table(table, stream, compression="zstd", use_dictionary=list(TEXTS), write_page_checksum=True)
        return stream.getvalue()

    def read(self, chunk: int) -> Rows:
        """The rows of a chunk.

        Raises:
            SweepError: If its file is missing, damaged, or of another sweep.
        """
        rows, footer = self._read(chunk, [name for name in schema(self.names).names if name != "run"])
        if digest_of([rows]) != footer["rows"]:
            raise SweepError(f"{self.file(chunk)}: was changed after it was written; {_REMEDY}")
        return rows

    def footer(self, chunk: int) -> dict[str, Any]:
        """The footer of a chunk; errors as of `read`."""
        return self._read(chunk, [])[1]

    def check_samples(self) -> None:
        """Raise SweepError where samples that were written are missing or have changed."""
        if self.samples is not None:
            for chunk in range(self.count):
                self.samples.check(chunk, self.footer(chunk)["samples"])

    def columns(self, names: Iterable[str]) -> Rows:
        """Columns of all rows, (N,); errors as of `read`."""
        names = list(dict.fromkeys(names))
        columns = {name: np.empty(self.runs, type_of(name)) for name in names}
        for chunk in range(self.count):
            start, stop = self.of(chunk)
            for name, x in self._read(chunk, names)[0].items():
                columns[name][start:stop] = x
        return columns

    def _read(self, chunk: int, names: list[str]) -> tuple[Rows, dict[str, Any]]:
        """Return columns of a chunk, and its footer."""
        parquet, path, expected = needs("pyarrow.parquet", extra="sweeps"), self.file(chunk), self.of(chunk)
        with reading(path, SweepError, _REMEDY) as stream, _errors_of(path):
            file = parquet.ParquetFile(stream, page_checksum_verification=True)
            footer = json.loads(file.schema_arrow.metadata[_FOOTER])
            if footer["sweep"] != self.digest:
                raise SweepError(f"{path}: is of another sweep; {_REMEDY}")
            if (footer["chunk"], footer["start"], footer["stop"]) != (chunk, *expected):
                raise SweepError(f"{path}: is of other runs than its name says; {_REMEDY}")
            if not isinstance(footer["rows"], str) or not isinstance(footer["samples"], dict):
                raise SweepError(f"{path}: its footer lacks digests of rows and samples; {_REMEDY}")
            if not file.schema_arrow.equals(schema(self.names)):
                raise SweepError(f"{path}: its columns are not those of the sweep; {_REMEDY}")
            if not names:
                return {}, footer
            table = file.read(columns=["run", *names], use_threads=False)
            if len(table) != expected[1] - expected[0]:
                raise SweepError(f"{path}: has {len(table)} rows, not {expected[1] - expected[0]}; {_REMEDY}")
            columns = {name: table[name].to_numpy() for name in table.column_names}
            if any(table[name].null_count for name in columns):
                raise SweepError(f"{path}: has cells without a value; {_REMEDY}")
            if (columns.pop("run") != np.arange(*expected)).any():
                raise SweepError(
                    f"{path}: its rows are not those of runs {expected[0]} to {expected[1] - 1}; {_REMEDY}"
                )
            if strange := set(columns.get("outcome", ())) - set(OUTCOMES):
                known = ", ".join(OUTCOMES)
                raise SweepError(f"{path}: has the outcome {shown(min(strange))}, not one of {known}; {_REMEDY}")
            return {name: x.astype(type_of(name)) for name, x in columns.items()}, footer


@contextmanager
def _errors_of(path: Path) -> Iterator[None]:
    """Raise errors of a file as a SweepError with its path."""
    try:
        yield
    except SweepError:
        raise
    except Exception as error:  # pyarrow promises no kinds
        raise SweepError(f"{path}: is not a complete chunk ({type(error).__name__}); {_REMEDY}") from None


def has_specification(path: Path) -> bool:
    """Whether a folder holds a sweep."""
    return (path / _SPECIFICATION).is_file()


def read_specification(path: Path) -> str:
    """The text of the specification of a folder; SweepError if it holds no sweep, or it cannot be read."""
    return read(path / _SPECIFICATION, _MOST_TEXT, SweepError, _NONE).decode("utf-8", "replace")


def read_design(path: Path, digest: str) -> np.ndarray:
    """The rows of the design of a folder.

    Raises:
        SweepError: If their file is missing or damaged, or has another SHA-256 than the specification states.
    """
    file = _design(path, digest)
    data = read(file, _MOST_TABLE, SweepError, _AGAIN)
    try:
        rows = np.lib.format.read_array(io.BytesIO(data), allow_pickle=False)
    except Exception as error:  # of a damaged header NumPy promises no kinds
        raise SweepError(f"{file}: is not a table of numbers ({why(error)}); {_AGAIN}") from None
    if sha256(np.ascontiguousarray(rows).tobytes()).hexdigest() != digest:
        raise SweepError(f"{file}: was changed after it was written; {_AGAIN}")
    return rows


def mend_design(path: Path, rows: np.ndarray, digest: str) -> None:
    """Write the rows of a design where their file is missing or damaged; SweepError if it cannot be written."""
    try:
        read_design(path, digest)
    except SweepError:
        with _writing(path):
            _write_design(path, rows, digest)


def begin(path: Path, text: str, rows: np.ndarray, digest: str) -> None:
    """Write the specification of a new sweep, unless another process was first.

    The file of a design is named after its rows, so that two sweeps that begin at one time do not mix.

    Raises:
        SweepError: If the folder holds other files, or cannot be written.
    """
    make_folder(path)
    names = {each.name for each in path.iterdir() if not each.name.endswith(".unfinished")}
    strange = sorted(name for name in names if not name.startswith("design-"))
    if strange and _SPECIFICATION not in names:
        raise SweepError(f"{path}: holds other files, such as {strange[0]}; give a new folder")
    with _writing(path):
        _write_design(path, rows, digest)
        with suppress(FileExistsError):
            write(path / _SPECIFICATION, text.encode(), exclusive=True)


@contextmanager
def _writing(path: Path) -> Iterator[None]:
    """Raise errors of writing into a folder as a SweepError with its path."""
    try:
        yield
    except OSError as error:
        raise SweepError(f"{path}: cannot be written ({why(error)}); give another folder") from None


def _write_design(path: Path, rows: np.ndarray, digest: str) -> None:
    stream = io.BytesIO()
    np.save(stream, rows, allow_pickle=False)
    write(_design(path, digest), stream.getvalue())


def _design(path: Path, digest: str) -> Path:
    return path / f"design-{digest[:16]}.npy"


def read_all(folder: Folder) -> Iterator[Rows]:
    """The rows of all chunks, one after the other."""
    return map(folder.read, range(folder.count))
