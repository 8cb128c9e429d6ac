"""A folder that comes from somebody else runs no code: only functions that its reader names are imported."""

from __future__ import annotations

import json
import os
import pickle
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn.foundations import SweepError
from robot_dyn.tools import sweeps as sw
from tests import command
from tests.long import long
from tests.tools.sweeps.swept import VARY, scene

CODE = """
from pathlib import Path
import robot_dyn as rd

Path(__file__).with_name("imported").touch()

def setup():
    Path(__file__).with_name("called").touch()
    return rd.read_scene(Path(__file__).with_name("scene.toml"))

def last(run):
    Path(__file__).with_name("called").touch()
    return run.q[-1, 0]

last.unit = "rad"
"""
SCENE, FIGURE = "code_of_a_test:setup", "code_of_a_test:last"


@pytest.fixture
def received(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder whose scene and one figure are functions of a module that has left no trace yet."""
    scene(tmp_path)
    (tmp_path / "code_of_a_test.py").write_text(CODE)
    monkeypatch.chdir(tmp_path)
    monkeypatch.delitem(sys.modules, "code_of_a_test", raising=False)
    figures = {"mine": FIGURE, "peak": sw.peak("v")}
    plan = sw.Sweep(SCENE, 48, {"q0": VARY["q0"]}, figures, samples=sw.samples("q"))
    sw.run(plan, "out", threads=1, chunk=16)
    forget(monkeypatch)
    return tmp_path / "out"


def forget(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delitem(sys.modules, "code_of_a_test", raising=False)
    for trace in ("imported", "called"):
        Path(trace).unlink(missing_ok=True)


def no_code_ran() -> bool:
    return not Path("imported").exists() and not Path("called").exists() and "code_of_a_test" not in sys.modules


def test_results_are_read_without_importing_what_the_folder_names(received: Path) -> None:
    done = sw.read_sweep(received)
    table = done.table()
    answers = done.mean("mine"), done.quantiles("peak"), done.probability("mine > 0.1"), done.sensitivity("mine")
    shown = str(done), done.status, done.units, done.outcomes, done.verify(), done.worst("mine")
    done.save("rows.csv"), done.save("report.html"), done.to_json()
    again = pickle.loads(pickle.dumps(done.sweep))
    assert again.units == done.units and again.scene == SCENE
    assert no_code_ran()
    named = sw.read_sweep(received, scene=SCENE, figures={"mine": FIGURE})
    assert answers == (named.mean("mine"), named.quantiles("peak"), named.probability("mine > 0.1"), answers[3])
    assert (str(named), named.status, named.units, named.outcomes, named.verify(), named.worst("mine")) == shown
    assert named.specification == done.specification
    for name, x in named.table().items():
        np.testing.assert_array_equal(x, table[name])
    assert done.units["mine"] == done.units["q0[0]"] == "rad"


def test_what_needs_code_that_was_not_named_is_refused(received: Path) -> None:
    done = sw.read_sweep(received)
    (received / "rows" / "000001.parquet").unlink()
    for ask in (lambda: done.run(3), lambda: done.setup_of(3), lambda: sw.run(done.sweep, received)):
        with pytest.raises(SweepError):
            ask()
    with pytest.raises(SweepError):  # the figure is not named
        sw.run(sw.read_sweep(received, scene=SCENE).sweep, received)
    assert not Path("imported").exists() or "code_of_a_test" in sys.modules  # by the scene, which was named


def test_named_code_repeats_and_resumes_runs(received: Path) -> None:
    kept = sw.read_sweep(received).table()
    (received / "rows" / "000001.parquet").unlink()
    named = sw.read_sweep(received, scene=SCENE, figures={"mine": FIGURE})
    done = sw.run(named.sweep, received, threads=1)
    for name, x in done.table().items():
        np.testing.assert_array_equal(x, kept[name])
    assert isinstance(done.run(3), rd.Trajectory)


@pytest.mark.parametrize("names", [{"scene": SCENE}, {"figures": {"mine": FIGURE}}])
def test_a_file_of_another_digest_is_not_imported(received: Path, names) -> None:
    Path("code_of_a_test.py").write_text(CODE + "\n# changed\n")
    with pytest.raises(SweepError):
        sw.read_sweep(received, **names)
    assert no_code_ran()


@pytest.mark.parametrize(
    "names",
    [
        {"scene": "json:loads"},
        {"scene": 3},
        {"scene": "no_such_module_here:setup"},
        {"scene": "robot_dyn.no_such_module_here:setup"},
        {"figures": {"mine": "json:loads"}},
        {"figures": {"mine": "code_of_a_test:other"}},
        {"figures": {"peak": FIGURE}},
        {"figures": {"none": FIGURE}},
        {"figures": {"mine": 3}},
        {"figures": 3},
    ],
)
def test_other_code_than_that_of_the_folder_is_refused(received: Path, names) -> None:
    with pytest.raises(SweepError):
        sw.read_sweep(received, **names)
    assert no_code_ran()


def test_the_command_runs_no_code_that_a_folder_names(received: Path) -> None:
    for action in (("status",), ("verify",), ("report", "-o", "r.html"), ("export", "-o", "r.csv")):
        said = command.run("sweep", action[0], str(received), *action[1:])
        assert said.returncode == 0, said.stderr
    (received / "rows" / "000001.parquet").unlink()
    assert command.run("sweep", "run", str(received)).returncode == 2
    assert no_code_ran()
    named = "--scene", SCENE, "--figure", f"mine={FIGURE}"
    assert command.run("sweep", "run", str(received), *named).returncode == 0
    assert Path("called").exists()


@pytest.mark.parametrize("path", ["tempfile:mkdtemp", "pathlib:Path.home", "code_of_a_test:setup", 3, None, ["a:b"]])
def test_a_specification_made_by_hand_calls_nothing(received: Path, monkeypatch: pytest.MonkeyPatch, path) -> None:
    monkeypatch.setattr("tempfile.mkdtemp", lambda: Path("called").touch())
    data = json.loads((received / "sweep.json").read_text())
    (received / "sweep.json").write_text(json.dumps(data | {"scene": path, "figures": {}}))
    with pytest.raises(SweepError):
        sw.run(sw.read_sweep(received).sweep, received)
    assert no_code_ran()


@pytest.mark.parametrize("names", [", scene='code_of_a_test:setup'", *long([""])])
def test_a_folder_from_which_python_imports_is_refused(received: Path, names: str) -> None:
    """Else a file of the folder would be imported for one of the library's own dependencies."""
    shutil.copy("code_of_a_test.py", received)
    (received / "pyarrow.py").write_text("open('imported', 'w')")
    script = f"from robot_dyn.tools import sweeps as sw\nsw.read_sweep('.'{names})"
    said = subprocess.run([sys.executable, "-c", script], cwd=received, capture_output=True, text=True, check=False)
    assert "SweepError" in said.stderr and not (received / "imported").exists()
    for place in (received, received / "rows"):
        environment = os.environ | {"PYTHONPATH": str(place)}
        script = f"from robot_dyn.tools import sweeps as sw\nsw.read_sweep({str(received)!r}{names})"
        said = subprocess.run([sys.executable, "-c", script], env=environment, capture_output=True, text=True)
        assert "SweepError" in said.stderr, said.stderr
    assert not (received / "imported").exists() and not Path("imported").exists()


def test_a_module_that_lies_in_the_folder_is_not_imported(received: Path) -> None:
    """The folder may have the name of a package."""
    shutil.move("code_of_a_test.py", received / "code_of_a_test.py")
    data = json.loads((received / "sweep.json").read_text())
    (received / "sweep.json").write_text(json.dumps(data | {"scene": "out.code_of_a_test:setup"}))
    with pytest.raises(SweepError):
        sw.read_sweep(received, scene="out.code_of_a_test:setup")
    assert no_code_ran() and not (received / "imported").exists()
