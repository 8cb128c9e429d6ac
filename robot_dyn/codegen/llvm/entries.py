"""Entries for Python: (x₁, …, y) → Status, with NumPy's arrays and without conversion.

They accept any objects and report those that are not arrays of the right form, without a Python error. The `self` of
the function is a bytes object with the parameters, if there are any.
"""

from __future__ import annotations

import numpy as np
from llvmlite import ir

from robot_dyn.codegen.llvm import numpy_array as arrays
from robot_dyn.codegen.llvm.one_state import Status
from robot_dyn.codegen.llvm.python_function import OBJECT, api, function_of
from robot_dyn.codegen.llvm.vectors import F64, I32, I64
from robot_dyn.foundations.validate import MAX_ROUNDING_ERROR

_LARGEST_NARROW = MAX_ROUNDING_ERROR / float(np.finfo(np.float32).eps)


def write_state_entry(
    module: ir.Module,
    name: str,
    state: ir.Function,
    inputs: tuple[int, ...],
    shape: tuple[int, ...],
    timed: bool,
    parameters: bool,
) -> None:
    """Write the entry (x₁, …, y) of a function of one state: arrays (nᵢ,), y of `shape`; x₁ a number if it is a time.

    With `parameters` the function receives the numbers of `self` before y.
    """
    shapes, kind = [*((n,) for n in inputs[timed:]), shape], _kind(state)
    builder, own, objects, views, status = _entry(module, name, len(inputs) + 1, len(shapes))
    times = [_number(builder, objects[0], kind, status)] if timed else []  # first, as it may run Python code
    pointers = _data(builder, objects[timed:], views, kind, list(map(len, shapes)), status)
    expected = [[ir.Constant(I64, length) for length in lengths] for lengths in shapes]
    _require(builder, [arrays.has_lengths(builder, *pair) for pair in zip(views, expected, strict=True)], status)
    for t in times:
        pointers.insert(0, builder.alloca(kind))
        builder.store(t, pointers[0])
    _answer(builder, builder.call(state, _with_own(builder, pointers, own, parameters)), status)


def write_batch_entry(
    module: ir.Module, name: str, batch: ir.Function, inputs: tuple[int, ...], outputs: int, parameters: bool
) -> None:
    """Write the entry (x₁, …, y, start, stop) of a function of batches: arrays (B, nᵢ), y (B, m), not overlapping."""
    kind, widths = _kind(batch), [ir.Constant(I64, n) for n in (*inputs, outputs)]
    builder, own, (*objects, start, stop), views, status = _entry(module, name, len(widths) + 2, len(widths))
    pointers = _data(builder, objects, views, kind, [2] * len(views), status)
    states = builder.load(arrays.field(builder, views[-1], "lengths"))
    right = [arrays.has_lengths(builder, view, (states, n)) for view, n in zip(views, widths, strict=True)]
    ends = [builder.gep(x, [builder.mul(states, n)]) for x, n in zip(pointers, widths, strict=True)]
    apart = [  # otherwise results would overwrite arguments
        builder.or_(builder.icmp_unsigned("<=", ends[-1], pointer), builder.icmp_unsigned("<=", end, pointers[-1]))
        for pointer, end in zip(pointers[:-1], ends[:-1], strict=True)
    ]
    _require(builder, [*right, *apart], status)
    bounds = [api(builder, "PyLong_AsLongLong", bound) for bound in (start, stop)]
    thread = api(builder, "PyEval_SaveThread")  # other threads may run Python meanwhile
    result = builder.call(batch, [*_with_own(builder, pointers, own, parameters), *bounds])
    api(builder, "PyEval_RestoreThread", thread)
    _answer(builder, result, status)


def _kind(function: ir.Function) -> ir.Type:
    """Return the type of the numbers of a function of states."""
    pointer = function.args[0].type
    assert isinstance(pointer, ir.PointerType)
    return pointer.pointee


def _entry(
    module: ir.Module, name: str, count: int, arrays_: int
) -> tuple[ir.IRBuilder, ir.Value, list[ir.Value], list[ir.Value], ir.PhiInstr]:
    """Write the frame of a Python function: return its builder, `self`, the arguments, views, and the status.

    The block of the status releases the views, also those still empty, and returns the status.
    """
    function = function_of(module, name)
    builder, end = (ir.IRBuilder(function.append_basic_block(block)) for block in ("entry", "end"))
    views, status = [arrays.empty_view(builder) for _ in range(arrays_)], end.phi(I64)
    for view in views:
        api(end, "PyBuffer_Release", view)
    end.ret(api(end, "PyLong_FromLongLong", status))
    own, arguments, number = function.args
    _require(builder, [builder.icmp_signed("==", number, ir.Constant(I64, count))], status)
    objects: list[ir.Value] = [builder.load(builder.gep(arguments, [ir.Constant(I32, i)])) for i in range(count)]
    return builder, own, objects, views, status


def _data(
    builder: ir.IRBuilder,
    objects: list[ir.Value],
    views: list[ir.Value],
    kind: ir.Type,
    axes: list[int],
    status: ir.PhiInstr,
) -> list[ir.Value]:
    """Return pointers to the numbers of C-contiguous arrays with these numbers of axes; the last is writeable."""
    for value, view, count in zip(objects, views, axes, strict=True):
        _require(builder, [arrays.is_array(builder, value)], status)
        request = arrays.C_CONTIGUOUS | arrays.FORMAT | (arrays.WRITABLE if view is views[-1] else 0)
        with builder.if_then(builder.not_(arrays.acquired(builder, value, view, request)), likely=False):
            api(builder, "PyErr_Clear")
            _answer(builder, ir.Constant(I64, int(Status.SHAPE)), status)
        _require(builder, [arrays.has_form(builder, view, kind, count)], status)
    return [builder.bitcast(arrays.field(builder, view, "data"), kind.as_pointer()) for view in views]


def _with_own(builder: ir.IRBuilder, pointers: list[ir.Value], own: ir.Value, parameters: bool) -> list[ir.Value]:
    """Return the pointers to x₁, …, y, with that to the parameters before y."""
    if not parameters:
        return pointers
    return [*pointers[:-1], builder.bitcast(api(builder, "PyBytes_AsString", own), pointers[-1].type), pointers[-1]]


def _require(builder: ir.IRBuilder, conditions: list[ir.Value], status: ir.PhiInstr) -> None:
    """Report a SHAPE unless all conditions hold."""
    block = builder.append_basic_block()
    status.add_incoming(ir.Constant(I64, int(Status.SHAPE)), builder.block)
    builder.cbranch(arrays.all_of(builder, conditions), block, status.parent).set_weights([99, 1])
    builder.position_at_end(block)


def _answer(builder: ir.IRBuilder, found: ir.Value, status: ir.PhiInstr) -> None:
    """Report a status."""
    status.add_incoming(found, builder.block)
    builder.branch(status.parent)


def _number(builder: ir.IRBuilder, value: ir.Value, kind: ir.Type, status: ir.PhiInstr) -> ir.Value:
    """Return a Python number as float; refuse other objects, and numbers too large to be rounded to float32."""
    x = api(builder, "PyFloat_AsDouble", value)
    with builder.if_then(builder.fcmp_ordered("==", x, ir.Constant(F64, -1.0)), likely=False):
        error = api(builder, "PyErr_Occurred")
        with builder.if_then(builder.icmp_unsigned("!=", error, ir.Constant(OBJECT, None)), likely=False):
            api(builder, "PyErr_Clear")
            _answer(builder, ir.Constant(I64, int(Status.SHAPE)), status)
    if kind is F64:
        return x
    narrow = builder.fptrunc(x, kind)
    magnitude = builder.call(builder.module.declare_intrinsic("llvm.fabs", [F64]), [x])
    is_small = builder.fcmp_unordered("<=", magnitude, ir.Constant(F64, _LARGEST_NARROW))
    exact = builder.fcmp_unordered("==", builder.fpext(narrow, F64), x)
    _require(builder, [builder.or_(is_small, exact)], status)
    return narrow
