"""Names in README and docs exist: dotted names between backquotes resolve, and calls fit their signatures."""

from __future__ import annotations

import ast
import inspect
import re
import tomllib
from collections.abc import Iterator
from importlib import import_module
from operator import attrgetter
from pathlib import Path
from types import ModuleType, UnionType
from typing import Any, get_args, get_type_hints

import pytest

import robot_dyn as rd

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", ROOT / "CHANGELOG.md", *sorted((ROOT / "docs").rglob("*.md"))]
ROOMS = [rd, *(attrgetter(name)(rd) for name in ("effects", "control", "integrate", "accuracy"))]
TOOLS = [attrgetter(f"tools.{name}")(rd) for name in rd.tools.__all__]
CLASSES = {
    name: getattr(room, name)
    for room in [*ROOMS, *TOOLS]
    for name in room.__all__
    if inspect.isclass(getattr(room, name))
}
# Variables of the pages, with the class of their value.
VARIABLES = {
    "arm": rd.Robot,
    "robot": rd.Robot,
    "own": rd.Lagrangian,
    "plant": rd.Plant,
    "setup": rd.Setup,
    "run": rd.Trajectory,
    "runs": rd.Rollouts,
    "plan": rd.control.Plan,
    "proof": rd.tools.proof.Proof,
    "done": rd.tools.sweeps.SweepResult,
    "rd": rd,
    "robot_dyn": rd,
    "sw": rd.tools.sweeps,
}
NAMES = VARIABLES | CLASSES
FENCE = re.compile(r"^(?:```|~~~|:::).*?^(?:```|~~~|:::)[^\S\n]*$", re.MULTILINE | re.DOTALL)
CODE = re.compile(r"(`+)([^`]+?)\1")
DOTTED = re.compile(rf"(?<![\w./\"'-])(?:{'|'.join(NAMES)})(?:\.[A-Za-z_]\w*)+(?![\w/-])")
FILES = {"csv", "gif", "html", "json", "md", "mcap", "mp4", "nc", "npz", "parquet", "png", "py", "svg", "toml", "urdf"}
FILES |= {"xacro", "xml"}
with (ROOT / "pyproject.toml").open("rb") as file:
    ENTRY_POINTS = set(tomllib.load(file)["project"]["entry-points"])


def codes(text: str) -> Iterator[str]:
    """Return the texts between backquotes outside of blocks, on one line each."""
    for match in CODE.finditer(FENCE.sub("", text)):
        yield " ".join(match[2].split())


def hints(value: Any) -> dict[str, Any]:
    """Return the types of a function's result or a class's fields; none if they are imported by type checkers only."""
    try:
        return get_type_hints(value)
    except NameError:
        return {}


def member(value: Any, name: str) -> Any:
    """Return an attribute of a module or a class; of a field without a default its type, or None if unknown.

    Raises:
        AttributeError: If there is none of this name.
    """
    if inspect.isclass(value) and not hasattr(value, name):
        if any(name in vars(base).get("__annotations__", ()) for base in value.__mro__):
            return hints(value).get(name)
        raise AttributeError(f"{value.__name__} has no {name}")
    if isinstance(value, ModuleType) and not hasattr(value, name):
        return import_module(f"{value.__name__}.{name}")
    return getattr(value, name)


def resolved(dotted: str) -> Any:
    """Return the value of a dotted name, or the type of a property or field; None where the type is unknown."""
    first, *rest = dotted.split(".")
    value = NAMES[first]
    for name in rest:
        if value is None or not (inspect.isclass(value) or isinstance(value, ModuleType)):
            return None
        value = member(value, name)
        getter = getattr(value, "fget", None) or getattr(value, "func", None)
        value = hints(getter).get("return") if getter else value
        if isinstance(value, UnionType):
            value = next(kind for kind in get_args(value) if kind is not type(None))
    return value


def missing(text: str) -> list[str]:
    """Return the dotted names of a text that do not exist, with the calls that do not fit a signature."""
    problems = []
    for code in codes(text):
        for match in DOTTED.finditer(code):
            dotted = match[0]
            if dotted.rpartition(".")[2] in FILES or dotted in ENTRY_POINTS:
                continue
            try:
                resolved(dotted)
            except (AttributeError, ImportError) as error:
                problems.append(f"{dotted}: {error}")
        problems += [f"{code}: {error}" for error in misfits(code)]
    return problems


def misfits(code: str) -> Iterator[str]:
    """Return why a call such as `arm.C(q, v)` cannot be made, if it cannot; calls with … are not checked."""
    try:
        call = ast.parse(code, mode="eval").body
    except SyntaxError:
        return
    if not isinstance(call, ast.Call) or not DOTTED.fullmatch(name := ast.unparse(call.func)):
        return
    arguments = [*call.args, *(keyword.value for keyword in call.keywords)]
    if any(isinstance(x, ast.Starred) or (isinstance(x, ast.Constant) and x.value is ...) for x in arguments):
        return
    try:
        function = resolved(name)
        signature = inspect.signature(function)
    except (AttributeError, ImportError, TypeError, ValueError):
        return
    is_method = inspect.isfunction(function) and inspect.isclass(NAMES[name.partition(".")[0]])
    keywords = {keyword.arg: None for keyword in call.keywords if keyword.arg}
    try:
        signature.bind(*[None] * is_method, *call.args, **keywords)
    except TypeError as error:
        yield str(error)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.relative_to(ROOT).as_posix())
def test_names_of_a_page_exist(page: Path) -> None:
    assert missing(page.read_text(encoding="utf-8")) == []


@pytest.mark.parametrize("room", [*ROOMS, *TOOLS], ids=lambda room: room.__name__)
def test_names_of_help_exist(room: ModuleType) -> None:
    """`help(robot_dyn)` shows calls as well."""
    assert missing(str(room.__doc__)) == []


@pytest.mark.parametrize(
    "code", ["`rd.lagrange_of`", "`arm.N(q, v)`", "`Plant.mass`", "`run.error.x`", "`rd.effects.ViscousFriction.x`"]
)
def test_these_tests_can_fail(code: str) -> None:
    assert missing(code)


def test_many_names_are_checked() -> None:
    text = "".join(page.read_text(encoding="utf-8") for page in PAGES)
    assert sum(len(DOTTED.findall(code)) for code in codes(text)) > 100
