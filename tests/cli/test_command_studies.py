"""The commands accuracy and cost, as a user meets them."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

import robot_dyn as rd
from tests.cli.test_command_documents import promised
from tests.command import document, interrupted_at_work, refusal, run
from tests.long import long
from tests.snapshots import assert_text

SCENE = 'robot = "planar_2r"\nduration_s = 0.1\n{}\n[start]\nq = [0.4, 0.9]\n[[effect]]\nkind = "gravity"\n'
DRAG = '[[effect]]\nkind = "viscous_friction"\ndamping_N_m_s_per_rad = 0.3\n'
SCENES = {"accuracy": SCENE.format('engine = "interpreted"'), "cost": SCENE.format("accuracy = 1e-6") + DRAG}
METHODS = ("--method", "rk4", "--method", "explicit_euler")
FEW = {"accuracy": (*METHODS, "--repeats", "1", "--no-peers"), "cost": ("--budget", "0.2", "--repeats", "2")}
TABLES = {"accuracy": "method,engine", "cost": "group,what"}


@pytest.fixture
def scene(tmp_path: Path, command: str) -> Path:
    path = tmp_path / "scene.toml"
    path.write_text(SCENES[command], encoding="utf-8")
    return path


SENTENCES = {
    "accuracy": (r"\d+ digits of q over 0\.1 s: rk4", "explicit_euler (interpreted)", "planar_2r: gravity 9.807 m/s²"),
    "cost": (
        r"a step of RK4 takes \d+ instructions, .*: rigid bodies \d+, gravity \d+, viscous",
        "M, Cholesky / articulated body", "left out: right angles of the file",
    ),
}  # fmt: skip


@pytest.mark.parametrize("command", SENTENCES)
def test_it_says_a_sentence_and_writes_a_figure_and_a_table(command: str, scene: Path, tmp_path: Path) -> None:
    done = run(command, scene, *FEW[command], "-o", tmp_path / "plot.svg", "--csv", tmp_path / "runs")
    assert done.returncode == 0, done.stderr
    sentence, *more = SENTENCES[command]
    assert re.match(sentence, done.stdout)
    assert all(each in done.stdout for each in more)
    assert (tmp_path / "plot.svg").read_bytes().startswith(b"<?xml")
    assert (tmp_path / "runs.csv").read_text(encoding="utf-8").startswith(TABLES[command])


@pytest.mark.parametrize("command", SCENES)
def test_document_has_the_keys_that_are_promised(command: str, scene: Path) -> None:
    written = document(command, scene, *FEW[command])
    row = written["rows" if command == "accuracy" else "alternatives"][0]
    parts = (written["reference"], written["ladders"][0]) if command == "accuracy" else (row["first"],)
    assert promised(command).keys() == {*written, *row, *(key for part in parts for key in part)}


def test_a_robot_swings_freely_from_the_start_that_is_given() -> None:
    written = document(
        "accuracy", "pendulum", "--q", "0.5", "--duration", "0.2", *FEW["accuracy"][:2], *FEW["accuracy"][4:]
    )
    assert (written["robot"], written["reference"]["horizon_s"], written["unit"]) == ("pendulum", 0.2, "rad")
    assert {each["engine"] for each in written["ladders"]} == {"compiled", "interpreted"}


@pytest.mark.parametrize(
    ("command", "given"),
    [
        ("accuracy", "scene.toml --q 0.1,0.2"),
        ("accuracy", "scene.toml --method rk5"),
        ("accuracy", "scene.toml --budget 0"),
        ("accuracy", "pendulum --duration -1"),
        ("accuracy", "pendulum -o plot.txt"),
        ("accuracy", "scene.toml --csv scene.toml"),
        ("accuracy", "scene.toml --csv old.csv"),
        ("cost", "scene.toml --budget 0"),
        ("cost", "scene.toml -o plot.txt"),
        ("cost", "scene.toml --csv old.csv"),
        ("cost", "no.toml"),
    ],
)
def test_mistakes_are_told_in_one_line_before_the_work(
    scene: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, command: str, given: str
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "old.csv").write_text(TABLES[command])
    if given == "no.toml" or "--csv" in given or "-o" in given:
        monkeypatch.setattr(rd.accuracy, {"accuracy": "work_precision"}.get(command, command), None)
    assert_text("refused_studies", f"{command} {given}", refusal([command, *given.split()]))


WATCHED = {  # where each is at work: behind the first ladder, and before what is timed
    "accuracy": """
from robot_dyn.accuracy.work_precision_diagram import measurement as study
work = study._walk
study._walk = lambda *given: (work(*given), tell())[0]
""",
    "cost": """
from robot_dyn.accuracy.costs import cost as study
work = study.take_turns
study.take_turns = lambda *given: (tell(), work(*given))[1]
""",
}


@pytest.mark.parametrize("command", ["accuracy", *long(["cost"])])
def test_ctrl_c_ends_the_measurement_and_keeps_what_was_measured(command: str, scene: Path) -> None:
    repeats = ("--repeats", "1000") if command == "cost" else ()
    out = interrupted_at_work(command, scene, "--budget", "3000", *repeats, "--json", watched=WATCHED[command])
    written = json.loads(out)
    assert written["interrupted"] and "interrupted" in written["left_out"][-1]
    assert written["ladders" if command == "accuracy" else "alternatives"]
