"""Functions (t, y, p, own, out) of a state equation as machine code, of one run or of W in lock step.

Number k of run b is y[k W + b]; t and p are shared, and so are those of `own` that are one number for all runs. A run
with an angle beyond the range of the vectors' sine and cosine is computed once more with the C library's, so that no
run depends on the others.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from llvmlite import ir

from robot_dyn.compiled.llvm.lanes import F64, wide
from robot_dyn.compiled.llvm.vectors import I1, I64, Vectors
from robot_dyn.compiled.llvm.writer import Writer, Written
from robot_dyn.compiled.program import Program

SIDE = 8  # runs in a vector: a 512-bit register, or two or four smaller ones
Own = Mapping[int, tuple[int, bool]]  # of each number of `own`: its row, or where it stands once
_NOTHING: Mapping[int, int] = MappingProxyType({})
_ARGUMENTS = [F64, *[F64.as_pointer()] * 4]


def write_function(
    module: Any, name: str, program: Program, runs: int, shared: Mapping[int, int] = _NOTHING, passes: int = 1
) -> None:
    """A function of a program with the inputs t (1,), y, p and own.

    Args:
        module: LLVM's.
        name: Of the function.
        program: What it computes.
        runs: 1 or a multiple of SIDE.
        shared: Of those numbers of `own` that are the same for all runs, where in it each stands once; the others come
            row by row in their order.
        passes: How often it is computed at most, for the runs of each vector until the last output is 0 for all of
            them: the outputs before that one are then `own` of the next pass.
    """
    rows = [k for k in range(program.inputs[-1]) if k not in shared]
    own = {k: (row, False) for row, k in enumerate(rows)} | {k: (at, True) for k, at in shared.items()}
    any_angle = _any_angle(module, f"{name}_any_angle", program, runs, own)
    function = ir.Function(module, ir.FunctionType(ir.VoidType(), _ARGUMENTS), name)
    builder = ir.IRBuilder(function.append_basic_block())
    before, body, end = builder.block, function.append_basic_block(), function.append_basic_block()
    builder.branch(body)
    builder.position_at_end(body)
    at = builder.phi(I64)
    at.add_incoming(ir.Constant(I64, 0), before)
    writer = Writer(builder, F64, min(SIDE, runs))
    given = _inputs(writer.vectors, function.args, program, runs, at, own)
    written = writer.write(program, given) if passes == 1 else _repeated(writer, program, given, passes)
    for k, value in enumerate(written.results):
        builder.store(value, _place(writer.vectors, function.args[-1], k, runs, at), align=8)
    with builder.if_then(writer.vectors.any(written.beyond), likely=False):
        builder.call(any_angle, [*function.args, at, builder.bitcast(written.beyond, ir.IntType(writer.count))])
    following = builder.add(at, ir.Constant(I64, writer.count))
    at.add_incoming(following, builder.block)
    builder.cbranch(builder.icmp_signed("<", following, ir.Constant(I64, runs)), body, end)
    builder.position_at_end(end)
    builder.ret_void()


def _repeated(writer: Writer, program: Program, given: list[list[Any]], passes: int) -> Written:
    """The program of one vector of runs, pass after pass."""
    builder, vectors = writer.builder, writer.vectors
    before, again, done = builder.block, builder.append_basic_block(), builder.append_basic_block()
    builder.branch(again)
    builder.position_at_end(again)
    count, own = builder.phi(I64), [builder.phi(vectors.type) for _ in given[-1]]
    written = writer.write(program, [*given[:-1], own])
    *_, changed = written.results
    after = builder.add(count, ir.Constant(I64, 1))
    first, following = [ir.Constant(I64, 0), *given[-1]], [after, *written.results[-1 - len(own) : -1]]
    for phi, start, value in zip([count, *own], first, following, strict=True):
        phi.add_incoming(start, before)
        phi.add_incoming(value, builder.block)
    goes_on = vectors.any(builder.fcmp_ordered(">", changed, vectors.constant(0.0)))
    less = builder.icmp_signed("<", after, ir.Constant(I64, passes))
    builder.cbranch(builder.and_(goes_on, less), again, done)
    builder.position_at_end(done)
    return written


def _any_angle(module: Any, name: str, program: Program, runs: int, own: Own) -> Any:
    """The same for the runs from a number on that share a vector, and stored of those alone whose bit is set."""
    side = min(SIDE, runs)
    shape = ir.FunctionType(ir.VoidType(), [*_ARGUMENTS, I64, ir.IntType(side)])
    function = ir.Function(module, shape, name)
    function.linkage = "internal"
    function.attributes.add("noinline")
    function.attributes.add("optnone")  # it is hardly ever called, and soon compiled
    builder = ir.IRBuilder(function.append_basic_block())
    *arguments, at, bits = function.args
    writer = Writer(builder, F64, side, any_angle=True)
    mask = builder.bitcast(bits, wide(I1, side))
    given = _inputs(writer.vectors, arguments, program, runs, at, own)
    for k, value in enumerate(writer.write(program, given).results):
        place = _place(writer.vectors, arguments[-1], k, runs, at)
        builder.store(builder.select(mask, value, builder.load(place, align=8)), place, align=8)
    builder.ret_void()
    return function


def _inputs(vectors: Vectors, arguments: Any, program: Program, runs: int, at: Any, own: Own) -> list[list[Any]]:
    """The vectors of t, y, p and own, of the runs from `at` on."""
    t, y, p, numbers, _ = arguments
    _, m, shared, each = program.inputs
    builder = vectors.builder

    def one(array: Any, k: int) -> Any:
        """A number that all runs share."""
        return _spread(vectors, builder.load(builder.gep(array, [ir.Constant(I64, k)])))

    def of_each(array: Any, k: int) -> Any:
        return builder.load(_place(vectors, array, k, runs, at), align=8)

    return [
        [_spread(vectors, t)],
        [of_each(y, k) for k in range(m)],
        [one(p, k) for k in range(shared)],
        [(one if own[k][1] else of_each)(numbers, own[k][0]) for k in range(each)],
    ]


def _place(vectors: Vectors, array: Any, k: int, runs: int, at: Any) -> Any:
    """Where the numbers k of the runs from `at` on stand."""
    builder = vectors.builder
    place = builder.gep(array, [builder.add(at, ir.Constant(I64, k * runs))])
    return builder.bitcast(place, vectors.type.as_pointer())


def _spread(vectors: Vectors, x: Any) -> Any:
    """A number in each lane."""
    return vectors.of([x] * vectors.count) if vectors.count > 1 else x
