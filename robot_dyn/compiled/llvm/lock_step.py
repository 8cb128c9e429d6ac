"""Functions (t, y, p, own, out) of a state equation as machine code, of one run or of W in lock step.

Number k of run b is y[k W + b]; t and p are shared. Where an angle is beyond the range of the vectors' sine and cosine,
the C library's serve.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir

from robot_dyn.compiled.llvm.lanes import F64
from robot_dyn.compiled.llvm.vectors import I64, Vectors
from robot_dyn.compiled.llvm.writer import Writer
from robot_dyn.compiled.program import Program

SIDE = 8  # runs in a vector: a 512-bit register, or two or four smaller ones
_POINTER = F64.as_pointer()


def write_function(module: Any, name: str, program: Program, runs: int) -> None:
    """A function of a program with the inputs t (1,), y, p and own; `runs` is 1 or a multiple of SIDE."""
    function = ir.Function(module, ir.FunctionType(ir.VoidType(), [F64, *[_POINTER] * 4]), name)
    builder = ir.IRBuilder(function.append_basic_block())
    before, body, end = builder.block, function.append_basic_block(), function.append_basic_block()
    builder.branch(body)
    builder.position_at_end(body)
    at = builder.phi(I64)
    at.add_incoming(ir.Constant(I64, 0), before)
    _vector(builder, function, program, runs, at)
    following = builder.add(at, ir.Constant(I64, min(SIDE, runs)))
    at.add_incoming(following, builder.block)
    builder.cbranch(builder.icmp_signed("<", following, ir.Constant(I64, runs)), body, end)
    builder.position_at_end(end)
    builder.ret_void()


def _vector(builder: Any, function: Any, program: Program, runs: int, at: Any) -> None:
    """The runs from `at` on that share a vector."""
    t, y, p, own, out = function.args
    writer = Writer(builder, F64, min(SIDE, runs), completed=True)
    vectors = writer.vectors
    _, m, shared, each = program.inputs
    inputs = [
        [_spread(vectors, t)],
        [_loaded(vectors, y, k, runs, at) for k in range(m)],
        [_spread(vectors, builder.load(builder.gep(p, [ir.Constant(I64, k)]))) for k in range(shared)],
        [_loaded(vectors, own, k, runs, at) for k in range(each)],
    ]
    for k, value in enumerate(writer.write(program, inputs).results):
        builder.store(value, _number(vectors, out, k, runs, at), align=8)


def _number(vectors: Vectors, array: Any, k: int, runs: int, at: Any) -> Any:
    """Where the numbers k of the runs from `at` on stand."""
    builder = vectors.builder
    place = builder.gep(array, [builder.add(at, ir.Constant(I64, k * runs))])
    return builder.bitcast(place, vectors.type.as_pointer())


def _loaded(vectors: Vectors, array: Any, k: int, runs: int, at: Any) -> Any:
    return vectors.builder.load(_number(vectors, array, k, runs, at), align=8)


def _spread(vectors: Vectors, x: Any) -> Any:
    """A number in each lane."""
    return vectors.of([x] * vectors.count) if vectors.count > 1 else x
