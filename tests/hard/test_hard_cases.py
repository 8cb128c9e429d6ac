"""Hard cases of every family: within what is allowed, or said to be beyond it; `make stress` runs the full ones too."""

from __future__ import annotations

import json

import pytest

from tests.hard.__main__ import DOCS
from tests.hard.case import Case
from tests.hard.chains import CHAINS, FOLDER, LONG, file_of
from tests.hard.families import FAMILIES
from tests.hard.figure import draw
from tests.hard.report import page, rows

SEED = 1
SOME = {  # one of each family
    "spatial, 7 joints", "q of 100000 rad", "double pendulum, rk4, 20000 steps", "damper of 1e+06 N m s/rad",
    "planar_2r, smooth, scenes 0 to 2", "ur5's elbow 0.1 m beyond", "planar_2r, PID in saturation",
    "double pendulum, rk4", "planar_2r", "double_pendulum", "turning and sliding", "stopped",
}  # fmt: skip
ALL = [
    pytest.param(case, id=f"{name}: {case.name}", marks=[] if case.name in SOME else [pytest.mark.long])
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


def test_some_case_of_each_family_is_not_long() -> None:
    short = [(name, case.name) for name, family in FAMILIES.items() for case in family.CASES if not case.full]
    assert {name for name, case in short if case in SOME} == FAMILIES.keys()
    assert {case for _, case in short} >= SOME


def test_the_page_says_what_its_figures_say_and_its_picture_has_a_mark_for_each() -> None:
    """docs/hard_cases.md follows from hard_cases.json and from the words of the families, as they are."""
    known = json.loads((DOCS / "hard_cases.json").read_text())
    assert (DOCS / "hard_cases.md").read_text() == page(known)
    figures = rows(known)
    drawn = sum(len(marks.get_offsets()) for marks in draw(figures).axes[0].collections)
    assert drawn == sum(row.ours for those in figures.values() for row in those)


def test_the_files_are_those_that_the_script_makes() -> None:
    """`python -m tests.hard.chains` writes urdf/hard."""
    for name, written in (CHAINS | LONG).items():
        assert file_of(name).read_text().replace("\n", "") == written, "run python -m tests.hard.chains"
    assert len(list(FOLDER.iterdir())) == len(CHAINS | LONG)
