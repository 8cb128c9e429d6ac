"""Tiles: W states side by side, number k of state b at x[k W + b]; packed and unpacked in blocks of 8 × 8.

A block is transposed in registers by shuffles. Element by element, moving the numbers of a state would take as long as
a fifth of forward dynamics.
"""

from __future__ import annotations

from typing import Any

import numba as nb
from llvmlite import ir
from numba.core import types
from numba.extending import intrinsic

from robot_dyn.compiled.lanes import F32, F64

SIDE = 8
_I1, _I32, _I64 = ir.IntType(1), ir.IntType(32), ir.IntType(64)


def transposed(builder: Any, rows: list[Any]) -> list[Any]:
    """Eight vectors of eight, transposed by exchanging blocks of 1, 2 and 4."""
    for size in (1, 2, 4):
        new = list(rows)
        for i in range(SIDE):
            if not i & size:
                upper, lower = rows[i], rows[i + size]
                first = [j if not j & size else SIDE + j - size for j in range(SIDE)]
                second = [j + size if not j & size else SIDE + j for j in range(SIDE)]
                for place, order in ((i, first), (i + size, second)):
                    mask = ir.Constant(ir.VectorType(_I32, SIDE), order)
                    new[place] = builder.shuffle_vector(upper, lower, mask)
        rows = new
    return rows


def _masked(builder: Any, count: Any) -> Any:
    """The mask of the first `count` lanes."""
    vector = ir.VectorType(_I64, SIDE)
    all_of_it = builder.insert_element(ir.Constant(vector, ir.Undefined), count, ir.Constant(_I32, 0))
    zeros = ir.Constant(ir.VectorType(_I32, SIDE), [0] * SIDE)
    spread = builder.shuffle_vector(all_of_it, ir.Constant(vector, ir.Undefined), zeros)
    return builder.icmp_signed("<", ir.Constant(vector, list(range(SIDE))), spread)


def _block_typed(
    typingctx: Any, to: Any, to_at: Any, to_step: Any, rows: Any, of: Any, at: Any, step: Any, columns: Any
) -> Any:
    """to[to_at + j to_step + i] = of[at + i step + j] for i < 8 up to `rows`, j < 8 up to `columns`.

    `columns` bounds what is read of each row of `of`, `rows` what is written of each row of `to`.
    """

    def code(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        kind = F64 if signature.args[4].dtype == types.float64 else F32
        vector = ir.VectorType(kind, SIDE)
        name = f"v{SIDE}f{64 if kind is F64 else 32}.p0"
        loader = builder.module.declare_intrinsic(
            f"llvm.masked.load.{name}",
            fnty=ir.FunctionType(vector, [ir.PointerType(vector), _I32, ir.VectorType(_I1, SIDE), vector]),
        )
        storer = builder.module.declare_intrinsic(
            f"llvm.masked.store.{name}",
            fnty=ir.FunctionType(ir.VoidType(), [vector, ir.PointerType(vector), _I32, ir.VectorType(_I1, SIDE)]),
        )
        align = ir.Constant(_I32, 8 if kind is F64 else 4)

        def place(array: int, start: Any, stride: Any, i: int) -> Any:
            data = context.make_array(signature.args[array])(context, builder, args[array]).data
            offset = builder.add(start, builder.mul(stride, ir.Constant(_I64, i)))
            return builder.bitcast(builder.gep(data, [offset]), ir.PointerType(vector))

        read, write = _masked(builder, args[7]), _masked(builder, args[3])
        nothing = ir.Constant(vector, [0.0] * SIDE)
        taken = [builder.call(loader, [place(4, args[5], args[6], i), align, read, nothing]) for i in range(SIDE)]
        for j, made in enumerate(transposed(builder, taken)):
            builder.call(storer, [made, place(0, args[1], args[2], j), align, write])
        return context.get_dummy_value()

    i8 = types.int64
    return types.void(to, i8, i8, i8, of, i8, i8, i8), code


_block: Any = intrinsic(_block_typed)


@nb.njit(nogil=True)
def pack(x: Any, first: int, array: Any, base: int, width: int) -> None:
    """Put the states base … base + width − 1 of an array (B, n) into the rows of a tile from `first` on.

    Rows up to 7 beyond the last are written with zeros: pack the inputs in order, into a tile with 7 rows to spare.
    """
    n = array.shape[1]
    flat = array.reshape(array.size)
    for b in range(0, width, SIDE):
        for k in range(0, n, SIDE):
            _block(x, (first + k) * width + b, width, SIDE, flat, (base + b) * n + k, n, min(SIDE, n - k))


@nb.njit(nogil=True)
def unpack(array: Any, base: int, z: Any, width: int) -> None:
    """Take the states base … base + width − 1 of an array (B, m) from a tile, of 7 rows more than m."""
    m = array.shape[1]
    flat = array.reshape(array.size)
    for b in range(0, width, SIDE):
        for k in range(0, m, SIDE):
            _block(flat, (base + b) * m + k, m, min(SIDE, m - k), z, k * width + b, width, SIDE)
