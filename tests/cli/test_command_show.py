"""Commands that show or export a run: what they write, and what they print where they cannot."""

from __future__ import annotations

import re
from importlib.util import find_spec
from pathlib import Path

import pytest
from rich.filesize import decimal

import robot_dyn as rd
from robot_dyn import RobotDynError
from robot_dyn.cli.commands import demo
from robot_dyn.view import PLOTS
from tests.browser import opened
from tests.command import run, said

PROGRAMS = {"scipy": "SciPy", "mujoco": "MuJoCo", "pydrake": "Drake", "heyoka": "heyoka"}


@pytest.fixture(scope="module")
def file(tmp_path_factory) -> Path:
    swing = rd.simulate(rd.load("planar_2r"), q0=[0.4, -0.7], duration_s=0.2, estimate_error=False)
    return swing.save(tmp_path_factory.mktemp("run") / "run.npz")


@pytest.mark.long
def test_the_demo_ends_with_a_replay_a_plot_and_a_run(tmp_path, browser) -> None:
    """It shows arm and cross-check, then names four files that are there; the page opens with the network off.

    Last comes what 1e-8 rad takes, here and by the programs that are installed; those that are not are named. Where
    the machine is busy, the budget may end before a run reaches that.
    """
    text = said("demo", "--output", tmp_path / "new" / "demo")
    assert "M, mass matrix [" in text and "1 of 1 agree" in text and "finished at t = 1.5 s" in text
    files, _, price = text.partition("Now look:")[2].partition("What 1e-8 rad takes here: 1 s of the same arm")
    named = [Path(line.split()[0]) for line in files.splitlines() if line.strip()]
    assert [path.name for path in named] == ["panda.html", "panda.png", "panda.npz", "panda.toml"]
    assert all(path.stat().st_size > 100 for path in named)
    assert re.search(r"\n  robot_dyn.*: ([\d.]+ [µm]?s|not reached)", price)
    for module, program in PROGRAMS.items():
        installed = find_spec(module) is not None
        assert bool(re.search(rf"\n  {program}.*: (.* times as long|not reached)", price)) is installed
        assert (f"left out: {module}: not installed" in price) is not installed
    assert rd.read(named[2]).outcome.ending == "finished"
    with opened(browser, named[0], offline=True) as view:
        assert view.ask("replay.duration") == 1.5


def test_the_price_needs_no_other_program(monkeypatch) -> None:
    """Without any, and where there is no reference, the demo says so and goes on."""
    swing = rd.Setup(rd.Plant(rd.load("pendulum")), [0.3], duration_s=0.2, engine="compiled")
    monkeypatch.setattr("robot_dyn.accuracy.work_precision_diagram.peers.find_spec", lambda name: None)
    lines = list(demo._price(swing))
    assert re.match(r"  robot_dyn.*: ([\d.]+ [µm]?s|not reached)", lines[2])
    named = [line for line in lines if "left out" in line]
    assert named == [f"  left out: {name}: not installed" for name in PROGRAMS]

    def refuse(*_: object, **__: object) -> None:
        raise RobotDynError("no reference")

    monkeypatch.setattr(rd.accuracy, "work_precision", refuse)
    assert list(demo._price(swing))[2:] == ["left out: no reference"]


def test_a_plot_is_written_beside_the_run_unless_told(file, tmp_path) -> None:
    assert "run.png" in said("plot", file)
    assert file.with_suffix(".png").read_bytes().startswith(b"\x89PNG")
    said("plot", file, "-o", tmp_path / "two.svg", "--only", "joints", "--only", "phase", "--dark")
    assert "<svg" in (tmp_path / "two.svg").read_text(encoding="utf-8")


def test_help_names_every_plot() -> None:
    text = said("plot", "--help")
    assert all(name in text.replace("\n", " ") for name in PLOTS)


@pytest.fixture
def files(tmp_path: Path, monkeypatch) -> Path:
    monkeypatch.chdir(tmp_path)
    setup = rd.Setup(rd.Plant(rd.load("pendulum")), [0.1], duration_s=0.01, method="RK4")
    rd.simulate(setup).save("run.npz")
    rd.rollouts(setup, [[0.1], [0.2]]).save("runs.npz")
    return tmp_path


@pytest.mark.parametrize("name", ["run", "runs"])
def test_export_writes_the_table_of_a_file(files: Path, name: str) -> None:
    done = run("export", f"{name}.npz", "-o", "x.csv")
    assert done.returncode == 0, done.stderr
    assert done.stdout == f"written: x.csv ({decimal((files / 'x.csv').stat().st_size)})\n"
    table = rd.read("run.npz").table() if name == "run" else rd.read("runs.npz").table()
    lines = (files / "x.csv").read_text(encoding="utf-8").splitlines()
    assert lines[0] == ",".join(table) and len(lines) == 1 + len(next(iter(table.values())))


@pytest.mark.parametrize(("suffix", "package"), [("parquet", "pyarrow"), ("nc", "xarray"), ("mcap", "mcap_ros2")])
def test_the_suffix_says_the_format(files: Path, suffix: str, package: str) -> None:
    pytest.importorskip(package)
    done = run("export", "run.npz", "-o", f"x.{suffix}")
    assert done.returncode == 0, done.stderr
    assert (files / f"x.{suffix}").read_bytes() == rd.read("run.npz").save(f"y.{suffix}").read_bytes()
