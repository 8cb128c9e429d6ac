"""Compiled code that survives its process: a Numba overload, taken from a store or compiled and put there.

Numba never frees machine code, so a process loads each key once and keeps it: to load it again would lose memory.
The key is the SHA-256 of all that the machine code depends on: the straight-line code and its constants, the signature,
the versions of what made it, and the processor with its features.
"""

from __future__ import annotations

import hashlib
import pickle
import platform
from collections.abc import Callable
from importlib.metadata import PackageNotFoundError, version
from typing import Any, Protocol

from robot_dyn.compiled.interrupts import interrupts_later

_loaded: dict[str, Any] = {}  # functions by key


class Store(Protocol):
    """Where payloads are kept by key; see `robot_dyn.compiled.cache`."""

    def load(self, key: str) -> bytes | None:
        """The payload of a key; None if there is no such key."""
        ...

    def save(self, key: str, payload: bytes, about: str = "") -> None:
        """Keep a payload, with a text about it."""
        ...


def compiled(
    make: Callable[[], Any], arguments: list[str], store: Store | None, identity: list[str], about: str = ""
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


def digest(identity: list[str]) -> str:
    """The key of what these texts, this processor and these versions determine."""
    import llvmlite.binding as llvm

    versions = [f"{name} {version_of(name)}" for name in ("robot-dyn", "numba", "llvmlite", "casadi", "numpy")]
    machine = [platform.python_version(), llvm.get_host_cpu_name(), llvm.get_host_cpu_features().flatten()]
    parts = [*identity, *versions, *machine]
    return hashlib.sha256("\0".join(f"{len(part)} {part}" for part in parts).encode()).hexdigest()


def version_of(name: str) -> str:
    """The version of an installed distribution, or "unknown"."""
    try:
        return version(name)
    except PackageNotFoundError:  # run from its folder
        return "unknown"


def _payload(function: Any) -> bytes:
    from numba.core.serialize import dumps

    (overload,) = function.overloads.values()
    return dumps(overload._reduce())


def _restored(payload: bytes, count: int) -> Any:
    """The function of a payload, or None if this Numba cannot take it."""
    import numba as nb
    from numba.core.compiler import CompileResult

    function: Any = nb.njit(eval(f"lambda {', '.join(f'x{i}' for i in range(count))}: None"))  # hung upon, never run
    context = function.targetctx
    try:
        context.refresh()
        overload = CompileResult._rebuild(context, *pickle.loads(payload))
    except (pickle.UnpicklingError, ValueError, TypeError, AttributeError, EOFError, RuntimeError):
        return None
    context.insert_user_function(overload.entry_point, overload.fndesc, [overload.library])
    function.add_overload(overload)
    function.disable_compile()
    return function
