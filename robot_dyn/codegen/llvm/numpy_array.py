"""NumPy arrays in machine code, read through Python's buffer protocol: a `Py_buffer` belongs to the stable ABI."""

from __future__ import annotations

from collections.abc import Sequence

from llvmlite import ir

from robot_dyn.codegen.llvm.python_function import NDARRAY, OBJECT, VIEW, api
from robot_dyn.codegen.llvm.vectors import F64, I1, I32, I64

WRITABLE, FORMAT, STRIDES, C_CONTIGUOUS = 0x1, 0x4, 0x18, 0x38  # requests to PyObject_GetBuffer
_FIELDS = "data", "owner", "size", "itemsize", "readonly", "axes", "format", "lengths", "strides"


def empty_view(builder: ir.IRBuilder) -> ir.Value:
    """Return a pointer to a `Py_buffer` of no object, whose release does nothing."""
    view = builder.alloca(VIEW)
    builder.store(ir.Constant(OBJECT, None), _place(builder, view, "owner"))
    return view


def field(builder: ir.IRBuilder, view: ir.Value, name: str) -> ir.Value:
    """Load a field of a view."""
    return builder.load(_place(builder, view, name))


def is_array(builder: ir.IRBuilder, value: ir.Value) -> ir.Value:
    """Return True if the class of an object is `numpy.ndarray`, not a subclass."""
    kind = api(builder, "PyObject_Type", value)
    api(builder, "Py_DecRef", kind)  # the object still references it
    ndarray = builder.module.globals.get(NDARRAY) or ir.GlobalVariable(builder.module, ir.IntType(8), NDARRAY)
    return builder.icmp_unsigned("==", kind, ndarray)


def acquired(builder: ir.IRBuilder, value: ir.Value, view: ir.Value, request: int) -> ir.Value:
    """Fill a view; return whether that succeeded. If not, a Python error is set."""
    status = api(builder, "PyObject_GetBuffer", value, view, ir.Constant(I32, request))
    return builder.icmp_signed("==", status, ir.Constant(I32, 0))


def has_form(builder: ir.IRBuilder, view: ir.Value, kind: ir.Type, axes: int) -> ir.Value:
    """Return True if a view contains aligned numbers of `kind` in native byte order, along `axes` axes."""
    conditions = [builder.icmp_signed("==", field(builder, view, "axes"), ir.Constant(I32, axes))]
    text = field(builder, view, "format")
    for i, letter in enumerate(b"d\0" if kind is F64 else b"f\0"):
        character = builder.load(builder.gep(text, [ir.Constant(I64, i)]))
        conditions.append(builder.icmp_unsigned("==", character, ir.Constant(character.type, letter)))
    below = builder.ptrtoint(field(builder, view, "data"), I64)
    below = builder.and_(below, ir.Constant(I64, 7 if kind is F64 else 3))
    return all_of(builder, [*conditions, builder.icmp_signed("==", below, ir.Constant(I64, 0))])


def has_lengths(builder: ir.IRBuilder, view: ir.Value, expected: Sequence[ir.Value]) -> ir.Value:
    """Return True if a view of len(expected) axes has these lengths."""
    lengths, conditions = field(builder, view, "lengths"), []
    for axis, length in enumerate(expected):
        actual = builder.load(builder.gep(lengths, [ir.Constant(I64, axis)]))
        conditions.append(builder.icmp_signed("==", actual, length))
    return all_of(builder, conditions)


def all_of(builder: ir.IRBuilder, conditions: Sequence[ir.Value]) -> ir.Value:
    """Return True if all conditions hold."""
    result = ir.Constant(I1, 1)
    for condition in conditions:
        result = builder.and_(result, condition)
    return result


def _place(builder: ir.IRBuilder, view: ir.Value, name: str) -> ir.Value:
    return builder.gep(view, [ir.Constant(I32, 0), ir.Constant(I32, _FIELDS.index(name))])
