"""What machine code depends on is in its key, and nothing else: an object of before an edit is not used after it."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn.codegen import INSTEAD, MachineFunction
from robot_dyn.codegen.llvm import machine_code
from robot_dyn.codegen.loops import dependencies as of_loops
from robot_dyn.codegen.loops.kinds import kind_of
from robot_dyn.codegen.store import keys as identity
from robot_dyn.codegen.store.keys import digest, digest_of_files, sources_of_the_writer, traced_sources
from tests.codegen.cells import cell
from tests.codegen.test_kernel import Memory

HELPERS = """
import numpy as np
from enum import IntEnum
from typing import NamedTuple

SCALE, TABLE, WEIGHTS = 2.0, ((1.0, 2.0), (3.0, 4.0)), np.array([0.5, 0.25])

class Ended(IntEnum):
    DONE = 3

class Entries(NamedTuple):
    FIRST: int = 0

AT = Entries()

def deepest(x):
    return x * 1.5

def deeper(x):
    return deepest(x) + 1.0

def unused(x):
    return x - 1.0
"""
LOOP = """
def make(factor, then):
    def f(x, n):
        total = 0.0
        for i in range(n):
            total += deeper(x[i]) * SCALE + WEIGHTS[i % 2] * TABLE[1][0]
        total = then(total, x[AT.FIRST])
        return total * factor + Ended.DONE
    return f

def added(a, b):
    return a + b
"""
EDITS = {
    "a constant of the module": ("SCALE, TABLE", "2.0, ((1.0", "2.5, ((1.0"),
    "an entry of a tuple": ("SCALE, TABLE", "(3.0, 4.0)", "(3.5, 4.0)"),
    "an entry of an array": ("SCALE, TABLE", "[0.5, 0.25]", "[0.5, 0.75]"),
    "the type of an array": ("SCALE, TABLE", "[0.5, 0.25]", "[5, 25]"),
    "a helper": ("def deeper", "+ 1.0", "+ 1.25"),
    "a helper two calls deep": ("def deepest", "1.5", "1.75"),
    "its operation": ("def deepest", "x * 1.5", "x / 1.5"),
    "a member of an enumeration": ("class Ended", "DONE = 3", "DONE = 4"),
    "a default of a named tuple": ("class Entries", "FIRST: int = 0", "FIRST: int = 1"),
    "a number in the loop": ("def make", "Ended.DONE", "Ended.DONE + 1"),
    "an operation in the loop": ("def make", "total += deeper", "total -= deeper"),
    "a range in the loop": ("def make", "range(n)", "range(1, n)"),
    "the name of a constant": ("def make", "TABLE[1][0]", "TABLE[1][1]"),
    "what is called": ("def make", "deeper(x[i])", "deepest(x[i])"),
    "the function of the closure": ("def added", "a + b", "a - b"),
}


def built(text: str, factor: Any = 3.0) -> Any:
    """The loop of the source of a notebook's cell."""
    module = cell(text)
    return module.make(factor, module.added)


def in_another_process(function: Any, store: Any, monkeypatch: pytest.MonkeyPatch) -> Any:
    monkeypatch.setattr(machine_code, "_loaded", {})
    return MachineFunction(function, INSTEAD, lambda: store, "").calls()


X = np.array([0.3, -0.7, 1.9])


@pytest.fixture(autouse=True)
def reads_arguments() -> None:
    """What reads the words of arguments is compiled once in a process, and stands in no store of these tests."""
    MachineFunction(built(HELPERS + LOOP), INSTEAD, lambda: None, "").calls()(X, 3)


@pytest.mark.parametrize("where", EDITS)
def test_after_an_edit_the_old_object_is_not_used(where: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Wherever it is; and what comes out is what Python gives then."""
    begin, old, new = EDITS[where]
    text = HELPERS + LOOP
    at = text.index(begin)
    edited = text[:at] + text[at:].replace(old, new, 1)
    assert edited != text
    store = Memory()
    for each in (text, edited):
        function = built(each)
        assert in_another_process(function, store, monkeypatch)(X, 3) == function(X, 3)
    assert len(store) == 2 * 2  # each with a note that it is there


def test_a_value_of_the_closure_and_a_type_of_an_argument_are_in_the_key(monkeypatch: pytest.MonkeyPatch) -> None:
    store, text = Memory(), HELPERS + LOOP
    for function, x in [
        (built(text), X),
        (built(text, 3.5), X),
        (built(text, 3), X),
        (built(text), np.arange(6.0)[::2]),
    ]:
        assert in_another_process(function, store, monkeypatch)(x, 3) == function(x, 3)
    assert len(store) == 4 + 3  # types of arguments share the note


@pytest.mark.parametrize("change", ["the translator", "a version", "the processor", "what stands in for a function"])
def test_the_translator_and_the_machine_are_in_the_key(change: str, monkeypatch: pytest.MonkeyPatch) -> None:
    function = MachineFunction(built(HELPERS + LOOP), INSTEAD, lambda: None, "")
    kinds = kind_of(X), kind_of(3)
    before = function.key(kinds)
    if change == "the translator":
        monkeypatch.setattr("robot_dyn.codegen.loops.call.sources_of_the_translator", lambda: "edited")
    elif change == "a version":
        monkeypatch.setattr(identity, "version_of", lambda name: "9")
    elif change == "the processor":
        import llvmlite.binding as llvm

        monkeypatch.setattr(llvm, "get_host_cpu_name", lambda: "another")
    else:
        other = built((HELPERS + LOOP).replace("return x * 1.5", "return x * 1.25")).__globals__["deeper"]
        instead = {**INSTEAD, function.function.__globals__["deeper"]: other}
        function = MachineFunction(function.function, instead, lambda: None, "")
    assert function.key(kinds) != before


def test_a_word_in_another_file_and_a_function_that_is_not_reached_change_no_key() -> None:
    text = HELPERS + LOOP
    key = of_loops.dependencies(built(text), INSTEAD)
    assert of_loops.dependencies(built(text.replace("return x - 1.0", "return x - 2.0")), INSTEAD) == key
    assert of_loops.dependencies(built(text), INSTEAD) == key


def test_whether_machine_code_is_there_is_known_before_it_is_called(monkeypatch: pytest.MonkeyPatch) -> None:
    """In the store of another process, or in memory."""
    store, text = Memory(), HELPERS + LOOP
    machine = MachineFunction(built(text), INSTEAD, lambda: store, "")
    assert not machine.is_kept()
    machine.calls()(X, 3)
    assert machine.is_kept()
    assert MachineFunction(built(text), INSTEAD, lambda: store, "").is_kept()
    assert not MachineFunction(built(text, 9.0), INSTEAD, lambda: store, "").is_kept()
    assert MachineFunction(machine.function, INSTEAD, lambda: None, "").is_kept() is False


ROOT = Path(rd.__file__).parent


def test_an_edited_module_is_another_key(tmp_path: Path) -> None:
    """Any file, however deep; another name of a file; and nothing that is not Python."""
    below = tmp_path / "compiled" / "llvm"
    below.mkdir(parents=True)
    (below / "tanh.py").write_text("x = 1")

    def now() -> str:
        return digest_of_files(tmp_path, tmp_path.rglob("*.py"))

    digests = [now()]
    (tmp_path / "notes.txt").write_text("one")
    assert now() == digests[0]
    (below / "tanh.py").write_text("x = 2")
    digests.append(now())
    (below / "tanh.py").rename(below / "sinh.py")
    digests.append(now())
    assert len(set(digests)) == 3


def test_sources_are_in_the_keys_of_kernels_programs_and_equations(monkeypatch: pytest.MonkeyPatch) -> None:
    """A kernel's are those of the writer, a program's all that may be traced."""
    kernel = sources_of_the_writer(), {path.name for path in (ROOT / "codegen/llvm").glob("*.py")}
    assert len(kernel[0]) == 64
    assert {"writer.py", "elementary.py"} <= kernel[1]
    texts: list[list[str]] = []
    monkeypatch.setattr("robot_dyn.codegen.kernel.digest", lambda of: texts.append(of) or digest(of))
    rd.compiled(rd.load("planar_2r"), cache=False).M([0.1, 0.2])
    assert texts
    assert all(kernel[0] in each for each in texts)


def test_an_edit_of_a_plot_changes_no_key() -> None:
    """Of a program: all that may be traced, and no room above the simulation, which none of it can import."""
    traced = {path.relative_to(ROOT).as_posix() for path in traced_sources()}
    assert {
        "effects/friction.py",
        "foundations/arithmetic.py",
        "simulation/dynamics/state_equation.py",
        "codegen/trace/symbolic.py",
    } <= traced
    assert not {each for each in traced if each.startswith(("view/", "cli/", "scene/", "accuracy/", "stress_test/"))}
    assert any(path.name == "plots.py" or "plot" in path.name for path in (ROOT / "view").rglob("*.py"))
