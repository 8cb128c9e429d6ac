"""Batches as machine code: batch(x₁, …, y, start, stop) → Status, for states start … stop − 1 of arrays (B, n).

L states at a time go from memory through all instructions and back: intermediate values stay in registers as far as
LLVM can, and loads and shuffles fill the gaps that long chains of products leave.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir

from robot_dyn.codegen.llvm.one_state import Limits, distinct, judged, numbers
from robot_dyn.codegen.llvm.rows import loaded, prefetch, store
from robot_dyn.codegen.llvm.vectors import F32, I64, align_stack
from robot_dyn.codegen.llvm.writer import Writer
from robot_dyn.codegen.program import Program

REGISTER = 64  # bytes: a 512-bit register, or two or four smaller ones


def lanes(kind: Any) -> int:
    """L: the states of a vector."""
    return REGISTER // (4 if kind is F32 else 8)


def batch_function(module: Any, name: str, program: Program, kind: Any, limits: Limits, parameters: bool) -> Any:
    """The function for a batch of at least L states; the last vector may overlap the one before.

    With `parameters` the last input is one row, the same for all states.
    """
    pointers = [kind.as_pointer()] * (len(program.inputs) + 1)
    function = ir.Function(module, ir.FunctionType(I64, [*pointers, I64, I64]), name)
    align_stack(function)
    *arrays, start, stop = function.args
    opening, loop, end = (function.append_basic_block(each) for each in ("opening", "loop", "end"))
    ir.IRBuilder(opening).branch(loop)
    builder = ir.IRBuilder(loop)
    writer = Writer(builder, kind, lanes(kind))
    vectors, step = writer.vectors, ir.Constant(I64, lanes(kind))
    base, *before = seen = [builder.phi(each) for each in (I64, vectors.type, vectors.type, vectors.none.type)]
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
    writer: Writer, program: Program, arrays: list[Any], at: Any, before: list[Any], parameters: bool
) -> tuple[Any, Any, Any]:
    """L states from `at` on: loaded, computed, stored; Σ |x|, Σ |y| and angles beyond the range, with those before."""
    vectors, (*inputs, y) = writer.vectors, arrays
    given = list(zip(inputs, program.inputs, strict=True))
    of_states, alike = (given[:-1], given[-1:]) if parameters else (given, [])
    for array, n in of_states:
        prefetch(vectors, array, at, n, False)
    prefetch(vectors, y, at, len(program.outputs), True)
    columns = [loaded(vectors, array, at, n) for array, n in of_states]
    rows = [[vectors.of([x] * vectors.count) for x in numbers(vectors.builder, *each)] for each in alike]
    written = writer.write(program, [*columns, *rows])
    store(vectors, y, at, written.results)
    arguments = vectors.absolute_sum((x for each in columns for x in each), before[0])
    results = vectors.absolute_sum(distinct(program, written.results), before[1])
    return arguments, results, vectors.builder.or_(before[2], written.out_of_range)
