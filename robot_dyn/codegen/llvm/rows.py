"""Rows of an array (B, n) as vectors with number k of L states, loaded, stored and prefetched.

    8 rows of 8 numbers → transposed in registers by shuffles → 8 vectors of one number of 8 states

Moving the numbers of a state one by one would take a fifth of the time of forward dynamics.
"""

from __future__ import annotations

from collections.abc import Sequence

from llvmlite import ir

from robot_dyn.codegen.llvm.vectors import I1, I32, I64, Vectors, wide

SIDE = 8
_LINE = 64  # bytes of a cache line on most processors
_AHEAD = 2  # groups of L states: a quarter of a microsecond, the latency of memory


def loaded(vectors: Vectors, array: ir.Value, at: ir.Value, n: int) -> list[ir.Value]:
    """Return the n numbers of L states, rows of an array from `at` on, each as a vector."""
    columns = []
    for k in range(0, n, SIDE):
        width, blocks = min(SIDE, n - k), []
        for first in range(0, vectors.count, SIDE):
            rows = [_read(vectors, array, at, first + i, n, k, width) for i in range(SIDE)]
            blocks.append(transposed(vectors.builder, rows)[:width])
        columns += blocks[0] if len(blocks) == 1 else [_joined(vectors, *pair) for pair in zip(*blocks, strict=True)]
    return columns


def store(vectors: Vectors, array: ir.Value, at: ir.Value, results: list[ir.Value]) -> None:
    """Write vectors as the numbers of L states, rows of an array from `at` on."""
    n = len(results)
    for k in range(0, n, SIDE):
        width = min(SIDE, n - k)
        for first in range(0, vectors.count, SIDE):
            part = [_part(vectors, x, first) for x in results[k : k + width]]
            for i, row in enumerate(transposed(vectors.builder, part + [part[0]] * (SIDE - width))):
                place = _place(vectors, array, at, first + i, n, k, width)
                _masked(vectors, "store", ir.VoidType(), row, *place)


def prefetch(vectors: Vectors, array: ir.Value, at: ir.Value, n: int, written: bool) -> None:
    """Prefetch the cache lines of the states that are computed AHEAD groups later; past the end this is harmless."""
    builder = vectors.builder
    start = builder.bitcast(builder.gep(array, [builder.mul(at, ir.Constant(I64, n))]), ir.IntType(8).as_pointer())
    flags = [ir.Constant(I32, x) for x in (int(written), 3, 1)]  # for writing; keep in cache; data
    shape = ir.FunctionType(ir.VoidType(), [start.type, *(x.type for x in flags)])
    function = builder.module.declare_intrinsic("llvm.prefetch.p0", fnty=shape)
    length = vectors.count * n * vectors.size
    for offset in range(0, length, _LINE):
        builder.call(function, [builder.gep(start, [ir.Constant(I64, _AHEAD * length + offset)]), *flags])


def transposed(builder: ir.IRBuilder, rows: list[ir.Value]) -> list[ir.Value]:
    """Transpose eight vectors of eight by exchanging blocks of 1, 2 and 4."""
    for size in (1, 2, 4):
        new = list(rows)
        for i in range(SIDE):
            if not i & size:
                upper, lower = rows[i], rows[i + size]
                first = [j if not j & size else SIDE + j - size for j in range(SIDE)]
                second = [j + size if not j & size else SIDE + j for j in range(SIDE)]
                new[i], new[i + size] = (builder.shuffle_vector(upper, lower, _order(x)) for x in (first, second))
        rows = new
    return rows


def _read(vectors: Vectors, array: ir.Value, at: ir.Value, i: int, n: int, k: int, width: int) -> ir.Value:
    vector = wide(vectors.kind, SIDE)
    place = _place(vectors, array, at, i, n, k, width)
    return _masked(vectors, "load", vector, *place, ir.Constant(vector, ir.Undefined))


def _masked(vectors: Vectors, operation: str, result: ir.Type, *arguments: ir.Value) -> ir.Value:
    shape = ir.FunctionType(result, [x.type for x in arguments])
    name = f"llvm.masked.{operation}.v{SIDE}f{8 * vectors.size}.p0"
    return vectors.builder.call(vectors.builder.module.declare_intrinsic(name, fnty=shape), arguments)


def _place(
    vectors: Vectors, array: ir.Value, at: ir.Value, i: int, n: int, k: int, width: int
) -> tuple[ir.Value, ir.Value, ir.Value]:
    """Return the address of numbers k … of row at + i of an array (B, n), the alignment, and the mask of the width."""
    builder = vectors.builder
    offset = builder.add(builder.mul(at, ir.Constant(I64, n)), ir.Constant(I64, i * n + k))
    pointer = builder.bitcast(builder.gep(array, [offset]), wide(vectors.kind, SIDE).as_pointer())
    mask = ir.Constant(ir.VectorType(I1, SIDE), [int(j < width) for j in range(SIDE)])
    return pointer, ir.Constant(I32, vectors.size), mask


def _part(vectors: Vectors, vector: ir.Value, first: int) -> ir.Value:
    """Return eight numbers of a vector."""
    if vectors.count == SIDE:
        return vector
    return vectors.builder.shuffle_vector(vector, vector, _order(range(first, first + SIDE)))


def _joined(vectors: Vectors, low: ir.Value, high: ir.Value) -> ir.Value:
    return vectors.builder.shuffle_vector(low, high, _order(range(2 * SIDE)))


def _order(places: Sequence[int]) -> ir.Value:
    """Return the mask of a shuffle."""
    return ir.Constant(ir.VectorType(I32, len(places)), list(places))
