"""Hard cases of every family: within what is allowed, or said to be beyond it; `make stress` runs the full ones too."""

from __future__ import annotations

import json
from importlib import import_module
from inspect import getdoc
from pathlib import Path

import pytest

from tests.campaigns.hard.case import Case, Row
from tests.campaigns.hard.chains import CHAINS, FOLDER, LONG, file_of
from tests.campaigns.hard.families import FAMILIES
from tests.campaigns.hard.figure import draw
from tests.campaigns.hard.report import Result, rows, summarise, write

SEED = 1
ROOT = Path(__file__).parents[3]
SOME = {  # one of each family
    "spatial, 7 joints", "q of 100000 rad", "double pendulum, RK4, 20000 steps", "damper of 1e+06 N m s/rad",
    "planar_2r, smooth, scenes 0 to 2", "relay", "ur5's elbow 0.1 m beyond", "planar_2r, PID in saturation",
    "double pendulum, RK4", "planar_2r", "double_pendulum", "turning and sliding", "stopped",
}  # fmt: skip
SLOW = {
    "panda, smooth, scenes 0 to 1", "planar_2r, set-valued, scenes 0 to 2", "panda, set-valued, scenes 1 to 3",
    "double pendulum, GaussLegendre6, 20000 short steps", "Panda, RK4", "Lyapunov time of the double pendulum",
}  # fmt: skip


def _marks(case: Case) -> list[pytest.MarkDecorator]:
    if case.name in SOME:
        return []
    return [pytest.mark.stress if case.name in SLOW else pytest.mark.long]


ALL = [
    pytest.param(case, id=f"{name}: {case.name}", marks=_marks(case))
    for name, family in FAMILIES.items()
    for case in family.CASES
    if not case.full
]


@pytest.mark.filterwarnings("ignore::robot_dyn.ModelWarning")
@pytest.mark.parametrize("case", ALL)
def test_no_figure_is_wrong_without_a_word(case: Case) -> None:
    rows = list(case.rows(SEED))
    assert rows
    assert not [each for each in rows if each.silent]


def test_the_counts_are_those_of_the_rows_and_the_picture_has_a_mark_for_each(tmp_path) -> None:
    for name in ("chaos", "tools"):
        found = [
            Row("a case", "a figure", 3.0, 4.0),
            Row("a case", "another", 5.0, 4.0, said="refused"),
            Row("a case", "of a peer", 9.0, 4.0, program="peer"),
        ]
        write(Result(name, FAMILIES[name].CASES[0].name, SEED, tuple(found), 1.0), tmp_path)
    summarise(tmp_path)
    known = json.loads((tmp_path / "figures.json").read_text())
    counted = json.loads((tmp_path / "hard_cases.json").read_text())["families"][0]
    assert counted == {
        "title": FAMILIES["chaos"].TITLE, "cases": 1, "figures": 2, "holds": 1, "said": 1, "silent": 0, "worst": 0.75,
        "words": ["refused"],
    }  # fmt: skip
    assert (
        sum(len(marks.get_offsets()) for marks in draw(rows(known)).axes[0].collections) == 4
    )  # two of ours in each of two families


def test_the_documentation_counts_each_family_and_states_its_law(monkeypatch) -> None:
    """The site takes counts from docs/data/hard_cases.json, and laws from the docstrings."""
    monkeypatch.syspath_prepend(str(ROOT / "docs" / "site_parts"))
    made = import_module("hard_cases")
    titles = [family.TITLE for family in FAMILIES.values()]
    kept = json.loads((ROOT / "docs" / "data" / "hard_cases.json").read_text(encoding="utf-8"))
    assert [each["title"] for each in kept["families"]] == titles
    assert made.laws() == {family.TITLE: getdoc(family) for family in FAMILIES.values()}
    assert all(each["holds"] + each["said"] + each["silent"] == each["figures"] for each in kept["families"])
    text = made.page("")
    assert all(f"## {title}\n" in text for title in titles)


def test_some_case_of_each_family_is_not_long() -> None:
    short = [(name, case.name) for name, family in FAMILIES.items() for case in family.CASES if not case.full]
    assert {name for name, case in short if case in SOME} == FAMILIES.keys()
    assert {case for _, case in short} >= SOME


def test_the_files_are_those_that_the_script_makes() -> None:
    """`python -m tests.campaigns.hard.chains` writes urdf/hard."""
    for name, written in (CHAINS | LONG).items():
        assert file_of(name).read_text().replace("\n", "") == written, "run python -m tests.campaigns.hard.chains"
    assert len(list(FOLDER.iterdir())) == len(CHAINS | LONG)
