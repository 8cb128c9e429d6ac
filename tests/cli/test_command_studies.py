"""The commands accuracy, cost, certify and prove, as a user meets them."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from tests.command import document, interrupted_at_work, refusal, run
from tests.long import long
from tests.promised import check_document

SCENE = 'robot = "planar_2r"\nduration_s = 0.1\n{}\n[start]\nq = [0.4, 0.9]\n[[effect]]\nkind = "gravity"\n'
DRAG = '[[effect]]\nkind = "viscous_friction"\nviscous_N_m_s_per_rad = 0.3\n'
SCENES = {"work-precision": SCENE.format('engine = "interpreted"'), "cost": SCENE.format("accuracy = 1e-6") + DRAG}
METHODS = ("--method", "RK4", "--method", "Euler")
FEW = {"work-precision": (*METHODS, "--repeats", "1", "--no-peers"), "cost": ("--budget", "0.2", "--repeats", "2")}
FEW["certify"] = ("--samples", "100", "--repeats", "1")
TABLES = {
    "work-precision": "method,engine",
    "cost": "group,name",
    "certify": "quantity,implementation,at_state,typical",
}


@pytest.fixture
def scene(tmp_path: Path, command: str) -> Path:
    path = tmp_path / "scene.toml"
    path.write_text(SCENES.get(command, ""), encoding="utf-8")
    return path


SENTENCES = {
    "work-precision": (
        r"\d+ digits of q over 0\.1 s: RK4", r"Euler \(interpreted\)", "planar_2r: gravity 9.807 m/s²",
    ),
    "cost": (
        r"a step of RK4 takes \d+ instructions, .*: rigid bodies \d+, gravity \d+, viscous",
        "M, Cholesky / articulated body", "left out: right angles of the file",
    ),
    "certify": (
        r"digits of forward_dynamics at the worst state found: .*Pinocchio 1\d\.\d in ",
        r"^M +Pinocchio +16\.3 +16\.3 +100 +16\.3 +16\.3 +\d", r"decimals of the file as float64 +16\.9",
        "κ of M scaled to a unit diagonal: typical 1, largest at random 1, searched 1",
    ),
}  # fmt: skip


@pytest.mark.parametrize("command", SENTENCES)
def test_it_says_a_sentence_and_writes_a_figure_and_a_table(command: str, scene: Path, tmp_path: Path) -> None:
    what = ("pendulum", "--q", "0.5") if command == "certify" else (scene,)
    done = run(command, *what, *FEW[command], "-o", tmp_path / "plot.svg", "--csv", tmp_path / "runs")
    assert done.returncode == 0, done.stderr
    sentence, *more = SENTENCES[command]
    assert re.match(sentence, done.stdout)
    assert all(re.search(each, done.stdout, re.M) for each in more)
    assert (tmp_path / "plot.svg").read_bytes().startswith(b"<?xml")
    assert (tmp_path / "runs.csv").read_text(encoding="utf-8").startswith(TABLES[command])


@pytest.mark.parametrize("command", SCENES)
def test_document_has_the_keys_that_are_promised(command: str, scene: Path) -> None:
    written = document(command, scene, *FEW[command])
    check_document(command, written)
    assert written["rows" if command == "work-precision" else "alternatives"]


def test_document_of_certify_has_the_keys_that_are_promised_and_no_infinity() -> None:
    done = run("certify", "massless_tip", *FEW["certify"], "--json")
    made = json.loads(done.stdout, parse_constant=lambda word: pytest.fail(f"{word} is not JSON"))
    digits = made["digits"][0]
    check_document("certify", made)
    assert made["condition"]["searched"] is None
    assert made["left_out"] == ["forward dynamics: joint 'pointer_joint' carries no inertia"]
    assert digits["state"].keys() == {"q"} and digits["samples"] == 100


def test_a_robot_swings_freely_from_the_start_that_is_given() -> None:
    written = document(
        "work-precision",
        "pendulum",
        "--q",
        "0.5",
        "--duration",
        "0.2",
        *FEW["work-precision"][:2],
        *FEW["work-precision"][4:],
    )
    assert (written["robot"], written["reference"]["horizon_s"], written["unit"]) == ("pendulum", 0.2, "rad")
    assert {each["engine"] for each in written["ladders"]} == {"compiled", "interpreted"}


WATCHED = {  # where each is at work: behind the first ladder, and before what is timed
    "work-precision": """
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


@pytest.mark.parametrize("command", ["work-precision", *long(["cost"])])
def test_ctrl_c_ends_the_measurement_and_keeps_what_was_measured(command: str, scene: Path) -> None:
    repeats = ("--repeats", "1000") if command == "cost" else ()
    out = interrupted_at_work(command, scene, "--budget", "3000", *repeats, "--json", watched=WATCHED[command])
    written = json.loads(out)
    assert written["interrupted"] and "interruption" in written["left_out"][-1]
    assert written["ladders" if command == "work-precision" else "alternatives"]


PROVEN = (
    'robot = "planar_2r"\nduration_s = 0.05\n[start]\nq = [0.3, -0.4]\nv = [0.7, 1.1]\n[[effect]]\nkind = "gravity"\n'
)


@pytest.fixture
def proven(tmp_path: Path) -> Path:
    path = tmp_path / "scene.toml"
    path.write_text(PROVEN, encoding="utf-8")
    return path


def test_prove_says_the_theorem_and_which_numbers_are_meant(proven: Path) -> None:
    done = run("prove", proven)
    assert done.returncode == 0, done.stderr
    assert "planar_2r: the motion exists and is unique for 0 ≤ t ≤ 0.05 s" in done.stdout
    assert re.search(r"joint_1 +\[-?0\.\d{18,} \+/- \d\.\d+e-2\d\]", done.stdout)
    assert "q(0) [0.3, -0.4] as float64" in done.stdout and "Trusted: " in done.stdout


def test_document_of_prove_has_the_keys_that_are_promised(proven: Path) -> None:
    made = json.loads(run("prove", proven, "--until", "0.01", "--bits", "60", "--json").stdout)
    check_document("prove", made)
    assert made["proven"] is True and made["until_s"] == 0.01 and max(made["radius_q"]) < 1e-12


def test_what_is_not_proven_is_told_by_the_exit_code(proven: Path) -> None:
    done = run("prove", proven, "--until", "100", "--budget", "0.2")
    assert done.returncode == 1
    assert re.search(r"Not proven beyond t = 0\.\d+ s, because the budget of 0\.2 s is used up\.", done.stdout)
    proven.write_text(PROVEN + '[[effect]]\nkind = "dry_friction"\ncoulomb_N_m = 1.0\n', encoding="utf-8")
    assert "effect dry_friction switches" in refusal(["prove", str(proven)])
