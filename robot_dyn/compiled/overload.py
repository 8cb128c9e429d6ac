"""Compiled code that survives its process: a Numba overload, taken from a store or compiled and put there.

Numba never frees machine code, so a process loads each key once and keeps it: to load it again would lose memory.
Numba has no public way to keep an overload; what is used of its inner parts stands here alone.
"""

from __future__ import annotations

import inspect
import pickle
from collections.abc import Callable
from typing import Any

from robot_dyn.compiled.identity import digest, version_of
from robot_dyn.compiled.interrupts import interrupts_later
from robot_dyn.compiled.store import Store
from robot_dyn.errors import RobotDynError

TESTED = "0.61 to 0.68"  # versions of Numba
_loaded: dict[str, Any] = {}  # functions by key


class NumbaStructureError(RobotDynError):
    """Numba lacks an inner part that keeps machine code."""


def compiled(
    make: Callable[[], Any], arguments: list[Any], store: Store | None, identity: list[str], about: str = ""
) -> Any:
    """A Numba function with one overload, restored from the store if it is there.

    Args:
        make: Gives the function, not yet compiled.
        arguments: Numba's types of them; the result is an int64.
        store: Where to look and keep; None for nowhere.
        identity: Texts that determine the machine code.
        about: What it is of, for a reader of the store.
    """
    from numba.core import types

    signature = types.int64(*arguments)
    key = digest([str(signature), *identity])
    payload = store.load(key) if store is not None else None
    function = _loaded.get(key)
    if function is None and payload is not None:
        function = _restored(payload, len(arguments))
    if function is None:
        function, payload = make(), None
        with interrupts_later():
            function.compile(signature)
        function.disable_compile()
    if store is not None and payload is None:
        store.save(key, _payload(function), about)
    return _loaded.setdefault(key, function)


def _payload(function: Any) -> bytes:
    (overload,) = function.overloads.values()
    reduce = _inner(overload, "_reduce")
    return _inner(_module("numba.core.serialize"), "dumps")(reduce())


def _restored(payload: bytes, count: int) -> Any:
    """The function of a payload, or None if this Numba cannot take it."""
    function = _empty(count)
    context = _inner(function, "targetctx")
    rebuild = _inner(_inner(_module("numba.core.compiler"), "CompileResult"), "_rebuild")
    enter, add = _inner(context, "insert_user_function"), _inner(function, "add_overload")
    try:
        context.refresh()
        overload = rebuild(context, *pickle.loads(payload))
    except (pickle.UnpicklingError, ValueError, TypeError, AttributeError, EOFError, RuntimeError):
        return None
    enter(overload.entry_point, overload.fndesc, [overload.library])
    add(overload)
    function.disable_compile()
    return function


def _empty(count: int) -> Any:
    """A Numba function of so many arguments for an overload to be hung upon; it is never run itself."""
    import numba as nb

    def nothing(*_: Any) -> None: ...

    kind = inspect.Parameter.POSITIONAL_OR_KEYWORD
    nothing.__signature__ = inspect.Signature([inspect.Parameter(f"x{i}", kind) for i in range(count)])  # pyright: ignore[reportFunctionMemberAccess]
    return nb.njit(nothing)


def _module(name: str) -> Any:
    from importlib import import_module

    return import_module(name)


def _inner(owner: Any, name: str) -> Any:
    """An inner part of Numba.

    Raises:
        NumbaStructureError: If it is not there.
    """
    try:
        return getattr(owner, name)
    except AttributeError:
        raise NumbaStructureError(
            f"Numba {version_of('numba')} has no {name} in {type(owner).__name__}, which versions {TESTED} have;"
            ' install one of these, or take engine="interpreted"'
        ) from None
