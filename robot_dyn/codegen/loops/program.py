"""An LLVM module with a function and all that it calls, each translated once for the types of its arguments."""

from __future__ import annotations

from collections.abc import Callable
from enum import Enum
from types import FunctionType, ModuleType
from typing import NoReturn, final

import numpy as np
from llvmlite import ir

from robot_dyn.codegen.loops.dependencies import Instead
from robot_dyn.codegen.loops.function import Function
from robot_dyn.codegen.loops.kinds import (
    BOOL,
    FLOAT,
    I8,
    I64,
    TEXT,
    WORDS,
    ArrayKind,
    Kind,
    Number,
    RecordKind,
    Static,
    TupleKind,
    kind_of,
    words,
)  # fmt: skip
from robot_dyn.codegen.loops.source import SubsetError
from robot_dyn.codegen.loops.values import (
    UNWRITTEN,
    ArrayValue,
    Builder,
    Scalar,
    StaticValue,
    Value,
    Written,
    leaves,
    number,
    of_leaves,
    word,
)  # fmt: skip

Refuse = Callable[[str, str], NoReturn]
_WORDS: type[np.unsignedinteger] = np.uint64


@final
class Program:
    """A module being written.

    Args:
        module: LLVM module.
        prefix: Prefix of the names of its functions.
        instead: Substitutes for functions: either functions of the subset, translated without checks; or functions
            marked by `emits`, (f, node, arguments) → value, which write instructions.
    """

    def __init__(self, module: ir.Module, prefix: str, instead: Instead) -> None:
        self.module, self.prefix, self.instead = module, prefix, instead
        self._unchecked = {function for function in instead.values() if not hasattr(function, "emits")}
        self._done: dict[tuple[FunctionType, tuple[Kind, ...]], Written | None] = {}
        self._texts: dict[str, ir.Value] = {}
        self._arrays: dict[int, tuple[np.ndarray, ir.Value]] = {}
        self._invariant = module.add_metadata([])

    def written(self, function: FunctionType, kinds: tuple[Kind, ...], refuse: Refuse) -> Written:
        """Return a function for arguments of these types, written on first use."""
        place = function, kinds
        if place not in self._done:
            self._done[place] = None
            checks = function not in self._unchecked and not hasattr(function, "unchecked")
            self._done[place] = Function(self, function, kinds, checks).written()
        written = self._done[place]
        if written is None:
            refuse(f"the recursive function {function.__name__!r}", "write a loop")
        return written

    def name(self, name: str) -> str:
        """Return a unique name for a function of the module."""
        return f"{self.prefix}{name}_{len(self._done)}"

    def entry(self, function: FunctionType, kinds: tuple[Kind, ...], name: str) -> Kind:
        """Write the function that other code calls; return the type of its result.

        Its arguments are the addresses of the words of each argument, and the address for the words of the result. It
        returns the text of its failure, or null.
        """
        written = self.written(function, kinds, self._alone)
        shape = ir.FunctionType(TEXT, [WORDS.as_pointer(), WORDS])
        entry = ir.Function(self.module, shape, f"{self.prefix}{name}")
        b = ir.IRBuilder(entry.append_basic_block())
        addresses, out = entry.args
        parts: list[ir.Value] = []
        for i, kind in enumerate(kinds):
            pointer = self.invariant_load(b, b.gep(addresses, [ir.Constant(I64, i)]))
            parts += self._loaded(b, pointer, kind)
        result = b.call(written.ir, parts)
        count = written.may_fail + len(leaves(self._nothing(written.result)))
        results: list[ir.Value] = [result] if count == 1 else [b.extract_value(result, i) for i in range(count)]
        text, results = (results[0], results[1:]) if written.may_fail else (ir.Constant(TEXT, None), results)
        for i, value in enumerate(results):
            b.store(_word(b, value), b.gep(out, [ir.Constant(I64, i)]))
        b.ret(text)
        return written.result

    @staticmethod
    def _alone(construct: str, remedy: str) -> NoReturn:
        raise SubsetError(f"{construct} is not translated; {remedy}")

    @staticmethod
    def _nothing(kind: Kind) -> Value:
        if not _only_numbers(kind):
            raise SubsetError("a function that returns an array cannot be called from Python; write into an argument")
        return of_leaves(kind, [UNWRITTEN] * words(kind))

    def _loaded(self, b: Builder, pointer: ir.Value, kind: Kind) -> list[ir.Value]:
        """Return the parts of an argument, loaded from its words."""
        if isinstance(kind, RecordKind):
            return [pointer]
        if isinstance(kind, TupleKind):
            parts, at = [], 0
            for item in kind.items:
                parts += self._loaded(b, b.gep(pointer, [ir.Constant(I64, at)]), item)
                at += words(item)
            return parts
        if isinstance(kind, Static):
            return []
        return leaves(self.read(b, pointer, kind, 0))

    def read(self, b: Builder, pointer: ir.Value, kind: Number | ArrayKind, first: int) -> Value:
        """Return a number or an array, loaded from its words."""
        loaded = [self.invariant_load(b, b.gep(pointer, [ir.Constant(I64, first + i)])) for i in range(words(kind))]
        if isinstance(kind, Number):
            if kind.llvm == I64:
                return Scalar(kind, loaded[0])
            return Scalar(kind, (b.trunc if kind == BOOL else b.bitcast)(loaded[0], kind.llvm))
        n = kind.ndim
        lengths, apart = loaded[1 : 1 + n - kind.single], loaded[1 + n : 1 + 2 * n - kind.single]
        bytes_ = ir.Constant(I64, 1 if kind.number == BOOL else 8)
        apart = [] if kind.contiguous else [b.sdiv(stride, bytes_, flags=("exact",)) for stride in apart]
        return of_leaves(kind, [b.inttoptr(loaded[0], kind.number.stored.as_pointer()), *lengths, *apart])

    def invariant_load(self, b: Builder, pointer: ir.Value) -> ir.Value:
        """Load a value that does not change while machine code runs."""
        loaded = b.load(pointer)
        loaded.set_metadata("invariant.load", self._invariant)
        return loaded

    def external(self, name: str, result: ir.Type, *arguments: ir.Type) -> ir.Value:
        """Return a function of the C library."""
        if name in self.module.globals:
            return self.module.globals[name]
        function = ir.Function(self.module, ir.FunctionType(result, arguments), name)
        function.attributes.add("nobuiltin")  # LLVM would replace some powers by a square root or a product
        return function

    def text(self, text: str) -> ir.Value:
        """Return the address of a text."""
        if text not in self._texts:
            data = bytearray(text.encode() + b"\0")
            kind = ir.ArrayType(I8, len(data))
            self._texts[text] = self._global(kind, data).bitcast(TEXT)
        return self._texts[text]

    def _global(self, kind: ir.Type, data: object) -> ir.GlobalVariable:
        variable = ir.GlobalVariable(self.module, kind, f"{self.prefix}data_{len(self.module.globals)}")
        variable.linkage, variable.global_constant, variable.initializer = "internal", True, ir.Constant(kind, data)
        return variable

    def constant(self, value: object, refuse: Refuse) -> Value:
        """Return a value that is fixed when the function is translated."""
        if isinstance(value, _WORDS):
            return word(int(value))
        if isinstance(value, bool | np.bool_):
            return number(bool(value))
        if isinstance(value, float):
            return number(float(value))
        if isinstance(value, int | np.integer) and -(2**63) <= value < 2**63:
            return number(int(value))
        if isinstance(value, np.ndarray):
            return self._constant_array(value)
        if isinstance(value, str | tuple | ModuleType | type | Enum) or value is None or callable(value):
            return StaticValue(value)
        return refuse(f"a value of type {type(value).__name__}", "use numbers, arrays, tuples and functions")

    def _constant_array(self, x: np.ndarray) -> ArrayValue:
        kind = kind_of(x)
        assert isinstance(kind, ArrayKind)
        if id(x) not in self._arrays:
            stored = ir.ArrayType(kind.number.stored, x.size)
            entries = [entry if kind.number == FLOAT else int(entry) for entry in x.ravel().tolist()]
            self._arrays[id(x)] = x, self._global(stored, entries).bitcast(kind.number.stored.as_pointer())
        kind = ArrayKind(kind.number, kind.ndim, True, kind.single, True)
        return ArrayValue(kind, self._arrays[id(x)][1], tuple(number(length) for length in x.shape))


def _word(b: ir.IRBuilder, value: ir.Value) -> ir.Value:
    if value.type == I64:
        return value
    return b.zext(value, I64) if value.type == BOOL.llvm else b.bitcast(value, I64)


def _only_numbers(kind: Kind) -> bool:
    if isinstance(kind, TupleKind):
        return all(map(_only_numbers, kind.items))
    return isinstance(kind, Number | Static)


def translated(function: FunctionType, kinds: tuple[Kind, ...], instead: Instead) -> Kind:
    """Translate a function for arguments of these types, only for the type of its result and its errors."""
    return Program(ir.Module(), "", instead).written(function, kinds, Program._alone).result
