"""The reference of a public room: its names in the groups of its docstring, each as autodoc documents it."""

from __future__ import annotations

import inspect
import re
from importlib import import_module
from textwrap import dedent
from types import ModuleType

import robot_dyn
from robot_dyn.queries.dynamics import Dynamics


def page(room: str) -> str:
    """A section for each group of names; `room` is `robot_dyn` itself, or a room of it such as `effects`."""
    module = robot_dyn if room == "robot_dyn" else import_module(f"robot_dyn.{room}")
    left = {name for name in module.__all__ if not inspect.ismodule(getattr(module, name))}
    parts = [f"{(inspect.getdoc(module) or '').partition(chr(10))[0]}\n"]
    for label, text in groups(module):
        names = [each for each in dict.fromkeys(re.findall(r"\w+", f"{label} {text}")) if each in left]
        left -= set(names)
        if names:
            entries = "\n".join(entry(module, name) for name in names)
            parts.append(f"## {label[0].upper()}{label[1:]}\n\n```{{eval-rst}}\n{entries}```\n")
    assert not left, f"the docstring of {module.__name__} does not name {sorted(left)}"
    return "\n".join(parts)


def groups(module: ModuleType) -> list[tuple[str, str]]:
    """Label and text of each line of the map in a room's docstring; a line without a label goes on."""
    found: list[tuple[str, str]] = []
    for paragraph in (inspect.getdoc(module) or "").split("\n\n")[1:]:
        lines = dedent(paragraph).splitlines()
        column = _column(lines)
        for line in lines:
            label, text = line[:column].strip(), line[column:].strip()
            if label or not found:
                found.append((label or "Others", text))
            else:
                found[-1] = (found[-1][0], f"{found[-1][1]} {text}")
    return found


def _column(lines: list[str]) -> int:
    """Where the text begins in all lines of a paragraph; 0 if it is none of a map."""
    starts = range(4, min(map(len, lines)))
    return next((k for k in starts if all(line[k - 1] == " " != line[k] for line in lines) and _gap(lines, k)), 0)


def _gap(lines: list[str], column: int) -> bool:
    """Whether two spaces stand before the text somewhere, as in a table."""
    return any(line[column - 2 : column] == "  " for line in lines)


def entry(module: ModuleType, name: str) -> str:
    """The directive of a name; one that is of `robot_dyn` as well is documented there."""
    value = getattr(module, name)
    full = f"{module.__name__}.{name}"
    if module is not robot_dyn and name in robot_dyn.__all__:
        return f":py:obj:`robot_dyn.{name}` is documented with the names of every day.\n\n"
    if inspect.isclass(value):
        kind = "autoexception" if issubclass(value, BaseException) else "autoclass"
        queries = "   :inherited-members:\n" * (issubclass(value, Dynamics) and value is not Dynamics)
        return f".. {kind}:: {full}\n   :members:\n{queries}   :show-inheritance:\n\n"
    if callable(value):
        return f".. autofunction:: {full}\n\n"
    return f".. py:data:: {full}\n   :value: {value!r}\n\n"
