"""Scripts of the checks: the gate of words counts what it states; the comparison of trees passes rounding alone."""

from __future__ import annotations

from textwrap import dedent

import numpy as np
import pytest
import words
from referee import results, runs, sweeps, timings
from referee.results import Result
from scipy.stats import binom

ROOM = '''
"""Of a room."""
# what is left, and what
# it is beside
from typing import Any

Array = Any
COUNT = 3  # so many

def public(x: Array, y: "list[Any]", *rest: int) -> float:
    """Return likewise, in place
    of x; `behind` is code."""
    return f"{x} is no {y}" + 'beside'

def _private(x: Any) -> Any:
    """Whether x."""
    return call(1, 2, 3, 4, 5, 6, 7, 8, [each for each in x], *x) + call(1, 2, 3, 4, 5, 6, 7, 8)

@dataclass
class Public:
    """A noun."""

    x: Array
    y: int

    def method(self) -> Any:
        for name, each in self.x.items():
            lambda each: 1

    def _method(self) -> Any:
        """Whatever it is."""
'''

PAGE = """
# Behind

```python
behind = 3  # as of
```

Prose beside `behind`, <!-- made by whatever --> [a link](beside.md) and as
of one.
"""


def places(rule: str, text: str = ROOM) -> list[int]:
    """Return the lines of the hits of a rule, without the empty first line."""
    aliases = words.aliases_of({"room": text})["room"]
    return sorted(hit.line - 1 for hit in words.in_code(text, "room.py", aliases) if hit.rule == rule)


@pytest.mark.parametrize(
    ("rule", "lines"),
    [
        ("opening", [1, 15]),
        ("what without noun", [2]),
        ("beside", [3, 12]),
        ("so many", [7]),
        ("likewise", [10]),
        ("in place of", [10]),  # over the end of a line
        ("behind", []),  # code
        ("is no", [12]),
        ("whatever", [30]),
        ("each", [16, 26]),  # loops and comprehensions, not arguments
        ("arguments", [16]),  # eight are allowed
        ("Any", [9, 9, 22, 25]),  # an alias, a quoted annotation, a field and a result
    ],
)
def test_a_rule_counts_its_places(rule: str, lines: list[int]) -> None:
    assert places(rule) == lines


def test_prose_of_a_page_is_counted_without_its_code_comments_and_addresses() -> None:
    hits = {(hit.rule, hit.line) for hit in words.in_page(PAGE, "page.md")}
    assert hits == {("behind", 2), ("beside", 8), ("as of", 8)}


def test_an_alias_of_any_is_one_wherever_it_is_imported() -> None:
    modules = {
        "a": "from typing import Any\nArray = Any",
        "b": "from a import Array as Vector\nMatrix = list[Vector]",
        "c": "from b import Matrix",
        "d": "class Array: ...",
    }
    aliases = words.aliases_of(modules)
    assert [sorted(aliases[name] - {"Any"}) for name in "abcd"] == [["Array"], ["Matrix", "Vector"], ["Matrix"], []]


def test_comments_and_strings_are_distinguished() -> None:
    text = dedent("""
        x = "# behind"  # beside 'one
        y = 'it\\'s # behind' + f"{x}#"  # beside
    """)
    assert places("beside", text) == [1, 2]
    assert places("behind", text) == [1, 2]  # once each, as literals


@pytest.mark.parametrize(("count", "complaints"), [(3, 0), (4, 1), (2, 1)])
def test_a_count_above_its_ceiling_is_an_error_and_one_below_lowers_it(count: int, complaints: int) -> None:
    assert len(words.complaints({"behind": count}, {"behind": 3})) == complaints


def test_ceilings_are_lowered_to_the_counts_and_never_raised() -> None:
    source = 'CEILINGS = {\n    "behind": 3,\n    "beside": 5,\n}\n'
    lowered = words.lowered(source, {"behind": 2, "beside": 9}, {"behind": 3, "beside": 5})
    assert lowered == 'CEILINGS = {\n    "behind": 2,\n    "beside": 5,\n}\n'


def test_there_are_twenty_phrases_and_each_rule_has_a_ceiling() -> None:
    assert set(words.CEILINGS) == set(words.BY_SYNTAX) | set(words.PHRASES)
    assert len(words.PHRASES) == 20


STORED = Result({"q": np.array([1.0, 2.0])}, {"ending": "finished", "steps": 10}, {"q": 1e-12}, {"steps": [10, 11, 10]})


def faults(values: list[float], ending: str = "finished", steps: int = 10) -> int:
    """Return the number of faults of a result beside the stored one."""
    new = Result({"q": np.array(values)}, {"ending": ending, "steps": steps})
    return len(results.compared("case", STORED, new).faults)


def test_rounding_times_growth_passes_and_more_does_not() -> None:
    assert faults([1.0, 2.0]) == 0
    assert faults([1.0, 2.0 + 99e-12]) == 0
    assert faults([1.0, 2.0 + 101e-12]) == 1
    assert faults([1.0, np.nan]) == 1
    assert faults([1.0]) == 1


def test_texts_are_equal_and_counts_as_near_as_those_of_pushed_runs() -> None:
    assert faults([1.0, 2.0], ending="diverged") == 1
    assert [faults([1.0, 2.0], steps=k) for k in (8, 9, 12, 13)] == [1, 0, 0, 1]


def test_results_are_read_as_they_were_written(tmp_path) -> None:
    results.save({"case": STORED}, tmp_path, "runs")
    row = results.compared("case", results.load(tmp_path, "runs")["case"], STORED)
    assert row.is_same and row.ratio == 0.0


def test_the_upper_end_covers_the_median_with_95_percent() -> None:
    """Of 30 values the twentieth, by the binomial distribution; of four none."""
    assert timings.upper_end([float(k) for k in range(1, 31)]) == 20.0
    assert binom.cdf(19, 30, 0.5) >= 0.95 > binom.cdf(18, 30, 0.5)
    assert timings.upper_end([1.0] * 4) == np.inf


@pytest.mark.parametrize(
    ("count", "names"),
    [(runs.COUNT, runs.cases()), (sweeps.COUNT, sweeps.sweeps()), (timings.COUNT, timings.names())],
)
def test_all_cases_have_names(count: int, names: object) -> None:
    assert len(set(names)) == count  # type: ignore[call-overload]
