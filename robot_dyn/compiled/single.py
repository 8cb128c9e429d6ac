"""One state: its code on numbers, the sines and cosines side by side in vectors; called from Python or compiled code.

From Python an array is read where it stands, by the fields of NumPy's C structure (its ABI). To wrap it up as Numba's
own array takes 50 ns, four times a call: more than the equations of an arm.
"""

from __future__ import annotations

from typing import Any, final

import numpy as np
from llvmlite import ir
from numba.core import types
from numba.core.datamodel import models
from numba.extending import NativeValue, intrinsic, register_model, unbox

from robot_dyn.compiled.lanes import F32, F64, Lanes, wide
from robot_dyn.compiled.sincos import GROUP, sincos_lanes
from robot_dyn.compiled.source import Line, Source, trigonometric_first
from robot_dyn.compiled.writer import FLAGS, Writer

_HEAD = object.__basicsize__  # of PyObject: its last field is the type
# PyArrayObject_fields, numpy/ndarraytypes.h: data, nd, dimensions, strides, base, descr, flags
_TYPE, _DATA, _AXES, _LENGTHS, _DTYPE, _FLAGS = _HEAD - 8, _HEAD, _HEAD + 8, _HEAD + 16, _HEAD + 40, _HEAD + 48
_PLAIN, _WRITEABLE = np.int32(0x1 | 0x100), np.int32(0x400)  # C-contiguous and aligned
_I8, _I32, _I64 = ir.IntType(8), ir.IntType(32), ir.IntType(64)


@final
class Object(types.Opaque):
    """Numba's type of any Python object, borrowed from the caller."""

    def __init__(self) -> None:
        super().__init__("robot_dyn.Object")


register_model(Object)(models.OpaqueModel)


@unbox(Object)
def _borrowed(kind: Any, value: Any, context: Any) -> Any:
    return NativeValue(value)


def _field(builder: Any, value: Any, offset: int, kind: Any) -> Any:
    place = builder.gep(builder.bitcast(value, _I8.as_pointer()), [ir.Constant(_I64, offset)])
    return builder.load(builder.bitcast(place, kind.as_pointer()))


@intrinsic
def is_array(typingctx: Any, value: Any, like: Any) -> Any:
    """Whether an object is of the same class as `like`, an array."""

    def code(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        return builder.icmp_signed("==", *(_field(builder, each, _TYPE, _I64) for each in args))

    return types.boolean(value, like), code


@intrinsic
def has_form(typingctx: Any, value: Any, like: Any, shape: Any, writeable: Any) -> Any:
    """Whether an array is C-contiguous, has the dtype of `like` and this shape, and may be written if it must be."""

    def code(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        value, like, lengths, must = args
        flags = builder.or_(
            ir.Constant(_I32, int(_PLAIN)),
            builder.select(must, ir.Constant(_I32, int(_WRITEABLE)), ir.Constant(_I32, 0)),
        )
        right = builder.icmp_signed("==", builder.and_(_field(builder, value, _FLAGS, _I32), flags), flags)
        right = builder.and_(
            right,
            builder.icmp_signed("==", _field(builder, value, _DTYPE, _I64), _field(builder, like, _DTYPE, _I64)),
        )
        axes = ir.Constant(_I32, len(shape))
        right = builder.and_(right, builder.icmp_signed("==", _field(builder, value, _AXES, _I32), axes))
        with builder.if_else(right) as (then, otherwise):  # an array of no axes has no lengths
            with then:
                pointer, same = _field(builder, value, _LENGTHS, _I8.as_pointer()), ir.Constant(ir.IntType(1), 1)
                for i in range(len(shape)):
                    length = _field(builder, pointer, 8 * i, _I64)
                    same = builder.and_(same, builder.icmp_signed("==", length, builder.extract_value(lengths, i)))
                inner = builder.block
            with otherwise:
                outer = builder.block
        answer = builder.phi(ir.IntType(1))
        answer.add_incoming(same, inner)
        answer.add_incoming(ir.Constant(ir.IntType(1), 0), outer)
        return answer

    return types.boolean(value, like, shape, writeable), code


def state_of(source: Source, dtype: str, limit: float, most: float, doubtful: float) -> Any:
    """The intrinsic (x₀, …), y → (Σ |x|, Σ |y|, whether an angle is beyond `limit`) at one state.

    Arguments are Numba's arrays, objects known to be such arrays, or a number; y may be an argument;
    it is written if Σ |x| < most, Σ |y| < doubtful and no angle is beyond.
    """
    kind = F32 if dtype == "float32" else F64

    def typed(typingctx: Any, arrays: Any, y: Any) -> Any:
        number = getattr(types, dtype)

        def code(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            writer, columns, total = Writer(context, builder, kind, 1), [], ir.Constant(kind, 0.0)
            for i, (each, n) in enumerate(zip(arrays, source.inputs, strict=True)):
                value = builder.extract_value(args[0], i)
                if isinstance(each, types.Float):
                    columns.append([context.cast(builder, value, each, number)])
                    total = writer.size(columns[-1], total)
                else:
                    data = _data(context, builder, each, value, kind)
                    columns.append([builder.load(builder.gep(data, [ir.Constant(_I64, k)])) for k in range(n)])
                    total = _sized(writer, data, n, total)
            far = _straight(writer, source, columns, limit)
            results = [writer.values[name] for name in source.results]
            data = _data(context, builder, y, args[1], kind)
            distinct = [writer.values[name] for name in dict.fromkeys(source.results)]  # of M half
            sizes = total, writer.size(distinct, writer.constant(0))
            fine = builder.not_(far)
            for size, bound in zip(sizes, (most, doubtful), strict=True):
                fine = builder.and_(fine, builder.fcmp_ordered("<", size, ir.Constant(kind, bound)))
            with builder.if_then(fine, likely=True):  # else arguments that `y` lies in are still to be read
                for k, value in enumerate(results):
                    builder.store(value, builder.gep(data, [ir.Constant(_I64, k)]))
            return context.make_tuple(builder, signature.return_type, [*sizes, far])

        return types.Tuple((number, number, types.boolean))(arrays, y), code

    return intrinsic(typed)


def _sized(writer: Writer, data: Any, n: int, total: Any) -> Any:
    """Add Σ |x| of n numbers, read once more in vectors: number by number it would be one instruction in twenty."""
    builder, at = writer.builder, 0
    for count in (8, 4, 2, 1):
        wider = Writer(writer.context, builder, writer.kind, count)
        while n - at >= count:
            place = builder.bitcast(builder.gep(data, [ir.Constant(_I64, at)]), wide(writer.kind, count).as_pointer())
            x = wider.intrinsic("fabs", builder.load(place, align=8 if writer.kind is F64 else 4))
            total = builder.fadd(total, x if count == 1 else _sum(writer, x, count), flags=FLAGS)
            at += count
    return total


def _sum(writer: Writer, vector: Any, count: int) -> Any:
    name = f"llvm.vector.reduce.fadd.v{count}f{64 if writer.kind is F64 else 32}"
    shape = ir.FunctionType(writer.kind, [writer.kind, vector.type])
    made = writer.builder.module.declare_intrinsic(name, fnty=shape)
    return writer.builder.call(made, [ir.Constant(writer.kind, 0.0), vector], fastmath=FLAGS)


def _data(context: Any, builder: Any, kind: Any, value: Any, number: Any) -> Any:
    if isinstance(kind, Object):
        return _field(builder, value, _DATA, number.as_pointer())
    return context.make_array(kind)(context, builder, value).data


def _straight(writer: Writer, source: Source, columns: list[list[Any]], limit: float) -> Any:
    """The code on numbers; whether an angle is beyond the limit."""
    writer.start(source, columns)
    first, trigonometric, rest = trigonometric_first(source.lines)
    far = ir.Constant(ir.IntType(1), 0)
    for line in first:
        writer.line(line)
    for i in range(0, len(trigonometric), GROUP):
        far = writer.builder.or_(far, _together(writer, trigonometric[i : i + GROUP], limit))
    for line in rest:
        if line.trigonometric:
            far = writer.builder.or_(far, _together(writer, [line], limit))
        else:
            writer.line(line)
    return far


def _together(writer: Writer, lines: list[Line], limit: float) -> Any:
    """Sines and cosines in one vector; whether one of the angles is beyond the limit."""
    builder, count = writer.builder, GROUP if len(lines) > 1 else 1
    of = [writer.values[line.read[0]] for line in lines]
    if count == 1:
        angles = Lanes(builder, of[0], writer.kind, 1)
    else:
        vector = ir.Constant(wide(writer.kind, count), [0.0] * count)
        for i, angle in enumerate(of):
            vector = builder.insert_element(vector, angle, ir.Constant(_I32, i))
        angles = Lanes(builder, vector, writer.kind, count)
    both = sincos_lanes(angles)
    for i, line in enumerate(lines):
        parts = [
            half.value if count == 1 else builder.extract_element(half.value, ir.Constant(_I32, i)) for half in both
        ]
        writer.values.update(zip(line.made, parts, strict=True))
    size = Lanes(
        builder, Writer(writer.context, builder, writer.kind, count).intrinsic("fabs", angles.value), writer.kind, count
    )
    beyond = builder.fcmp_ordered(">", size.value, size.of(limit))
    if count == 1:
        return beyond
    return builder.icmp_unsigned("!=", builder.bitcast(beyond, ir.IntType(count)), ir.Constant(ir.IntType(count), 0))
