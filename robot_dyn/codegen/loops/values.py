"""Values in a function during its translation: LLVM values with their types in the subset of Python."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final, final

from llvmlite import ir

from robot_dyn.codegen.loops.kinds import (
    BOOL,
    FLOAT,
    I64,
    INT,
    UINT,
    WORDS,
    ArrayKind,
    Kind,
    Number,
    RecordKind,
    Static,
    TupleKind,
)

UNWRITTEN = ir.Constant(I64, ir.Undefined)
"""Placeholder for every LLVM value during type inference, when no instructions are written."""


@final
class _Silent:
    """Substitute for LLVM's builder during type inference; it writes nothing."""

    block: Any = None

    def __getattr__(self, name: str) -> Any:
        return _unwritten


def _unwritten(*_: object, **__: object) -> ir.Value:
    return UNWRITTEN


SILENT: Final = _Silent()
Builder = ir.IRBuilder | _Silent


@final
@dataclass(frozen=True, eq=False)
class Scalar:
    """A number.

    Attributes:
        kind: Type.
        ir: LLVM value.
        const: Python value, or None if it is not constant.
    """

    kind: Number
    ir: ir.Value
    const: float | None = None


@final
@dataclass(frozen=True, eq=False)
class ArrayValue:
    """An array: the address of its first entry, its lengths, and its strides in entries unless it is contiguous."""

    kind: ArrayKind
    data: ir.Value
    shape: tuple[Scalar, ...]
    apart: tuple[Scalar, ...] = ()

    def strides(self, builder: Builder) -> tuple[Scalar, ...]:
        """Return the strides, in entries."""
        if not self.kind.contiguous:
            return self.apart
        strides = [ONE]
        for length in reversed(self.shape[1:]):
            strides.insert(0, times(length, strides[0], builder))
        return tuple(strides)


@final
@dataclass(frozen=True, eq=False)
class RecordValue:
    """A named tuple, referenced by the address of its words."""

    kind: RecordKind
    pointer: ir.Value


@final
@dataclass(frozen=True, eq=False)
class TupleValue:
    """Several values."""

    items: tuple[Value, ...]

    @property
    def kind(self) -> TupleKind:
        """Type of the tuple."""
        return TupleKind(tuple(item.kind for item in self.items))


@final
@dataclass(frozen=True, eq=False)
class StaticValue:
    """A value fixed when the function is translated."""

    value: object

    @property
    def kind(self) -> Static:
        """Type of the value."""
        return Static.from_value(self.value)


@final
@dataclass(frozen=True)
class Written:
    """A translated function in an LLVM module.

    Attributes:
        ir: LLVM function.
        result: Type of the result.
        may_fail: True if the function can fail; it then returns the text of the failure, or null, before its result.
    """

    ir: ir.Function
    result: Kind
    may_fail: bool


Value = Scalar | ArrayValue | RecordValue | TupleValue | StaticValue


def number(value: float) -> Scalar:
    """Return a constant."""
    kind = BOOL if isinstance(value, bool) else INT if isinstance(value, int) else FLOAT
    return Scalar(kind, ir.Constant(kind.llvm, value), value)


def word(value: int) -> Scalar:
    """Return an unsigned constant."""
    return Scalar(UINT, ir.Constant(I64, value), value)


ONE = number(1)


def leaf_types(kind: Kind) -> list[ir.Type]:
    """Return the LLVM types of the parts of a value, as they are passed and stored in variables."""
    if isinstance(kind, Number):
        return [kind.llvm]
    if isinstance(kind, ArrayKind):
        axes = kind.ndim - kind.single
        return [kind.number.stored.as_pointer(), *[I64] * (axes if kind.contiguous else 2 * axes)]
    if isinstance(kind, RecordKind):
        return [WORDS]
    return [] if isinstance(kind, Static) else [leaf for item in kind.items for leaf in leaf_types(item)]


def leaves(value: Value) -> list[ir.Value]:
    """Return the LLVM values of the parts of a value."""
    if isinstance(value, Scalar):
        return [value.ir]
    if isinstance(value, ArrayValue):
        axes = value.kind.ndim - value.kind.single
        return [value.data, *(length.ir for length in (*value.shape[:axes], *value.apart[:axes]))]
    if isinstance(value, RecordValue):
        return [value.pointer]
    return [] if isinstance(value, StaticValue) else [leaf for item in value.items for leaf in leaves(item)]


def of_leaves(kind: Kind, parts: Sequence[ir.Value]) -> Value:
    """Return the value that consists of these parts."""
    if isinstance(kind, Number):
        return Scalar(kind, parts[0])
    if isinstance(kind, ArrayKind):
        axes = kind.ndim - kind.single
        lengths = tuple(Scalar(INT, part) for part in parts[1:])
        last = (ONE,) * kind.single
        return ArrayValue(kind, parts[0], lengths[:axes] + last, () if kind.contiguous else lengths[axes:] + last)
    if isinstance(kind, RecordKind):
        return RecordValue(kind, parts[0])
    if isinstance(kind, Static):
        return StaticValue(kind.value)
    items, at = [], 0
    for item in kind.items:
        count = len(leaf_types(item))
        items.append(of_leaves(item, parts[at : at + count]))
        at += count
    return TupleValue(tuple(items))


def times(x: Scalar, y: Scalar, builder: Builder) -> Scalar:
    """Return a product of lengths; LLVM may assume that it does not overflow."""
    if x.const is not None and y.const is not None:
        return number(x.const * y.const)
    if x.const == 1 or y.const == 1:
        return y if x.const == 1 else x
    return Scalar(INT, builder.mul(x.ir, y.ir, flags=("nsw",)))
