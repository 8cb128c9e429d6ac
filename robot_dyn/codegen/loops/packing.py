"""The words of arguments: numbers, and the addresses, lengths and strides of arrays, read from NumPy's own structure.

A loop takes some eighty arrays. Python takes 1 µs to look up one address; machine code reads all in 1 µs.
"""

from __future__ import annotations

import ctypes
import struct
from array import array
from collections.abc import Callable
from dataclasses import dataclass
from itertools import count
from typing import Any, final

import numpy as np
from llvmlite import ir

from robot_dyn.codegen.llvm import machine_code, numpy_array
from robot_dyn.codegen.loops.kinds import (
    I8,
    I64,
    WORDS,
    ArrayKind,
    Kind,
    RecordKind,
    Static,
    TupleKind,
    kind_of,
    words,
)
from robot_dyn.codegen.loops.vectors import ZERO, steps
from robot_dyn.codegen.store.cache import Store
from robot_dyn.codegen.store.keys import digest, sources_of_the_translator

_I32 = ir.IntType(32)
_FORM = 2  # words of the form of an array: flags, axes and whether the last is of length 1; and its dtype
_HEADER = ctypes.CFUNCTYPE(None, ctypes.c_int64, *[ctypes.c_void_p] * 4)


@final
@dataclass(frozen=True)
class _Layout:
    """Where the words of values go.

    Attributes:
        size: Words in all.
        starts: The first word of each value.
        firsts: The first word of each array.
        numbers: The word of each number, and what makes it.
    """

    size: int
    starts: tuple[int, ...]
    firsts: array[int]
    numbers: tuple[tuple[int, Callable[[Any], int]], ...]


@final
@dataclass(frozen=True)
class Packed:
    """The words of values.

    Attributes:
        kinds: Their types.
        number: A number for these types, which is quick to compare.
        words: Valid as long as the values live.
        starts: The address of the first word of each value.
    """

    kinds: tuple[Kind, ...]
    number: int
    words: array[int]
    starts: tuple[int, ...]


_one: dict[Kind, Kind] = {}  # one object for equal types, which is quick to compare
_numbers = count()  # runs may start in several threads
_layouts: dict[tuple[Any, ...], _Layout] = {}
_kinds: dict[
    tuple[Any, ...], tuple[int, tuple[Kind, ...], Any]
] = {}  # with the dtypes, so that their addresses stay in use


def pack(values: tuple[Any, ...], store: Callable[[], Store | None]) -> Packed:
    """The words of arguments.

    Args:
        values: The arguments.
        store: Returns where machine code is stored, or None.

    Raises:
        TraceError: If machine code cannot take one.
    """
    form: list[Any] = []
    arrays: list[int] = []
    numbers: list[Any] = []
    _flatten(values, form, arrays, numbers)
    shape = tuple(form)
    layout = _layouts.get(shape)
    if layout is None:
        layout = _layouts[shape] = _layout(tuple(map(kind_of, values)))
    block, forms = array("q", bytes(8 * max(1, layout.size))), array("q", bytes(8 * _FORM * len(arrays)))
    start = block.buffer_info()[0]
    if arrays:
        objects = array("q", arrays)
        places = (each.buffer_info()[0] for each in (objects, layout.firsts, block, forms))
        _reader(store)(len(arrays), *places)
    for (at, word), each in zip(layout.numbers, numbers, strict=True):
        block[at] = word(each)
    known = shape, forms.tobytes()
    found = _kinds.get(known)
    if found is None:
        kinds = (kind_of(each) for each in values)
        of_values = tuple([_one.setdefault(each, each) for each in kinds])
        found = _kinds.setdefault(known, (next(_numbers), of_values, _dtypes(values)))
    return Packed(found[1], found[0], block, tuple([start + 8 * each for each in layout.starts]))


def _flatten(value: tuple[Any, ...], form: list[Any], arrays: list[int], numbers: list[Any]) -> None:
    """The arrays and numbers that a value consists of."""
    form.append(type(value))
    form.append(len(value))
    for each in value:
        kind = type(each)
        if isinstance(each, np.ndarray):
            form.append(each.ndim)
            arrays.append(id(each))
        elif isinstance(each, tuple):
            _flatten(each, form, arrays, numbers)
        elif each is None:
            form.append(None)
        else:
            form.append(kind)
            numbers.append(each)


def _dtypes(value: Any) -> list[Any]:
    if isinstance(value, np.ndarray):
        return [value.dtype]
    return [each for item in value for each in _dtypes(item)] if isinstance(value, tuple) else []


def _layout(kinds: tuple[Kind, ...]) -> _Layout:
    firsts: list[int] = []
    numbers: list[tuple[int, Callable[[Any], int]]] = []

    def look(kind: Kind, first: int) -> int:
        if isinstance(kind, RecordKind | TupleKind):
            at = first
            for each in kind.kinds if isinstance(kind, RecordKind) else kind.items:
                at = look(each, at)
        elif isinstance(kind, ArrayKind):
            firsts.append(first)
        elif not isinstance(kind, Static):
            numbers.append((first, _bits if kind.name == "float" else _signed if kind.name == "uint" else int))
        return first + words(kind)

    starts = [0]
    for each in kinds:
        starts.append(look(each, starts[-1]))
    return _Layout(starts[-1], tuple(starts[:-1]), array("q", firsts), tuple(numbers))


def _bits(x: float) -> int:
    return struct.unpack("q", struct.pack("d", x))[0]


def _signed(x: Any) -> int:
    return int(x) if x < 2**63 else int(x) - 2**64


_readers: list[Any] = []


def _reader(store: Callable[[], Store | None]) -> Any:
    """The function (count, arrays, first words, words, forms) that reads arrays."""
    if not _readers:
        numpy_array.check_structure()
        key = digest(["arrays", sources_of_the_translator(), str(sorted(numpy_array.OFFSETS.items()))])
        _readers.append(_HEADER(machine_code.addresses(("read",), key, _write, store(), "the arrays of arguments")[0]))
    return _readers[0]


def _write(module: Any, prefix: str) -> None:
    shape = ir.FunctionType(ir.VoidType(), [I64, *[WORDS] * 4])
    function = ir.Function(module, shape, f"{prefix}read")
    b = ir.IRBuilder(function.append_basic_block())
    total, objects, firsts, block, forms = function.args
    with steps(b, ZERO, total, 1) as k:
        array = b.inttoptr(b.load(b.gep(objects, [k])), I8.as_pointer())
        to = b.gep(block, [b.load(b.gep(firsts, [k]))])
        axes = b.sext(numpy_array.field(b, array, "axes", _I32), I64)
        b.store(numpy_array.field(b, array, "data", I64), to)
        lengths, strides = (numpy_array.field(b, array, name, WORDS) for name in ("lengths", "strides"))
        with steps(b, ZERO, axes, 1) as i:
            after = b.add(i, ir.Constant(I64, 1))
            b.store(b.load(b.gep(lengths, [i])), b.gep(to, [after]))
            b.store(b.load(b.gep(strides, [i])), b.gep(to, [b.add(after, axes)]))
        last = b.load(b.gep(lengths, [b.sub(axes, ir.Constant(I64, 1))]))
        single = b.zext(b.icmp_signed("==", last, ir.Constant(I64, 1)), I64)
        flags = b.zext(numpy_array.field(b, array, "flags", _I32), I64)
        form = b.or_(b.shl(flags, ir.Constant(I64, 8)), b.or_(b.shl(axes, ir.Constant(I64, 1)), single))
        at = b.gep(forms, [b.mul(k, ir.Constant(I64, _FORM))])
        b.store(form, at)
        b.store(numpy_array.field(b, array, "dtype", I64), b.gep(at, [ir.Constant(I64, 1)]))
    b.ret_void()
