"""What a sweep writes: nothing is replaced unasked, no file of its folder ever, and no cell is a formula."""

from __future__ import annotations

import csv
import hashlib
import os
from pathlib import Path

import numpy as np
import pytest

from robot_dyn.foundations import SweepError, check_folder, table_cell
from robot_dyn.tools import sweeps as sw
from robot_dyn.tools.sweeps import run_sweep
from tests import command
from tests.tools.sweeps.swept import VARY, swept


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> sw.SweepResult:
    folder = tmp_path_factory.mktemp("swept")
    figures = {"=1+1": sw.peak("v")}
    return sw.run(swept(folder, 48, vary={"q0": VARY["q0"]}, figures=figures), folder / "out", threads=1, chunk=16)


def contents(folder: Path) -> dict[Path, str]:
    files = (path for path in folder.rglob("*") if path.is_file())
    return {path: hashlib.sha256(path.read_bytes()).hexdigest() for path in files}


@pytest.mark.parametrize("suffix", ["csv", "parquet", "html"])
def test_a_file_is_replaced_only_by_force_and_only_by_its_kind(done, tmp_path: Path, suffix: str) -> None:
    if suffix == "parquet":
        pytest.importorskip("pyarrow")
    path = tmp_path / f"x.{suffix}"
    done.save(path)
    before = path.read_bytes()
    os.utime(path, (0, 0))
    with pytest.raises(SweepError):
        done.save(path)
    assert (path.read_bytes(), path.stat().st_mtime) == (before, 0)
    done.save(path, force=True)
    assert path.stat().st_mtime > 0
    path.write_text("joint,peak [N m]\nelbow,150\n")
    for force in (False, True):
        with pytest.raises(SweepError):
            done.save(path, force=force)
    assert path.read_text() == "joint,peak [N m]\nelbow,150\n"


def test_no_file_of_the_folder_is_replaced_even_by_force(done, tmp_path: Path) -> None:
    before = contents(done.path)
    chunk = done.folder.file(1)
    link, hard = tmp_path / "link.csv", tmp_path / "hard.csv"
    link.symlink_to(done.path / "new.csv")
    os.link(chunk, hard)
    for path in (chunk.with_suffix(".csv"), done.path / "rows.csv", done.path / "rows" / "000001.parquet", link, hard):
        with pytest.raises(SweepError):
            done.save(path, force=True)
    with pytest.raises(SweepError):
        done.save(done.path / "report.html", force=True)
    assert contents(done.path) == before


def test_the_command_asks_for_force(done, tmp_path: Path) -> None:
    for action, name in (("export", "x.csv"), ("report", "x.html")):
        arguments = "sweep", action, str(done.path), "-o", str(tmp_path / name)
        codes = [command.run(*arguments, *more).returncode for more in ((), (), ("--force",))]
        assert codes == [0, 2, 0]


def test_no_cell_of_a_table_is_a_formula(done, tmp_path: Path) -> None:
    """As OWASP asks: =, +, -, @, tab and line breaks do not begin a text. Numbers stay numbers."""
    with open(done.save(tmp_path / "x.csv"), newline="", encoding="utf-8") as file:
        heading, *rows = csv.reader(file)
    assert not any(cell.startswith(tuple("=+@\t\r\n")) for row in (heading, *rows) for cell in row)
    q = heading.index("q0[0] [rad]")
    np.testing.assert_array_equal([float(row[q]) for row in rows], done.table("q0[0]")["q0[0]"])
    for frame in (done.to_pandas(), done.to_pandas("q0[0]")):
        assert frame.index.name == "run"
        np.testing.assert_array_equal(frame["q0[0]"], done.table("q0[0]")["q0[0]"])
    for text in ("=1+1", "+cmd|' /C calc'!A0", "-2+3", "@SUM(A1)", "\t=1", "\r=1", "\n=1"):
        assert table_cell(text) == f"'{text}"
    for value in ("-1.5", "+2e3", "-inf", "a=b", "", -1.5, None, 3):
        assert table_cell(value) is value


def test_a_folder_that_cannot_be_written_is_refused_before_any_run(tmp_path: Path, monkeypatch) -> None:
    def no_pilot(*_: object) -> int:
        raise AssertionError("a run was made")

    monkeypatch.setattr(run_sweep, "pilot", no_pilot)
    sweep = swept(tmp_path, 48, vary={"q0": VARY["q0"]})
    (tmp_path / "file").write_text("")
    for folder in (tmp_path / "file", tmp_path / "file" / "out", "/proc/none/out", "\0", tmp_path / "a\0b"):
        with pytest.raises(SweepError):
            sw.run(sweep, folder)


@pytest.mark.parametrize("name", ["new", "new/below"])
def test_a_check_of_a_folder_leaves_nothing(tmp_path: Path, name: str) -> None:
    check_folder(tmp_path / name, SweepError)
    assert not list(tmp_path.iterdir())
