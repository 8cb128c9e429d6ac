"""Events as texts, "diverged | error > 0.1": names, numbers, comparisons and logic, parsed here and never evaluated.

    or     = and { "|" and }          not     = ("!" | "not") not | "(" or ")" | compared
    and    = not { "&" not }          compared = value [ ("<" | "<=" | ">" | ">=" | "==" | "!=") value ]

`or` and `and` may be written for | and &. A comparison with nan is unknown, and so is what depends on it: the logic is
Kleene's, so that `diverged | error > 0.1` is known of a run that diverged.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import final

import numpy as np

from robot_dyn.foundations import SweepError, nearest, shorten, shown

_TOKEN = re.compile(
    r"\s*(?:(?P<number>[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)(?![\w.])|(?P<operator><=|>=|==|!=|[<>|&!()])"
    r"|(?P<name>[^\W\d][\w.]*(?::[\w./-]+)?(?:\[\d+\])?(?:\.\w+)?)|(?P<quoted>\"[^\"]+\"|'[^']+'))"
)
_WORDS = {"or": "|", "and": "&", "not": "!"}
_COMPARE = {
    "<": np.less, "<=": np.less_equal, ">": np.greater, ">=": np.greater_equal, "==": np.equal, "!=": np.not_equal,
}  # fmt: skip
_MOST = 1000  # characters
_DEEPEST = 50


@final
@dataclass(frozen=True, eq=False)
class Truth:
    """Of each run, whether an event is certain and whether it is possible, (N,): these differ where it is unknown."""

    certain: np.ndarray
    possible: np.ndarray


@final
class Expression:
    """An expression, parsed.

    Args:
        text: As above; a name that is no word stands in quotes.

    Raises:
        SweepError: If it is not one; marks the place.
    """

    def __init__(self, text: str) -> None:
        if not isinstance(text, str) or len(text) > _MOST:
            raise SweepError(f"an event is a text such as 'diverged | error > 0.1', got {shown(text)}")
        self.text, self._tokens, self._at, self._depth = text, _tokens(text), 0, 0
        self._tree = self._or()
        if self._at < len(self._tokens):
            raise self._wrong("ends, or goes on with | or &,", self._remedy())

    @property
    def names(self) -> tuple[str, ...]:
        """Of the columns that it needs."""
        return tuple(dict.fromkeys(value for kind, value, _ in self._tokens if kind == "name"))

    def of(self, columns: Mapping[str, np.ndarray]) -> Truth:
        """The event in each run; SweepError if a name is not that of a column."""
        for name in self.names:
            if name not in columns:
                raise SweepError(f"no column {name!r}; {nearest(name, columns)}")
        return _truth(self._tree, columns)

    def _or(self) -> tuple:
        tree = self._and()
        while self._next("|"):
            tree = ("|", tree, self._and())
        return tree

    def _and(self) -> tuple:
        tree = self._not()
        while self._next("&"):
            tree = ("&", tree, self._not())
        return tree

    def _not(self) -> tuple:
        self._depth += 1
        if self._depth > _DEEPEST:
            raise SweepError(f"{shorten(self.text)}: is nested too deeply")
        try:
            if self._next("!"):
                return ("!", self._not())
            if self._next("("):
                tree = self._or()
                if not self._next(")"):
                    raise self._wrong("has a )")
                return tree
            return self._compared()
        finally:
            self._depth -= 1

    def _compared(self) -> tuple:
        left = self._value()
        for operator in _COMPARE:
            if self._next(operator):
                right = self._value()
                if left[0] == right[0] == "number":
                    raise SweepError(f"{self.text}: compares two numbers; one of them must be the name of a column")
                return (operator, left, right)
        if left[0] == "number":
            raise self._wrong("compares the number with <, <=, >, >=, == or !=")
        return left

    def _value(self) -> tuple:
        kind, value, _ = self._tokens[self._at] if self._at < len(self._tokens) else ("end", "", 0)
        if kind not in ("name", "number"):
            raise self._wrong("has a name or a number")
        self._at += 1
        return (kind, float(value) if kind == "number" else value)

    def _next(self, operator: str) -> bool:
        found = self._at < len(self._tokens) and self._tokens[self._at][:2] == ("operator", operator)
        self._at += found
        return found

    def _remedy(self) -> str:
        """For what stands where an event could end."""
        kind, value, _ = self._tokens[self._at]
        if value in _COMPARE:
            return "; 0.1 < x < 0.2 is x > 0.1 & x < 0.2"
        if value == "(":
            return "; functions are not known: a figure may compute what is to be compared"
        return "; a name of several words stands in quotes, and units are left out" if kind == "name" else ""

    def _wrong(self, expected: str, remedy: str = "") -> SweepError:
        place = self._tokens[self._at][2] if self._at < len(self._tokens) else len(self.text)
        return SweepError(f"{self.text[:place]}⟨here⟩{self.text[place:]}: is not an event; one {expected} here{remedy}")


def _tokens(text: str) -> list[tuple[str, str, int]]:
    """Kind, value and place of each."""
    found, at = [], 0
    text_end = len(text.rstrip())
    while at < text_end:
        match = _TOKEN.match(text, at)
        if match is None:
            place = at + len(text[at:]) - len(text[at:].lstrip())
            raise SweepError(
                f"{text[:place]}⟨here⟩{text[place:]}: {text[place]!r} is neither name, number nor comparison"
                f" (<, <=, >, >=, ==, !=)"
            )
        kind = str(match.lastgroup)
        value, at = match[kind], match.end()
        if kind == "name" and value in _WORDS:
            kind, value = "operator", _WORDS[value]
        if kind == "quoted":
            kind, value = "name", value[1:-1]
        found.append((kind, value, match.start(match.lastgroup or 0)))
    return found


def _truth(tree: tuple, columns: Mapping[str, np.ndarray]) -> Truth:
    kind = tree[0]
    if kind == "name":
        x = columns[tree[1]]
        if x.dtype != bool:
            raise SweepError(f"{tree[1]!r} is a number: compare it, as {tree[1]} > 0.1")
        return Truth(x, x)
    if kind == "!":
        of = _truth(tree[1], columns)
        return Truth(~of.possible, ~of.certain)
    if kind in "|&":
        a, b = _truth(tree[1], columns), _truth(tree[2], columns)
        if kind == "|":
            return Truth(a.certain | b.certain, a.possible | b.possible)
        return Truth(a.certain & b.certain, a.possible & b.possible)
    left, right = (each[1] if each[0] == "number" else columns[each[1]] for each in tree[1:])
    if any(isinstance(x, np.ndarray) and x.dtype == bool for x in (left, right)):
        raise SweepError("an outcome is true or false: it is not compared with a number")
    with np.errstate(invalid="ignore"):
        x = np.asarray(_COMPARE[kind](left, right))
    known = np.asarray(~(np.isnan(left) | np.isnan(right)))
    return Truth(x & known, x | ~known)
