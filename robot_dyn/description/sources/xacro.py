"""Expansion of xacro macros by the reference implementation, the package xacro.

xacro evaluates expressions of the file as Python; its filter stops mistakes, not attackers: **a xacro file is a
program**. It is expanded only on request, in a separate process with limits on time and memory, because xacro keeps
state in its module and writes to stderr. The result is read like any other file.
"""

from __future__ import annotations

import json
import re
import subprocess
import sys
from collections.abc import Iterable, Mapping
from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

from robot_dyn.description import catalog
from robot_dyn.foundations.errors import DescriptionError, RobotDynError, nearest, shorten, shown

SECONDS = 60  # time limit of an expansion
MEMORY = 2 << 30  # bytes
_UNDEFINED = re.compile(r"Undefined substitution argument (\w+)")

_CHILD = """
import json, sys
sys.path[:] = json.loads(sys.argv[1])
from robot_dyn.description.sources.xacro import answer
answer()
"""


class Expansion(NamedTuple):
    """An expanded xacro file.

    Attributes:
        text: The URDF, with a line for each element, as the command `xacro` writes it.
        warnings: Warnings of xacro.
        places: For each element of the text, in its order, the line from which it comes and the macro calls that led
            there, innermost first: "line 3 of arm.xacro, macro arm called in line 9". The checked file is not named.
    """

    text: bytes
    warnings: list[str]
    places: list[str]


def expand(path: Path, arguments: Mapping[str, str | float | bool], package_dirs: Iterable[str | Path]) -> Expansion:
    """Expand a xacro file.

    Args:
        path: The file.
        arguments: Values of its `<xacro:arg>` elements by name: texts, numbers or booleans.
        package_dirs: Folders that `$(find package)` searches first, see `packages`.

    Raises:
        DescriptionError: If xacro is not installed, fails, takes too long, or has no such argument.
    """
    if find_spec("xacro") is None:
        raise DescriptionError(f"{path}: to expand it, the package xacro is needed; pip install robot-dyn[xacro]")
    if not isinstance(arguments, Mapping):
        raise DescriptionError(f"xacro must be a mapping of names to values, for example {{}}, got {shown(arguments)}")
    order = {
        "path": str(path),
        "arguments": {str(name): _text(str(name), value) for name, value in arguments.items()},
        "package_dirs": [str(Path(folder).expanduser().absolute()) for folder in package_dirs],
    }
    command = [sys.executable, "-P", "-c", _CHILD, json.dumps(sys.path)]  # -P: no module of the working directory
    try:
        child = subprocess.run(
            command, input=json.dumps(order), capture_output=True, encoding="utf-8", errors="replace", timeout=SECONDS
        )
    except subprocess.TimeoutExpired:
        raise DescriptionError(f"{path}: expanding its macros takes over {SECONDS} s; simplify them") from None
    warnings = [line.removeprefix("warning: ") for line in child.stderr.splitlines() if line.startswith("warning: ")]
    try:
        result = json.loads(child.stdout)
    except ValueError:
        last = shorten((child.stderr.splitlines() or ["no memory or no time left"])[-1], 200)
        raise DescriptionError(f"{path}: the expansion ended without a result ({last}); simplify its macros") from None
    if "error" in result:
        raise DescriptionError(f"{path}: xacro rejects it: {shorten(result['error'], 400)}; {result['remedy']}")
    for name in result["unknown"]:
        raise DescriptionError(f"{path}: xacro has no argument {name!r} in it; {nearest(name, result['known'])}")
    warnings = [f"xacro: {shorten(line, 200)}" for line in dict.fromkeys(warnings)]
    return Expansion(result["text"].encode(), warnings, result["places"])


def _text(name: str, value: Any) -> str:
    """Return a value in the form that xacro reads."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str | int | float | Path):
        return str(value)
    raise DescriptionError(f"xacro: {name!r} must be a string, a number or a boolean, got {shown(value)}")


class _Arguments(dict[str, str]):
    """Arguments that record which names the file declares or uses."""

    def __init__(self, arguments: Mapping[str, str]) -> None:
        super().__init__(arguments)
        self.used: set[str] = set()

    def __contains__(self, name: object) -> bool:
        self.used.add(str(name))
        return super().__contains__(name)

    def __getitem__(self, name: str) -> str:
        self.used.add(name)
        return super().__getitem__(name)


def answer() -> None:
    """Run the child process: read an order from stdin, write the URDF or an error to stdout."""
    order = json.load(sys.stdin)
    with suppress(ImportError, OSError, ValueError):  # this system has no such limits
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
        resource.setrlimit(resource.RLIMIT_CPU, (SECONDS, SECONDS))
    path, arguments = Path(order["path"]), _Arguments(order["arguments"])
    _serve_packages(path, order["package_dirs"])
    import xacro  # pyright: ignore[reportMissingImports]

    _record_places(xacro)

    try:
        document: Any = xacro.process_file(str(path), mappings=arguments)
        text = document.toprettyxml(indent="  ")
        places = [_place(element, str(path)) for element in document.getElementsByTagName("*")]
    except Exception as error:  # xacro and the file's expressions can raise anything
        file = (xacro.filestack or [path])[-1]
        why, remedy = _why(error)
        print(json.dumps({"error": f"{why} (in {file})", "remedy": remedy}))
        return
    unknown = sorted(set(order["arguments"]) - arguments.used)
    known = sorted(arguments.used - set(unknown))
    print(json.dumps({"text": text, "unknown": unknown, "known": known, "places": places}))


def _record_places(xacro: Any) -> None:
    """Record where each element is written, and the macro calls in which it is copied; xacro keeps neither."""
    from xml.dom import expatbuilder, minidom

    if not (hasattr(xacro, "filestack") and hasattr(xacro, "handle_macro_call")):
        return  # another version of xacro: findings then have no places

    builder: Any = expatbuilder.ExpatBuilderNS
    start, clone, call = builder.start_element_handler, minidom._clone_node, xacro.handle_macro_call  # pyright: ignore[reportAttributeAccessIssue]
    calls: list[tuple[str, Any]] = []

    def placed(self: Any, name: str, attributes: Any) -> None:
        start(self, name, attributes)
        self.curNode.place = xacro.filestack[-1], self.getParser().CurrentLineNumber

    def copied(node: Any, deep: bool, owner: Any) -> Any:
        copy = clone(node, deep, owner)
        if place := getattr(node, "place", None):
            copy.place, copy.calls = place, [*reversed(calls)]
        return copy

    def called(node: Any, *tables: Any) -> Any:
        calls.append((node.tagName.removeprefix("xacro:"), getattr(node, "place", None)))
        try:
            return call(node, *tables)
        finally:
            calls.pop()

    builder.start_element_handler, minidom._clone_node, xacro.handle_macro_call = placed, copied, called  # pyright: ignore[reportAttributeAccessIssue]


def _place(element: Any, main: str) -> str:
    """Return the place of an element, see `Expansion`."""

    def line(place: tuple[str, int]) -> str:
        return f"line {place[1]}" + ("" if str(place[0]) == main else f" of {Path(place[0]).name}")

    if (place := getattr(element, "place", None)) is None:
        return ""
    calls = [f"macro {name} called in {line(at)}" for name, at in getattr(element, "calls", []) if at is not None]
    return ", ".join([line(place), *calls])


def _why(error: BaseException) -> tuple[str, str]:
    """Return the error of xacro, or of `_serve_packages` if that is its cause, and the remedy."""
    cause = error
    while isinstance(cause := getattr(cause, "exc", None), BaseException):
        if isinstance(cause, RobotDynError):
            why, _, remedy = str(cause).rpartition("; ")
            return why, remedy
    why = " ".join(str(error).split()) or type(error).__name__
    if undefined := _UNDEFINED.search(why):
        return why, f"give it a value: xacro={{'{undefined[1]}': …}} of load, --xacro {undefined[1]}=…"
    return why, "correct the file"


def _serve_packages(path: Path, package_dirs: list[str]) -> None:
    """Provide the ROS 2 module in which xacro looks up the folder of a package."""
    module = ModuleType("ament_index_python.packages")
    module.get_package_share_directory = lambda name: str(catalog.package(name, path, package_dirs))  # pyright: ignore[reportAttributeAccessIssue]
    sys.modules |= {"ament_index_python": ModuleType("ament_index_python"), module.__name__: module}
