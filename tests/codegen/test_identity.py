"""The key of compiled code holds everything that it depends on."""

from __future__ import annotations

from pathlib import Path

import pytest

import robot_dyn as rd
from robot_dyn.codegen.store.keys import digest, digest_of_files, sources_of_the_writer, traced_sources

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
    rd.Compiled(rd.load("planar_2r"), cache=False).M([0.1, 0.2])
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
