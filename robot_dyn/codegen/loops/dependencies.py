"""Dependencies of the machine code of a function, as texts: the code of all functions it reaches, and constants.

    function → its code, and the values of the names in it → …

The code is Python's bytecode, against which the syntax tree was checked; so a store can be searched without parsing.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from enum import EnumMeta
from types import FunctionType, ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np

from robot_dyn.codegen.loops.source import names_of
from robot_dyn.codegen.store.definition import code_parts

if TYPE_CHECKING:
    from robot_dyn.codegen.loops.values import Value

Instead = Mapping[Callable[..., object], "FunctionType | Callable[..., Value]"]  # substitutes for functions


def reached(function: Callable[..., object], instead: Instead) -> list[FunctionType]:
    """Return a function and all functions it calls by the names in it, or their substitutes."""
    functions: dict[FunctionType, None] = {}

    def visit(candidate: Callable[..., object]) -> None:
        candidate = instead.get(candidate, candidate)
        if isinstance(candidate, FunctionType) and candidate not in functions and not hasattr(candidate, "emits"):
            functions[candidate] = None
            for value in _named(candidate).values():
                if callable(value):
                    visit(value)

    visit(function)
    return list(functions)


def dependencies(function: Callable[..., object], instead: Instead) -> list[str]:
    """Return texts that determine the behaviour of a function, for arguments of given types."""
    texts = []
    for dependency in reached(function, instead):
        code = dependency.__code__
        values = (f"{name} = {_described(value, instead)}" for name, value in sorted(_named(dependency).items()))
        lines = code.co_firstlineno, code.co_linetable.hex()  # messages name them
        texts += [f"{dependency.__module__}.{dependency.__qualname__}", repr((code_parts(code), lines)), *values]
    return texts


def _named(function: FunctionType) -> dict[str, object]:
    """Return the values of names that a function takes from elsewhere."""
    values, code = names_of(function), function.__code__
    return {name: values[name] for name in (*code.co_names, *code.co_freevars) if name in values}


def _described(value: object, instead: Instead) -> str:
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
