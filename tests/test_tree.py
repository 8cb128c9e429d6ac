"""The tree: rooms of few files, files of few lines, imports downward only, tests beside what they test."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "robot_dyn"
MOST_FILES, MOST_LINES = 14, 300
ALTERNATIVES = {"effects", "control", "control/digital_loop", "integrate", "cli/commands"}  # one of a kind a file
LONGER = {"queries/dynamics.py": "the public protocol: docstrings, which say what every implementation answers"}
MOST_LONGER = 5


def rooms() -> list[str]:
    """Folders of the package with modules in them."""
    return sorted({path.parent.relative_to(PACKAGE).as_posix() for path in PACKAGE.rglob("*.py")} - {"."})


@pytest.mark.parametrize("room", [room for room in rooms() if room not in ALTERNATIVES])
def test_a_room_has_few_files(room: str) -> None:
    """Those whose files are alternatives of one kind may have more: one alternative a file."""
    files = [path.name for path in (PACKAGE / room).glob("*.py") if path.name != "__init__.py"]
    assert len(files) <= MOST_FILES, files


@pytest.mark.parametrize("room", rooms())
def test_a_room_says_what_is_in_it(room: str) -> None:
    assert ast.get_docstring(ast.parse((PACKAGE / room / "__init__.py").read_text(encoding="utf-8")))


def test_files_are_short() -> None:
    """At most 300 lines, with a few exceptions that have a reason each."""
    lengths = {
        path.relative_to(PACKAGE).as_posix(): len(path.read_text(encoding="utf-8").splitlines())
        for path in PACKAGE.rglob("*.py")
    }
    assert {name for name, length in lengths.items() if length > MOST_LINES} == set(LONGER)
    assert len(LONGER) <= MOST_LONGER and all(LONGER.values())


def test_readmes_of_rooms_are_short() -> None:
    lengths = {
        path.parent.name: len(path.read_text(encoding="utf-8").splitlines()) for path in PACKAGE.glob("*/README.md")
    }
    assert lengths.pop("model") <= 40
    assert set(lengths) == {room for room in rooms() if "/" not in room} - {"model"}
    assert max(lengths.values()) <= 15


def test_files_that_readmes_name_exist() -> None:
    """A name such as `plant.py` or `geometry/` is of the room."""
    for page in PACKAGE.glob("*/README.md"):
        names = re.findall(r"`([\w/]+\.py|\w+/)`", page.read_text(encoding="utf-8"))
        missing = [name for name in names if not any((at / name).exists() for at in (page.parent, PACKAGE, ROOT))]
        assert names and not missing, page


def test_tests_stand_in_the_rooms_of_what_they_test() -> None:
    """Each room of the package with tests has a folder of that name; the rest is batteries and whole-package tests."""
    top = {room for room in rooms() if "/" not in room}
    folders = {path.parent.relative_to(ROOT / "tests").as_posix() for path in (ROOT / "tests").rglob("test_*.py")}
    assert folders - {".", "arithmetic", "hard"} <= top | {"codegen"}


def test_imports_go_downward() -> None:
    """The contracts of import-linter in pyproject.toml: one column of rooms, no circle, no arrow up."""
    linter = [sys.executable, "-c", "from importlinter.cli import lint_imports_command as c; c()", "--no-cache"]
    done = subprocess.run(linter, cwd=ROOT, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stdout[-2000:]


@pytest.mark.parametrize("code", ["rd.load('ur5').M([0.0] * 6)", "rd.load('ur5').C([0.1] * 6, [0.2] * 6)"])
def test_a_query_loads_what_it_needs(code: str) -> None:
    """M and C of a robot load neither a compiler nor anything that draws, proves or simulates."""
    heavy = ("numba", "llvmlite", "casadi", "flint", "matplotlib", "scipy", "meshcat", "trimesh", "pydantic", "typer")
    program = f"import sys, robot_dyn as rd; {code}; print([m for m in {heavy} if m in sys.modules])"
    program += "; print(sorted({m.split('.')[1] for m in sys.modules if m.startswith('robot_dyn.')}))"
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, timeout=60, check=True
    )
    loaded, modules = done.stdout.splitlines()
    assert loaded == "[]"
    assert not {"simulation", "codegen", "effects", "control", "view", "studies", "lagrange"} & set(
        ast.literal_eval(modules)
    )
