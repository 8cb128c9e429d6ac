"""The command prove, as a user meets it."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from tests.cli.test_command_documents import promised
from tests.command import refusal, run

SCENE = (
    'robot = "planar_2r"\nduration_s = 0.05\n[start]\nq = [0.3, -0.4]\nv = [0.7, 1.1]\n[[effect]]\nkind = "gravity"\n'
)


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    path = tmp_path / "scene.toml"
    path.write_text(SCENE, encoding="utf-8")
    return path


def test_prove_says_the_theorem_and_which_numbers_are_meant(scene: Path) -> None:
    done = run("prove", scene)
    assert done.returncode == 0, done.stderr
    assert "planar_2r: the motion exists and is unique for 0 ≤ t ≤ 0.05 s" in done.stdout
    assert re.search(r"joint_1 +\[-?0\.\d{18,} \+/- \d\.\d+e-2\d\]", done.stdout)
    assert "q(0) [0.3, -0.4] as float64" in done.stdout and "Trusted: " in done.stdout


def test_document_has_the_keys_that_are_promised(scene: Path) -> None:
    made = json.loads(run("prove", scene, "--until", "0.01", "--bits", "60", "--json").stdout)
    assert made.keys() == promised("prove").keys()
    assert made["proven"] is True and made["until_s"] == 0.01 and max(made["radius_q"]) < 1e-12


def test_what_is_not_proven_is_told_by_the_exit_code(scene: Path) -> None:
    done = run("prove", scene, "--until", "100", "--budget", "0.2")
    assert done.returncode == 1
    assert re.search(r"Not proven beyond t = 0\.\d+ s, because the budget of 0\.2 s is used up\.", done.stdout)
    scene.write_text(SCENE + '[[effect]]\nkind = "dry_friction"\nlevel_N_m = 1.0\n', encoding="utf-8")
    assert "effect dry_friction switches" in refusal(["prove", str(scene)])
