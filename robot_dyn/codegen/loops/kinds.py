"""Types of the subset: numbers, arrays of them, named tuples by reference, tuples, and constants."""

from __future__ import annotations

import struct
from dataclasses import dataclass, field
from typing import NamedTuple, TypeGuard, final

import numpy as np
from llvmlite import ir

from robot_dyn.foundations.errors import TraceError

I1, I8, I64, F64 = ir.IntType(1), ir.IntType(8), ir.IntType(64), ir.DoubleType()
TEXT, WORDS = I8.as_pointer(), I64.as_pointer()


@final
@dataclass(frozen=True)
class Number:
    """A number: float64, int64, uint64 or a truth value."""

    name: str

    @property
    def llvm(self) -> ir.Type:
        """LLVM type."""
        return {"float": F64, "bool": I1}.get(self.name, I64)

    @property
    def stored(self) -> ir.Type:
        """LLVM type of an array entry."""
        return I8 if self.name == "bool" else self.llvm


FLOAT, INT, UINT, BOOL = Number("float"), Number("int"), Number("uint"), Number("bool")
_CLASSES: tuple[tuple[Number, type | tuple[type, ...]], ...] = (
    (BOOL, (bool, np.bool_)), (UINT, np.uint64), (INT, (int, np.integer)), (FLOAT, float),
)  # fmt: skip
_OF_DTYPE = {np.dtype(of): number for of, number in ((float, FLOAT), (np.int64, INT), (np.uint64, UINT), (bool, BOOL))}


@final
@dataclass(frozen=True)
class ArrayKind:
    """An array.

    Attributes:
        number: Type of its numbers.
        ndim: Number of axes.
        contiguous: True if contiguous in C order; otherwise strides are determined at run time.
        single: True if the last of several axes has length 1 at compile time, for example for a single run.
        frozen: True if read-only.
    """

    number: Number
    ndim: int
    contiguous: bool = True
    single: bool = False
    frozen: bool = False

    @property
    def words(self) -> int:
        """Number of words of its description: address, lengths, and strides in bytes."""
        return 1 + 2 * self.ndim


@final
@dataclass(frozen=True)
class RecordKind:
    """A named tuple, referenced by the address of the words of its fields.

    Attributes:
        name: Name of the class.
        names, kinds: Names and types of the fields.
    """

    name: str
    names: tuple[str, ...]
    kinds: tuple[Kind, ...]

    @property
    def words(self) -> int:
        """Number of words of all fields."""
        return sum(map(words, self.kinds))

    def first(self, name: str) -> int:
        """Return the first word of a field."""
        return sum(map(words, self.kinds[: self.names.index(name)]))


@final
@dataclass(frozen=True)
class TupleKind:
    """Several values."""

    items: tuple[Kind, ...]


@final
@dataclass(frozen=True)
class Static:
    """A value fixed when the function is translated: a function, a module, a class, a tuple of constants.

    Attributes:
        value: The value.
        token: Text that distinguishes values; 1, 1.0 and True differ.
    """

    value: object = field(compare=False)
    token: str

    @staticmethod
    def from_value(value: object) -> Static:
        """Return the type of a value."""
        return Static(value, f"{id(value)}" if callable(value) else repr(value))


Kind = Number | ArrayKind | RecordKind | TupleKind | Static
Unpacked = float | np.uint64 | None | tuple["Unpacked", ...]  # what machine code returns to Python


def words(kind: Kind) -> int:
    """Return the number of 64-bit words of a value."""
    if isinstance(kind, Number):
        return 1
    if isinstance(kind, TupleKind):
        return sum(map(words, kind.items))
    return 0 if isinstance(kind, Static) else kind.words


def is_record(value: object) -> TypeGuard[NamedTuple]:
    """Return True for a named tuple."""
    return isinstance(value, tuple) and hasattr(value, "_fields")


def kind_of(value: object) -> Kind:
    """Return the type of an argument.

    Raises:
        TraceError: If machine code does not support it.
    """
    if isinstance(value, np.ndarray):
        return _kind_of_array(value)
    if is_record(value):
        return RecordKind(type(value).__name__, value._fields, tuple(map(kind_of, value)))
    if isinstance(value, tuple):
        return TupleKind(tuple(map(kind_of, value)))
    for number, of in _CLASSES:
        if isinstance(value, of):
            return number
    if value is None:
        return Static.from_value(value)
    raise TraceError(
        f"machine code supports numbers, arrays and named tuples of them, got a {type(value).__name__}; convert it"
    )


def _kind_of_array(x: np.ndarray) -> ArrayKind:
    if x.dtype not in _OF_DTYPE or not x.ndim or any(offset % x.itemsize for offset in (x.ctypes.data, *x.strides)):
        raise TraceError(
            "machine code supports aligned arrays of float64, int64, uint64 or bool with at least one axis, got"
            f" {x.dtype} of shape {x.shape}; convert it"
        )
    single, frozen = x.ndim > 1 and x.shape[-1] == 1, x.data.readonly
    return ArrayKind(_OF_DTYPE[x.dtype], x.ndim, x.flags.c_contiguous, single, frozen)


def unpacked(values: list[int], kind: Kind) -> Unpacked:
    """Return the value of words of a number, or of a tuple of numbers."""
    if isinstance(kind, TupleKind):
        ends = np.cumsum([0, *map(words, kind.items)])
        return tuple(unpacked(values[a:b], item) for a, b, item in zip(ends, ends[1:], kind.items, strict=False))
    if kind == FLOAT:
        return struct.unpack("d", struct.pack("q", values[0]))[0]
    if kind == UINT:
        return np.uint64(values[0] % 2**64)
    return None if isinstance(kind, Static) else bool(values[0]) if kind == BOOL else values[0]
