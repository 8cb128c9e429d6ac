"""Cases that `make test` leaves to `make test-long`."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from typing import Any

import pytest

import robot_dyn as rd

EIGHT = ("anymal_b", "cart_pole", "kinova", "mimic_chain", "panda", "planar_2r", "skew_tree", "ur5")


def long(cases: Iterable[Any]) -> list[Any]:
    """Parameters marked as long; a case of several arguments is a tuple or a `pytest.param`."""
    return [_long(case if hasattr(case, "marks") else pytest.param(*_arguments(case))) for case in cases]


def _arguments(case: Any) -> Iterable[Any]:
    return case if type(case) is tuple else [case]


def _long(case: Any) -> Any:
    return pytest.param(*case.values, id=case.id, marks=[*case.marks, pytest.mark.long])


def robots(without: Collection[str] = ()) -> list[Any]:
    """Names of the catalog; all are long but eight, of which some are trees, slide, are coupled or float."""
    names = [name for name in rd.list_robots() if name not in without]
    return [*(name for name in names if name in EIGHT), *long(name for name in names if name not in EIGHT)]
