"""The command accuracy, as a user meets it."""

from __future__ import annotations

import json
import re
import signal
from pathlib import Path

import pytest

import robot_dyn as rd
from tests.command import document, refusal, run, started

DOCUMENT = (Path(__file__).parents[2] / "docs" / "json.md").read_text(encoding="utf-8")
SCENE = """robot = "planar_2r"
duration_s = 0.1
engine = "interpreted"
[start]
q = [0.4, 0.9]
[[effect]]
kind = "gravity"
"""
FEW = ("--method", "rk4", "--method", "explicit_euler", "--repeats", "1", "--no-peers")


@pytest.fixture
def scene(tmp_path) -> Path:
    path = tmp_path / "scene.toml"
    path.write_text(SCENE, encoding="utf-8")
    return path


def test_accuracy_says_a_sentence_and_writes_a_diagram_and_a_table(scene, tmp_path) -> None:
    done = run("accuracy", scene, *FEW, "-o", tmp_path / "plot.svg", "--csv", tmp_path / "runs")
    assert done.returncode == 0, done.stderr
    assert re.match(r"\d+ digits of q over 0\.1 s: rk4", done.stdout)
    assert "explicit_euler (interpreted)" in done.stdout and "planar_2r: gravity 9.807 m/s²" in done.stdout
    assert (tmp_path / "plot.svg").read_bytes().startswith(b"<?xml")
    assert (tmp_path / "runs.csv").read_text(encoding="utf-8").startswith("method,engine")


def test_document_has_the_keys_that_are_promised(scene) -> None:
    made = document("accuracy", scene, *FEW)
    section = DOCUMENT.split("## `robot-dyn accuracy")[1].split("\n## ")[0]
    rows = [line.split("|")[1] for line in section.splitlines() if line.startswith("| `")]
    promised = {key for row in rows for key in re.findall(r"`(\w+)`", row)}
    assert promised == {*made, *made["reference"], *made["ladders"][0], *made["rows"][0]}


def test_a_robot_swings_freely_from_the_start_that_is_given() -> None:
    made = document("accuracy", "pendulum", "--q", "0.5", "--duration", "0.2", *FEW[:2], *FEW[4:])
    assert (made["robot"], made["reference"]["horizon_s"], made["unit"]) == ("pendulum", 0.2, "rad")
    assert {each["engine"] for each in made["ladders"]} == {"compiled", "interpreted"}


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (["scene.toml", "--q", "0.1,0.2"], r"--q: is for a robot; a scene states its own, so leave it out"),
        (["scene.toml", "--method", "rk5"], r"no integration method 'rk5'; nearest: rk4.*"),
        (["scene.toml", "--budget", "0"], r"budget_s must be positive, got 0\.0|budget_s must be above 0, got 0\.0"),
        (["pendulum", "--duration", "-1"], r"--duration must be positive, got -1"),
        (["pendulum", "-o", "plot.txt"], r"plot\.txt: '\.txt' is not the suffix of a plot; .*"),
        (["scene.toml", "--csv", "scene.toml"], r"scene\.toml: '\.toml' is not the suffix of a table .*"),
        (["scene.toml", "--csv", "old.csv"], r"old\.csv: exists; add --force to replace it.*"),
    ],
)
def test_mistakes_are_told_in_one_line_before_the_work(scene, tmp_path, monkeypatch, given, message: str) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "old.csv").write_text("method,engine")
    if "--csv" in given or "-o" in given:
        monkeypatch.setattr(rd, "work_precision", None)
    assert re.fullmatch(message, refusal(["accuracy", *given]))


WATCHED = """
import sys
from robot_dyn.studies.work_precision_diagram import measured
from robot_dyn.cli import main

walk = measured._walk

def watched(*arguments):
    walk(*arguments)
    print("at work", file=sys.stderr, flush=True)

measured._walk = watched
main()
"""


def test_ctrl_c_ends_the_measurement_and_keeps_its_runs(scene) -> None:
    with started("accuracy", scene, "--budget", "3000", "--json", code=WATCHED) as process:
        assert process.stderr is not None
        assert process.stderr.readline() == "at work\n"
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=60)
    assert process.returncode == 130, err
    made = json.loads(out)
    assert made["interrupted"] and made["ladders"] and "interrupted" in made["left_out"][-1]
    assert "Traceback" not in err
