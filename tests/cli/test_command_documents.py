"""The documents of --json have exactly the keys that docs/reference/json.md promises."""

from __future__ import annotations

from pathlib import Path

import pytest
from json_reference import page

import robot_dyn as rd
from robot_dyn.scene import starter
from tests.command import ROOT, document
from tests.promised import check_document


def test_the_page_is_up_to_date():
    command = "python scripts/json_reference.py > docs/reference/json.md"
    written = (ROOT / "docs" / "reference" / "json.md").read_text(encoding="utf-8")
    assert written == page(), f"the page is out of date; write it by {command}"


def test_list():
    listed = document("list")
    check_document("list", listed)
    assert tuple(listed["robots"]) == rd.list_robots()


def test_info():
    panda = document("info", "panda", "--lock", "panda_joint2=0.25", "--compiled")
    check_document("info", panda)
    assert {joint["kind"] for joint in panda["joints"]} <= {"revolute", "continuous", "prismatic"}
    assert panda["couplings"]


def test_query():
    check_document("query", document("query", "ur5"), without=("why", "quantities"))
    why = document("query", "ur5", "--why", "elbow_joint", "--quantity", "momentum")
    check_document("query", why)
    assert why["why"]["shares"]


@pytest.mark.parametrize("command", ["explain", "parameters"])
def test_of_a_scene(command: str, tmp_path: Path):
    (tmp_path / "scene.toml").write_text(starter("cart_pole"), encoding="utf-8")
    check_document(command, document(command, tmp_path / "scene.toml"))


def test_compare():
    both = document("compare", "pendulum", "mimic_chain", "--samples", "2")
    check_document("compare", both)
    assert both["ok"] is True and both["refused"] == {} and list(both["robots"]) == ["pendulum", "mimic_chain"]
    for robot in both["robots"].values():
        assert robot["samples"] == 2
        for name, quantity in robot["quantities"].items():
            assert quantity["state"].keys() == (set() if name.startswith("file: ") else {"q", "v", "a", "tau"})
