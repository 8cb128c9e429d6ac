"""The command certify, as a user meets it."""

from __future__ import annotations

import json
import re

import pytest

import robot_dyn as rd
from tests.cli.test_command_documents import names, promised
from tests.command import refusal, run
from tests.snapshots import assert_text

FEW = ("--samples", "100", "--repeats", "1")


def test_certify_says_digits_beside_times_and_writes_a_diagram_and_a_table(tmp_path) -> None:
    done = run("certify", "pendulum", *FEW, "--q", "0.5", "-o", tmp_path / "plot.svg", "--csv", tmp_path / "digits")
    assert done.returncode == 0, done.stderr
    assert re.match(r"digits of forward_dynamics at the worst state found: .*Pinocchio 1\d\.\d in ", done.stdout)
    assert re.search(r"^M +Pinocchio +16\.3 +16\.3 +100 +16\.3 +16\.3 +\d", done.stdout, re.M)
    assert re.search(r"decimals of the file as float64 +16\.9", done.stdout)
    assert "κ of M scaled to a unit diagonal: typical 1, largest at random 1, searched 1" in done.stdout
    assert (tmp_path / "plot.svg").read_bytes().startswith(b"<?xml")
    assert (tmp_path / "digits.csv").read_text(encoding="utf-8").startswith("quantity,implementation,given,typical")


def test_document_has_the_keys_that_are_promised_and_no_infinity() -> None:
    done = run("certify", "massless_tip", *FEW, "--json")
    made = json.loads(done.stdout, parse_constant=lambda word: pytest.fail(f"{word} is not JSON"))
    digits = made["digits"][0]
    assert promised("certify").keys() == {*made, *digits}
    assert made["condition"].keys() == names(promised("certify")["condition"])
    assert made["condition"]["searched"] is None
    assert made["left_out"] == ["forward dynamics: joint 'pointer_joint' carries no inertia"]
    assert digits["state"].keys() == {"q"} and digits["samples"] == 100


@pytest.mark.parametrize(
    "given",
    [
        ["--samples", "10"],
        ["--q", "0.1,0.2"],
        ["--tau", "0.1"],
        ["-o", "plot.txt"],
        ["--csv", "old.csv"],
    ],
)
def test_mistakes_are_told_in_one_line_before_the_work(tmp_path, monkeypatch, given: list[str]) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "old.csv").write_text("quantity,implementation")
    if "--csv" in given or "-o" in given:
        monkeypatch.setattr(rd.accuracy, "certify", None)
    assert_text("refused_studies", " ".join(["certify", *given]), refusal(["certify", "pendulum", *given]))
