"""Functions (t, y, p, run_parameters, out) of a state equation as machine code, of one run or of W in lock step.

Number k of run b is y[k W + b]; t and p are shared, and so are those of `run_parameters` that are one number for all
runs. A run with an angle beyond the range of the vectorised sine and cosine is computed again with those of the C
library, so that runs do not depend on each other.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

from llvmlite import ir

from robot_dyn.codegen.llvm.vectors import F64, I1, I64, Vectors, align_stack, wide
from robot_dyn.codegen.llvm.writer import Writer
from robot_dyn.codegen.program import Program

SIDE = 8  # runs in a vector: a 512-bit register, or two or four smaller ones
Own = Mapping[int, tuple[int, bool]]  # of each number of `run_parameters`: its row, or where it stands once
_NOTHING: Mapping[int, int] = MappingProxyType({})
_ARGUMENTS = [F64, *[F64.as_pointer()] * 4]


class Computed(NamedTuple):
    """What a function computes of a vector of runs.

    Attributes:
        results: A vector of each.
        out_of_range: As of `Written`.
        seldom: Numbers of the results that are stored only where `doubt` holds for some run.
        doubt: The mask of these runs; None if all are stored.
    """

    results: list[Any]
    out_of_range: Any
    seldom: range = range(0)
    doubt: Any = None


Body = Callable[[Writer, list[list[Any]]], Computed]  # (writer, the vectors of each input) → …


def write_function(module: Any, name: str, program: Program, runs: int, shared: Mapping[int, int] = _NOTHING) -> None:
    """A function of a program with the inputs t (1,), y, p and own.

    Args:
        module: LLVM's.
        name: Of the function.
        program: What it computes.
        runs: 1 or a multiple of SIDE.
        shared: Of those numbers of `run_parameters` that are the same for all runs, where in it each stands once; the
            others come row by row in their order.
    """

    def body(writer: Writer, given: list[list[Any]]) -> Computed:
        written = writer.write(program, given)
        return Computed(written.results, written.out_of_range)

    _write(module, name, program.inputs, body, runs, shared)


def write_step(
    module: Any,
    name: str,
    programs: tuple[Program, Program, Program],
    runs: int,
    shared: Mapping[int, int],
    passes: int,
) -> None:
    """A step as three programs in one function, so that values between them stay in registers or cache.

        known = first(t, x, p, own),   found = second(t, known, own = places) until nothing changes,
        after = third(t, x, own = found and known)

    y is x and the places, where the second one starts; it is repeated for the runs of a vector until its last result is
    0 for all of them, `passes` times at most, the results before that one being its places then. What comes out is
    after, found and known; the last, of runs in lock step, only of vectors in which a run has not settled.
    """
    first, second, third = programs
    n = second.inputs[-1]
    m = first.inputs[1]

    def body(writer: Writer, given: list[list[Any]]) -> Computed:
        t, y, p, run_parameters = given
        known = writer.write(first, [t, y[:m], p, run_parameters])
        found = _repeated(writer, second, [t, known.results, [], y[m:]], passes)
        after = writer.write(third, [t, y[:m], [], [*found, *known.results]])
        doubt = writer.builder.fcmp_ordered(">", found[-1], writer.vectors.constant(0.0))
        results = [*after.results, *found, *known.results]
        seldom = len(after.results) + len(found) if runs > 1 else len(results)
        return Computed(results, known.out_of_range, range(seldom, len(results)), doubt)

    _write(module, name, (1, m + n, *first.inputs[2:]), body, runs, shared)


def _write(
    module: Any, name: str, inputs: tuple[int, ...], body: Body, runs: int, shared: Mapping[int, int]
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


def _repeated(writer: Writer, program: Program, given: list[list[Any]], passes: int) -> list[Any]:
    """The results of a program of one vector of runs, pass after pass."""
    builder, vectors = writer.builder, writer.vectors
    before, again, done = builder.block, builder.append_basic_block(), builder.append_basic_block()
    builder.branch(again)
    builder.position_at_end(again)
    count, run_parameters = builder.phi(I64), [builder.phi(vectors.type) for _ in given[-1]]
    results = writer.write(program, [*given[:-1], run_parameters]).results
    after = builder.add(count, ir.Constant(I64, 1))
    first, following = [ir.Constant(I64, 0), *given[-1]], [after, *results[-1 - len(run_parameters) : -1]]
    for phi, start, value in zip([count, *run_parameters], first, following, strict=True):
        phi.add_incoming(start, before)
        phi.add_incoming(value, builder.block)
    goes_on = vectors.any(builder.fcmp_ordered(">", results[-1], vectors.constant(0.0)))
    less = builder.icmp_signed("<", after, ir.Constant(I64, passes))
    builder.cbranch(builder.and_(goes_on, less), again, done)
    builder.position_at_end(done)
    return results


def _any_angle(module: Any, name: str, inputs: tuple[int, ...], body: Body, runs: int, run_parameters: Own) -> Any:
    """The same for the runs that share a vector, stored only for those whose bit is set."""
    side = min(SIDE, runs)
    shape = ir.FunctionType(ir.VoidType(), [*_ARGUMENTS, I64, ir.IntType(side)])
    function = ir.Function(module, shape, name)
    function.linkage = "internal"
    function.attributes.add("noinline")
    function.attributes.add("optnone")  # it is rarely called, and compiled faster so
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
    vectors: Vectors, arguments: Any, inputs: tuple[int, ...], runs: int, at: Any, run_parameters: Own
) -> list[list[Any]]:
    """The vectors of t, y, p and own, of the runs from `at` on."""
    t, y, p, numbers, _ = arguments
    _, m, shared, each = inputs
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
        [(one if run_parameters[k][1] else of_each)(numbers, run_parameters[k][0]) for k in range(each)],
    ]


def _place(vectors: Vectors, array: Any, k: int, runs: int, at: Any) -> Any:
    """Where the numbers k of the runs from `at` on stand."""
    builder = vectors.builder
    place = builder.gep(array, [builder.add(at, ir.Constant(I64, k * runs))])
    return builder.bitcast(place, vectors.type.as_pointer())


def _spread(vectors: Vectors, x: Any) -> Any:
    """A number in each lane."""
    return vectors.of([x] * vectors.count) if vectors.count > 1 else x
