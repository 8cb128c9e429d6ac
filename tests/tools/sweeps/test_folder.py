"""The folder: files whole or not there, whatever fails while they are written; damage and strangers are refused."""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from robot_dyn.foundations import MissingExtraError, SweepError
from robot_dyn.simulation.rollouts.lock_step import LANES
from robot_dyn.tools import sweeps as sw
from robot_dyn.tools.sweeps import Work, begun, run_sweep
from robot_dyn.tools.sweeps.folder import begin
from robot_dyn.tools.sweeps.rows import NUMBERS, TEXTS
from robot_dyn.tools.sweeps.specification import specification
from robot_dyn.tools.sweeps.work import Stopped
from tests.tools.sweeps.swept import VARY, digest, names_in, swept


@pytest.fixture
def begun_100(tmp_path: Path) -> Path:
    """The folder of a sweep of 100 runs in chunks of 50, none of which is made."""
    return begun(swept(tmp_path, 100), tmp_path / "out", chunk=50).path


def test_a_full_disk_names_the_chunk_and_keeps_the_rest(tmp_path: Path, monkeypatch) -> None:
    sweep = swept(tmp_path, 100)
    folder = begun(sweep, tmp_path / "out", chunk=20)
    folder.prepare()
    work = Work(sweep)
    folder.write(0, *work.run_rows(0, 20))

    def full(*_: object) -> None:
        raise OSError(28, "No space left on device")

    said = (
        r"^chunk 3 \(runs 60 to 79\): .*000003\.parquet.*\(No space left on device\).*free disk space.* are kept: run"
    )
    with monkeypatch.context() as patch, pytest.raises(SweepError, match=said):
        patch.setattr(os, "fsync", full)
        folder.write(3, *work.run_rows(60, 80))
    assert folder.missing().tolist() == [1, 2, 3, 4]
    done = sw.run(sweep, tmp_path / "out")
    assert done.verify() == digest(sweep)


def test_the_name_of_a_specification_is_on_the_disk_before_the_sweep_begins(tmp_path: Path, monkeypatch) -> None:
    """The folder is synchronized after the name is there, so that a power loss leaves no rows without it."""
    sweep, out, synced = swept(tmp_path, 50), tmp_path / "out", []
    fsync = os.fsync

    def noted(handle: int) -> None:
        if out.is_dir() and os.path.samestat(os.fstat(handle), out.stat()):
            synced.append((out / "sweep.json").exists())
        fsync(handle)

    monkeypatch.setattr(os, "fsync", noted)
    begin(out, specification(sweep, 20), sweep.points.rows)
    assert synced[-1]


def test_a_chunk_is_not_called_damaged_where_pyarrow_is_missing(tmp_path: Path, monkeypatch) -> None:
    done = sw.run(swept(tmp_path, 20), tmp_path / "out", chunk=20)
    monkeypatch.setitem(sys.modules, "pyarrow.parquet", None)
    for read in (lambda: done.folder.footer(0), lambda: done.folder.columns(["error"]), lambda: done.folder.read(0)):
        with pytest.raises(MissingExtraError):
            read()


@pytest.mark.parametrize("tiles", [1.0, 1.7, 2.9])
def test_samples_of_a_chunk_take_no_more_than_they_may(tmp_path: Path, monkeypatch, tiles: float) -> None:
    """The pilot rounds to whole tiles; a chunk of more time and runs is bounded by its samples alone."""
    sweep = swept(tmp_path, 2000, samples="q", vary={"q0": VARY["q0"]})
    monkeypatch.setattr(run_sweep, "_CHUNK_S", 1e6)
    size = 8 * 51 * 2  # times and joints
    monkeypatch.setattr(run_sweep, "_SAMPLE_BYTES", int(tiles * LANES * size))
    monkeypatch.setattr(run_sweep, "_LEAST_CHUNKS", 1)
    assert run_sweep.pilot(sweep) == int(tiles) * LANES


def test_an_interrupted_pilot_is_an_interruption_and_leaves_no_folder(tmp_path: Path, monkeypatch) -> None:
    def interrupted(*_: object) -> None:
        raise Stopped

    monkeypatch.setattr(Work, "rows", interrupted)
    with pytest.raises(KeyboardInterrupt):
        sw.run(swept(tmp_path, 20), tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_what_killed_writers_left_is_removed_and_what_others_write_is_not(tmp_path: Path) -> None:
    """When its file is written again, or by any run a day later."""
    sweep = swept(tmp_path, 40)
    folder = begun(sweep, tmp_path / "out", chunk=20)
    folder.prepare()
    ages = {
        f".000001.parquet.{'0' * 16}.unfinished": 60.0,
        f".000001.parquet.{'1' * 16}.unfinished": 0.0,  # another writer has just begun it
        f".000009.parquet.{'2' * 16}.unfinished": 60.0,
        f".000009.parquet.{'3' * 16}.unfinished": 90_000.0,
    }
    for name, age in ages.items():
        path = folder.file(0).with_name(name)
        path.write_bytes(b"half")
        os.utime(path, (time.time() - age, time.time() - age))
    assert not len(sw.run(sweep, folder.path).missing)
    names = sorted(path.name for path in folder.file(0).parent.iterdir() if path.name in ages)
    assert names == sorted(ages)[1:3]


@pytest.mark.parametrize(
    ("change", "named"),
    [
        ({"seed": 4}, "seed is 3 there, 4 here"),
        ({"runs": 101}, "runs is 100 there, 101 here"),
        ({"vary": {"kp": sw.uniform(low=1.0, high=2.0)}}, "vary.viscous_friction.viscous is"),
        ({"figures": {}}, "figures.error is"),
        ({"design": "latin", "runs": 96}, "runs is 100"),
    ],
)
def test_another_sweep_in_the_folder_is_refused_with_the_first_difference(begun_100: Path, change, named) -> None:
    with pytest.raises(SweepError, match=f"contains another sweep: {named}"):
        begun(swept(begun_100.parent, **{"runs": 100} | change), begun_100)


@pytest.mark.parametrize(
    ("file", "old", "new", "named"),
    [
        ("scene.toml", "kp = 40.0", "kp = 41.0", r"setup.settings.control.kp is 40.* there, 41.* here"),
        ("out/sweep.json", f'"numpy": "{np.__version__}"', '"numpy": "1.0"', r"versions.numpy is 1.0 there"),
        ("out/sweep.json", '"chunk": 50', '"chunk": 25', "chunk is 25 there, 50 here"),
    ],
)
def test_another_scene_version_or_chunk_is_refused_by_name(begun_100: Path, file, old, new, named) -> None:
    path = begun_100.parent / file
    assert old in path.read_text()
    path.write_text(path.read_text().replace(old, new))
    with pytest.raises(SweepError, match=named):
        begun(swept(begun_100.parent, 100), begun_100, chunk=50)
    if file == "scene.toml":
        with pytest.raises(SweepError, match=named):
            sw.read_sweep(begun_100)


def test_a_folder_of_other_files_is_refused(tmp_path: Path) -> None:
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "thesis.tex").write_text("")
    with pytest.raises(SweepError, match=r"contains other files, such as thesis\.tex"):
        sw.run(swept(tmp_path, 50), tmp_path / "full")


def test_a_driver_that_was_second_takes_the_specification_of_the_first(tmp_path: Path, monkeypatch) -> None:
    """Their pilots took different times; the first begins the folder while the second makes its pilot."""
    sweep, out = swept(tmp_path, 50), tmp_path / "out"

    def slow_pilot(*_: object) -> int:
        begin(out, specification(sweep, 20), sweep.points.rows)
        return 16

    monkeypatch.setattr(run_sweep, "pilot", slow_pilot)
    assert begun(sweep, out) == begun(sweep, out, chunk=20)
    assert names_in(out) == ["design", "sweep.json"]


def test_another_sweep_that_begins_at_the_same_time_changes_nothing(tmp_path: Path, monkeypatch) -> None:
    """The first begins while the second makes its pilot, which is refused and leaves the folder as it was."""
    first, second, out = swept(tmp_path, 50, samples="q"), swept(tmp_path, 50, seed=4, samples="v"), tmp_path / "out"
    pilot = run_sweep.pilot

    def pilot_of_the_second(sweep: sw.Sweep, chunk: int | None) -> int:
        monkeypatch.setattr(run_sweep, "pilot", pilot)
        sw.run(first, out, chunk=20, job="1/3")
        return pilot(sweep, chunk)

    monkeypatch.setattr(run_sweep, "pilot", pilot_of_the_second)
    with pytest.raises(SweepError, match="contains another sweep: seed"):
        sw.run(second, out, chunk=20)
    assert len(sw.read_sweep(out).missing) == 2
    done = sw.run(first, out)
    assert done.verify() == digest(first) and set(done.samples().data_vars) == {"q"}


def test_a_folder_is_moved_with_its_scene(tmp_path: Path) -> None:
    (tmp_path / "here").mkdir()
    digest = sw.run(swept(tmp_path / "here", 40), tmp_path / "here" / "out").verify()
    (tmp_path / "here").rename(tmp_path / "there")
    folder, scene = tmp_path / "there" / "out", tmp_path / "there" / "scene.toml"
    with pytest.raises(SweepError, match=r"no such file.*sw.read_sweep\(folder, scene=…\) or --scene"):
        sw.read_sweep(folder)
    assert sw.read_sweep(folder, scene).verify() == digest
    scene.write_text(scene.read_text().replace("0.9", "0.8"))
    with pytest.raises(SweepError, match="contains another sweep: setup"):
        sw.read_sweep(folder, scene)


def test_a_disk_without_room_is_said_before_the_start(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    sweep = swept(tmp_path, 1000, design="random")
    numbers, texts = 5 + 3 + len(NUMBERS), len(TEXTS)  # 5 numbers that vary, 3 figures
    assert sweep.bytes_expected == 1000 * (8 * numbers + 4 * texts)
    monkeypatch.setattr(run_sweep, "disk_usage", lambda _: SimpleNamespace(free=80_000))
    with pytest.raises(SweepError, match=r"the sweep will take .* GiB, and .* has"):
        sw.run(sweep, tmp_path / "out")
    assert not (tmp_path / "out").exists()
