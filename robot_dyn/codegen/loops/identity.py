"""What the machine code of a function depends on, in words: the code of all that it reaches, and constants.

    function → its code, and the values of the names in it → …

The code is that of Python, which is what the syntax tree was checked against; so nothing has to be parsed to look for
machine code in a store.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from enum import EnumMeta
from functools import cache
from pathlib import Path
from types import CodeType, FunctionType, ModuleType
from typing import Any

import numpy as np

from robot_dyn.codegen.loops.source import names_of
from robot_dyn.codegen.store.identity import digest_of


@cache
def sources_of_the_translator() -> str:
    """The SHA-256 of this package, and of what compiles its modules."""
    room = Path(__file__).parents[1]
    emitters = [room / "array_operations.py"]  # what they write is in no code of a function that is reached
    return digest_of(room, [*(room / "loops").glob("*.py"), *(room / "llvm").glob("*.py"), *emitters])


def reached(function: Callable[..., Any], instead: Mapping[Any, Callable[..., Any]]) -> list[FunctionType]:
    """A function and all that it calls, or what stands in their place: by the names in them."""
    found: dict[FunctionType, None] = {}

    def look(each: Any) -> None:
        each = instead.get(each, each)
        if isinstance(each, FunctionType) and each not in found and not hasattr(each, "emits"):
            found[each] = None
            for value in _named(each).values():
                if callable(value):
                    look(value)

    look(function)
    return list(found)


def identity(function: Callable[..., Any], instead: Mapping[Any, Callable[..., Any]]) -> list[str]:
    """Texts that determine what a function does, for arguments of given types."""
    made = []
    for each in reached(function, instead):
        values = (f"{name} = {_described(value, instead)}" for name, value in sorted(_named(each).items()))
        made += [f"{each.__module__}.{each.__qualname__}", repr(_code(each.__code__)), *values]
    return made


def _named(function: FunctionType) -> dict[str, Any]:
    """The values of names that a function takes from elsewhere."""
    values, code = names_of(function), function.__code__
    return {name: values[name] for name in (*code.co_names, *code.co_freevars) if name in values}


def _code(code: CodeType) -> tuple[Any, ...]:
    constants = tuple(_code(each) if isinstance(each, CodeType) else repr(each) for each in code.co_consts)
    names = code.co_names, code.co_varnames, code.co_freevars, code.co_cellvars
    return code.co_code.hex(), constants, names, code.co_firstlineno, code.co_linetable.hex()


def _described(value: Any, instead: Mapping[Any, Callable[..., Any]]) -> str:
    value = instead.get(value, value) if callable(value) else value
    if isinstance(value, FunctionType | ModuleType):
        return f"{value.__name__} of {getattr(value, '__module__', '')}"
    if isinstance(value, EnumMeta):
        members: dict[str, Any] = dict(value.__members__)
        return str([(name, repr(each.value)) for name, each in members.items()])
    if isinstance(value, np.ndarray):
        return f"{value.dtype} {value.shape} {value.tobytes().hex()}"
    if isinstance(value, tuple):
        return f"{type(value).__name__}({', '.join(_items(value, instead))})"
    if isinstance(value, bool | int | float | str | np.generic) or value is None:
        return f"{type(value).__name__} {value!r}"
    return f"{type(value).__name__} {getattr(value, '__qualname__', '')}"


def _items(value: tuple[Any, ...], instead: Mapping[Any, Callable[..., Any]]) -> Iterator[str]:
    return (_described(each, instead) for each in value)
