"""The tree: rooms that say what is in them, imports downward only, tests where what they test stands."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from collections.abc import Iterator
from importlib import import_module
from inspect import signature
from operator import attrgetter
from pathlib import Path

import grimp
import pytest
from IPython.core.completer import IPCompleter, provisionalcompleter

import robot_dyn as rd

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


TOOLS = PACKAGE / "tools"
FOLDERS = sorted(path.parent.relative_to(ROOT).as_posix().replace("/", ".") for path in PACKAGE.rglob("__init__.pyi"))

# Modules of the core, besides what its folders list, that a tool imports, each with the reason.
EXCEPTIONS = {
    ("proof", "robot_dyn.codegen.trace.base_parameters"): "the equation of a proof has the fewest parameters",
    ("proof", "robot_dyn.codegen.trace.condition"): "functions of users are traced on nodes with conditions",
    ("proof", "robot_dyn.codegen.trace.origins"): "the equation of a proof has the fewest terms",
    ("sweeps", "robot_dyn.simulation.rollouts.batch"): "a sweep records as much of a batch as its figures need",
    ("sweeps", "robot_dyn.simulation.rollouts.comparison"): "uncut sweeps are compared as uncut rollouts are",
    ("sweeps", "robot_dyn.simulation.rollouts.lock_step"): "chunks are multiples of the runs of one lock step",
    ("sweeps", "robot_dyn.simulation.rollouts.overview"): "a row holds the remarks on its run",
    ("sweeps", "robot_dyn.simulation.rollouts.rollouts"): "a sweep runs batches from rows of its design",
    ("symbols", "robot_dyn.codegen.trace.base_parameters"): "formulas in base parameters have the fewest terms",
}
MOST_EXCEPTIONS = 15
MOST_INTERNAL = 250  # statements of tests; most are on machine code, which has no other way in

Import = tuple[str, str, int]  # module, name, line


def listed(folder: str) -> dict[str, str]:
    """The names that a folder lists, and the module of each."""
    stub = ast.parse((ROOT / folder.replace(".", "/") / "__init__.pyi").read_text(encoding="utf-8"))
    found = [node for node in stub.body if isinstance(node, ast.ImportFrom)]
    own = {node.name: folder for node in stub.body if isinstance(node, ast.FunctionDef)}
    return own | {name.name: str(node.module) for node in found for name in node.names}


LISTED = {folder: listed(folder) for folder in FOLDERS}


def imports(path: Path) -> Iterator[Import]:
    """Names of the package that a file imports, in functions and for type checkers too."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module and node.module.split(".")[0] == "robot_dyn":
            yield from ((node.module, name.name, node.lineno) for name in node.names)
        elif isinstance(node, ast.Import):
            names = (name.name.rpartition(".") for name in node.names if name.name.startswith("robot_dyn."))
            yield from ((module, name, node.lineno) for module, _, name in names)


def internal(path: Path) -> list[Import]:
    """Imports of names that no folder lists."""
    return [(module, name, line) for module, name, line in imports(path) if name not in LISTED.get(module, ())]


def within(module: str, folder: str) -> bool:
    return module == folder or module.startswith(f"{folder}.")


@pytest.mark.parametrize("folder", FOLDERS)
def test_a_folder_has_the_names_that_it_lists(folder: str) -> None:
    for name, home in LISTED[folder].items():
        assert within(home, folder) or name in import_module(folder).__all__, name
        assert getattr(import_module(folder), name) is not None


@pytest.mark.parametrize("folder", FOLDERS)
def test_no_listed_name_is_that_of_a_module(folder: str) -> None:
    """`from folder import name` would give one or the other, by what was imported before."""
    at = ROOT / folder.replace(".", "/")
    modules = {path.stem for path in at.iterdir() if path.suffix == ".py" or path.is_dir()}
    assert not {name for name, home in LISTED[folder].items() if name in modules and home != folder}


@pytest.mark.parametrize("tool", sorted(path.name for path in TOOLS.iterdir() if (path / "__init__.py").exists()))
def test_a_tool_imports_names_that_folders_of_the_core_list(tool: str) -> None:
    found = {
        (str(path.relative_to(ROOT)), module, name)
        for path in (TOOLS / tool).rglob("*.py")
        for module, name, _ in internal(path)
        if not within(module, f"robot_dyn.tools.{tool}")
    }
    allowed = {module for each, module in EXCEPTIONS if each == tool}
    assert not {each for each in found if each[1] not in allowed}
    assert allowed == {module for _, module, _ in found}, "an exception that nobody needs"


def test_exceptions_are_few() -> None:
    assert len(EXCEPTIONS) <= MOST_EXCEPTIONS


def test_modules_of_the_core_import_modules() -> None:
    """Else the contracts of import-linter would not see which."""
    found = {
        (str(path.relative_to(ROOT)), module, name)
        for path in PACKAGE.rglob("*.py")
        if TOOLS not in path.parents
        for module, name, _ in imports(path)
        if LISTED.get(module, {}).get(name, module) != module
    }
    assert not found


def test_each_name_below_the_documented_ones_is_imported() -> None:
    """A folder lists no name that neither a tool nor a test needs."""
    used = {
        (module, name)
        for top in (TOOLS, ROOT / "tests", ROOT / "scripts", ROOT / "docs")
        for path in top.rglob("*.py")
        for module, name, _ in imports(path)
    }
    undocumented = {(folder, name) for folder in FOLDERS for name in LISTED[folder].keys() - set(documented(folder))}
    assert not sorted(undocumented - used)


def documented(folder: str) -> list[str]:
    """Names above `__all__` in the stub of a folder."""
    stub = (ROOT / folder.replace(".", "/") / "__init__.pyi").read_text(encoding="utf-8")
    above, found, _ = stub.partition("__all__")
    return [line.split()[-1] for line in above.splitlines() if line.startswith("from ")] if found else []


def test_tests_import_few_names_that_no_folder_lists() -> None:
    """Such imports are what keeps modules from being moved."""
    places = {(path, line) for path in (ROOT / "tests").rglob("*.py") for _, _, line in internal(path)}
    assert len(places) <= MOST_INTERNAL


TOOL_NAMES = ("doctor", "export", "identify", "motors", "proof", "step", "stress", "sweeps", "symbols")
ROOMS = ("effects", "control", "integrate", "accuracy", "tools", *(f"tools.{name}" for name in TOOL_NAMES))


@pytest.mark.parametrize("name", ROOMS)
def test_each_public_name_is_defined_where_the_stub_says(name: str) -> None:
    room = import_module(f"robot_dyn.{name}")
    assert attrgetter(name)(rd) is room
    assert room.__all__ == dir(room) != []
    for public in room.__all__:
        assert getattr(room, public) is not None
        if public in rd.__all__:
            assert getattr(room, public) is getattr(rd, public)


@pytest.mark.parametrize("name", ["", *ROOMS])
def test_the_docstring_of_a_room_is_a_map_of_its_names(name: str) -> None:
    """`help(rd.effects)` names each of them, since nobody finds what it leaves out."""
    room = attrgetter(name)(rd) if name else rd
    assert [each for each in room.__all__ if not re.search(rf"\b{each}\b", str(room.__doc__))] == []


def test_names_of_every_day_are_few_and_each_has_a_reason() -> None:
    """The table of docs/developers/decisions/names.md."""
    text = (Path(__file__).parents[1] / "docs/developers/decisions/names.md").read_text(encoding="utf-8")
    reasons = [re.findall(r"`(\w+)`", line.split("|")[1]) for line in text.splitlines() if line.startswith("| `")]
    assert sorted(name for names in reasons for name in names) == rd.__all__


def test_a_class_to_be_subclassed_states_the_methods_to_write_first() -> None:
    rooms = (rd.effects, rd.control)
    bases = ["Conservative", "Dissipative", "Active", "Bound", "Stateful", "Controller", "Stateless", "Block"]
    for name in bases:
        base = next(getattr(room, name) for room in rooms if name in room.__all__)
        after = str(base.__doc__).split("define\n\n", 1)
        assert len(after[0]) < 200, name
        methods = re.findall(r"^ +def (\w+)\((.*?)\): \.\.\. +# \S", after[1], re.MULTILINE)
        assert len(methods) == 2, name
        for method, arguments in methods:
            if hasattr(base, method):
                assert set(arguments.split(", ")) - {"z"} <= set(signature(getattr(base, method)).parameters), name


def test_options_by_keyword_complete_in_a_session() -> None:
    """IPython completes from the signature: names of edits and of the options of a run are in it."""
    completer = IPCompleter(namespace={"rd": rd, "arm": rd.load("planar_2r")})
    for text, names in {
        "arm.with_(": ["gravity=", "payload=", "mass_scale="],
        "rd.simulate(arm, ": ["duration_s=", "controller=", "on_progress="],
        "rd.rollouts(arm, ": ["duration_s=", "vary="],
        "rd.advise(arm, ": ["duration_s=", "controller="],
    }.items():
        with provisionalcompleter():
            found = {each.text for each in completer.completions(text, len(text))}
        assert found >= set(names), (text, sorted(found)[:40])


def test_an_unknown_name_of_a_room_is_an_attribute_error() -> None:
    with pytest.raises(AttributeError, match=r"module 'robot_dyn\.effects' has no attribute 'Friction'"):
        rd.effects.Friction  # noqa: B018  # pyright: ignore[reportAttributeAccessIssue]
