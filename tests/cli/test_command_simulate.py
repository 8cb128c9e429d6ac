"""The commands simulate, explain and scene, as a user meets them."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

import robot_dyn as rd
from robot_dyn.scene import starter, starter_names
from tests.command import document, interrupted_at_work, run
from tests.long import long
from tests.promised import check_document

COMMAND = [sys.executable, "-c", "from robot_dyn.cli import main; main()"]


@pytest.fixture
def scene(tmp_path) -> Path:
    path = tmp_path / "scene.toml"
    path.write_text(starter("cart_pole").replace("4.0", "0.2", 1), encoding="utf-8")
    return path


def test_simulate_prints_a_summary_and_keeps_the_run(scene, tmp_path) -> None:
    done = run("simulate", scene, "-o", tmp_path / "run.npz", "--csv", tmp_path / "run.csv")
    assert done.returncode == 0, done.stderr
    for said in (
        "finished at t = 0.2 s",
        "effects: gravity 9.807 m/s², viscous_friction, spring, external_wrench\n",
        "energy ledger",
        "error of q [m or rad]",
    ):
        assert said in done.stdout
    assert rd.read(tmp_path / "run.npz").summary in done.stdout
    assert (tmp_path / "run.csv").is_file()


def test_force_replaces(scene, tmp_path) -> None:
    for name in ("run.npz", "run.csv"):
        (tmp_path / name).touch()
    done = run("simulate", scene, "-o", tmp_path / "run.npz", "--csv", tmp_path / "run.csv", "--force")
    assert done.returncode == 0, done.stderr
    assert rd.read(tmp_path / "run.npz").t[-1] == 0.2 and (tmp_path / "run.csv").stat().st_size > 1000


@pytest.mark.skipif(os.name != "posix", reason="/dev/full, pipes and descriptors of POSIX")
@pytest.mark.parametrize(("redirection", "code"), [("> /dev/full", 2), *long([("| head -0", 0), (">&-", 2)])])
def test_a_run_is_written_whatever_becomes_of_the_output(scene, tmp_path, redirection: str, code: int) -> None:
    """The files come first; what cannot be printed is said in one line."""
    command = (
        f'set -o pipefail; "{COMMAND[0]}" -c "{COMMAND[2]}" simulate {scene} -o {tmp_path / "run.npz"} {redirection}'
    )
    done = subprocess.run(["bash", "-c", command], capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == code
    assert rd.read(tmp_path / "run.npz").t[-1] == 0.2
    assert done.stderr.count("\n") == 1 and ("standard output cannot be written" in done.stderr) == (code == 2)


def test_document_has_the_keys_that_are_promised(scene) -> None:
    check_document("simulate", document("simulate", scene))


def test_scene_prints_starters() -> None:
    listed = [line.split(maxsplit=1) for line in run("scene").stdout.splitlines()[1:]]
    assert [name for name, _ in listed] == list(starter_names())
    assert all(starter(name).startswith(f"# {what}\n") for name, what in listed)
    assert run("scene", "pendulum").stdout == starter("pendulum")


def test_a_run_that_diverges_says_when_and_what_to_do(scene) -> None:
    scene.write_text(
        'robot = "planar_2r"\nduration_s = 1.0\nmethod = "Euler"\nstep_s = 0.1\n'
        '[[effect]]\nkind = "spring"\nstiffness_N_m_per_rad = 1e5\nrest_rad = 1.0\n'
    )
    done = run("simulate", scene)
    assert done.returncode == 1
    assert re.search(r"diverged at t = .*step.*joint_\d.*use step_s=", done.stdout)


WATCHED = """
from robot_dyn.simulation.run.fixed_steps import FixedSteps

advance, calls = FixedSteps.advance, []

def watched(self):
    calls.append(1)
    if len(calls) == 20:
        tell()
    return advance(self)

FixedSteps.advance = watched
"""


def test_ctrl_c_ends_a_run_and_keeps_it(scene, tmp_path) -> None:
    text = 'robot = "planar_2r"\nduration_s = 9000.0\nmethod = "RK4"\nstep_s = 1e-3\nengine = "interpreted"\n'
    scene.write_text(text + "[start]\nq = [0.4, -0.7]\n")  # it would run for many minutes
    output = tmp_path / "run.npz"
    assert "stopped at t = " in interrupted_at_work("simulate", scene, "-o", output, watched=WATCHED)
    assert len(rd.read(output).t) > 1
