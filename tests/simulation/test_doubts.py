"""Doubts about the accuracy of a run: rows with one table of sentences, the same in results, files and JSON."""

from __future__ import annotations

import json
from pathlib import Path
from string import Formatter

import pytest

import robot_dyn as rd
from robot_dyn.cli import report
from robot_dyn.foundations import json_text
from robot_dyn.simulation import Doubt, DoubtKind
from robot_dyn.simulation.results.doubts import _SENTENCES


@pytest.fixture(scope="module")
def coarse() -> rd.Trajectory:
    """A swing by Euler's method in steps of 50 ms: its estimate ends early, and its ledger does not close."""
    return rd.simulate(rd.load("planar_2r"), [2.5, 0.7], duration_s=3.0, method="Euler", step_s=0.05)


def test_every_kind_has_a_sentence_of_its_facts() -> None:
    assert set(_SENTENCES) == set(DoubtKind)
    for kind, parts in _SENTENCES.items():
        formats = [form for part in parts for form in ((part,) if isinstance(part, str) else part)]
        names = {name for form in formats for _, name, _, _ in Formatter().parse(form) if name}
        numbers = {name: spec for form in formats for _, name, spec, _ in Formatter().parse(form) if name}
        facts = {name: 0.5 if numbers[name] else "arm" for name in names}
        doubt = Doubt(kind, facts)
        assert doubt.text and "{" not in str(doubt)


def test_a_doubt_states_the_finer_setting_as_a_number(coarse: rd.Trajectory) -> None:
    assert coarse.error is not None and coarse.error.ends_early is not None and coarse.ledger.cause is not None
    assert coarse.error.ends_early.kind is DoubtKind.COMPANIONS_DIFFER
    assert coarse.ledger.cause.kind is DoubtKind.LONG_STEPS
    for doubt in (coarse.error.ends_early, coarse.ledger.cause):
        assert doubt.facts["smaller_step_s"] == pytest.approx(0.05 / 4)


def test_doubts_are_the_same_in_a_file_and_in_json(coarse: rd.Trajectory, tmp_path: Path) -> None:
    again = rd.read(coarse.save(tmp_path / "run.npz"))
    assert coarse.error is not None and again.error is not None
    assert (again.error.ends_early, again.ledger.cause) == (coarse.error.ends_early, coarse.ledger.cause)
    document = json.loads(json_text(report.run(coarse)))
    rows = [*document["error_doubts"], document["ledger_doubt"]]
    doubts = [x for x in (coarse.error.ends_early, coarse.error.no_order, coarse.ledger.cause) if x]
    assert [(row["kind"], row["facts"], row["text"]) for row in rows] == [(x.kind, x.facts, x.text) for x in doubts]
    assert all(doubt.text in coarse.summary for doubt in doubts)
