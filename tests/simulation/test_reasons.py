"""Every reason has a docstring, an example message, and an ending; a sentence leaves out parts without their facts."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import pytest

from robot_dyn.simulation import Ending, Outcome, Reason, Remark, RemarkKind

sys.path.append(str(Path(__file__).parents[2] / "docs"))
from site_parts import reasons


@pytest.mark.parametrize("reason", Reason)
def test_every_reason_is_explained_on_the_page(reason: Reason) -> None:
    assert reasons.docstrings(Reason)[reason].endswith(".")
    assert f"`Reason.{reason.name}`" in reasons.page("")


@pytest.mark.parametrize("reason", [reason for reason in Reason if reason is not Reason.END])
def test_the_example_of_every_reason_fills_all_parts(reason: Reason) -> None:
    """No sentence is empty, and none shows a field that was not filled in."""
    text = Outcome(reason, 1.5, "elbow", dict(reasons.EXAMPLES.get(reason, {}))).text
    assert text and "{" not in text


def test_runs_finish_at_their_duration_or_at_an_event_and_stop_if_they_are_interrupted() -> None:
    endings = {reason: Outcome(reason, 0.0).ending for reason in Reason}
    of = {ending: {reason for reason, x in endings.items() if x is ending} for ending in Ending}
    assert of[Ending.FINISHED] == {Reason.END, Reason.TERMINAL_EVENT}
    assert of[Ending.STOPPED] == {Reason.INTERRUPTED, Reason.INTERRUPTED_IN_ESTIMATE}


def test_a_sentence_leaves_out_what_it_has_no_facts_for() -> None:
    bare = Outcome(Reason.STATE_OVERFLOWS, 1.0, "elbow").text
    known = Outcome(Reason.STATE_OVERFLOWS, 1.0, "elbow", {"step_s": 0.01}).text
    assert known.startswith(bare) and "elbow" in known and "elbow" not in bare


def test_of_several_remedies_one_is_given() -> None:
    """With a stable period, without one, and where none was looked for."""
    loop = Remark(RemarkKind.UNSTABLE, "elbow", "q", 0.0, 0.0, 0.0, 2.0, 1.0, {"growth": "2", "period_s": 0.25})
    known = replace(loop, facts=loop.facts | {"limit_s": 0.125, "shorter_s": "0.06"})
    assert "0.125" in known.remedy and "0.25" not in known.remedy
    assert "0.25" in loop.remedy and loop.remedy != known.remedy
