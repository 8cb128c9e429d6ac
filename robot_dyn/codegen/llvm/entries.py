"""Entries for Python: (x₁, …, y) → Status, of NumPy's arrays without conversion.

They accept any objects and report those that are not arrays of the right form. The `self` of the function is an array
of the dtype that the others must have; it holds the parameters, if there are any.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from llvmlite import ir

from robot_dyn.codegen.llvm import numpy_array as arrays
from robot_dyn.codegen.llvm.one_state import Status
from robot_dyn.codegen.llvm.python_function import api, function_of
from robot_dyn.codegen.llvm.vectors import F64, I32, I64
from robot_dyn.foundations.validate import LEAST_EXACT

_LARGEST_NARROW = LEAST_EXACT / float(np.finfo(np.float32).eps)


def write_state_entry(
    module: Any, name: str, state: Any, inputs: tuple[int, ...], shape: tuple[int, ...], timed: bool, parameters: bool
) -> None:
    """The entry (x₁, …, y) of a function for one state: arrays (nᵢ,), y of `shape`; x₁ a number if it is a time.

    With `parameters` the function takes the numbers of `self` before y.
    """
    builder, like, objects, refuse = _entry(module, name, len(inputs) + 1)
    kind = state.args[0].type.pointee
    rest = objects[timed:]
    times = [_number(builder, objects[0], kind, refuse)] if timed else []  # first, as it may run Python code
    shapes = [*((n,) for n in inputs[timed:]), shape]
    _require(builder, [arrays.is_array(builder, x, like) for x in rest], refuse)
    forms = [arrays.has_form(builder, x, like, len(s), x is rest[-1]) for x, s in zip(rest, shapes, strict=True)]
    _require(builder, forms, refuse)
    expected = [[ir.Constant(I64, length) for length in each] for each in shapes]
    _require(builder, [arrays.has_shape(builder, x, s) for x, s in zip(rest, expected, strict=True)], refuse)
    pointers = [arrays.data(builder, x, kind) for x in rest]
    for t in times:
        pointers.insert(0, builder.alloca(kind))
        builder.store(t, pointers[0])
    _answer(builder, builder.call(state, _with_own(builder, pointers, like, parameters)))


def write_batch_entry(
    module: Any, name: str, batch: Any, inputs: tuple[int, ...], outputs: int, parameters: bool
) -> None:
    """The entry (x₁, …, y, start, stop) of a function for batches: arrays (B, nᵢ), y (B, m), that do not overlap it."""
    builder, like, objects, refuse = _entry(module, name, len(inputs) + 3)
    kind = batch.args[0].type.pointee
    *rest, start, stop = objects
    _require(builder, [arrays.is_array(builder, x, like) for x in rest], refuse)
    _require(builder, [arrays.has_form(builder, x, like, 2, x is rest[-1]) for x in rest], refuse)
    states = arrays.lengths(builder, rest[-1], 2)[0]
    widths = [ir.Constant(I64, n) for n in (*inputs, outputs)]
    _require(builder, [arrays.has_shape(builder, x, (states, n)) for x, n in zip(rest, widths, strict=True)], refuse)
    pointers = [arrays.data(builder, x, kind) for x in rest]
    ends = [builder.gep(x, [builder.mul(states, n)]) for x, n in zip(pointers, widths, strict=True)]
    apart = [  # otherwise results would overwrite arguments
        builder.or_(builder.icmp_unsigned("<=", ends[-1], pointer), builder.icmp_unsigned("<=", end, pointers[-1]))
        for pointer, end in zip(pointers[:-1], ends[:-1], strict=True)
    ]
    _require(builder, apart, refuse)
    bounds = [api(builder, "PyLong_AsLongLong", each) for each in (start, stop)]
    thread = api(builder, "PyEval_SaveThread")  # other threads may run Python meanwhile
    status = builder.call(batch, [*_with_own(builder, pointers, like, parameters), *bounds])
    api(builder, "PyEval_RestoreThread", thread)
    _answer(builder, status)


def _entry(module: Any, name: str, count: int) -> tuple[Any, Any, list[Any], Any]:
    """A function of Python: its builder, `self`, the arguments, and the block that reports a SHAPE."""
    function = function_of(module, name)
    builder = ir.IRBuilder(function.append_basic_block("entry"))
    refuse = function.append_basic_block("refuse")
    _answer(ir.IRBuilder(refuse), ir.Constant(I64, int(Status.SHAPE)))
    like, arguments, number = function.args
    _require(builder, [builder.icmp_signed("==", number, ir.Constant(I64, count))], refuse)
    return builder, like, [builder.load(builder.gep(arguments, [ir.Constant(I32, i)])) for i in range(count)], refuse


def _with_own(builder: Any, pointers: list[Any], like: Any, parameters: bool) -> list[Any]:
    """The pointers to x₁, …, y, and before y that to the parameters."""
    own = [arrays.data(builder, like, pointers[-1].type.pointee)] if parameters else []
    return [*pointers[:-1], *own, pointers[-1]]


def _require(builder: Any, conditions: list[Any], refuse: Any) -> None:
    """Refuse unless all conditions hold."""
    right = conditions[0]
    for each in conditions[1:]:
        right = builder.and_(right, each)
    block = builder.append_basic_block()
    builder.cbranch(right, block, refuse).set_weights([99, 1])
    builder.position_at_end(block)


def _number(builder: Any, value: Any, kind: Any, refuse: Any) -> Any:
    """A Python number; anything else is refused, and so is what `validate.converted` refuses to round to float32."""
    x = api(builder, "PyFloat_AsDouble", value)
    with builder.if_then(builder.fcmp_ordered("==", x, ir.Constant(F64, -1.0)), likely=False):
        error = builder.ptrtoint(api(builder, "PyErr_Occurred"), I64)
        with builder.if_then(builder.icmp_signed("!=", error, ir.Constant(I64, 0)), likely=False):
            api(builder, "PyErr_Clear")
            builder.branch(refuse)
    if kind is F64:
        return x
    narrow = builder.fptrunc(x, kind)
    known = builder.fcmp_unordered("<=", builder.call(_magnitude(builder), [x]), ir.Constant(F64, _LARGEST_NARROW))
    exact = builder.fcmp_unordered("==", builder.fpext(narrow, F64), x)
    _require(builder, [builder.or_(known, exact)], refuse)
    return narrow


def _magnitude(builder: Any) -> Any:
    return builder.module.declare_intrinsic("llvm.fabs", [F64])


def _answer(builder: Any, status: Any) -> None:
    builder.ret(api(builder, "PyLong_FromLongLong", status))
