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
from tests.tools.sweeps.swept import swept

for _module in ("zarr", "xarray"):
    pytest.importorskip(_module)
pa = pytest.importorskip("pyarrow")
parquet = pytest.importorskip("pyarrow.parquet")
Damage = Callable[[Path], object]


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> sw.SweepResult:
    """A sweep of 60 runs in 3 chunks, with samples."""
    folder = tmp_path_factory.mktemp("whole")
    return sw.run(swept(folder, 60, samples="q"), folder / "out", chunk=20)


@pytest.fixture
def copy(whole: sw.SweepResult, tmp_path: Path) -> Path:
    return Path(shutil.copytree(whole.path, tmp_path / "out"))


def text(name: str, written: str | bytes) -> Damage:
    return lambda folder: (folder / name).write_bytes(written if isinstance(written, bytes) else written.encode())


def key(name: str, value: Any) -> Damage:
    """Another value of a key of sweep.json; None removes it."""

    def change(folder: Path) -> None:
        data = json.loads((folder / "sweep.json").read_text()) | {name: value}
        kept = {key: each for key, each in data.items() if each is not None or key != name}
        (folder / "sweep.json").write_text(json.dumps(kept))

    return change


def removed(folder: Path, name: str) -> Path:
    path = folder / name
    shutil.rmtree(path) if path.is_dir() else path.unlink(missing_ok=True)
    return path


def pipe(name: str) -> Damage:
    return lambda folder: os.mkfifo(removed(folder, name))


def zeros(name: str) -> Damage:
    return lambda folder: removed(folder, name).symlink_to("/dev/zero")


def a_folder(name: str) -> Damage:
    return lambda folder: removed(folder, name).mkdir()


def gone(name: str) -> Damage:
    return lambda folder: removed(folder, name)


def design_of_zeros(folder: Path) -> None:
    (design,) = folder.glob("design-*.npy")
    zeros(design.name)(folder)


def rows_of(change: Callable[[Any], Any]) -> Damage:
    """Another table of a chunk, with the footer that `change` leaves it."""

    def write(folder: Path) -> None:
        parquet.write_table(change(parquet.read_table(folder / ROWS)), folder / ROWS)

    return write


def cell(name: str, value: Any) -> Damage:
    """Another value of the first row of a column."""

    def change(table: Any) -> Any:
        at, values = table.column_names.index(name), [value, *table[name].to_pylist()[1:]]
        return table.set_column(at, table.schema.field(name), pa.array(values, table.schema.field(name).type))

    return rows_of(change)


def footer(**changes: Any) -> Damage:
    """Another footer of a chunk; None removes a key."""

    def change(table: Any) -> Any:
        found = json.loads(table.schema.metadata[b"footer"]) | changes
        found = {name: each for name, each in found.items() if each is not None}
        return table.replace_schema_metadata({b"footer": json.dumps(found)})

    return rows_of(change)


ROWS, SHARD = "rows/000001.parquet", "samples/q/c/1/0/0"


@pytest.mark.parametrize(
    "damage",
    [
        pytest.param(text("sweep.json", ""), id="empty"),
        pytest.param(text("sweep.json", b"\xff\x00" * 100), id="binary"),
        pytest.param(text("sweep.json", "NaN"), id="NaN"),
        pytest.param(text("sweep.json", "[]"), id="a list"),
        pytest.param(text("sweep.json", "[" * 100_000), id="brackets"),
        pytest.param(a_folder("sweep.json"), id="a folder"),
        pytest.param(key("runs", "60"), id="runs of text"),
        pytest.param(key("runs", 10**30), id="too many runs"),
        pytest.param(key("vary", None), id="without vary"),
        pytest.param(key("order", 3), id="order of a number"),
        pytest.param(key("chunk", None), id="without chunk"),
        pytest.param(key("chunk", 0), id="chunk 0"),
        pytest.param(key("chunk", -1), id="chunk -1"),
        pytest.param(key("chunk", 1.5), id="chunk 1.5"),
        pytest.param(key("chunk", "20"), id="chunk of text"),
        pytest.param(text(ROWS, ""), id="empty rows"),
        pytest.param(text(ROWS, b"PAR1" * 100), id="rows of nothing"),
        pytest.param(a_folder(ROWS), id="rows of a folder"),
        pytest.param(lambda folder: text("rows", "")(removed(folder, "rows").parent), id="rows a file"),
    ],
)
def test_a_damaged_specification_or_chunk_is_refused(copy: Path, damage: Damage) -> None:
    damage(copy)
    with pytest.raises(RobotDynError):
        sw.read(copy).table()


@pytest.mark.parametrize(
    "damage",
    [
        pytest.param(footer(rows=None), id="no digest of rows"),
        pytest.param(footer(rows=3), id="digest of a number"),
        pytest.param(footer(samples=None), id="no digests of samples"),
        pytest.param(footer(samples=[]), id="a list of digests"),
        pytest.param(cell("reason", None), id="no reason"),
        pytest.param(cell("outcome", None), id="no outcome"),
        pytest.param(cell("outcome", "finishedX"), id="another outcome"),
        pytest.param(cell("error", None), id="no figure"),
        pytest.param(cell("run", 7), id="another run"),
    ],
)
@pytest.mark.parametrize("question", [sw.SweepResult.verify, sw.SweepResult.table])
def test_a_chunk_written_by_hand_is_refused_by_its_file(
    copy: Path, damage: Damage, question: Callable[[sw.SweepResult], object]
) -> None:
    question(sw.read(copy))
    damage(copy)
    with pytest.raises(SweepError, match=r"000001\.parquet: .*; run the sweep again"):
        question(sw.read(copy))


@pytest.mark.parametrize("found", [4, 6])
def test_a_folder_of_another_format_is_refused_with_both(copy: Path, found: int) -> None:
    key("format", found)(copy)
    with pytest.raises(SweepError, match=f"has format {found}, this version reads 5; read it with the version"):
        sw.read(copy)


@pytest.mark.parametrize(
    "damage",
    [
        pytest.param(text("sweep.json", ""), id="empty"),
        pytest.param(text("sweep.json", b"\xff\x00" * 100), id="binary"),
        pytest.param(text("sweep.json", "[]"), id="a list"),
        pytest.param(a_folder("sweep.json"), id="a folder"),
        pytest.param(key("runs", "60"), id="runs of text"),
        pytest.param(key("chunk", 0), id="chunk 0"),
        pytest.param(text("samples/t/zarr.json", "{"), id="times of samples"),
        pytest.param(gone("samples"), id="no samples"),
    ],
)
def test_a_damaged_folder_is_not_resumed(copy: Path, whole: sw.SweepResult, damage: Damage) -> None:
    damage(copy)
    with pytest.raises(RobotDynError):
        sw.run(whole.sweep, copy)


@pytest.mark.parametrize(
    "damage",
    [
        pytest.param(gone("samples"), id="no samples"),
        pytest.param(gone(SHARD), id="no shard"),
        pytest.param(gone("samples/q/zarr.json"), id="no array"),
        pytest.param(text("samples/zarr.json", "{"), id="group"),
        pytest.param(text("samples/t/zarr.json", "{"), id="times"),
        pytest.param(text("samples/q/zarr.json", "{}"), id="array"),
        pytest.param(text(SHARD, ""), id="empty shard"),
    ],
)
def test_damaged_samples_are_refused(copy: Path, damage: Damage) -> None:
    damage(copy)
    with pytest.raises(RobotDynError):
        sw.read(copy).samples().q.values  # noqa: B018


@pytest.mark.skipif(os.name != "posix", reason="pipes have paths on POSIX alone")
def test_a_pipe_is_refused_at_once(copy: Path) -> None:
    pipe("samples/q/zarr.json")(copy)
    with pytest.raises(RobotDynError), limited(6):
        sw.read(copy).samples()
    pipe("sweep.json")(copy)
    with pytest.raises(RobotDynError), limited(6):
        sw.read(copy)


@pytest.mark.skipif(os.name != "posix", reason="devices have paths on POSIX alone")
@pytest.mark.parametrize(
    ("damage", "question"),
    [
        pytest.param(zeros(SHARD), "samples().q.values", id="shard, zeros"),
        *long(
            [
                pytest.param(design_of_zeros, "table()", id="design, zeros"),
                pytest.param(zeros(ROWS), "table()", id="rows, zeros"),
                pytest.param(zeros("samples/t/zarr.json"), "samples().q.values", id="times, zeros"),
            ]
        ),
    ],
)
def test_what_is_not_a_regular_file_is_refused_at_once(
    copy: Path, whole: sw.SweepResult, damage: Damage, question: str
) -> None:
    """The same question is put to the whole folder first, so that the time is that of reading alone."""
    damage(copy)
    first = f"sw.read({str(whole.path)!r}).{question}"
    assert outcome_of(f"sw.read(folder).{question}", copy, wait_s=6.0, first=first) == "refused"


# --- the design


def short(path: Path) -> None:
    path.write_bytes(path.read_bytes()[:-8])


def changed(path: Path) -> None:
    data = path.read_bytes()
    path.write_bytes(flipped(data, len(data) - 3))


@pytest.mark.parametrize(
    "damage",
    [Path.unlink, short, changed, lambda path: path.write_bytes(b""), lambda path: path.write_bytes(b"PK\x03\x04")],
    ids=["gone", "short", "changed", "empty", "another kind"],
)
def test_a_damaged_design_is_refused_until_the_sweep_is_run_again(
    copy: Path, whole: sw.SweepResult, damage: Callable[[Path], object]
) -> None:
    (design,) = copy.glob("design-*.npy")
    rows = design.read_bytes()
    damage(design)
    with pytest.raises(SweepError, match="run the sweep into this folder again"):
        sw.read(copy)
    sw.run(whole.sweep, copy)
    assert design.read_bytes() == rows and sw.read(copy).verify() == whole.verify()


# --- bits


def flipped(data: bytes, at: int) -> bytes:
    return data[:at] + bytes([data[at] ^ 1]) + data[at + 1 :]


def test_one_flipped_bit_of_a_chunk_is_refused_or_changes_nothing(copy: Path) -> None:
    """Of 60 places in a file of rows; each answer is that of the whole file, or one error."""
    file, table = copy / ROWS, sw.read(copy).table()
    data, others = file.read_bytes(), list[int]()
    for at in np.linspace(4, len(data) - 5, 60).astype(int).tolist():
        file.write_bytes(flipped(data, at))
        try:
            read = sw.read(copy).table()
        except RobotDynError:
            continue
        others += [at for name, x in table.items() if not np.array_equal(x, read[name], equal_nan=x.dtype.kind == "f")]
    assert not others


def test_one_flipped_bit_of_samples_is_refused(copy: Path) -> None:
    shard = copy / SHARD
    shard.write_bytes(flipped(shard.read_bytes(), 1000))
    with pytest.raises(RobotDynError):
        sw.read(copy).samples().q.values  # noqa: B018


# --- memory, versions


def test_a_sweep_of_a_table_is_read_in_little_memory(tmp_path: Path) -> None:
    vary = {"kp": sw.uniform(low=10.0, high=20.0)}
    rows = np.random.default_rng(0).random((32, 1))
    sw.run(swept(tmp_path, 32, vary=vary, design=rows), tmp_path / "out", chunk=16)
    assert outcome_of("sw.read(folder / 'out').table()", tmp_path, gib=8) == "done"


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
    there, here = sw.read(tmp_path / "old"), sw.run(swept(tmp_path, 40), tmp_path / "new", chunk=20)
    for name, x in here.table("end", "kd", "q0[0]").items():
        np.testing.assert_array_equal(there.table(name)[name], x)
