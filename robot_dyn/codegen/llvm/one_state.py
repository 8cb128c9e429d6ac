"""One state as machine code: state(x₁, …, y) → Status, with pointers to the numbers of each input and to the results.

Sums of absolute values detect non-finite and large numbers. Results are written if there is no doubt, after all inputs
are read: y may be an input. Parameters, the last input if any, were checked before.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum
from typing import final

from llvmlite import ir

from robot_dyn.codegen.llvm.vectors import FLAGS, I64, Vectors
from robot_dyn.codegen.llvm.writer import Writer
from robot_dyn.codegen.program import Program


class Status(IntEnum):
    """Report of a kernel on its arguments and results; the largest value of several states counts.

    The slow path raises the error.
    """

    FINE = 0
    FAR = 1  # an angle beyond the range of the sine and cosine
    SHAPE = 2
    ARGUMENT = 3  # not finite, or large
    RESULT = 4  # not finite, or doubtfully large


@final
@dataclass(frozen=True)
class Limits:
    """Upper bounds of Σ |x| of the arguments and of the results of one state."""

    arguments: float
    results: float


def state_function(
    module: ir.Module, name: str, program: Program, kind: ir.Type, limits: Limits, any_angle: bool, parameters: bool
) -> ir.Function:
    """Write the function of one state; with `any_angle` it uses the C library's sine and cosine, for any angle."""
    pointers = [kind.as_pointer()] * (len(program.inputs) + 1)
    function = ir.Function(module, ir.FunctionType(I64, pointers), name)
    builder = ir.IRBuilder(function.append_basic_block())
    *inputs, y = function.args
    writer = Writer(builder, kind, 1, any_angle)
    vectors, total, columns = writer.vectors, ir.Constant(kind, 0.0), []
    for i, (array, n) in enumerate(zip(inputs, program.inputs, strict=True), start=1):
        columns.append(numbers(builder, array, n))
        if not parameters or i < len(inputs):
            total = _add_absolute(vectors, array, n, total)
    written = writer.write(program, columns)
    size = vectors.absolute_sum(distinct(program, written.results), ir.Constant(kind, 0.0))
    status, fine = judged(
        builder, total, size, written.out_of_range, limits.arguments, ir.Constant(kind, limits.results)
    )
    with builder.if_then(fine, likely=True):
        for k, value in enumerate(written.results):
            builder.store(value, builder.gep(y, [ir.Constant(I64, k)]))
    builder.ret(status)
    return function


def numbers(builder: ir.IRBuilder, array: ir.Value, n: int) -> list[ir.Value]:
    """Load the n numbers at a pointer."""
    return [builder.load(builder.gep(array, [ir.Constant(I64, k)])) for k in range(n)]


def distinct(program: Program, results: list[ir.Value]) -> list[ir.Value]:
    """Return each result once; half of the entries of M."""
    return list(dict(zip(program.outputs, results, strict=True)).values())


def judged(
    builder: ir.IRBuilder,
    arguments: ir.Value,
    results: ir.Value,
    out_of_range: ir.Value,
    most: float,
    doubtful: ir.Value,
) -> tuple[ir.Value, ir.Value]:
    """Return the Status for the sums of absolute values and the angles, and the condition that it is FINE."""
    passed = builder.fcmp_ordered("<", arguments, ir.Constant(arguments.type, most))
    small = builder.fcmp_ordered("<", results, doubtful)
    status = builder.select(small, ir.Constant(I64, int(Status.FINE)), ir.Constant(I64, int(Status.RESULT)))
    status = builder.select(out_of_range, ir.Constant(I64, int(Status.FAR)), status)
    status = builder.select(passed, status, ir.Constant(I64, int(Status.ARGUMENT)))
    return status, builder.and_(builder.and_(passed, small), builder.not_(out_of_range))


def _add_absolute(vectors: Vectors, array: ir.Value, n: int, total: ir.Value) -> ir.Value:
    """Add Σ |x| of n numbers, loaded again as vectors: one by one they would be 5 % of all instructions."""
    builder, at = vectors.builder, 0
    for count in (8, 4, 2, 1):
        wider = Vectors(builder, vectors.kind, count)
        while n - at >= count:
            place = builder.bitcast(builder.gep(array, [ir.Constant(I64, at)]), wider.type.as_pointer())
            x = wider.intrinsic("fabs", builder.load(place, align=wider.size))
            total = builder.fadd(total, wider.sum(x), flags=FLAGS)
            at += count
    return total
