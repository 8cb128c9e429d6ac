"""NumPy's arrays in machine code, by the fields of its C structure (its ABI, numpy/ndarraytypes.h).

Wrapping an array as an object of another library takes 50 ns, four times a call: more than the equations of an arm.
"""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np
from llvmlite import ir

from robot_dyn.codegen.llvm.vectors import I32, I64
from robot_dyn.foundations.errors import RobotDynError

TESTED = "2.2 to 2.4"  # versions of NumPy
_HEAD = object.__basicsize__  # of PyObject: its last field is the type
# PyArrayObject_fields: data, nd, dimensions, strides, base, descr, flags
OFFSETS = {
    "type": _HEAD - 8,
    "data": _HEAD,
    "axes": _HEAD + 8,
    "lengths": _HEAD + 16,
    "strides": _HEAD + 24,
    "dtype": _HEAD + 40,
    "flags": _HEAD + 48,
}
_PLAIN, _WRITEABLE = 0x1 | 0x100, 0x400  # C-contiguous and aligned
_I8 = ir.IntType(8)


class ArrayStructureError(RobotDynError):
    """This NumPy has the fields of an array at unknown offsets."""


@cache
def check_structure() -> None:
    """Compare the fields of an array with their known values.

    Raises:
        ArrayStructureError: If a field is at another offset.
    """
    x = np.ones((2, 3))
    found = {name: ctypes.c_void_p.from_address(id(x) + OFFSETS[name]).value for name in ("type", "data", "dtype")}
    found |= {name: ctypes.c_int.from_address(id(x) + OFFSETS[name]).value for name in ("axes", "flags")}
    expected = {"type": id(np.ndarray), "data": x.ctypes.data, "dtype": id(x.dtype), "axes": 2, "flags": x.flags.num}
    wrong = [name for name in expected if found[name] != expected[name]]
    if not wrong:  # then the field between axes and dtype is a pointer that can be followed
        shape = ctypes.POINTER(ctypes.c_ssize_t).from_address(id(x) + OFFSETS["lengths"])
        wrong = [] if (shape[0], shape[1]) == x.shape else ["lengths"]
    if not wrong:
        places = [ctypes.c_void_p.from_address(id(x) + OFFSETS[name]).value or 0 for name in ("lengths", "strides")]
        wrong = [] if places[1] - places[0] == 2 * ctypes.sizeof(ctypes.c_ssize_t) else ["strides"]  # behind them
    if wrong:
        raise ArrayStructureError(
            f"NumPy {np.__version__} does not keep {', '.join(wrong)} of an array where versions {TESTED} do;"
            ' install one of these, or take engine="interpreted"'
        )


def field(builder: Any, array: Any, name: str, kind: Any) -> Any:
    """A field of an array."""
    place = builder.gep(builder.bitcast(array, _I8.as_pointer()), [ir.Constant(I64, OFFSETS[name])])
    return builder.load(builder.bitcast(place, kind.as_pointer()))


def data(builder: Any, array: Any, kind: Any) -> Any:
    """The pointer to the numbers of an array."""
    return field(builder, array, "data", kind.as_pointer())


def is_array(builder: Any, value: Any, like: Any) -> Any:
    """Whether an object is of the same class as `like`, an array."""
    return builder.icmp_signed("==", *(field(builder, each, "type", I64) for each in (value, like)))


def has_form(builder: Any, array: Any, like: Any, axes: int, writeable: bool) -> Any:
    """Whether an array is C-contiguous, of the dtype of `like`, of so many axes, and writeable if it must be."""
    must = ir.Constant(I32, _PLAIN | (_WRITEABLE if writeable else 0))
    flags = builder.icmp_signed("==", builder.and_(field(builder, array, "flags", I32), must), must)
    dtypes = (field(builder, each, "dtype", I64) for each in (array, like))
    right = builder.and_(flags, builder.icmp_signed("==", *dtypes))
    return builder.and_(right, builder.icmp_signed("==", field(builder, array, "axes", I32), ir.Constant(I32, axes)))


def lengths(builder: Any, array: Any, axes: int) -> list[Any]:
    """The shape of an array of so many axes; a scalar array has no lengths to read."""
    pointer = field(builder, array, "lengths", I64.as_pointer())
    return [builder.load(builder.gep(pointer, [ir.Constant(I64, i)])) for i in range(axes)]


def has_shape(builder: Any, array: Any, shape: Sequence[Any]) -> Any:
    """Whether an array of len(shape) axes has this shape."""
    right = ir.Constant(ir.IntType(1), 1)
    for length, expected in zip(lengths(builder, array, len(shape)), shape, strict=True):
        right = builder.and_(right, builder.icmp_signed("==", length, expected))
    return right
