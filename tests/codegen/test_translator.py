"""Plain functions as machine code do what Python does, or are refused, or say what went wrong."""

from __future__ import annotations

import ast
import math
import random
import sys
from contextlib import suppress
from math import frexp
from typing import Any, NamedTuple

import numpy as np
import pytest

from robot_dyn.codegen import INSTEAD, MachineFunction
from robot_dyn.codegen.loops.expressions import EXPRESSIONS
from robot_dyn.codegen.loops.source import SubsetError
from robot_dyn.codegen.loops.statements import STATEMENTS
from robot_dyn.foundations import MachineCodeError, TraceError
from tests.codegen.cells import cell
from tests.long import long, stress


def compiled(function: Any) -> Any:
    return MachineFunction(function, INSTEAD, lambda: None, "").calls()


def defined(text: str, **known: Any) -> Any:
    """A function of a source that can be read, as of a cell of a notebook."""
    return cell(text, np=np, frexp=frexp, **known).f


class Writer:
    """A random program of the subset: floats a, b, c, integers i, j, k, truth values, arrays x and n."""

    def __init__(self, seed: int) -> None:
        self.random, self.lines, self.depth = random.Random(seed), [], 0

    def choice(self, *of: str) -> str:
        return self.random.choice(of)

    def number(self, deep: int = 0) -> str:
        if deep > 3 or self.random.random() < 0.25:
            return self.choice(
                "a", "b", "c", "x[i % 4]", "x[j % 4]", "x[-1]", "y[k % 3, 1]", "0.5", "-1.25", "1e-3", "2.0"
            )
        made = self.number(deep + 1), self.number(deep + 1)
        return self.choice(
            f"({made[0]} + {made[1]})", f"({made[0]} - {made[1]})", f"({made[0]} * {made[1]})",
            f"({made[0]} / ({made[1]} * {made[1]} + 0.5))", f"abs({made[0]})", f"max({made[0]}, {made[1]})",
            f"min({made[0]}, {made[1]}, a)", f"np.sqrt(abs({made[0]}))", f"np.sign({made[0]})", f"(-{made[0]})",
            f"({made[0]} if {self.truth(deep + 1)} else {made[1]})", f"float({self.integer(deep + 1)})",
            f"(abs({made[0]}) + 0.5) ** {self.choice('2', '-1', '0.5', '(k % 4)')}", f"np.spacing(abs({made[0]}))",
            f"np.nextafter({made[0]}, {made[1]})", f"frexp({made[0]})[0]", f"min(max({made[0]}, -9.0), 9.0)",
        )  # fmt: skip

    def integer(self, deep: int = 0) -> str:
        if deep > 3 or self.random.random() < 0.4:
            return self.choice("i", "j", "k", "n[i % 3]", "len(x)", "y.shape[1]", "3", "-2", "x.size")
        made = self.integer(deep + 1), self.integer(deep + 1)
        return self.choice(
            f"({made[0]} + {made[1]})", f"({made[0]} - {made[1]})", f"(({made[0]}) % 11 * (({made[1]}) % 7))",
            f"({made[0]} // ({made[1]} % 5 + 1))", f"({made[0]} % ({made[1]} % 5 - 6))", f"abs({made[0]})",
            f"max({made[0]}, {made[1]})", f"({made[0]} if {self.truth(deep + 1)} else {made[1]})",
            f"int(min(max({self.number(deep + 1)}, -99.0), 99.0))",
        )  # fmt: skip

    def truth(self, deep: int = 0) -> str:
        sign = self.choice("<", "<=", ">", ">=", "==", "!=")
        if deep > 2:
            return f"({self.choice('i', 'j', 'k')} {sign} {self.choice('i', 'j', '2')})"
        return self.choice(
            f"({self.number(deep + 1)} {sign} {self.number(deep + 1)})",
            f"({self.integer(deep + 1)} {sign} {self.integer(deep + 1)})",
            f"({self.truth(deep + 1)} and {self.truth(deep + 1)})",
            f"({self.truth(deep + 1)} or {self.truth(deep + 1)})", f"(not {self.truth(deep + 1)})",
            f"(-3 < {self.integer(deep + 1)} <= {self.integer(deep + 1)})",
        )  # fmt: skip

    def write(self, text: str) -> None:
        self.lines.append("    " * (self.depth + 1) + text)

    def statement(self) -> None:
        kind = self.random.randrange(12 if self.depth < 3 else 7)
        if kind == 0:
            self.write(f"{self.choice('a', 'b', 'c')} = {self.number()}")
        elif kind == 1:
            self.write(f"{self.choice('i', 'j', 'k')} = ({self.integer()}) % 1000")
        elif kind == 2:
            to = self.choice("a", "b", "c", "x[k % 4]", "y[i % 3, j % 2]")
            self.write(f"{to} {self.choice('+', '-', '*')}= {self.number()}")
        elif kind == 3:
            self.write(
                f"x[{self.choice('0', '-2', 'i % 4', 'k % 4')}], n[j % 3] = {self.number()}, ({self.integer()}) % 1000"
            )
        elif kind == 4:
            self.write("a, b, c = b, c, a")
        elif kind == 5:
            self.write(self.choice("x[1:3] = c", "y[...] = a", "y[:, 0] = b", "x[: k % 5] = 0.25"))
        elif kind == 6:
            self.write(f"a = view(y[{self.choice('i % 3', '-1')}], x[1:], b)")
        elif kind in (7, 8):
            self.write(f"if {self.truth()}:")
            self.block()
            if self.random.random() < 0.5:
                self.write("else:")
                self.block()
        elif kind in (9, 10):
            name = f"r{len(self.lines)}"
            self.write(f"for {name} in {self.choice('range(5)', 'range(i % 4, 9, 2)', 'range(6, -1, -2)', 'n')}:")
            self.block(f"k = {name} % 50", self.choice("continue", "break"))
        else:
            name = f"w{len(self.lines)}"
            self.write(f"{name} = 0")
            self.write(f"while {name} < 4:")
            self.block(f"{name} += 1", "break")

    def block(self, first: str = "pass", leave: str = "") -> None:
        self.depth += 1
        self.write(first)
        for _ in range(self.random.randrange(1, 4)):
            self.statement()
        if leave and self.random.random() < 0.4:
            self.write(f"if {self.truth()}:")
            self.write(f"    {leave}")
        self.depth -= 1

    def program(self) -> str:
        for _ in range(8):
            self.statement()
        return "\n".join(["def f(a, b, c, i, j, k, x, y, n):", *self.lines, "    return a, b, c, i, j, k"]) + "\n"


def view(row: Any, x: Any, s: float) -> float:
    """A function that is called with views."""
    total = 0.0
    for e in range(len(row)):
        row[e] = row[e] * 0.5 + s
        total += row[e] - x[e]
    return total


def same(x: Any, y: Any) -> None:
    """Bits of floats; integers."""
    for mine, theirs in zip(x, y, strict=True):
        a, b = np.asarray(mine), np.asarray(theirs)
        np.testing.assert_array_equal(a, b)
        if a.dtype == float:
            np.testing.assert_array_equal(np.signbit(a[~np.isnan(a)]), np.signbit(b[~np.isnan(b)]))


@pytest.mark.parametrize(
    "seeds", [range(10), *long([range(10, 30)]), *stress([range(30, 200)])], ids=["10", "30", "200"]
)
def test_random_programs_do_what_python_does(seeds: range) -> None:
    """From 4 general starts: results and every array, to the last bit. Scalars are NumPy's, by IEEE 754."""
    compared = 0
    for seed in seeds:
        text = Writer(seed).program()
        function = defined(text, view=view)
        machine = compiled(function)
        rng = np.random.default_rng(seed)
        for _ in range(4):
            numbers = [
                *map(np.float64, rng.normal(size=3) * 10.0 ** rng.integers(-2, 3, 3)),
                *map(int, rng.integers(-9, 99, 3)),
            ]
            arrays = [rng.normal(size=4), rng.normal(size=(3, 4))[:, 1:3], rng.integers(-5, 50, 3)]
            ours, theirs = [x.copy() for x in arrays], [x.copy() for x in arrays]
            ours[1], theirs[1] = (np.zeros((3, 5))[:, ::2][:, :2] for _ in range(2))
            ours[1][...] = theirs[1][...] = arrays[1]
            with np.errstate(all="ignore"):
                try:
                    expected = function(*numbers, *theirs)
                except OverflowError:  # of a float without an integer, or a Python float beyond
                    continue
            compared += 1
            try:
                same(machine(*numbers, *ours), expected)
                same(ours, theirs)
            except AssertionError as error:
                raise AssertionError(f"seed {seed}\n{text}\n{error}") from None
    assert compared > 3 * len(seeds)


class Two(NamedTuple):
    x: np.ndarray
    inner: Any


class Inner(NamedTuple):
    s: float
    k: int
    flag: bool
    key: np.ndarray


def test_records_hold_records_and_all_kinds_of_numbers() -> None:
    """Fields of nested named tuples; unsigned words wrap, as NumPy's."""

    def f(two, scale):
        total = 0.0
        for e in range(len(two.x)):
            total += two.x[e] * scale
        if two.inner.flag:
            total += two.inner.s
        word = (two.inner.key[0] * two.inner.key[1]) ^ (two.inner.key[0] >> np.uint64(7))
        return total, two.inner.k * 2, word, two.inner.flag

    two = Two(np.array([1.5, -2.25]), Inner(0.125, 7, True, np.array([2**63 + 12345, 987654321987], np.uint64)))
    with np.errstate(over="ignore"):
        expected = f(two, 3.0)
    assert compiled(f)(two, 3.0) == expected


LARGE = 2**62


@pytest.mark.parametrize(
    ("text", "given", "message"),
    [
        ("return x[i]", (np.ones(3), 3), "line 2: an index is out of range"),
        ("return x[i]", (np.ones(3), -4), "an index is out of range"),
        ("x[i] = 1.0", (np.ones(3), 5), "an index is out of range"),
        ("return i // (len(x) - 3)", (np.ones(3), 5), "an integer is divided by zero"),
        ("return i % (len(x) - 3)", (np.ones(3), 5), "an integer is divided by zero"),
        ("return i + i", (np.ones(3), LARGE), "an integer overflows 64 bits"),
        ("return i * 3", (np.ones(3), LARGE), "an integer overflows 64 bits"),
        ("return -i - i - 1", (np.ones(3), LARGE), "an integer overflows 64 bits"),
        ("return (-i - i) // (2 - len(x))", (np.ones(3), LARGE), "an integer overflows 64 bits"),
        ("return abs(-i - i)", (np.ones(3), LARGE), "an integer overflows 64 bits"),
        ("return int(x[0])", (np.full(3, 1e19), 0), "a float does not fit an integer of 64 bits"),
        ("return int(x[0])", (np.full(3, np.nan), 0), "a float does not fit an integer of 64 bits"),
        ("return np.uint64(i)", (np.ones(3), -1), "np.uint64 of a negative number"),
        ("y = x.reshape((i, 2))\n    return y[0, 0]", (np.ones(3), 2), "a shape has a different number of entries"),
        ("copy(x[i:], x[1:])", (np.ones(3), 2), "a copy between arrays of different shapes"),
    ],
)  # fmt: skip
def test_what_goes_wrong_ends_the_call_with_its_line(text: str, given: Any, message: str) -> None:
    """Indices out of range, integers that overflow, divisions of integers by zero: checked, in each call."""
    from robot_dyn.integrate.primitives import copy

    with pytest.raises(MachineCodeError, match=message):
        compiled(defined(f"def f(x, i):\n    {text}\n", copy=copy))(*given)


def test_a_failure_passes_through_the_functions_that_call() -> None:
    """With the line of the innermost one."""

    def inner(x, i):
        return x[i] + 1.0

    def outer(x, i):
        return inner(x, i) * 2.0

    machine = compiled(outer)
    assert machine(np.ones(3), 2) == machine(np.ones(3), -1) == 4.0
    with pytest.raises(MachineCodeError, match=r"inner, line \d+: an index is out of range"):
        machine(np.ones(3), 3)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("return [a for a in x]", "ListComp"),
        ("return {1: x}", "Dict"),
        ("with x:\n        pass", "the statement With"),
        ("try:\n        pass\n    except ValueError:\n        pass", "the statement Try"),
        ("def g():\n        pass", "the statement FunctionDef"),
        ("raise ValueError", "the statement Raise"),
        ("return x @ x", "an operation on a value that is not a number"),
        ("return x + 1.0", "an operation on a value that is not a number"),
        ("x[0:2] = x[1:3]", "an operation on a value that is not a number"),
        ("return np.sin(x[0])", "the call np.sin"),
        ("return print(x)", "the call print"),
        ("return x.sum()", "the attribute x.sum"),
        ("return max(x[0], initial=1)", "an argument by name"),
        ("return x[::2]", "a slice with a step"),
        ("i = 1\n    i = x[0] * i\n    i = len(x)\n    return i", "an integer where another branch has a float"),
        ("if len(x) > 2:\n        y = 1.0\n    return y", "'y', which may have no value here"),
        ("for i in range(len(x)):\n        y = 1.0\n    return y", "'y', which may have no value here"),
        ("while True:\n        if x[0] > 1:\n            break\n        y = 1.0\n    return y", "'y', which may"),
        ("if x[0] > 1:\n        return 1.0", "a function that ends without its result"),
        ("y = x\n    y = 1.0\n    return y", "of different types"),
        ("return nothing", "the undefined name 'nothing'"),
        ("return x[0] % 2.0", "Mod of numbers of type float"),
        ("return len(x) ** 2", "a power of an integer"),
        ("return f(x)", "the recursive function 'f'"),
        ("return (x[0] > 1) + (x[1] > 1)", "arithmetic of two truth values"),
        ("return x[0] and x[1]", "and, or of values that are not truth values"),
        ("return x is x", "is not a number"),
        ("return x[0] in x", "is not a number"),
        ("for i in range(3):\n        pass\n    else:\n        pass", "else of a loop"),
        ("global z\n    return 1", "the statement Global"),
        ("return 1 // 0", "an operation on constants"),
        ("return np.uint64(1) + 1.0", "a number of type float where uint is required"),
        ("y = x[0:1, 0:1]\n    return y[0]", "2 indices of an array with 1 axes"),
    ],
)  # fmt: skip
def test_what_is_outside_the_subset_is_refused_with_line_and_remedy(text: str, message: str) -> None:
    with pytest.raises(SubsetError, match=rf"<cell -?\d+>, line \d+, in f: .*({message}).*; \w+"):
        compiled(defined(f"def f(x):\n    {text}\n"))(np.ones(3))


def test_a_function_without_source_and_one_that_was_edited_are_refused(tmp_path: Any) -> None:
    """The tree that is translated is that of the code which runs, not of a file that was saved since."""
    scope: dict[str, Any] = {}
    exec("def f(x):\n    return x", scope)
    with pytest.raises(SubsetError, match="without its source"):
        compiled(scope["f"])(1.0)
    file = tmp_path / "mine.py"
    file.write_text("def f(x):\n    return x + 1.0\n")
    exec(compile(file.read_text(), str(file), "exec"), scope)
    file.write_text("def f(x):\n    return x + 2.25\n")
    with pytest.raises(SubsetError, match=r"changed since it was read is .*; import the module again"):
        compiled(scope["f"])(1.0)


def test_arrays_of_one_form_may_differ_in_what_may_be_done_with_them() -> None:
    """Each call takes the type of its own arrays: contiguous, strided, read-only, of a subclass, empty."""

    def f(x, y):
        total = 0.0
        for i in range(len(x)):
            total += x[i] * (i + 1)
        y[0] = total
        return total

    function, y, plain = compiled(f), np.zeros(1), np.arange(1.0, 4.0)
    frozen = plain.copy()
    frozen.setflags(write=False)
    for x in (plain, np.repeat(plain, 2)[::2], frozen, plain[::-1].copy()[::-1], plain.view(np.recarray), plain[:0]):
        assert function(x, y) == y[0] == (14.0 if len(x) else 0.0)
    with pytest.raises(SubsetError, match="read-only"):
        function(plain, frozen)
    assert function(plain, y) == 14.0


@pytest.mark.parametrize(
    "wrong",
    [
        np.ones(3, ">f8"), np.ones(3, np.float32), np.ones(3, "M8[s]"), np.ones(3, object), np.ones(3, "S0"),
        np.ones(3, [("x", float)]), np.array(1.0), np.frombuffer(bytes(25), offset=1),
        np.zeros(3, np.dtype([("a", "i1"), ("x", float)]))["x"],
    ],
    ids=str,
)  # fmt: skip
def test_arrays_that_machine_code_cannot_read_are_refused(wrong: np.ndarray) -> None:
    """Each time, and an aligned array of the same form is read."""

    def f(x):
        return 0.0 if len(x) == 0 else x[0]

    function = compiled(f)
    for _ in range(2):
        with pytest.raises(TraceError):
            function(wrong)
        assert function(np.ones(3)) == 1.0


def test_no_array_is_kept_by_its_reading() -> None:
    arrays = [np.ones(3), np.ones((3, 2))[:, :1], np.ones(3, "M8[s]"), np.ones(3).view(np.recarray)]
    function = MachineFunction(lambda x: 0, INSTEAD, lambda: None, "")
    before = [sys.getrefcount(x) for x in arrays]
    for _ in range(20):
        for i in range(len(arrays)):
            with suppress(TraceError):
                function.check(arrays[i])
    assert [sys.getrefcount(x) for x in arrays] == before


def test_no_sum_of_products_is_contracted() -> None:
    """Of a fused product the rest would be left: (1 + ε)(1 − ε) − 1 rounds to −ε² or to 0."""

    def f(x, y, z):
        return x * y + z

    e = 2.0**-30
    assert compiled(f)(1 + e, 1 - e, -1.0) == 0.0
    assert math.ldexp(1.0, -60) == e * e


def test_the_page_names_the_syntax_of_the_subset() -> None:
    """23 kinds of nodes, each on the page."""
    from pathlib import Path

    page = (Path(__file__).parents[2] / "docs" / "developers" / "extending.md").read_text()
    nodes = [each.__name__ for each in (*EXPRESSIONS, *STATEMENTS, ast.Slice)]
    assert len(nodes) == 23
    assert [name for name in nodes if f"`{name}`" not in page] == []


def test_arguments_may_change_between_calls() -> None:
    """Other arrays, other types, other numbers: words are made again for what is another object."""

    def f(x, n):
        return x[0] * n

    machine = compiled(f)
    x = np.array([2.0, 3.0])
    for given, expected in [((x, 2), 4.0), ((x, 3), 6.0), ((x[1:], 3), 9.0), ((x[::-1], 3), 9.0), ((x, 0.5), 1.0),
                            ((x[1:], 0.5), 1.5), ((x[1:], 2), 6.0), ((x, 2), 4.0)]:  # fmt: skip
        assert machine(*given) == expected
    x[0] = 7.0
    assert machine(x, 2) == 14.0
