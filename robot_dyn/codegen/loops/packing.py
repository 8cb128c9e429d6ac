"""The words of arguments: numbers, and addresses, lengths and strides of arrays, read from their `Py_buffer`.

A loop has about eighty arrays. Python needs 1 µs for one address; machine code reads all of them in 5 µs.
"""

from __future__ import annotations

import struct
from array import array
from collections.abc import Callable, Hashable
from dataclasses import dataclass
from itertools import count
from typing import Any, SupportsInt, final

import numpy as np
from llvmlite import ir

from robot_dyn.codegen.llvm import machine_code, numpy_array
from robot_dyn.codegen.llvm.python_function import OBJECT, api, function_of, python_function
from robot_dyn.codegen.loops.kinds import I8, I64, WORDS, Kind, kind_of
from robot_dyn.codegen.loops.vectors import steps
from robot_dyn.codegen.store.cache import Store
from robot_dyn.codegen.store.keys import digest, sources_of_the_translator

_ONE = ir.Constant(I64, 1)


@final
@dataclass(frozen=True)
class Packed:
    """Words of values.

    Attributes:
        kinds: Types of the values.
        number: Number that identifies these types, quick to compare.
        words: All words, valid as long as the values exist.
        starts: Address of the first word of each value.
    """

    kinds: tuple[Kind, ...]
    number: int
    words: array[int]
    starts: tuple[int, ...]


@final
class _Layout:
    """Word positions of values with a common form, and their types by the forms of their arrays.

    Attributes:
        starts: First word of each value.
        size: Number of words.
        firsts: First word of each array.
        numbers: Word of each number.
        kinds: Number that identifies the types, and the types, by array forms.
    """

    def __init__(self, values: tuple[object, ...]) -> None:
        self.starts: list[int] = []
        self.size, self.firsts, self.numbers = 0, array("q"), list[int]()
        self.kinds: dict[bytes, tuple[int, tuple[Kind, ...]]] = {}
        for value in values:
            self.starts.append(self.size)
            self._add(value)

    def _add(self, value: object) -> None:
        if isinstance(value, np.ndarray):
            self.firsts.append(self.size)
            self.size += 1 + 2 * value.ndim
        elif isinstance(value, tuple):
            for item in value:
                self._add(item)
        elif value is not None:
            self.numbers.append(self.size)
            self.size += 1


_one: dict[Kind, Kind] = {}  # one object for equal types, so that comparison is quick
_numbers = count()  # thread-safe
_layouts: dict[tuple[Hashable, ...], _Layout] = {}


def pack(values: tuple[object, ...], store: Callable[[], Store | None]) -> Packed:
    """Return the words of arguments.

    Args:
        values: The arguments.
        store: Function that returns the store of machine code, or None.

    Raises:
        TraceError: If machine code does not support an argument.
    """
    form: list[Hashable] = []
    arrays: list[np.ndarray] = []
    numbers: list[SupportsInt] = []
    _flatten(values, form, arrays, numbers)
    shape = tuple(form)
    layout = _layouts.get(shape)
    if layout is None:
        layout = _layouts[shape] = _Layout(values)
    block, forms = array("q", bytes(8 * max(1, layout.size))), array("q", bytes(8 * len(arrays)))
    start = block.buffer_info()[0]
    if arrays:
        _reader(store)(layout.firsts.buffer_info()[0], start, forms.buffer_info()[0], *arrays)
    array_forms = forms.tobytes()
    typed = layout.kinds.get(array_forms)
    if typed is None:
        kinds = (kind_of(value) for value in values)
        typed = layout.kinds.setdefault(
            array_forms, (next(_numbers), tuple([_one.setdefault(kind, kind) for kind in kinds]))
        )
    floats = memoryview(block).cast("B").cast("d")
    for at, number in zip(layout.numbers, numbers, strict=True):
        if isinstance(number, float):
            floats[at] = number
        elif type(number) is np.uint64:
            struct.pack_into("Q", block, 8 * at, int(number))
        else:
            block[at] = int(number)
    return Packed(typed[1], typed[0], block, tuple([start + 8 * at for at in layout.starts]))


def _flatten(values: tuple[Any, ...], form: list[Hashable], arrays: list[np.ndarray], numbers: list[Any]) -> None:
    """Append the arrays and numbers contained in values."""
    for value in values:
        kind = type(value)
        if kind is np.ndarray:
            form += value.dtype, value.ndim
            arrays.append(value)
            continue
        form += (kind,)
        if kind is float or kind is int or kind is bool:
            numbers.append(value)
            continue
        if isinstance(value, tuple):
            form.append(len(value))
            _flatten(value, form, arrays, numbers)
        elif isinstance(value, np.ndarray):  # an instance of a subclass
            _flatten((np.asarray(value),), form, arrays, numbers)
        elif value is not None:
            numbers.append(value)


_readers: list[Callable[..., int]] = []


def _reader(store: Callable[[], Store | None]) -> Callable[..., int]:
    """Return the function (addresses of first words, words and forms, array, array, …) that reads arrays."""
    if not _readers:
        key = digest(["arrays", sources_of_the_translator()])
        address = machine_code.addresses(("read",), key, _write, store(), "the arrays of arguments")[0]
        _readers.append(python_function(address))
    return _readers[0]


def _write(module: ir.Module, prefix: str) -> None:
    """Write the reader. An array's form has four bits: contiguous, misaligned, read-only, last axis of length 1."""
    function = function_of(module, f"{prefix}read")
    b = ir.IRBuilder(function.append_basic_block())
    _, arguments, total = function.args
    view, bits, last = numpy_array.empty_view(b), b.alloca(I64), b.alloca(I64)
    places = [api(b, "PyLong_AsLongLong", b.load(b.gep(arguments, [ir.Constant(I64, i)]))) for i in range(3)]
    firsts, block, forms = (b.inttoptr(place, WORDS) for place in places)
    with steps(b, ir.Constant(I64, len(places)), total, 1) as k:
        value, index = b.load(b.gep(arguments, [k])), b.sub(k, ir.Constant(I64, len(places)))
        with b.if_then(b.not_(numpy_array.acquired(b, value, view, numpy_array.STRIDES)), likely=False):
            b.ret(ir.Constant(OBJECT, None))  # Python raises the error
        data, lengths, strides = (numpy_array.field(b, view, name) for name in ("data", "lengths", "strides"))
        axes = b.sext(numpy_array.field(b, view, "axes"), I64)
        to = b.gep(block, [b.load(b.gep(firsts, [index]))])
        first = b.ptrtoint(data, I64)
        for place, number in ((to, first), (bits, first), (last, ir.Constant(I64, 0))):
            b.store(number, place)
        with steps(b, ir.Constant(I64, 0), axes, 1) as i:
            length, stride, after = b.load(b.gep(lengths, [i])), b.load(b.gep(strides, [i])), b.add(i, _ONE)
            b.store(length, b.gep(to, [after]))
            b.store(stride, b.gep(to, [b.add(after, axes)]))
            b.store(b.or_(b.load(bits), stride), bits)
            b.store(length, last)
        itemsize, readonly = (numpy_array.field(b, view, name) for name in ("itemsize", "readonly"))
        form = b.sext(api(b, "PyBuffer_IsContiguous", view, ir.Constant(I8, ord("C"))), I64)
        odd = b.and_(b.load(bits), b.sub(itemsize, _ONE))  # 0 if aligned
        single = b.zext(b.icmp_signed("==", b.load(last), _ONE), I64)
        for digit in (b.zext(b.icmp_signed("!=", odd, ir.Constant(I64, 0)), I64), b.sext(readonly, I64), single):
            form = b.or_(b.shl(form, _ONE), digit)
        b.store(form, b.gep(forms, [index]))
        api(b, "PyBuffer_Release", view)
    b.ret(api(b, "PyLong_FromLongLong", ir.Constant(I64, 0)))
