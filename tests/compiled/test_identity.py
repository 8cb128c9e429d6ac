"""What compiled code depends on is in its key, and what is taken from the inside of NumPy and Numba is looked at."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from robot_dyn.compiled import identity, overload
from robot_dyn.compiled.identity import digest, digest_of_folder
from robot_dyn.compiled.llvm import numpy_array
from robot_dyn.compiled.llvm.numpy_array import ArrayStructureError, check_structure
from robot_dyn.compiled.overload import NumbaStructureError
from tests.compiled.test_kernel import Memory


def test_an_edited_module_is_another_key(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Any file of the package, however deep; another name of a file; and nothing that is not Python."""
    below = tmp_path / "compiled" / "llvm"
    below.mkdir(parents=True)
    (below / "tanh.py").write_text("x = 1")
    (tmp_path / "notes.txt").write_text("one")
    digests = [digest_of_folder(tmp_path)]
    (tmp_path / "notes.txt").write_text("two")
    assert digest_of_folder(tmp_path) == digests[0]
    (below / "tanh.py").write_text("x = 2")
    digests.append(digest_of_folder(tmp_path))
    (below / "tanh.py").rename(below / "sinh.py")
    digests.append(digest_of_folder(tmp_path))
    assert len(set(digests)) == 3
    key = digest(["a program"])
    monkeypatch.setattr(identity, "source_digest", lambda: digests[0])
    assert digest(["a program"]) != key


def test_the_digest_is_of_this_package() -> None:
    assert identity.source_digest() == digest_of_folder(Path(identity.__file__).parents[1])


def test_numpy_keeps_its_fields_where_they_are_read(monkeypatch: pytest.MonkeyPatch) -> None:
    """PyArrayObject of NumPy 2.2 to 2.4; where a field stands elsewhere, no machine code reads an array."""
    check_structure.__wrapped__()
    for name in numpy_array.OFFSETS:
        elsewhere = numpy_array.OFFSETS[name] + 8  # of lengths, the strides
        monkeypatch.setattr(numpy_array, "OFFSETS", numpy_array.OFFSETS | {name: elsewhere})
        with pytest.raises(
            ArrayStructureError, match=rf"NumPy {np.__version__} does not keep {name} .* 2\.2 to 2\.4 do"
        ):
            check_structure.__wrapped__()
        monkeypatch.undo()


def machine(store: Any) -> Any:
    """A function of two arguments, compiled by Numba and kept."""
    import numba as nb

    number = nb.types.float64
    return overload.compiled(lambda: nb.njit(lambda x, y: int(x + 2 * y)), [number, number], store, ["x + 2 y"])


def test_a_function_of_numba_is_restored_and_may_be_called_by_others(monkeypatch: pytest.MonkeyPatch) -> None:
    """By the inner parts of Numba 0.61 to 0.68; the second function compiles nothing."""
    import numba as nb
    from numba.core import event, types

    memory, made = Memory(), []
    for _ in range(2):
        monkeypatch.setattr(overload, "_loaded", {})  # as in another process
        with event.install_recorder("numba:compile") as recorder:
            made.append(machine(memory))
        assert made[-1](1.0, 3.0) == 7
    assert not recorder.buffer
    assert made[1] is not made[0]
    callee = made[1]
    assert nb.njit(types.int64(types.float64))(lambda x: callee(x, 1.0) + 1)(2.0) == 5


def test_a_numba_without_these_parts_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    from numba.core.compiler import CompileResult

    memory = Memory()
    monkeypatch.setattr(overload, "_loaded", {})
    machine(memory)
    monkeypatch.setattr(overload, "_loaded", {})
    monkeypatch.delattr(CompileResult, "_rebuild")
    with pytest.raises(NumbaStructureError, match=r"Numba .* has no _rebuild .* versions 0\.61 to 0\.68 have"):
        machine(memory)


def test_a_compiled_robot_needs_no_numba() -> None:
    """Its import takes as long as all the rest of a query from the cache."""
    code = (
        "import sys, robot_dyn as rd\n"
        "rd.Compiled(rd.load('planar_2r'), cache=False).forward_dynamics([0.1, 0.2], [0.3, 0.4], [0.5, 0.6])\n"
        "assert 'numba' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True, timeout=60)
