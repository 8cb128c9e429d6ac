"""The wall: tools and tests import names that a folder lists in its `__init__.pyi`; modules of the core, modules."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "robot_dyn"
TOOLS = PACKAGE / "tools"
FOLDERS = sorted(path.parent.relative_to(ROOT).as_posix().replace("/", ".") for path in PACKAGE.rglob("__init__.pyi"))

# Modules of the core, besides what its folders list, that a tool imports, each with the reason.
EXCEPTIONS = {
    ("proof", "robot_dyn.codegen.program"): "a proof runs the instructions of compiled programs on sets",
    ("proof", "robot_dyn.codegen.trace.base_parameters"): "the equation of a proof has the fewest parameters",
    ("proof", "robot_dyn.codegen.trace.condition"): "functions of users are traced on nodes with conditions",
    ("proof", "robot_dyn.codegen.trace.origins"): "the equation of a proof has the fewest terms",
    ("sweeps", "robot_dyn.simulation.rollouts.batch"): "a sweep records as much of a batch as its figures need",
    ("sweeps", "robot_dyn.simulation.rollouts.lock_step"): "chunks are multiples of the runs of one lock step",
    ("sweeps", "robot_dyn.simulation.rollouts.overview"): "a row holds the remarks on its run",
    ("sweeps", "robot_dyn.simulation.rollouts.rollouts"): "a sweep runs batches from rows of its design",
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
