"""The folder of a sweep: its specification, and a file for each finished chunk of runs.

sweep.json                   the specification
design-0123456789abcdef.npy  rows of the design, with the start of their SHA-256
rows/000123.parquet          a chunk
uncut.json                   of an uncut sweep: some of its runs compared with runs whose steps end at thresholds

Files are written completely or not at all. Two writers of one file do no harm: both write the same rows.
"""

from __future__ import annotations

import io
import json
import os
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass, field
from hashlib import sha256
from pathlib import Path
from time import time
from typing import Any, final

import numpy as np
from pydantic import TypeAdapter

from robot_dyn.foundations import SceneError, SweepError, needs, read, reading, save, shown, sync_folder, why
from robot_dyn.simulation.rollouts.comparison import Comparison
from robot_dyn.tools.sweeps.imported import NONE_NAMED, Named, check_places
from robot_dyn.tools.sweeps.kept_samples import dataset, longest
from robot_dyn.tools.sweeps.rows import OUTCOMES, SAMPLE_COLUMNS, TEXTS, Rows, digest_of, schema, type_of
from robot_dyn.tools.sweeps.specification import FILE, Specification, processor, specification, stated_in, versions
from robot_dyn.tools.sweeps.sweep import Sweep
from robot_dyn.tools.sweeps.work import IN_LOCK_STEP, Facts, OneByOne

OLD_S = 86_400.0  # age in [s] after which an unfinished file is removed
UNCUT = "uncut.json"
_MOST_TABLE, _MOST_COMPARISON = 2**34, 2**20
_FOOTER, _UNFINISHED = b"footer", ".unfinished"
_REMEDY = "remove this file, then run the sweep again"
_AGAIN = "run the sweep into this folder again, which writes the file"


@final
@dataclass(frozen=True)
class Folder:
    """Chunks of the runs 0, …, N − 1 as files.

    Attributes:
        path: Path of the folder.
        runs: Number of runs, N.
        chunk: Number of runs in a chunk; the last chunk may have fewer.
        digest: SHA-256 of the specification.
        names: Names of varying parameters, of figures and of columns of samples.
        metadata: Versions and processor, stored in footers.
    """

    path: Path
    runs: int
    chunk: int
    digest: str
    names: tuple[str, ...]
    metadata: dict[str, Any] = field(default_factory=dict)

    @property
    def count(self) -> int:
        """Number of chunks."""
        return -(-self.runs // self.chunk)

    def run_range(self, chunk: int) -> tuple[int, int]:
        """Return the first run of a chunk, and the run after its last."""
        return chunk * self.chunk, min((chunk + 1) * self.chunk, self.runs)

    def file(self, chunk: int) -> Path:
        """Return the file of a chunk."""
        return self._rows / _file_name(chunk)

    @property
    def _rows(self) -> Path:
        return self.path / "rows"

    def present(self) -> np.ndarray:
        """Return True for chunks with a file, (count,)."""
        try:
            names = set(os.listdir(self._rows))
        except FileNotFoundError:
            names = set()
        except OSError as error:
            raise SweepError(
                f"{self._rows}: is not a folder of rows ({why(error)}); remove it, and run again"
            ) from None
        return np.array([_file_name(chunk) in names for chunk in range(self.count)])

    def missing(self) -> np.ndarray:
        """Return the indices of chunks without a file."""
        return np.flatnonzero(~self.present())

    def prepare(self) -> None:
        """Create the folder of rows, and remove files that killed writers left more than a day ago."""
        make_folder(self._rows)
        for path in (*self.path.glob(f".*{_UNFINISHED}"), *self._rows.glob(f".*{_UNFINISHED}")):
            with suppress(OSError):  # removed meanwhile, or owned by another user
                if time() - path.lstat().st_mtime > OLD_S:
                    path.unlink()

    def write(self, chunk: int, rows: Rows, facts: Facts) -> None:
        """Write a chunk; raise a SweepError, with existing files unchanged, if that fails."""
        pa, parquet = needs("pyarrow", extra="sweeps"), needs("pyarrow.parquet", extra="sweeps")
        start, stop = self.run_range(chunk)
        footer = {
            "sweep": self.digest,
            "chunk": chunk,
            "start": start,
            "stop": stop,
            "rows": digest_of([rows]),
        } | asdict(facts)
        try:
            stated = schema(self.names).with_metadata({_FOOTER: json.dumps(footer | self.metadata)})
            table = pa.table(rows | {"run": np.arange(start, stop)}, stated)
            save(
                self.file(chunk),
                lambda stream: parquet.write_table(
                    table, stream, compression="zstd", use_dictionary=list(TEXTS), write_page_checksum=True
                ),
                SweepError,
            )
        except SweepError as error:
            raise SweepError(
                f"chunk {chunk} (runs {start} to {stop - 1}): {error}; finished chunks are kept: run the sweep again"
            ) from None

    def write_comparison(self, comparison: Comparison) -> None:
        """Write the comparison of an uncut sweep; raise a SweepError if that fails."""
        text = json.dumps({"sweep": self.digest, "comparison": asdict(comparison)}, indent=1, ensure_ascii=False)
        save(self.path / UNCUT, lambda stream: stream.write(text.encode()), SweepError)

    def comparison(self) -> Comparison | None:
        """Return the comparison of an uncut sweep, None if there is none; raise a SweepError if it is damaged."""
        file, again = self.path / UNCUT, "remove this file, and run the sweep again, which compares the runs again"
        if not file.exists():
            return None
        try:
            stored = json.loads(read(file, _MOST_COMPARISON, SweepError, again))
            if stored["sweep"] != self.digest:
                raise SweepError(f"{file}: belongs to another sweep; {again}")
            return TypeAdapter(Comparison).validate_python(stored["comparison"])
        except (ValueError, TypeError, KeyError) as error:
            raise SweepError(f"{file}: is not the comparison of an uncut sweep ({shown(error)}); {again}") from None

    def one_by_one(self) -> OneByOne:
        """Return the number of runs of the present chunks that were simulated one by one, and their time."""
        chunks = np.flatnonzero(self.present()).tolist()
        return sum((OneByOne(**self.footer(chunk)["one_by_one"]) for chunk in chunks), IN_LOCK_STEP)

    def read(self, chunk: int) -> Rows:
        """Return the rows of a chunk.

        Raises:
            SweepError: If the file is missing, damaged, or belongs to another sweep.
        """
        rows, footer = self._read(chunk, [name for name in schema(self.names).names if name != "run"])
        if digest_of([rows]) != footer["rows"]:
            raise SweepError(f"{self.file(chunk)}: was changed after it was written; {_REMEDY}")
        return rows

    def digest_of_rows(self) -> str:
        """Return the SHA-256 of all rows; for errors, see `read`."""
        return digest_of(map(self.read, range(self.count)))

    def footer(self, chunk: int) -> dict[str, Any]:
        """Return the footer of a chunk; for errors, see `read`."""
        return self._read(chunk, [])[1]

    def samples(self, columns: Mapping[str, str], joint_types: Sequence[str | None]) -> Any:
        """Return the samples in columns, by quantity, as a `xarray.Dataset` of kept runs; for errors, see `read`."""
        parts: list[Rows] = []
        t, joints = np.empty(0), ()
        for chunk in range(self.count):
            rows, footer = self._read(chunk, list(columns.values()))
            parts.append(rows)
            t, joints = longest(t, np.array(footer["t"])), footer["joints"]
        lists = {name: np.concatenate([part[column] for part in parts]) for name, column in columns.items()}
        return dataset(lists, t, joints, joint_types)

    def columns(self, names: Iterable[str]) -> Rows:
        """Return columns of all rows, (N,); for errors, see `read`."""
        names = list(dict.fromkeys(names))
        columns = {name: np.empty(self.runs, type_of(name)) for name in names}
        for chunk in range(self.count):
            start, stop = self.run_range(chunk)
            for name, x in self._read(chunk, names)[0].items():
                columns[name][start:stop] = x
        return columns

    def _read(self, chunk: int, names: list[str]) -> tuple[Rows, dict[str, Any]]:
        """Return columns of a chunk, and its footer."""
        path, parquet = self.file(chunk), needs("pyarrow.parquet", extra="sweeps")
        with reading(path, SweepError, _REMEDY) as stream:
            try:
                return self._parsed(parquet.ParquetFile(stream, page_checksum_verification=True), chunk, names)
            except _DamagedError as error:
                raise SweepError(f"{path}: {error}; {_REMEDY}") from None
            except Exception as error:  # pyarrow does not document the types of its errors
                raise SweepError(f"{path}: is not a complete chunk ({type(error).__name__}); {_REMEDY}") from None

    def _parsed(self, file: Any, chunk: int, names: list[str]) -> tuple[Rows, dict[str, Any]]:
        start, stop = self.run_range(chunk)
        footer = json.loads(file.schema_arrow.metadata[_FOOTER])
        if footer["sweep"] != self.digest:
            raise _DamagedError("belongs to another sweep")
        if (footer["chunk"], footer["start"], footer["stop"]) != (chunk, start, stop):
            raise _DamagedError("contains other runs than its name states")
        if not isinstance(footer["rows"], str):
            raise _DamagedError("its footer lacks the digest of its rows")
        TypeAdapter(Facts).validate_python({name: footer[name] for name in ("one_by_one", "t", "joints")})
        if not file.schema_arrow.equals(schema(self.names)):
            raise _DamagedError("its columns are not those of the sweep")
        if not names:
            return {}, footer
        table = file.read(columns=["run", *names], use_threads=False)
        columns = {name: table[name].to_numpy() for name in table.column_names}
        if any(table[name].null_count for name in columns.keys() - SAMPLE_COLUMNS.values()):
            raise _DamagedError("has cells without a value")
        if columns.pop("run").tolist() != list(range(start, stop)):
            raise _DamagedError(f"its rows are not those of runs {start} to {stop - 1}")
        if strange := set(columns.get("outcome", ())) - set(OUTCOMES):
            raise _DamagedError(f"has the outcome {shown(min(strange))}, not one of {', '.join(OUTCOMES)}")
        return {name: x.astype(type_of(name)) for name, x in columns.items()}, footer


def _file_name(chunk: int) -> str:
    return f"{chunk:06d}.parquet"


class _DamagedError(Exception):
    """A fault of the file of a chunk."""


def make_folder(path: Path) -> None:
    """Create a folder and its parents; raise a SweepError if that fails."""
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise SweepError(f"{path}: the folder cannot be created ({why(error)}); give another path") from None


def read_design(path: Path, digest: str) -> np.ndarray:
    """Return the rows of the design of a folder.

    Raises:
        SweepError: If the file is missing or damaged, or its SHA-256 differs from the specification.
    """
    file = _design(path, digest)
    data = read(file, _MOST_TABLE, SweepError, _AGAIN)
    try:
        rows = np.lib.format.read_array(io.BytesIO(data), allow_pickle=False)
    except Exception as error:  # NumPy does not document the types of errors for a damaged header
        raise SweepError(f"{file}: is not a table of numbers ({why(error)}); {_AGAIN}") from None
    if sha256(np.ascontiguousarray(rows).tobytes()).hexdigest() != digest:
        raise SweepError(f"{file}: was changed after it was written; {_AGAIN}")
    return rows


def begin(path: Path, stated: Specification, rows: np.ndarray) -> None:
    """Write the specification of a new sweep, unless another process was first.

    The file of a design is named after its rows, so that two sweeps that begin at the same time do not mix.

    Raises:
        SweepError: If the folder contains other files, or cannot be written.
    """
    make_folder(path)
    names = {entry.name for entry in path.iterdir() if not entry.name.endswith(_UNFINISHED)}
    strange = sorted(name for name in names if not name.startswith("design-"))
    if strange and FILE not in names:
        raise SweepError(f"{path}: contains other files, such as {strange[0]}; give a new folder")
    write_design(path, rows, stated.rows_sha256)
    own = path / f".{FILE}.{os.urandom(8).hex()}{_UNFINISHED}"
    save(own, lambda stream: stream.write(stated.text.encode()), SweepError)
    try:
        with suppress(FileExistsError):
            os.link(own, path / FILE)  # unlike os.replace, fails if the file exists
        sync_folder(path)
    except OSError as error:
        raise SweepError(f"{path}: cannot be written ({why(error)}); give another folder") from None
    finally:
        own.unlink(missing_ok=True)


def write_design(path: Path, rows: np.ndarray, digest: str) -> None:
    """Write the rows of a design; raise a SweepError if that fails."""
    save(_design(path, digest), lambda stream: np.save(stream, rows, allow_pickle=False), SweepError)


def _design(path: Path, digest: str) -> Path:
    return path / f"design-{digest[:16]}.npy"


def opened(path: Path, names: Named = NONE_NAMED, *, runs: bool = False) -> tuple[Folder, Sweep]:
    """Return the folder of a sweep, and the sweep; for arguments and errors, see `read_sweep`.

    To make runs, the versions of packages must be those of the folder, too.
    """
    check_places(path)
    stored = stated_in(path)
    try:
        sweep = stored.sweep(read_design(path, stored.rows_sha256), path, names)
    except SceneError as error:
        remedy = "pass the present path of the scene, sw.read_sweep(folder, scene=…) or --scene"
        raise SweepError(f"{path / FILE}: {error}; {remedy}") from None
    stored.check_same(specification(sweep, stored.chunk), path, versions=runs)
    return folder_of(path, sweep, stored), sweep


def folder_of(path: Path, sweep: Sweep, stated: Specification) -> Folder:
    """Return the folder of a sweep with the specification in it."""
    names = (*sweep.columns, *sweep.figures, *(sweep.samples.columns.values() if sweep.samples else ()))
    return Folder(path, stated.runs, stated.chunk, stated.digest, names, {"versions": versions()} | processor())
