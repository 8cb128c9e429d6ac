"""Results as files: what JSON and CSV hold is what the dataclass holds, and nothing else is overwritten."""

from __future__ import annotations

import csv
import json
from dataclasses import dataclass, field
from enum import Enum
from math import inf, nan

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn.foundations import UNREPORTED, json_text, plain, reported
from robot_dyn.report import Result, ResultError
from robot_dyn.report.result import kinds
from tests.promised import check_document


class Colour(Enum):
    RED = "red"


@dataclass(frozen=True)
class Inner:
    size: float
    hidden: list[int] = field(metadata=UNREPORTED)

    @reported
    def double(self) -> float:
        """Twice the size."""
        return 2 * self.size

    @property
    def other(self) -> float:
        """Not told."""
        return 0.0


@dataclass(frozen=True)
class Odd(Result):
    robot: str
    inner: tuple[Inner, ...]
    by_name: dict[str, object]
    left_out: tuple[str, ...] = ()
    columns = ("size", "double")

    @property
    def rows(self):
        return [vars(each) | {"double": each.double} for each in self.inner]


ODD = Odd(
    "ré\n", (Inner(0.1, [1]), Inner(inf, [2])),
    {"q": np.array([[1.5, nan]]), "n": np.int64(3), "c": Colour.RED, "z": 1 + 2j, "no": None, "is": True},
)  # fmt: skip


def test_json_holds_fields_and_reported_properties_and_no_number_that_it_lacks() -> None:
    read = json.loads(json_text(ODD), parse_constant=lambda word: pytest.fail(f"{word} is not JSON"))
    assert read == plain(ODD) == {
        "robot": "ré\n", "inner": [{"size": 0.1, "double": 0.2}, {"size": None, "double": None}],
        "by_name": {"q": [[1.5, None]], "n": 3, "c": "red", "z": [1.0, 2.0], "no": None, "is": True},
        "left_out": [], "interrupted": False,
    }  # fmt: skip


def test_csv_holds_the_rows_and_json_all_of_any_result(tmp_path) -> None:
    with ODD.save(tmp_path / "odd").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert file.name.endswith("odd.csv")  # there is no figure of it
    assert [(float(row["size"]), float(row["double"])) for row in rows] == [(0.1, 0.2), (inf, inf)]
    assert json.loads(ODD.save(tmp_path / "odd.json").read_text(encoding="utf-8")) == plain(ODD)
    assert ODD.save(tmp_path / "odd.json").exists()  # it replaces its own kind


@pytest.mark.parametrize(("name", "content"), [("odd.csv", "price,stock\n1,2"), ("odd.json", '{"robot": 1}')])
def test_files_of_another_kind_are_not_replaced(tmp_path, name: str, content: str) -> None:
    (tmp_path / name).write_text(content)
    with pytest.raises(ResultError, match="so it is not replaced"):
        ODD.save(tmp_path / name)
    assert (tmp_path / name).read_text() == content


def test_each_drawing_is_of_a_result_with_a_table() -> None:
    for each in (each for each in Result.__subclasses__() if each.diagram):
        assert [kind.suffix for kind in kinds(each)] == [".png", ".svg", ".pdf", ".csv", ".json"]


def test_advice_has_the_keys_that_are_promised() -> None:
    made = plain(rd.advise(rd.Setup(rd.Plant(rd.load("pendulum")), [0.3], duration_s=0.1, method="RK4")))
    check_document("advise", made)
