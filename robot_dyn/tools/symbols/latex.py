"""Equations in LaTeX, with lines that fit a page of one column."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from typing import Any

WIDTH = 72  # of a line in characters, indices included: 345 pt, the column of `article`


def align(entries: Iterable[tuple[str, object]]) -> str:
    """Return an align* environment of amsmath with an equation for each pair of a left and a right side.

    A sum that is wider than a line is broken before a term; a product with a sum that is wider is multiplied out first.
    """
    lines = (line for left, right in entries for line in _broken(left, right))
    return "\\begin{align*}\n" + " \\\\\n".join(lines) + "\n\\end{align*}\n"


def _broken(left: str, right: Any) -> Iterator[str]:
    line = f"{left} &="
    for k, term in enumerate(_terms(right)):
        signed = term if term.startswith("-") or not k else f"+ {term}"
        if k and _width(line) + _width(signed) > WIDTH:
            yield line
            line = r"&\quad"
        line = f"{line} {signed}"
    yield line


def _terms(x: Any) -> Iterator[str]:
    """Yield the terms of a sum, products multiplied out where they are wider than a line."""
    import sympy as sp

    for term in x.as_ordered_terms():
        printed, sums = _printed(term), sp.expand_mul(term, deep=False)
        if _width(printed) > WIDTH - len("M11 = ") and sums.is_Add:
            yield from _terms(sums)
        else:
            yield printed


def _printed(x: Any) -> str:
    import sympy as sp

    return sp.latex(x, symbol_names={symbol: _letter(symbol.name) for symbol in x.free_symbols})


def _letter(name: str) -> str:
    """Return the LaTeX of a letter: of v1 a rate, of I3b_xx the index 3b,xx, of MX2 one letter and no product M X."""
    kind, body, axis = re.fullmatch(r"([A-Za-z]+?)(\d\w*?)?(?:_(\w+))?", name).groups()  # pyright: ignore[reportOptionalMemberAccess]
    head = {"v": r"\dot{q}", "alpha": r"\alpha"}.get(kind, kind if len(kind) == 1 else rf"\mathit{{{kind}}}")
    index = ",".join(filter(None, (body, axis)))
    return f"{head}_{{{index}}}" if index else head


def _width(latex: str) -> int:
    """Return the number of characters that are printed; those of both halves of a fraction."""
    return len(re.sub(r"\\(left|right|frac|dot|mathit|sqrt|quad|cdot)\b|[\\{}_^&]|(?<=\w) (?=\w)", "", latex))
