"""The command export: a run file, or one of rollouts, in the format of its suffix; or one line that says why not."""

from __future__ import annotations

from pathlib import Path

import pytest
from rich.filesize import decimal

import robot_dyn as rd
from tests.command import run


@pytest.fixture
def files(tmp_path: Path, monkeypatch) -> Path:
    monkeypatch.chdir(tmp_path)
    setup = rd.Setup(rd.Plant(rd.load("pendulum")), [0.1], duration_s=0.01, integrator="rk4")
    rd.save_run(rd.simulate(setup), "run.npz")
    rd.save_rollouts(rd.rollouts(setup, [[0.1], [0.2]]), "runs.npz")
    return tmp_path


@pytest.mark.parametrize("name", ["run", "runs"])
def test_export_writes_the_table_of_a_file(files: Path, name: str) -> None:
    done = run("export", f"{name}.npz", "-o", "x.csv")
    assert done.returncode == 0, done.stderr
    assert done.stdout == f"written: x.csv ({decimal((files / 'x.csv').stat().st_size)})\n"
    table = rd.load_run("run.npz").table() if name == "run" else rd.load_rollouts("runs.npz").table()
    lines = (files / "x.csv").read_text(encoding="utf-8").splitlines()
    assert lines[0] == ",".join(table) and len(lines) == 1 + len(next(iter(table.values())))


@pytest.mark.parametrize(("suffix", "package"), [("parquet", "pyarrow"), ("nc", "xarray"), ("mcap", "mcap_ros2")])
def test_the_suffix_says_the_format(files: Path, suffix: str, package: str) -> None:
    pytest.importorskip(package)
    done = run("export", "run.npz", "-o", f"x.{suffix}")
    assert done.returncode == 0, done.stderr
    assert (files / f"x.{suffix}").read_bytes() == rd.export(rd.load_run("run.npz"), f"y.{suffix}").read_bytes()
