"""A damaged folder of a sweep is refused by a RobotDynError: no foreign exception, no hang, no other numbers."""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from robot_dyn import RobotDynError
from robot_dyn.foundations import SweepError
from robot_dyn.tools import sweeps as sw
from tests.campaigns.fuzz.campaign import limited
from tests.long import long
from tests.tools.sweeps.children import outcome_of
from tests.tools.sweeps.swept import digest, swept

for _module in ("xarray",):
    pytest.importorskip(_module)
pa = pytest.importorskip("pyarrow")
parquet = pytest.importorskip("pyarrow.parquet")
Damage = Callable[[Path], object]
ROWS = "rows/000001.parquet"
AGAIN = "; remove this file, then run the sweep again"


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> sw.SweepResult:
    """A sweep of 60 runs in 3 chunks, with samples."""
    folder = tmp_path_factory.mktemp("whole")
    return sw.run(swept(folder, 60, samples="q"), folder / "out", chunk=20)


@pytest.fixture
def copy(whole: sw.SweepResult, tmp_path: Path) -> Path:
    return Path(shutil.copytree(whole.path, tmp_path / "out"))


def gone(name: str) -> Damage:
    """A file, or folder, or the only one that matches a pattern, is missing."""

    def remove(folder: Path) -> Path:
        path = next(folder.glob(name))
        shutil.rmtree(path) if path.is_dir() else path.unlink()
        return path

    return remove


def replaced(name: str, make: Callable[[Path], object]) -> Damage:
    return lambda folder: make(gone(name)(folder))  # pyright: ignore[reportArgumentType]


def text(name: str, written: str | bytes) -> Damage:
    return replaced(name, lambda path: path.write_bytes(written if isinstance(written, bytes) else written.encode()))


def a_folder(name: str) -> Damage:
    return replaced(name, Path.mkdir)


def zeros(name: str) -> Damage:
    return replaced(name, lambda path: path.symlink_to("/dev/zero"))


def bytes_of(name: str, change: Callable[[bytes], bytes]) -> Damage:
    def damage(folder: Path) -> None:
        path = next(folder.glob(name))
        path.write_bytes(change(path.read_bytes()))

    return damage


def key(name: str, value: Any) -> Damage:
    """Another value of a key of sweep.json; None removes it."""

    def change(data: bytes) -> bytes:
        stated = json.loads(data) | {name: value}
        return json.dumps({key: x for key, x in stated.items() if x is not None or key != name}).encode()

    return bytes_of("sweep.json", change)


def cell(name: str, value: Any) -> Damage:
    """Another value of the first row of a column."""

    def write(folder: Path) -> None:
        table = parquet.read_table(folder / ROWS)
        at, values = table.column_names.index(name), [value, *table[name].to_pylist()[1:]]
        field = table.schema.field(name)
        parquet.write_table(table.set_column(at, field, pa.array(values, field.type)), folder / ROWS)

    return write


def footer(**changes: Any) -> Damage:
    """Another footer of a chunk; None removes a key."""

    def write(folder: Path) -> None:
        table = parquet.read_table(folder / ROWS)
        stated = json.loads(table.schema.metadata[b"footer"]) | changes
        stated = {name: x for name, x in stated.items() if x is not None}
        parquet.write_table(table.replace_schema_metadata({b"footer": json.dumps(stated)}), folder / ROWS)

    return write


def flipped(data: bytes, at: int) -> bytes:
    return data[:at] + bytes([data[at] ^ 1]) + data[at + 1 :]


SPECIFICATION: dict[str, Damage] = {
    "empty": text("sweep.json", ""),
    "binary": text("sweep.json", b"\xff\x00" * 100),
    "NaN": text("sweep.json", "NaN"),
    "a list": text("sweep.json", "[]"),
    "brackets": text("sweep.json", "[" * 100_000),
    "a folder": a_folder("sweep.json"),
    "runs of text": key("runs", "60"),
    "too many runs": key("runs", 10**30),
    "without vary": key("vary", None),
    "order of a number": key("order", 3),
    **{f"chunk {value!r}": key("chunk", value) for value in (None, 0, -1, 1.5, "20")},
}
CHUNK: dict[str, Damage] = {
    "empty rows": text(ROWS, ""),
    "half of the rows": bytes_of(ROWS, lambda data: data[: len(data) // 2]),
    "rows of nothing": text(ROWS, b"PAR1" * 100),
    "rows of a folder": a_folder(ROWS),
    "rows a file": text("rows", ""),
    "another chunk": lambda folder: shutil.copy(folder / "rows/000002.parquet", folder / ROWS),
    "another sweep": footer(sweep="0" * 64),
}
BY_HAND: dict[str, Damage] = {
    "no digest of rows": footer(rows=None),
    "digest of a number": footer(rows=3),
    "no times of samples": footer(t=None),
    "times of samples in words": footer(t=["soon"]),
    "no joints": footer(joints=None),
    "no times": footer(one_by_one=None),
    "times of another kind": footer(one_by_one={"runs": "many", "runs_s": 0.0, "all_s": 1.0}),
    "no reason": cell("reason", None),
    "no outcome": cell("outcome", None),
    "another outcome": cell("outcome", "finishedX"),
    "no figure": cell("error", None),
    "another run": cell("run", 7),
}
DESIGN: dict[str, Damage] = {
    "gone": gone("design-*"),
    "short": bytes_of("design-*", lambda data: data[:-8]),
    "changed": bytes_of("design-*", lambda data: flipped(data, len(data) - 3)),
    "empty design": text("design-*", ""),
    "another kind": text("design-*", b"PK\x03\x04"),
}


@pytest.mark.parametrize("name", [*SPECIFICATION, *CHUNK])
def test_a_damaged_specification_or_chunk_is_refused(copy: Path, name: str) -> None:
    (SPECIFICATION | CHUNK)[name](copy)
    with pytest.raises(RobotDynError):
        sw.read_sweep(copy).table()


@pytest.mark.parametrize("name", BY_HAND)
@pytest.mark.parametrize("question", [sw.SweepResult.verify, sw.SweepResult.table])
def test_a_chunk_written_by_hand_is_refused_by_its_file(copy: Path, name: str, question: Callable[..., object]) -> None:
    question(sw.read_sweep(copy))
    BY_HAND[name](copy)
    with pytest.raises(SweepError, match=rf"000001\.parquet: .*{AGAIN}"):
        question(sw.read_sweep(copy))


@pytest.mark.parametrize("name", ["half of the rows", "another chunk", "another sweep"])
def test_a_damaged_chunk_is_made_again_once_it_is_removed(copy: Path, whole: sw.SweepResult, name: str) -> None:
    CHUNK[name](copy)
    done = sw.read_sweep(copy)
    for question in (done.verify, lambda: done.quantiles("end")):
        with pytest.raises(SweepError, match=r"000001\.parquet"):
            question()
    (copy / ROWS).unlink()
    with pytest.raises(SweepError, match="1 of 3 chunks are missing, the first is 1"):
        done.table()
    assert sw.run(whole.sweep, copy).verify() == digest(whole.sweep)


@pytest.mark.parametrize("found", [5, 8])
def test_a_folder_of_another_format_is_refused_with_both(copy: Path, found: int) -> None:
    key("format", found)(copy)
    with pytest.raises(SweepError, match=f"has format {found}, but this version reads 7; read it with the version"):
        sw.read_sweep(copy)


RESUMED = ("empty", "binary", "a list", "a folder", "runs of text", "chunk 0")


@pytest.mark.parametrize("name", RESUMED)
def test_a_damaged_folder_is_not_resumed(copy: Path, whole: sw.SweepResult, name: str) -> None:
    SPECIFICATION[name](copy)
    with pytest.raises(RobotDynError):
        sw.run(whole.sweep, copy)


@pytest.mark.parametrize("name", DESIGN)
def test_a_damaged_design_is_refused_until_the_sweep_is_run_again(copy: Path, whole: sw.SweepResult, name: str) -> None:
    (design,) = copy.glob("design-*.npy")
    rows = design.read_bytes()
    DESIGN[name](copy)
    with pytest.raises(SweepError, match="run the sweep into this folder again"):
        sw.read_sweep(copy)
    sw.run(whole.sweep, copy)
    assert design.read_bytes() == rows and sw.read_sweep(copy).verify() == whole.verify()


@pytest.mark.skipif(os.name != "posix", reason="pipes have paths on POSIX alone")
def test_a_pipe_is_refused_at_once(copy: Path) -> None:
    for name, question in ((ROWS, lambda done: done.samples()), ("sweep.json", None)):
        replaced(name, os.mkfifo)(copy)
        with pytest.raises(RobotDynError), limited(6):
            done = sw.read_sweep(copy)
            question and question(done)


@pytest.mark.skipif(os.name != "posix", reason="devices have paths on POSIX alone")
@pytest.mark.parametrize(
    ("name", "question"),
    [
        (ROWS, "samples().q.values"),
        *long([("design-*", "table()"), (ROWS, "table()")]),
    ],
)
def test_zeros_without_end_are_refused_at_once(copy: Path, whole: sw.SweepResult, name: str, question: str) -> None:
    """The same question is put to the whole folder first, so that the time is that of reading alone."""
    zeros(name)(copy)
    first = f"sw.read_sweep({str(whole.path)!r}).{question}"
    assert outcome_of(f"sw.read_sweep(folder).{question}", copy, wait_s=6.0, first=first) == "refused"


def test_one_flipped_bit_of_a_chunk_is_refused_or_changes_nothing(copy: Path) -> None:
    """Of 60 places in a file of rows; each answer is that of the whole file, or one error."""
    file, table = copy / ROWS, sw.read_sweep(copy).table()
    data, others = file.read_bytes(), list[int]()
    for at in np.linspace(4, len(data) - 5, 60).astype(int).tolist():
        file.write_bytes(flipped(data, at))
        try:
            read = sw.read_sweep(copy).table()
        except RobotDynError:
            continue
        others += [at for name, x in table.items() if not np.array_equal(x, read[name], equal_nan=x.dtype.kind == "f")]
    assert not others


# --- memory, versions


def test_a_sweep_of_a_table_is_read_in_little_memory(tmp_path: Path) -> None:
    vary = {"kp": sw.uniform(low=10.0, high=20.0)}
    rows = np.random.default_rng(0).random((32, 1))
    sw.run(swept(tmp_path, 32, vary=vary, design=rows), tmp_path / "out", chunk=16)
    assert outcome_of("sw.read_sweep(folder / 'out').table()", tmp_path, gib=8) == "done"


OTHER_VERSIONS = """
import importlib.metadata as metadata
read = metadata.PathDistribution.read_text
def older(self, name):
    text = read(self, name)
    of_ours = text and any(f'Name: {each}\\n' in text for each in ('numpy', 'scipy'))
    return text.replace('\\nVersion: ', '\\nVersion: 0.', 1) if of_ours and name == 'METADATA' else text
metadata.PathDistribution.read_text = older
sw.run(swept(folder, 40), folder / 'old', chunk=20)
"""


def test_results_are_read_after_numpy_and_scipy_were_upgraded(tmp_path: Path) -> None:
    """A process in which both have other versions makes the folder; here it is read."""
    assert outcome_of(OTHER_VERSIONS, tmp_path, gib=64) == "done"
    assert '"numpy": "0.' in (tmp_path / "old" / "sweep.json").read_text()
    there, here = sw.read_sweep(tmp_path / "old"), sw.run(swept(tmp_path, 40), tmp_path / "new", chunk=20)
    for name, x in here.table("end", "kd", "q0[0]").items():
        np.testing.assert_array_equal(there.table(name)[name], x)
