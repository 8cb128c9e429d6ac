"""Commands about compiled kernels: which formulation won, and what is kept on disk."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

import robot_dyn as rd
from tests.command import document, run, said


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("ROBOT_DYN_CACHE", str(tmp_path / "kernels"))
    return tmp_path / "kernels"


def test_info_names_the_formulation_of_the_fewest_instructions() -> None:
    answer = document("info", "planar_2r", "--compiled")["compiled"]
    assert set(answer) >= {"M", "C", "N", "inverse_dynamics", "forward_dynamics"}
    for row in answer.values():
        counts = row["instructions"]
        assert counts[row["served_by"]] == min(counts.values())
    assert min(answer["forward_dynamics"]["instructions"].values()) > 20  # M⁻¹ of two joints
    text = said("info", "planar_2r", "--compiled")
    assert f"{min(answer['M']['instructions'].values())}" in text and "forward_dynamics" in text
    assert "compiled" not in document("info", "planar_2r")


def test_the_cache_is_listed_and_cleared(folder: Path) -> None:
    assert "0 kernels" in said("cache")
    rd.Compiled(rd.load("pendulum")).M(np.array([0.3]))
    listed = document("cache")
    assert (listed["folder"], len(listed["kernels"])) == (str(folder), 1)
    assert listed["bytes"] == listed["kernels"][0]["size"] > 1000
    assert listed["kernels"][0]["key"][:12] in said("cache")
    cleared = document("cache", "--clear")
    assert (cleared["removed"], cleared["kernels"], list(folder.iterdir())) == (1, [], [])


def test_a_cache_that_is_off_is_none(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROBOT_DYN_CACHE", "off")
    assert document("cache")["folder"] is None
    assert "no cache" in said("cache")


@pytest.mark.skipif(os.name != "posix", reason="modes are those of POSIX")
def test_a_folder_that_others_can_enter_is_told_and_not_used(folder: Path) -> None:
    folder.mkdir(mode=0o755)
    done = run("cache")
    assert done.returncode == 0
    assert "no cache" in done.stdout and "is not yours alone" in done.stderr


def test_explain_counts_instructions_by_effect(tmp_path: Path) -> None:
    from robot_dyn.scene import starter

    scene = tmp_path / "scene.toml"
    scene.write_text(starter("cart_pole"), encoding="utf-8")
    line = next(line for line in said("explain", scene).splitlines() if line.startswith("machine code"))
    assert "instructions; of effects:" in line and "spring" in line
