"""Batches in vectors: L states of arrays (B, n) at a time, from memory through all instructions and back in one go.

    8 rows of 8 numbers → transposed in registers → the code on vectors of L states → transposed back → 8 rows

A number takes no way through memory that LLVM does not choose, and loads and shuffles fill the gaps that long chains
of products leave. The lines are those of the one-state kernel, read as vector instructions.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from llvmlite import ir
from numba.core import cgutils, types
from numba.extending import intrinsic

from robot_dyn.compiled.lanes import F32, F64, wide
from robot_dyn.compiled.source import Source
from robot_dyn.compiled.tiles import SIDE, transposed
from robot_dyn.compiled.writer import Writer

_LINE = 64  # bytes of a cache line, of most processors

_AHEAD = 2  # groups: a quarter of a microsecond, as long as memory takes to answer
_I1, _I32, _I64 = ir.IntType(1), ir.IntType(32), ir.IntType(64)


def lanes(dtype: str) -> int:
    """L: the numbers of a 512-bit register, or of two or four smaller ones."""
    return 64 // np.dtype(dtype).itemsize


def batch_of(source: Source, dtype: str) -> Any:
    """The intrinsic (x₀, …, y, start, stop) → (Σ |x|, Σ |y|, largest |angle|) over states start … stop − 1 of arrays.

    There must be L states at least: the last vector overlaps the one before.
    """
    kind, count = (F64, F32)[dtype == "float32"], lanes(dtype)

    def typed(typingctx: Any, arrays: Any, y: Any, start: Any, stop: Any) -> Any:
        number = getattr(types, dtype)

        def code(context: Any, builder: Any, signature: Any, args: Any) -> Any:
            inputs = [builder.extract_value(args[0], i) for i in range(len(arrays))]
            data = [
                context.make_array(each)(context, builder, value).data
                for each, value in zip((*arrays, y), (*inputs, args[1]), strict=True)
            ]
            writer = Writer(context, builder, kind, count)
            seen = [cgutils.alloca_once_value(builder, writer.constant(0)) for _ in range(3)]
            step = ir.Constant(_I64, count)
            with cgutils.for_range_slice(builder, args[2], args[3], step, _I64) as (base, _):
                last = builder.sub(args[3], step)
                at = builder.select(builder.icmp_signed("<", base, last), base, last)
                _group(writer, source, data, at, seen)
            sums = [_reduced(writer, builder.load(seen[0])), _reduced(writer, builder.load(seen[1]))]
            return context.make_tuple(builder, signature.return_type, [*sums, _largest(writer, builder.load(seen[2]))])

        return types.UniTuple(number, 3)(arrays, y, start, stop), code

    return intrinsic(typed)


def _group(writer: Writer, source: Source, data: list[Any], at: Any, seen: list[Any]) -> None:
    """L states from `at` on: loaded, computed, stored; what is seen of them is added up."""
    builder = writer.builder
    for i, n in enumerate((*source.inputs, source.outputs)):
        _prefetch(writer, data[i], at, n, i == len(source.inputs))
    columns = [_loaded(writer, array, at, n) for array, n in zip(data, source.inputs, strict=False)]
    writer.start(source, columns)
    for line in source.lines:
        writer.line(line)
    results = [writer.values[name] for name in source.results]
    _store(writer, data[-1], at, results)
    distinct = [writer.values[name] for name in dict.fromkeys(source.results)]  # of M half
    for place, vectors in ((seen[0], [x for each in columns for x in each]), (seen[1], distinct)):
        builder.store(writer.size(vectors, builder.load(place)), place)
    far = builder.load(seen[2])
    for line in source.lines:
        if line.trigonometric:
            turn = writer.intrinsic("fabs", writer.values[line.read[0]])
            far = builder.select(builder.fcmp_ordered(">", turn, far), turn, far)
    builder.store(far, seen[2])


def _prefetch(writer: Writer, array: Any, at: Any, n: int, written: bool) -> None:
    """Ask for the cache lines of the states that are computed AHEAD groups later; past the end that does no harm."""
    builder, size = writer.builder, 8 if writer.kind is F64 else 4
    start = builder.bitcast(builder.gep(array, [builder.mul(at, ir.Constant(_I64, n))]), ir.IntType(8).as_pointer())
    flags = [ir.Constant(_I32, x) for x in (int(written), 3, 1)]  # to write; to keep; data
    made = builder.module.declare_intrinsic(
        "llvm.prefetch.p0", fnty=ir.FunctionType(ir.VoidType(), [start.type, *(x.type for x in flags)])
    )
    length = writer.count * n * size
    for offset in range(0, length, _LINE):
        place = builder.gep(start, [ir.Constant(_I64, _AHEAD * length + offset)])
        builder.call(made, [place, *flags])


def _loaded(writer: Writer, array: Any, at: Any, n: int) -> list[Any]:
    """The n columns of L rows of an array from `at` on, each a vector."""
    builder, columns = writer.builder, []
    for k in range(0, n, SIDE):
        wanted, blocks = min(SIDE, n - k), []
        for first in range(0, writer.count, SIDE):
            rows = [_row(writer, array, at, first + i, n, k, wanted) for i in range(SIDE)]
            blocks.append(transposed(builder, rows)[:wanted])
        columns += blocks[0] if len(blocks) == 1 else [_joined(builder, *pair) for pair in zip(*blocks, strict=True)]
    return columns


def _row(writer: Writer, array: Any, at: Any, i: int, n: int, k: int, wanted: int) -> Any:
    pointer, align, mask = _place(writer, array, at, i, n, k, wanted)
    vector = wide(writer.kind, SIDE)
    name = f"llvm.masked.load.v{SIDE}f{64 if writer.kind is F64 else 32}.p0"
    shape = ir.FunctionType(vector, [pointer.type, _I32, mask.type, vector])
    loader = writer.builder.module.declare_intrinsic(name, fnty=shape)
    return writer.builder.call(loader, [pointer, align, mask, ir.Constant(vector, ir.Undefined)])


def _store(writer: Writer, array: Any, at: Any, results: list[Any]) -> None:
    """Write vectors as the columns of L rows of an array from `at` on."""
    builder, n, vector = writer.builder, len(results), wide(writer.kind, SIDE)
    name = f"llvm.masked.store.v{SIDE}f{64 if writer.kind is F64 else 32}.p0"
    for k in range(0, n, SIDE):
        wanted = min(SIDE, n - k)
        for first in range(0, writer.count, SIDE):
            part = [_part(builder, x, first) for x in results[k : k + wanted]]
            for i, row in enumerate(transposed(builder, part + [part[0]] * (SIDE - wanted))):
                pointer, align, mask = _place(writer, array, at, first + i, n, k, wanted)
                shape = ir.FunctionType(ir.VoidType(), [vector, pointer.type, _I32, mask.type])
                builder.call(builder.module.declare_intrinsic(name, fnty=shape), [row, pointer, align, mask])


def _place(writer: Writer, array: Any, at: Any, i: int, n: int, k: int, wanted: int) -> tuple[Any, Any, Any]:
    """Where numbers k … of row at + i of an array (B, n) stand, their alignment, and the mask of so many."""
    builder = writer.builder
    offset = builder.add(builder.mul(at, ir.Constant(_I64, n)), ir.Constant(_I64, i * n + k))
    pointer = builder.bitcast(builder.gep(array, [offset]), ir.PointerType(wide(writer.kind, SIDE)))
    mask = ir.Constant(ir.VectorType(_I1, SIDE), [int(j < wanted) for j in range(SIDE)])
    return pointer, ir.Constant(_I32, 8 if writer.kind is F64 else 4), mask


def _part(builder: Any, vector: Any, first: int) -> Any:
    """Eight lanes of a vector."""
    if vector.type.count == SIDE:
        return vector
    return builder.shuffle_vector(
        vector, vector, ir.Constant(ir.VectorType(_I32, SIDE), list(range(first, first + SIDE)))
    )


def _joined(builder: Any, low: Any, high: Any) -> Any:
    return builder.shuffle_vector(low, high, ir.Constant(ir.VectorType(_I32, 2 * SIDE), list(range(2 * SIDE))))


def _reduced(writer: Writer, vector: Any) -> Any:
    """The sum of a vector's lanes."""
    builder = writer.builder
    total = builder.extract_element(vector, ir.Constant(_I32, 0))
    for i in range(1, writer.count):
        total = builder.fadd(total, builder.extract_element(vector, ir.Constant(_I32, i)))
    return total


def _largest(writer: Writer, vector: Any) -> Any:
    """The largest of a vector's lanes."""
    builder = writer.builder
    most = builder.extract_element(vector, ir.Constant(_I32, 0))
    for i in range(1, writer.count):
        x = builder.extract_element(vector, ir.Constant(_I32, i))
        most = builder.select(builder.fcmp_ordered(">", x, most), x, most)
    return most
