"""The documents of --json have exactly the keys that docs/reference/json.md promises."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import robot_dyn as rd
from robot_dyn.scene import starter
from tests.command import ROOT, document

PROMISE = (ROOT / "docs" / "reference" / "json.md").read_text(encoding="utf-8")


def promised(command: str) -> dict[str, str]:
    """Meaning by key, of the table under a command's heading."""
    section = PROMISE.split(f"## `robot-dyn {command}")[1].split("\n## ")[0]
    rows = [line.strip("| ").split(" | ", 1) for line in section.splitlines() if line.startswith("| `")]
    return {key: meaning for keys, meaning in rows for key in names(keys)}


def names(text: str) -> set[str]:
    """Words in backticks, outside brackets."""
    return set(re.findall(r"`(\w+)`", re.sub(r"\([^)]*\)", "", text)))


def test_list():
    listed = document("list")
    assert listed.keys() == promised("list").keys()
    assert tuple(listed["robots"]) == rd.list_robots()


def test_info():
    keys = promised("info")
    panda = document("info", "panda", "--lock", "panda_joint2=0.25", "--compiled")
    assert panda.keys() == keys.keys()
    for joint in panda["joints"]:
        assert joint.keys() == names(keys["joints"])
        assert joint["kind"] in ("revolute", "continuous", "prismatic")
    assert [coupling.keys() for coupling in panda["couplings"]] == [names(keys["couplings"])]


def test_query():
    keys = promised("query")
    assert document("query", "ur5").keys() == keys.keys() - {"why", "quantities"}
    why = document("query", "ur5", "--why", "elbow_joint", "--quantity", "momentum")
    assert why.keys() == keys.keys()
    own, _, _ = keys["why"].partition(";")
    assert why["why"].keys() == names(own.partition(":")[2])
    (inside,) = re.findall(r"`shares` \(([^)]*)\)", own)
    assert {key for share in why["why"]["shares"] for key in share} == set(re.findall(r"`(\w+)`", inside))


@pytest.mark.parametrize(("command", "part"), [("explain", "effects"), ("parameters", "parameters")])
def test_of_a_scene(command: str, part: str, tmp_path: Path):
    keys = promised(command)
    (tmp_path / "scene.toml").write_text(starter("cart_pole"), encoding="utf-8")
    listed = document(command, tmp_path / "scene.toml")
    assert listed.keys() == keys.keys()
    assert {key for each in listed[part] for key in each} == names(keys[part])


def test_compare():
    keys = promised("compare")
    both = document("compare", "pendulum", "mimic_chain", "--samples", "2")
    assert both.keys() == keys.keys()
    assert both["ok"] is True and both["refused"] == {} and list(both["robots"]) == ["pendulum", "mimic_chain"]
    (paragraph,) = re.findall(r"Each of `quantities`, by name:(.*?)\n\n", PROMISE, re.S)
    for robot in both["robots"].values():
        assert robot.keys() == names(keys["robots"]) and robot["samples"] == 2
        for name, quantity in robot["quantities"].items():
            assert quantity.keys() == names(paragraph)
            assert quantity["state"].keys() == (set() if name.startswith("file: ") else {"q", "v", "a", "tau"})
