"""Batches as machine code: batch(x₁, …, y, start, stop) → Status, for states start … stop − 1 of arrays (B, n).

L states at a time pass from memory through all instructions and back: intermediate values stay in registers where
possible, and loads and shuffles fill the gaps in long chains of products.
"""

from __future__ import annotations

from collections.abc import Sequence

from llvmlite import ir

from robot_dyn.codegen.llvm.one_state import Limits, distinct, judged, numbers
from robot_dyn.codegen.llvm.rows import loaded, prefetch, store
from robot_dyn.codegen.llvm.vectors import F32, I64, align_stack
from robot_dyn.codegen.llvm.writer import Writer
from robot_dyn.codegen.program import Program

REGISTER = 64  # bytes: a 512-bit register, or two or four smaller ones


def lanes(kind: ir.Type) -> int:
    """Return L, the number of states in a vector."""
    return REGISTER // (4 if kind is F32 else 8)


def batch_function(
    module: ir.Module, name: str, program: Program, kind: ir.Type, limits: Limits, parameters: bool
) -> ir.Function:
    """Write the function for a batch of at least L states; the last vector may overlap the previous one.

    With `parameters` the last input is one row, the same for all states.
    """
    pointers = [kind.as_pointer()] * (len(program.inputs) + 1)
    function = ir.Function(module, ir.FunctionType(I64, [*pointers, I64, I64]), name)
    align_stack(function)
    *arrays, start, stop = function.args
    opening, loop, end = (function.append_basic_block(block) for block in ("opening", "loop", "end"))
    ir.IRBuilder(opening).branch(loop)
    builder = ir.IRBuilder(loop)
    writer = Writer(builder, kind, lanes(kind))
    vectors, step = writer.vectors, ir.Constant(I64, lanes(kind))
    base, *before = seen = [builder.phi(kind_) for kind_ in (I64, vectors.type, vectors.type, vectors.none.type)]
    for phi, value in zip(seen, (start, vectors.constant(0.0), vectors.constant(0.0), vectors.none), strict=True):
        phi.add_incoming(value, opening)
    last, after = builder.sub(stop, step), builder.add(base, step)
    at = builder.select(builder.icmp_signed("<", base, last), base, last)
    sums = _group(writer, program, arrays, at, before, parameters)
    for phi, value in zip(seen, (after, *sums), strict=True):
        phi.add_incoming(value, loop)
    builder.cbranch(builder.icmp_signed("<", after, stop), loop, end)
    builder.position_at_end(end)
    states = builder.sitofp(builder.sub(stop, start), kind)
    doubtful = builder.fmul(states, ir.Constant(kind, limits.results))
    arguments, results = vectors.sum(sums[0]), vectors.sum(sums[1])
    status, _ = judged(builder, arguments, results, vectors.any(sums[2]), limits.arguments, doubtful)
    builder.ret(status)
    return function


def _group(
    writer: Writer,
    program: Program,
    arrays: Sequence[ir.Value],
    at: ir.Value,
    before: Sequence[ir.Value],
    parameters: bool,
) -> tuple[ir.Value, ir.Value, ir.Value]:
    """Load, compute and store L states from `at` on; return Σ |x|, Σ |y| and the mask of far angles, accumulated."""
    vectors, (*inputs, y) = writer.vectors, arrays
    pairs = list(zip(inputs, program.inputs, strict=True))
    varying, alike = (pairs[:-1], pairs[-1:]) if parameters else (pairs, [])
    for array, n in varying:
        prefetch(vectors, array, at, n, False)
    prefetch(vectors, y, at, len(program.outputs), True)
    columns = [loaded(vectors, array, at, n) for array, n in varying]
    rows = [[vectors.packed([x] * vectors.count) for x in numbers(vectors.builder, *pair)] for pair in alike]
    written = writer.write(program, [*columns, *rows])
    store(vectors, y, at, written.results)
    arguments = vectors.absolute_sum((x for column in columns for x in column), before[0])
    results = vectors.absolute_sum(distinct(program, written.results), before[1])
    return arguments, results, vectors.builder.or_(before[2], written.out_of_range)
