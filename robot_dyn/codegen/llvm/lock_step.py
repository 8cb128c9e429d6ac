"""Functions (t, y, p, run_parameters, out) of a state equation as machine code, for one run or W runs in lock step.

Number k of run b is y[k W + b]; t, p and some of `run_parameters` are shared by all runs. A run with an angle beyond
the range of the vectorised sine and cosine is computed again with the C library, so that runs do not depend on each
other.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from types import MappingProxyType
from typing import NamedTuple

from llvmlite import ir

from robot_dyn.codegen.llvm.vectors import F64, I1, I64, Vectors, align_stack, wide
from robot_dyn.codegen.llvm.writer import Writer
from robot_dyn.codegen.program import Program

SIDE = 8  # runs in a vector: a 512-bit register, or two or four smaller ones
Own = Mapping[int, tuple[int, bool]]  # for each of `run_parameters`: its row, or its index if shared
_NOTHING: Mapping[int, int] = MappingProxyType({})
_ARGUMENTS = [F64, *[F64.as_pointer()] * 4]


class Computed(NamedTuple):
    """Results of a function for a vector of runs.

    Attributes:
        results: Vectors of the results.
        out_of_range: Mask of runs with an angle beyond the range.
        seldom: Indices of results that are stored only if `doubt` holds for some run.
        doubt: Mask of these runs; None if all results are stored.
    """

    results: list[ir.Value]
    out_of_range: ir.Value
    seldom: range = range(0)
    doubt: ir.Value | None = None


Body = Callable[[Writer, list[list[ir.Value]]], Computed]  # (writer, the vectors of each input) → …


def write_function(
    module: ir.Module, name: str, program: Program, runs: int, shared: Mapping[int, int] = _NOTHING
) -> None:
    """Write the function of a program with the inputs t (1,), y, p and run_parameters.

    Args:
        module: LLVM module.
        name: Name of the function.
        program: Program of the function.
        runs: 1 or a multiple of SIDE.
        shared: Index in `run_parameters` of each number that is the same for all runs; the others follow row by row in
            their order.
    """

    def body(writer: Writer, inputs: list[list[ir.Value]]) -> Computed:
        written = writer.write(program, inputs)
        return Computed(written.results, written.out_of_range)

    _write(module, name, program.inputs, body, runs, shared)


def write_step(
    module: ir.Module,
    name: str,
    programs: tuple[Program, Program, Program],
    runs: int,
    shared: Mapping[int, int],
    passes: int,
) -> None:
    """Write a step as three programs in one function, so that intermediate values stay in registers or cache.

        fixed = first(t, x, p, own),   solved = second(t, fixed, own = places) until nothing changes,
        after = third(t, x, own = solved and fixed)

    y contains x and the start of the places. The second program is repeated for a vector of runs until its last result
    is 0 for all of them, but at most `passes` times; its other results are the next places. The results are after,
    solved and fixed; in lock step, fixed is stored only for vectors in which a run has not converged.
    """
    first, second, third = programs
    n = second.inputs[-1]
    m = first.inputs[1]

    def body(writer: Writer, inputs: list[list[ir.Value]]) -> Computed:
        t, y, p, run_parameters = inputs
        fixed = writer.write(first, [t, y[:m], p, run_parameters])
        solved = _repeated(writer, second, [t, fixed.results, [], y[m:]], passes)
        after = writer.write(third, [t, y[:m], [], [*solved, *fixed.results]])
        doubt = writer.builder.fcmp_ordered(">", solved[-1], writer.vectors.constant(0.0))
        results = [*after.results, *solved, *fixed.results]
        seldom = len(after.results) + len(solved) if runs > 1 else len(results)
        return Computed(results, fixed.out_of_range, range(seldom, len(results)), doubt)

    _write(module, name, (1, m + n, *first.inputs[2:]), body, runs, shared)


def _write(
    module: ir.Module, name: str, inputs: tuple[int, ...], body: Body, runs: int, shared: Mapping[int, int]
) -> None:  # fmt: skip
    rows = [k for k in range(inputs[-1]) if k not in shared]
    run_parameters = {k: (row, False) for row, k in enumerate(rows)} | {k: (at, True) for k, at in shared.items()}
    any_angle = _any_angle(module, f"{name}_any_angle", inputs, body, runs, run_parameters)
    function = ir.Function(module, ir.FunctionType(ir.VoidType(), _ARGUMENTS), name)
    if runs > 1:
        align_stack(function)
    builder = ir.IRBuilder(function.append_basic_block())
    before, loop, end = builder.block, function.append_basic_block(), function.append_basic_block()
    builder.branch(loop)
    builder.position_at_end(loop)
    at = builder.phi(I64)
    at.add_incoming(ir.Constant(I64, 0), before)
    writer = Writer(builder, F64, min(SIDE, runs))
    computed = body(writer, _inputs(writer.vectors, function.args, inputs, runs, at, run_parameters))

    def store(which: Iterable[int]) -> None:
        for k in which:
            builder.store(computed.results[k], _place(writer.vectors, function.args[-1], k, runs, at), align=8)

    store(k for k in range(len(computed.results)) if k not in computed.seldom)
    if computed.doubt is not None:
        with builder.if_then(writer.vectors.any(computed.doubt), likely=False):
            store(computed.seldom)
    with builder.if_then(writer.vectors.any(computed.out_of_range), likely=False):
        builder.call(any_angle, [*function.args, at, builder.bitcast(computed.out_of_range, ir.IntType(writer.count))])
    following = builder.add(at, ir.Constant(I64, writer.count))
    at.add_incoming(following, builder.block)
    builder.cbranch(builder.icmp_signed("<", following, ir.Constant(I64, runs)), loop, end)
    builder.position_at_end(end)
    builder.ret_void()


def _repeated(writer: Writer, program: Program, inputs: list[list[ir.Value]], passes: int) -> list[ir.Value]:
    """Return the results of a program for one vector of runs, repeated until they converge."""
    builder, vectors = writer.builder, writer.vectors
    before, again, done = builder.block, builder.append_basic_block(), builder.append_basic_block()
    builder.branch(again)
    builder.position_at_end(again)
    count, run_parameters = builder.phi(I64), [builder.phi(vectors.type) for _ in inputs[-1]]
    results = writer.write(program, [*inputs[:-1], run_parameters]).results
    after = builder.add(count, ir.Constant(I64, 1))
    first, following = [ir.Constant(I64, 0), *inputs[-1]], [after, *results[-1 - len(run_parameters) : -1]]
    for phi, start, value in zip([count, *run_parameters], first, following, strict=True):
        phi.add_incoming(start, before)
        phi.add_incoming(value, builder.block)
    continues = vectors.any(builder.fcmp_ordered(">", results[-1], vectors.constant(0.0)))
    less = builder.icmp_signed("<", after, ir.Constant(I64, passes))
    builder.cbranch(builder.and_(continues, less), again, done)
    builder.position_at_end(done)
    return results


def _any_angle(
    module: ir.Module, name: str, inputs: tuple[int, ...], body: Body, runs: int, run_parameters: Own
) -> ir.Function:
    """Write the same function with the C library's sine, which stores results only for runs whose bit is set."""
    side = min(SIDE, runs)
    shape = ir.FunctionType(ir.VoidType(), [*_ARGUMENTS, I64, ir.IntType(side)])
    function = ir.Function(module, shape, name)
    function.linkage = "internal"
    function.attributes.add("noinline")
    function.attributes.add("optnone")  # rarely called; this shortens compilation
    builder = ir.IRBuilder(function.append_basic_block())
    *arguments, at, bits = function.args
    writer = Writer(builder, F64, side, any_angle=True)
    mask = builder.bitcast(bits, wide(I1, side))
    computed = body(writer, _inputs(writer.vectors, arguments, inputs, runs, at, run_parameters))
    for k, value in enumerate(computed.results):
        place = _place(writer.vectors, arguments[-1], k, runs, at)
        builder.store(builder.select(mask, value, builder.load(place, align=8)), place, align=8)
    builder.ret_void()
    return function


def _inputs(
    vectors: Vectors,
    arguments: Sequence[ir.Value],
    inputs: tuple[int, ...],
    runs: int,
    at: ir.Value,
    run_parameters: Own,
) -> list[list[ir.Value]]:
    """Return the vectors of t, y, p and run_parameters, for the runs from `at` on."""
    t, y, p, numbers, _ = arguments
    _, m, shared, count = inputs
    builder = vectors.builder

    def one(array: ir.Value, k: int) -> ir.Value:
        """Return a number shared by all runs."""
        return _spread(vectors, builder.load(builder.gep(array, [ir.Constant(I64, k)])))

    def of_runs(array: ir.Value, k: int) -> ir.Value:
        return builder.load(_place(vectors, array, k, runs, at), align=8)

    return [
        [_spread(vectors, t)],
        [of_runs(y, k) for k in range(m)],
        [one(p, k) for k in range(shared)],
        [(one if run_parameters[k][1] else of_runs)(numbers, run_parameters[k][0]) for k in range(count)],
    ]


def _place(vectors: Vectors, array: ir.Value, k: int, runs: int, at: ir.Value) -> ir.Value:
    """Return the address of the numbers k of the runs from `at` on."""
    builder = vectors.builder
    place = builder.gep(array, [builder.add(at, ir.Constant(I64, k * runs))])
    return builder.bitcast(place, vectors.type.as_pointer())


def _spread(vectors: Vectors, x: ir.Value) -> ir.Value:
    """Return a vector with a number in each lane."""
    return vectors.packed([x] * vectors.count) if vectors.count > 1 else x
