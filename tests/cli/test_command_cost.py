"""The command cost, as a user meets it."""

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
accuracy = 1e-6
[start]
q = [0.4, 0.9]
[[effect]]
kind = "gravity"
[[effect]]
kind = "viscous_friction"
damping_N_m_s_per_rad = 0.3
"""
FEW = ("--budget", "0.2", "--repeats", "2")


@pytest.fixture
def scene(tmp_path) -> Path:
    path = tmp_path / "scene.toml"
    path.write_text(SCENE, encoding="utf-8")
    return path


def test_cost_says_a_sentence_and_writes_a_figure_and_a_table(scene, tmp_path) -> None:
    done = run("cost", scene, *FEW, "-o", tmp_path / "plot.svg", "--csv", tmp_path / "table")
    assert done.returncode == 0, done.stderr
    assert re.match(r"a step of RK4 takes \d+ instructions, .*: rigid bodies \d+, gravity \d+, viscous", done.stdout)
    assert "M, Cholesky / articulated body" in done.stdout and "left out: right angles of the file" in done.stdout
    assert (tmp_path / "plot.svg").read_bytes().startswith(b"<?xml")
    assert (tmp_path / "table.csv").read_text(encoding="utf-8").startswith("group,what")


def test_document_has_the_keys_that_are_promised(scene) -> None:
    made = document("cost", scene, *FEW)
    section = DOCUMENT.split("## `robot-dyn cost")[1].split("\n## ")[0]
    rows = [line.split("|")[1] for line in section.splitlines() if line.startswith("| `")]
    promised = {key for row in rows for key in re.findall(r"`(\w+)`", row)}
    row = made["alternatives"][0]
    assert promised == {*made, *row, *row["first"]}


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (["scene.toml", "--budget", "0"], r"budget_s must be .*got 0\.0"),
        (["scene.toml", "-o", "plot.txt"], r"plot\.txt: '\.txt' is not the suffix of a plot; .*"),
        (["scene.toml", "--csv", "old.csv"], r"old\.csv: exists; add --force to replace it.*"),
        (["no.toml"], r"no\.toml: .*"),
    ],
)
def test_mistakes_are_told_in_one_line_before_the_work(scene, tmp_path, monkeypatch, given, message: str) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "old.csv").write_text("group,what")
    if "--budget" not in given:
        monkeypatch.setattr(rd, "cost", None)
    assert re.fullmatch(message, refusal(["cost", *given]))


WATCHED = """
import sys
from robot_dyn.studies.costs import cost
from robot_dyn.cli import main

turns = cost.in_turns

def watched(*arguments):
    print("at work", file=sys.stderr, flush=True)
    return turns(*arguments)

cost.in_turns = watched
main()
"""


def test_ctrl_c_ends_the_measurement_and_keeps_what_was_counted(scene) -> None:
    with started("cost", scene, "--budget", "3000", "--repeats", "1000", "--json", code=WATCHED) as process:
        assert process.stderr is not None
        assert process.stderr.readline() == "at work\n"
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=60)
    assert process.returncode == 130, err
    made = json.loads(out)
    assert made["interrupted"] and made["alternatives"] and "interrupted" in made["left_out"][-1]
    assert "Traceback" not in err
