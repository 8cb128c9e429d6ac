"""The tree: rooms that say what is in them, imports downward only, tests where what they test stands."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from pathlib import Path

import grimp
import pytest

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "robot_dyn"


def rooms() -> list[str]:
    """Folders of the package with modules in them."""
    return sorted({path.parent.relative_to(PACKAGE).as_posix() for path in PACKAGE.rglob("*.py")} - {"."})


@pytest.mark.parametrize("room", rooms())
def test_a_room_says_what_is_in_it(room: str) -> None:
    assert ast.get_docstring(ast.parse((PACKAGE / room / "__init__.py").read_text(encoding="utf-8")))


def test_each_top_room_has_a_readme() -> None:
    top = [path.parent for path in PACKAGE.glob("*/__init__.py")]
    assert [room.name for room in top if not (room / "README.md").exists()] == []


def test_files_that_pages_of_developers_name_exist() -> None:
    """A name such as `plant.py`, `lagrange/tree.py` or `geometry/` is of the room, the package or the repository."""
    developers = ROOT / "docs" / "developers"
    count = 0
    for page in [*PACKAGE.rglob("README.md"), developers / "architecture.md", *(developers / "decisions").glob("*.md")]:
        names = re.findall(r"`((?:\w+/)+(?:\w+\.\w+)?|\w+\.py)`", page.read_text(encoding="utf-8"))
        missing = [name for name in names if not any((at / name).exists() for at in (page.parent, PACKAGE, ROOT))]
        assert not missing and (names or PACKAGE not in page.parents), page
        count += len(names)
    assert count > 50


def test_tests_stand_in_the_rooms_of_what_they_test() -> None:
    """Each folder of tests mirrors a folder of the package; the rest are campaigns and tests of the whole package."""
    folders = {path.parent.relative_to(ROOT / "tests").as_posix() for path in (ROOT / "tests").rglob("test_*.py")}
    assert {each for each in folders - {"."} if not each.startswith("campaigns")} <= set(rooms())


def test_imports_go_downward() -> None:
    """The contracts of import-linter in pyproject.toml: one column of rooms, tools above it, no tool knows another."""
    linter = [sys.executable, "-c", "from importlinter.cli import lint_imports_command as c; c()", "--no-cache"]
    done = subprocess.run(linter, cwd=ROOT, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stdout[-2000:]


# Modules that import in a circle, by folder; the set may only shrink. The translator's functions are recursive.
IN_CIRCLES = {
    "codegen.loops": {"arrays", "calls", "expressions", "function", "numbers", "program", "statements"},
}


def test_no_imports_in_a_circle() -> None:
    """Imports inside functions and type-checking blocks included."""
    graph = grimp.build_graph("robot_dyn", cache_dir=None)
    imported = {module: graph.find_modules_directly_imported_by(module) for module in graph.modules}
    circles = {x for x, names in imported.items() if any(graph.chain_exists(importer=y, imported=x) for y in names)}
    known = {f"robot_dyn.{room}.{name}" for room, names in IN_CIRCLES.items() for name in names}
    assert circles == known, "mend a new circle; take a mended one out of IN_CIRCLES"


def test_no_rooms_of_a_run_import_in_a_circle() -> None:
    """Imports inside functions and type-checking blocks included."""
    graph = grimp.build_graph("robot_dyn", cache_dir=None)
    for room in (of_run := graph.find_children("robot_dyn.simulation")):
        graph.squash_module(room)
    imported = {room: graph.find_modules_directly_imported_by(room) for room in of_run}
    assert not {x for x in of_run if any(graph.chain_exists(importer=y, imported=x) for y in imported[x])}
