"""What the machine code of a function depends on, as texts: the code of all that it reaches, and constants.

    function → its code, and the values of the names in it → …

The code is Python's, against which the syntax tree was checked; so nothing has to be parsed to look for machine code
in a store.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from enum import EnumMeta
from types import FunctionType, ModuleType
from typing import Any

import numpy as np

from robot_dyn.codegen.loops.source import names_of
from robot_dyn.codegen.store.definition import code_parts


def reached(function: Callable[..., Any], instead: Mapping[Any, Callable[..., Any]]) -> list[FunctionType]:
    """A function and all that it calls, by the names in them, or their substitutes."""
    found: dict[FunctionType, None] = {}

    def visit(candidate: Any) -> None:
        candidate = instead.get(candidate, candidate)
        if isinstance(candidate, FunctionType) and candidate not in found and not hasattr(candidate, "emits"):
            found[candidate] = None
            for value in _named(candidate).values():
                if callable(value):
                    visit(value)

    visit(function)
    return list(found)


def dependencies(function: Callable[..., Any], instead: Mapping[Any, Callable[..., Any]]) -> list[str]:
    """Texts that determine what a function does, for arguments of given types."""
    texts = []
    for each in reached(function, instead):
        code = each.__code__
        values = (f"{name} = {_described(value, instead)}" for name, value in sorted(_named(each).items()))
        lines = code.co_firstlineno, code.co_linetable.hex()  # messages name them
        texts += [f"{each.__module__}.{each.__qualname__}", repr((code_parts(code), lines)), *values]
    return texts


def _named(function: FunctionType) -> dict[str, Any]:
    """The values of names that a function takes from elsewhere."""
    values, code = names_of(function), function.__code__
    return {name: values[name] for name in (*code.co_names, *code.co_freevars) if name in values}


def _described(value: Any, instead: Mapping[Any, Callable[..., Any]]) -> str:
    value = instead.get(value, value) if callable(value) else value
    if isinstance(value, FunctionType | ModuleType):
        return f"{value.__name__} of {getattr(value, '__module__', '')}"
    if isinstance(value, EnumMeta):
        members: dict[str, Any] = dict(value.__members__)
        return str([(name, repr(member.value)) for name, member in members.items()])
    if isinstance(value, np.ndarray):
        return f"{value.dtype} {value.shape} {value.tobytes().hex()}"
    if isinstance(value, tuple):
        return f"{type(value).__name__}({', '.join(_described(item, instead) for item in value)})"
    if isinstance(value, bool | int | float | str | np.generic) or value is None:
        return f"{type(value).__name__} {value!r}"
    return f"{type(value).__name__} {getattr(value, '__qualname__', '')}"
