"""Every hard case of every family: within what is allowed, or said to be beyond it; the long ones by `make stress`."""

from __future__ import annotations

import pytest

from tests.hard.case import Case
from tests.hard.families import FAMILIES

SEED = 1
ALL = [
    pytest.param(case, id=f"{name}: {case.name}", marks=[pytest.mark.stress] if case.full else [])
    for name, family in FAMILIES.items()
    for case in family.CASES
]


@pytest.mark.filterwarnings("ignore::robot_dyn.ModelWarning")
@pytest.mark.parametrize("case", ALL)
def test_no_figure_is_wrong_without_a_word(case: Case) -> None:
    rows = list(case.rows(SEED))
    assert rows
    assert not [each for each in rows if each.silent]
