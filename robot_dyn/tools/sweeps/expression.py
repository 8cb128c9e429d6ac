"""Events as texts over columns, such as "diverged | error > 0.1", read by Python's parser and never evaluated by it.

Comparisons of names and numbers are joined by |, & and ! (or `or`, `and` and `not`) and parentheses, in the order of
increasing precedence. Names that are not single words are quoted. A comparison with nan is unknown, by Kleene's logic:
`diverged | error > 0.1` is true for a run that diverged.
"""

from __future__ import annotations

import ast
import re
from bisect import bisect
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import reduce
from typing import Any, final

import numpy as np

from robot_dyn.foundations import SweepError, nearest, shown

_TOKEN = re.compile(
    r"\s*(?:(?P<number>[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)(?![\w.])|(?P<operator><=|>=|==|!=|[<>|&!()])"
    r"|(?P<name>[^\W\d][\w.]*(?::[\w./-]+)?(?:\[\d+\])?(?:\.\w+)?)|(?P<quoted>\"[^\"]+\"|'[^']+'))"
)
_WORDS = {"|": "or", "&": "and", "!": "not"}
_COMPARE = {
    ast.Lt: np.less, ast.LtE: np.less_equal, ast.Gt: np.greater, ast.GtE: np.greater_equal, ast.Eq: np.equal,
    ast.NotEq: np.not_equal,
}  # fmt: skip
_REMEDIES: dict[type[ast.AST], str] = {
    ast.Compare: "0.1 < x < 0.2 is x > 0.1 & x < 0.2",
    ast.Call: "functions are not supported: compute the value as a figure, and compare that",
}
_COMPARES = "compare the number with a column, by <, <=, >, >=, == or !="
_REMEDY = "put names of several words in quotes, and omit units"
_MOST = 1000  # largest number of characters
_DEEPEST = 50


@final
@dataclass(frozen=True, eq=False)
class Truth:
    """True for runs in which an event is certain, and possible, (N,); they differ where the event is unknown."""

    certain: np.ndarray
    possible: np.ndarray


@final
class Expression:
    """A parsed expression.

    Args:
        text: The expression; see above.

    Raises:
        SweepError: If the text is not an expression; the message marks the place.
    """

    def __init__(self, text: str) -> None:
        if not isinstance(text, str) or len(text) > _MOST:
            raise SweepError(f"an event is a text such as 'diverged | error > 0.1', got {shown(text)}")
        self.text = text
        self._operands: dict[str, str | float] = {}  # names and numbers, by their names in the parsed Python code
        words, self._places, self._columns, depth = [], [], [0], 0
        for kind, value, place in _tokens(text):
            depth += (value == "(") - (value == ")")
            if depth > _DEEPEST:
                raise SweepError(f"{shown(text)}: is nested too deeply")
            if kind != "operator":
                self._operands[f"_{place}"] = float(value) if kind == "number" else value
                value = f"_{place}"
            words.append(_WORDS.get(value, value))
            self._places.append(place)
            self._columns.append(self._columns[-1] + len(words[-1]) + 1)
        if not words or words[-1][0] not in "_)":  # ends with an operator
            raise self._wrong(self._columns[-1], "a name or a number is missing")
        if depth > 0:
            raise self._wrong(self._columns[-1], "a ) is missing")
        try:
            self._tree = ast.parse(" ".join(words), mode="eval").body
            self._check(self._tree)
        except SyntaxError as error:
            raise self._wrong((error.offset or 1) - 1) from None
        except (RecursionError, MemoryError):
            raise SweepError(f"{shown(text)}: is nested too deeply") from None

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the required columns."""
        return tuple(dict.fromkeys(value for value in self._operands.values() if isinstance(value, str)))

    def evaluate(self, columns: Mapping[str, np.ndarray]) -> Truth:
        """Evaluate the event in each run; raise a SweepError if a name is not a column."""
        for name in self.names:
            if name not in columns:
                raise SweepError(f"no column {name!r}; {nearest(name, columns)}")
        try:
            return self._truth(self._tree, columns)
        except RecursionError:
            raise SweepError(f"{shown(self.text)}: is nested too deeply") from None

    def _check(self, tree: ast.AST) -> None:
        """Raise a SweepError unless a tree is an event."""
        match tree:
            case ast.BoolOp(values=values):
                for value in values:
                    self._check(value)
            case ast.UnaryOp(op=ast.Not(), operand=operand):
                self._check(operand)
            case ast.Compare(left=ast.Name(id=a), ops=[_], comparators=[ast.Name(id=b)]):
                if not isinstance(self._operands[a], str) and not isinstance(self._operands[b], str):
                    raise SweepError(f"{self.text}: compares two numbers; one of them must be the name of a column")
            case ast.Name(id=name):
                if not isinstance(self._operands[name], str):
                    raise self._wrong(tree.col_offset, _COMPARES)
            case _:
                wrong = next((part for part in ast.walk(tree) if isinstance(part, ast.Call)), tree)
                raise self._wrong(getattr(wrong, "col_offset", 0), _REMEDIES.get(type(wrong), _REMEDY))

    def _truth(self, tree: Any, columns: Mapping[str, np.ndarray]) -> Truth:
        match tree:
            case ast.BoolOp(op=operator, values=values):
                parts = [self._truth(value, columns) for value in values]
                join = np.logical_or if isinstance(operator, ast.Or) else np.logical_and
                return Truth(reduce(join, [x.certain for x in parts]), reduce(join, [x.possible for x in parts]))
            case ast.UnaryOp(operand=operand):
                truth = self._truth(operand, columns)
                return Truth(~truth.possible, ~truth.certain)
            case ast.Compare(left=ast.Name(id=a), ops=[operator], comparators=[ast.Name(id=b)]):
                return self._compared(operator, self._operands[a], self._operands[b], columns)
        column = str(self._operands[tree.id])
        if (x := columns[column]).dtype != bool:
            raise SweepError(f"{column!r} is a number: compare it, for example {column} > 0.1")
        return Truth(x, x)

    def _compared(
        self, operator: ast.cmpop, a: str | float, b: str | float, columns: Mapping[str, np.ndarray]
    ) -> Truth:
        left, right = (columns[x] if isinstance(x, str) else np.float64(x) for x in (a, b))
        if bool in (left.dtype, right.dtype):
            raise SweepError("an outcome is true or false and cannot be compared with a number; remove the comparison")
        with np.errstate(invalid="ignore"):
            x = np.asarray(_COMPARE[type(operator)](left, right))
        is_known = np.asarray(~(np.isnan(left) | np.isnan(right)))
        return Truth(x & is_known, x | ~is_known)

    def _wrong(self, column: int, remedy: str = _REMEDY) -> SweepError:
        """Return the error at a column of the parsed Python code."""
        k = bisect(self._columns, column) - 1
        place = self._places[k] if k < len(self._places) else len(self.text)
        return SweepError(f"{self.text[:place]}⟨here⟩{self.text[place:]}: is not an event; {remedy}")


def _tokens(text: str) -> Iterator[tuple[str, str, int]]:
    """Yield kind, value and place of each token."""
    at, end = 0, len(text.rstrip())
    while at < end:
        match = _TOKEN.match(text, at)
        if match is None:
            place = at + len(text[at:]) - len(text[at:].lstrip())
            raise SweepError(
                f"{text[:place]}⟨here⟩{text[place:]}: {text[place]!r} is neither name, number nor comparison"
                f" (<, <=, >, >=, ==, !=)"
            )
        kind = str(match.lastgroup)
        value, place, at = match[kind], match.start(kind), match.end()
        if value in _WORDS.values():
            kind = "operator"
        yield ("name", value[1:-1], place) if kind == "quoted" else (kind, value, place)
