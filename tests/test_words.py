"""The gate of words counts what it states, and its ceilings only fall."""

from __future__ import annotations

from textwrap import dedent

import pytest
import words

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
