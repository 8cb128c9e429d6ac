"""Cases that `make test` leaves to `make test-long`, and those that both leave to `make stress`."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from typing import Any

import pytest

import robot_dyn as rd

EIGHT = ("anymal_b", "cart_pole", "kinova", "mimic_chain", "panda", "planar_2r", "skew_tree", "ur5")


def long(cases: Iterable[Any]) -> list[Any]:
    """Parameters marked as long; a case of several arguments is a tuple or a `pytest.param`."""
    return _marked(cases, pytest.mark.long)


def stress(cases: Iterable[Any]) -> list[Any]:
    """Parameters marked for `make stress`, written as those of `long`."""
    return _marked(cases, pytest.mark.stress)


def third(cases: Iterable[Any]) -> list[Any]:
    """Every third case marked as long, the others for `make stress`; written as those of `long`."""
    cases = list(cases)
    return [*long(cases[::3]), *stress(case for i, case in enumerate(cases) if i % 3)]


def _marked(cases: Iterable[Any], mark: pytest.MarkDecorator) -> list[Any]:
    made = [case if hasattr(case, "marks") else pytest.param(*_arguments(case)) for case in cases]
    return [pytest.param(*case.values, id=case.id, marks=[*case.marks, mark]) for case in made]


def _arguments(case: Any) -> Iterable[Any]:
    return case if type(case) is tuple else [case]


def robots(without: Collection[str] = ()) -> list[Any]:
    """Names of the catalog: eight, of which some are trees, slide, are coupled or float; a third of the others long."""
    names = [name for name in rd.list_robots() if name not in without]
    others = [name for name in names if name not in EIGHT]
    return [*(name for name in names if name in EIGHT), *third(others)]
