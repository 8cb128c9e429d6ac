"""From a program to LLVM instructions on numbers, or on vectors with one number for each state.

Sine and cosine are valid for |x| ≤ RANGE. Larger angles are reported; a writer with `any_angle` calls the C library.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain
from typing import TYPE_CHECKING, final

from robot_dyn.codegen.llvm.elementary import RANGE, sincos
from robot_dyn.codegen.llvm.operations import OPERATIONS
from robot_dyn.codegen.llvm.sine_groups import GROUP, in_groups
from robot_dyn.codegen.llvm.vectors import Lanes, Vectors
from robot_dyn.codegen.program import Kind, Op, Program

if TYPE_CHECKING:
    from llvmlite import ir


@final
@dataclass(frozen=True)
class Written:
    """Results of the instructions of a program.

    Attributes:
        results: Vectors of the results.
        out_of_range: Mask of states with an angle beyond RANGE.
    """

    results: list[ir.Value]
    out_of_range: ir.Value


@final
@dataclass(frozen=True)
class Writer:
    """Writer of programs.

    Attributes:
        builder: Builder of the instructions.
        kind: LLVM type of a number, F64 or F32.
        count: Number of states in a vector.
        any_angle: Use the C library's sine and cosine.
    """

    builder: ir.IRBuilder
    kind: ir.Type
    count: int = 1
    any_angle: bool = False

    @property
    def vectors(self) -> Vectors:
        """Vectors of the states."""
        return Vectors(self.builder, self.kind, self.count)

    def write(self, program: Program, inputs: Sequence[Sequence[ir.Value]]) -> Written:
        """Write the instructions of a program for vectors of each input."""
        vectors = self.vectors
        values = dict(enumerate(chain(*inputs, map(vectors.constant, program.constants))))
        out_of_range = vectors.none
        grouped = self.count == 1 and not self.any_angle
        for ops in in_groups(program) if grouped else ((op,) for op in program.ops):
            op = ops[0]
            if op.kind is not Kind.SINE_COSINE:
                values[op.results[0]] = OPERATIONS[op.kind](vectors, *(values[i] for i in op.operands))
            elif self.any_angle:
                values.update(
                    zip(op.results, (vectors.library(f, values[op.operands[0]]) for f in ("sin", "cos")), strict=True)
                )
            else:
                out_of_range = self.builder.or_(out_of_range, self._sines(ops, values))
        return Written([values[i] for i in program.outputs], out_of_range)

    def _sines(self, ops: tuple[Op, ...], values: dict[int, ir.Value]) -> ir.Value:
        """Write sines and cosines, several angles of one state in one vector; return the mask of far angles."""
        together = Vectors(self.builder, self.kind, self.count if len(ops) == 1 else GROUP)
        angles = [values[op.operands[0]] for op in ops]
        vector = angles[0] if len(ops) == 1 else together.packed(angles)
        both = sincos(Lanes(together, vector))
        for i, op in enumerate(ops):
            parts = [half.value if len(ops) == 1 else together.lane(half.value, i) for half in both]
            values.update(zip(op.results, parts, strict=True))
        size = together.intrinsic("fabs", vector)
        out_of_range = self.builder.fcmp_ordered(">", size, together.constant(RANGE))
        return out_of_range if len(ops) == 1 else together.any(out_of_range)
