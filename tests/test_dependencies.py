"""Dependencies: what the package imports is declared, at a version that works, and what is declared is used."""

from __future__ import annotations

import ast
import re
import sys
import tomllib
from functools import cache
from importlib.metadata import packages_distributions
from pathlib import Path

import pytest
from packaging.requirements import Requirement

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
# Declared and not imported: robots that the catalog finds by path, and the page's own script.
HOMES = {
    "pinocchio": ["pin"],  # its wheel puts the module beside site-packages, where nothing is listed
    "pydantic_core": ["pydantic"],  # which pins one version of it, and documents its errors and schemas
}
BY_PATH = {"example-robot-data", "meshcat", "pycollada"}


@cache
def homes() -> dict[str, list[str]]:
    """Distributions by the modules that they install; reading all of their records takes seconds."""
    return packages_distributions() | HOMES


@cache
def imported(folder: str) -> dict[str, str]:
    """Top-level modules that the files of a folder import and Python does not have, each with one such file."""
    found: dict[str, str] = {}
    for path in sorted((ROOT / folder).rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            names = [each.name for each in node.names] if isinstance(node, ast.Import) else []
            if isinstance(node, ast.ImportFrom) and not node.level and node.module:
                names = [node.module]
            found |= {name.partition(".")[0]: str(path.relative_to(ROOT)) for name in names}
    own = {"robot_dyn", "tests", "site_parts"} | {path.stem for path in (ROOT / folder).iterdir()}
    if folder == "tests":
        own |= {path.stem for path in (ROOT / "scripts").iterdir()}
    return {name: path for name, path in found.items() if name not in own | set(sys.stdlib_module_names)}


def names(requirements: list[str]) -> set[str]:
    """Distributions, by their normalised names."""
    return {normal(re.split(r"[^\w.-]", each)[0]) for each in requirements}


def normal(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()


DECLARED = names(PROJECT["project"]["dependencies"])
EXTRA = names([each for group in PROJECT["project"]["optional-dependencies"].values() for each in group])
GROUPS = PROJECT["dependency-groups"]
DEVELOPMENT = names(GROUPS["dev"])


@pytest.mark.parametrize(
    ("folder", "allowed"),
    [
        ("robot_dyn", DECLARED | EXTRA),
        *((each, DECLARED | EXTRA | DEVELOPMENT) for each in ("tests", "scripts")),
        ("docs", DECLARED | names(GROUPS["docs"])),
    ],
)
def test_what_is_imported_is_declared(folder: str, allowed: set[str]) -> None:
    """Every module comes from a distribution that pyproject.toml names, not from one that another brings along."""
    for module, path in imported(folder).items():
        if module == "_typeshed":
            continue  # stubs that come with every type checker, imported for it alone
        if module not in homes():  # not installed: by its own name
            assert normal(module) in allowed, f"{path} imports {module}, which nothing declares"
            continue
        of = {normal(home) for home in homes()[module]}
        assert of & allowed, f"{path} imports {module}, of {of}"


def test_what_is_declared_is_used() -> None:
    used = {normal(home) for module in imported("robot_dyn") for home in homes().get(module, [module])}
    assert used >= DECLARED - BY_PATH
    assert BY_PATH <= DECLARED


def test_what_needs_asks_for_is_of_its_extra() -> None:
    """The line that an error names installs the module that was missing."""
    calls = [
        (module, constants.get(extra, extra).strip('"'))
        for path in (ROOT / "robot_dyn").rglob("*.py")
        for text in [path.read_text(encoding="utf-8")]
        for constants in [{"EXTRA": "data", "_EXTRA": "sweeps"} if re.search(r"import EXTRA|EXTRA = ", text) else {}]
        for module, extra in re.findall(r'needs\("([\w.]+)", extra=([\w"]+)\)', text)
    ]
    assert len(calls) > 3
    for module, extra in calls:
        of = PROJECT["project"]["optional-dependencies"][extra]
        top = module.partition(".")[0]
        assert names(of) & {normal(home) for home in homes().get(top, [top])}, (module, extra)
        assert names(of) <= DEVELOPMENT


def test_the_lock_holds_what_is_declared() -> None:
    """One version of each, that the declaration allows; on other Pythons than its own it asks for nothing."""
    lines = (ROOT / "requirements-dev.lock").read_text(encoding="utf-8").splitlines()
    locked = {normal(each.name): each for each in map(Requirement, lines)}
    assert len(locked) == len(lines) > 50
    for each in locked.values():
        (version,) = each.specifier
        assert version.operator == "==" and each.url is None and str(each.marker) == 'python_version == "3.11"'
    for asked in map(
        Requirement, [*PROJECT["project"]["dependencies"], *(each for group in GROUPS.values() for each in group)]
    ):
        (version,) = locked[normal(asked.name)].specifier
        assert asked.specifier.contains(version.version), asked


def test_the_source_distribution_holds_the_whole_tree() -> None:
    """Whoever unpacks it can run the tests, which read SECURITY.md and run make; hidden files are the repository's."""
    ignored = {line.strip("/") for line in (ROOT / ".gitignore").read_text(encoding="utf-8").splitlines()}
    tree = {path.name for path in ROOT.iterdir() if not path.name.startswith(".")} - ignored
    tree = {name for name in tree if not name.endswith(".egg-info") and name not in ("__pycache__", "PKG-INFO")}
    included = set(PROJECT["tool"]["hatch"]["build"]["targets"]["sdist"]["include"])
    assert tree - {"pyproject.toml"} == included  # which is always in it


def test_the_page_says_what_each_is_for() -> None:
    page = (ROOT / "docs" / "developers" / "dependencies.md").read_text(encoding="utf-8")
    rows = re.findall(r"^\| ([\w, -]+) \| ", page, flags=re.MULTILINE)
    listed = {normal(name) for row in rows for name in row.split(", ")} - {"package"}
    assert listed == DECLARED | EXTRA


def test_the_page_of_the_install_lists_every_extra() -> None:
    page = (ROOT / "docs" / "start" / "install.md").read_text(encoding="utf-8")
    extras = set(PROJECT["project"]["optional-dependencies"])
    assert set(re.findall(r"^\| `(\w+)` \| ", page, flags=re.MULTILINE)) == extras
