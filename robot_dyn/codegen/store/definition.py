"""The definition of user code: one digest of everything that its functions and classes reach by name.

    function → its code, defaults, closure, attributes, globals → …      class → its bases and the values in it → …

Code is identified by its bytecode, which is what runs; its source may have been edited since. Numbers, strings, tuples
and arrays are identified by value, functions and classes of this library and of NumPy by name, since every key includes
their sources and versions. Anything that may differ in the next process has no definition: files, times, random
numbers, mutable objects, functions that assign to anything but their own variables, and modules as values.
"""

from __future__ import annotations

import builtins
import dis
import sys
from abc import ABCMeta
from collections.abc import Iterator, Mapping
from dataclasses import Field
from functools import cached_property, lru_cache, partial
from types import CodeType, FunctionType, GetSetDescriptorType, MemberDescriptorType, MethodType, ModuleType
from typing import Any, final

import numpy as np

from robot_dyn.codegen.store.keys import digest_of_texts
from robot_dyn.foundations.coefficients import Coefficient

_NUMBERS = bool, int, float, complex, str, bytes, type(None), type(Ellipsis), type(NotImplemented)
_BUILTIN = {
    "abs", "all", "any", "bool", "complex", "dict", "divmod", "enumerate", "filter", "float", "frozenset", "int",
    "isinstance", "issubclass", "len", "list", "map", "max", "min", "object", "pow", "property", "range", "reversed",
    "round", "set", "slice", "sorted", "staticmethod", "classmethod", "sum", "super", "tuple", "type", "zip",
}  # fmt: skip
# Modules whose functions and classes are identified by name: they return equal values in every process.
_PURE = {"abc", "cmath", "dataclasses", "math", "numpy", "numpy.linalg", "typing"}
_PURE_ROOMS = (
    "arithmetic", "coefficients", "control", "effects", "errors", "lagrange", "linear_algebra", "spatial",
    "threshold", "values",
)  # fmt: skip
# NumPy functions that read or write a file, a clock, a setting or uninitialised memory.
_IMPURE = {
    "datetime64", "empty", "empty_like", "fromfile", "fromregex", "genfromtxt", "get_printoptions",
    "getbufsize", "geterr", "geterrcall", "load", "loadtxt", "memmap", "save", "savetxt", "savez",
    "savez_compressed", "set_printoptions", "setbufsize", "seterr", "seterrcall", "show_config",
}  # fmt: skip
_SPECIAL = {"__call__", "__class__", "__delattr__", "__init__", "__len__", "__name__", "__post_init__", "__setattr__"}
_FIELDS = "__dataclass_fields__"
# Class attributes that are derived from others or do not affect numbers.
_FOLLOWS = {
    _FIELDS, "__abstractmethods__", "__annotate__", "__annotate_func__", "__annotations__", "__annotations_cache__",
    "__dataclass_params__", "__dict__", "__doc__", "__firstlineno__", "__hash__", "__match_args__", "__module__",
    "__orig_bases__", "__parameters__", "__repr__", "__static_attributes__", "__weakref__", "_abc_impl",
}  # fmt: skip
_MAX = 500  # functions and classes


class _UndefinedError(Exception):
    """A value without a definition was reached."""


def definition(value: object) -> str | None:
    """Return the SHA-256 of everything a value depends on; None if that may differ in another process."""
    reader = _Reader()
    try:
        parts = [reader.text(value), *reader.texts()]
    except (_UndefinedError, RecursionError):
        return None
    return digest_of_texts(parts)


@final
class _Reader:
    """Texts of values; functions and classes are numbered in the order in which they are reached."""

    def __init__(self) -> None:
        self._reached: list[Any] = []
        self._numbers: dict[int, int] = {}  # index in `_reached`, by identity

    def text(self, value: Any) -> str:
        """Return a text that, together with `texts`, distinguishes a value from all others."""
        kind: Any = type(value)
        if kind in _NUMBERS:
            return f"{kind.__name__} {value!r}"
        if issubclass(kind, np.ndarray | np.generic) and kind.__module__ == "numpy" and not value.dtype.hasobject:
            return f"{kind.__name__} {value.dtype.str} {value.shape} {value.tobytes().hex()}"
        if kind in (tuple, frozenset):
            items = map(self.text, value)
            return f"{kind.__name__} {[*items] if kind is tuple else sorted(items)}"
        if kind is partial:
            return f"partial {self.text(value.func)} {self.text(value.args)} {self._items(value.keywords)}"
        if kind is MethodType:
            return f"method {self.text(value.__func__)} {self.text(value.__self__)}"
        if _is_pure(value):
            return f"{value.__module__}.{value.__qualname__}"
        if isinstance(value, FunctionType | type):
            return self._number(value)
        if kind.__name__ == "_HAS_DEFAULT_FACTORY_CLASS":  # a default from a factory, in an __init__
            return kind.__name__
        if kind is np.ufunc and getattr(np, value.__name__, None) is value:
            return f"numpy {value.__name__}"
        raise _UndefinedError

    def texts(self) -> Iterator[str]:
        """Return the texts of the functions and classes reached."""
        for value in self._reached:  # the list grows during the loop
            yield self._of_function(value) if isinstance(value, FunctionType) else self._of_class(value)

    def _number(self, value: Any) -> str:
        if id(value) not in self._numbers:
            if len(self._reached) == _MAX:
                raise _UndefinedError
            self._numbers[id(value)] = len(self._reached)
            self._reached.append(value)
        return f"reached {self._numbers[id(value)]}"

    def _items(self, values: Mapping[Any, Any]) -> str:
        return str([(str(name), self.text(value)) for name, value in sorted(values.items())])

    def _of_function(self, function: FunctionType) -> str:
        code = function.__code__
        try:
            closure = {
                x: cell.cell_contents for x, cell in zip(code.co_freevars, function.__closure__ or (), strict=True)
            }
        except ValueError:  # a closure variable has no value yet
            raise _UndefinedError from None
        if function.__builtins__ is not vars(builtins):  # pyright: ignore
            raise _UndefinedError
        defaults = self.text(function.__defaults__), self._items(function.__kwdefaults__ or {})
        names = {" ".join(path): _at(function.__globals__, path) for path in _globals(code)}
        words = code_parts(code), *defaults, self._items(closure), self._items(names), self._items(vars(function))
        return f"function {function.__qualname__} {words}"

    def _of_class(self, kind: type) -> str:
        if type(kind) not in (type, ABCMeta):
            raise _UndefinedError
        bases, fields = [self.text(base) for base in kind.__bases__], self._of_fields(vars(kind).get(_FIELDS, {}))
        own = {name: self._of_attribute(value) for name, value in sorted(vars(kind).items()) if name not in _FOLLOWS}
        return f"class {kind.__qualname__} {bases} {fields} {own}"

    def _of_attribute(self, value: Any) -> str:
        """Return the text of a class attribute."""
        if isinstance(value, staticmethod | classmethod):
            return f"{type(value).__name__} {self.text(value.__func__)}"
        if type(value) is property:
            return f"property {[self.text(accessor) for accessor in (value.fget, value.fset, value.fdel)]}"
        if type(value) is cached_property:
            return f"cached {self.text(value.func)}"
        if isinstance(value, MemberDescriptorType | GetSetDescriptorType):
            return "slot"
        return self.text(value)

    def _of_fields(self, fields: Mapping[str, Field[Any]]) -> str:
        """Return the text of dataclass fields, whose defaults are in the methods."""
        return str([(name, item.init, self._of_metadata(item.metadata)) for name, item in fields.items()])

    def _of_metadata(self, metadata: Mapping[Any, Any]) -> list[tuple[str, str]]:
        return [(str(k), repr(x) if type(x) is Coefficient else self.text(x)) for k, x in metadata.items()]


def _is_pure(value: Any) -> bool:
    """Return True for a function or class that its name identifies, in a module of constant behaviour."""
    module, name = getattr(value, "__module__", None), getattr(value, "__qualname__", None)
    if not isinstance(module, str) or not isinstance(name, str) or isinstance(value, ModuleType):
        return False
    if module == "builtins":
        is_known = name in _BUILTIN or (isinstance(value, type) and issubclass(value, BaseException))
        return is_known and getattr(builtins, name, None) is value
    package, _, rest = module.partition(".")
    is_own = package == "robot_dyn" and rest.partition(".")[0] in _PURE_ROOMS
    owner: Any = sys.modules.get(module) if is_own or (module in _PURE and name not in _IMPURE) else None
    for attribute in name.split("."):
        owner = getattr(owner, attribute, None)
    return owner is value


def _at(names: Mapping[str, Any], path: tuple[str, ...]) -> Any:
    """Return the value of a global name, or of an attribute path in a module."""
    value = names[path[0]] if path[0] in names else getattr(builtins, path[0], _at)
    for name in path[1:]:
        if not isinstance(value, ModuleType):
            break
        value = getattr(value, name, _at)
    if value is _at:
        raise _UndefinedError
    return value


@lru_cache(maxsize=1024)
def _globals(code: CodeType) -> frozenset[tuple[str, ...]]:
    """Return the paths to all a code object uses of its module, such as (np, linalg, norm): a name, then attributes.

    Raises:
        _UndefinedError: If the code assigns to variables of other scopes, imports, or inspects the functions it calls.
    """
    paths: list[list[str]] = []
    continues = False
    for instruction in dis.get_instructions(code):
        operation, name = instruction.opname, str(instruction.argval)
        takes_attribute = operation in ("LOAD_ATTR", "LOAD_METHOD")
        if operation in ("LOAD_GLOBAL", "LOAD_NAME"):
            paths.append([name])
        elif takes_attribute and continues:
            paths[-1].append(name)
        elif operation != "KW_NAMES" and any(
            word in operation for word in ("GLOBAL", "NAME", "IMPORT", "STORE_ATTR", "DELETE_ATTR")
        ):
            raise _UndefinedError
        if operation in ("STORE_DEREF", "DELETE_DEREF") and name in code.co_freevars:
            raise _UndefinedError
        if takes_attribute and name.startswith("__") and name not in _SPECIAL:
            raise _UndefinedError
        continues = operation in ("LOAD_GLOBAL", "LOAD_NAME") or (takes_attribute and continues)
    inside = (_globals(constant) for constant in code.co_consts if isinstance(constant, CodeType))
    return frozenset(map(tuple, paths)).union(*inside)


@lru_cache(maxsize=1024)
def code_parts(code: CodeType) -> tuple[object, ...]:
    """Return everything that determines what a code object does, as strings and numbers, without file and lines."""
    names = code.co_names, code.co_varnames, code.co_freevars, code.co_cellvars
    counts = code.co_argcount, code.co_posonlyargcount, code.co_kwonlyargcount
    kind = code.co_flags & 0xFFFF  # without __future__ flags, which a notebook cell may inherit from another
    return code.co_code.hex(), code.co_exceptiontable.hex(), names, counts, kind, [*map(_constant, code.co_consts)]


def _constant(value: object) -> tuple[object, ...]:
    if isinstance(value, CodeType):
        return code_parts(value)
    if isinstance(value, tuple | frozenset):
        items = map(repr, map(_constant, value))
        return type(value).__name__, [*items] if isinstance(value, tuple) else sorted(items)
    return type(value).__name__, repr(value)
