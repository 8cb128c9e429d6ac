"""Events as texts: the logic is Kleene's, and nothing but names, numbers, comparisons and logic is accepted."""

from __future__ import annotations

import re
from contextlib import suppress

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robot_dyn.foundations import SweepError
from robot_dyn.tools.sweeps.expression import Expression

NAN = float("nan")
COLUMNS = {
    "diverged": np.array([True, False, False, False]),
    "error": np.array([NAN, 0.05, 0.2, 0.1]),
    "payload_mass:tool0": np.array([1.0, 2.0, 3.0, 4.0]),
    "q0[1]": np.array([-1.0, 0.0, 1.0, 2.0]),
}


def truth(text: str) -> list[str]:
    """Of each run "yes", "no" or "?"."""
    of = Expression(text).evaluate(COLUMNS)
    return ["yes" if a else "?" if b else "no" for a, b in zip(of.certain, of.possible, strict=True)]


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("diverged | error > 0.1", "yes no yes no"),
        ("error >= .1", "? no yes yes"),
        ("!(error < 1e-1)", "? no yes yes"),
        ("not error < 0.1 and not diverged", "no no yes yes"),
        ("diverged & error > 0.1", "? no no no"),
        ("payload_mass:tool0 > 2 & q0[1] != 2", "no no yes no"),
        ("'payload_mass:tool0' == 2 or diverged", "yes yes no no"),
        ("error > 0.1 | error <= 0.1", "? yes yes yes"),
        ("0.1 < error", "? no yes no"),
        ("-1 == q0[1]", "yes no no no"),
    ],
)
def test_kleene_logic(text: str, expected: str) -> None:
    """Unknown where a number is nan, unless the rest decides."""
    assert truth(text) == expected.split()


@pytest.mark.parametrize(
    "text",
    [
        "", "error >", "> 1", "error > 0.1 |", "(diverged", "diverged)", "diverged diverged", "error = 1", "1", "1 > ",
        "__import__('os').system('true')", "error > 1; diverged", "error > 0x1", "lambda: 0", "error ** 2 > 1",
        "diverged > 1", "error", "nothing > 1", "error > 0.1.2", "(" * 200 + "diverged" + ")" * 200, "a" * 2000, 3,
        None,
    ],
)  # fmt: skip
def test_anything_else_is_refused(text: str) -> None:
    with pytest.raises(SweepError):
        Expression(text).evaluate(COLUMNS)


CALL, NUMBER = "functions are not supported", "compare the number"


@pytest.mark.parametrize(
    ("text", "remedy"),
    [
        ("⟨here⟩f(x) > 1", CALL), ("⟨here⟩f(x)", CALL), ("⟨here⟩5", NUMBER), ("diverged & ⟨here⟩3", NUMBER),
        ("⟨here⟩x<1<2", "x > 0.1 & x < 0.2"), ("⟨here⟩()", ""), ("diverged | ⟨here⟩", "missing"),
        ("x > 1 | (⟨here⟩", "missing"), ("⟨here⟩", "missing"), ("(diverged⟨here⟩", "missing"), ("1<2", "two numbers"),
    ],
)  # fmt: skip
def test_what_is_no_event_is_refused_before_columns_are_known(text: str, remedy: str) -> None:
    """Where it is wrong, with the remedy."""
    with pytest.raises(SweepError, match=f"^{re.escape(text)}: .*{re.escape(remedy)}"):
        Expression(text.replace("⟨here⟩", ""))


def test_the_message_marks_the_place() -> None:
    with pytest.raises(SweepError, match="error > ⟨here⟩"):
        Expression("error > | diverged")
    with pytest.raises(SweepError, match="no column 'eror'; nearest: error"):
        Expression("eror > 1").evaluate(COLUMNS)


@given(st.text(max_size=40))
def test_no_text_raises_anything_else(text: str) -> None:
    with suppress(SweepError):
        Expression(text).evaluate(COLUMNS)


@given(st.recursive(st.sampled_from(["a", "b"]), lambda t: st.one_of(
    t.map(lambda x: f"!({x})"), st.tuples(t, t).map(lambda p: f"({p[0]}) | ({p[1]})"),
    st.tuples(t, t).map(lambda p: f"({p[0]}) & {p[1]}")), max_leaves=8))  # fmt: skip
def test_logic_is_that_of_python(text: str) -> None:
    """On truth values known to both; Python's precedence of | and & is the same."""
    a, b = np.array([True, True, False, False]), np.array([True, False, True, False])
    expected = [
        bool(eval(text.replace("!", "~"), {"a": np.bool_(x), "b": np.bool_(y)})) for x, y in zip(a, b, strict=True)
    ]
    of = Expression(text).evaluate({"a": a, "b": b})
    assert of.certain.tolist() == of.possible.tolist() == expected
