"""Vectors: numbers side by side, one for each state, and what LLVM and the C library compute of them.

Of one state a vector is a number. Sums may be reordered and products contracted; NaN and infinities come through.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any, final

from llvmlite import ir

from robot_dyn.codegen.llvm.lanes import F64, wide
from robot_dyn.values import LINE

FLAGS = ("afn", "arcp", "contract", "nsz", "reassoc")  # of LLVM's fast-math flags, all but nnan and ninf
I1, I32, I64 = ir.IntType(1), ir.IntType(32), ir.IntType(64)


@final
@dataclass(frozen=True)
class Vectors:
    """Vectors of so many numbers of one type.

    Attributes:
        builder: Where instructions go.
        kind: LLVM's type of a number, F64 or F32.
        count: Numbers in a vector.
    """

    builder: Any
    kind: Any
    count: int

    @property
    def type(self) -> Any:
        """LLVM's type of a vector."""
        return wide(self.kind, self.count)

    @property
    def size(self) -> int:
        """Bytes of a number."""
        return 8 if self.kind is F64 else 4

    def constant(self, x: float) -> Any:
        """A vector of equal numbers."""
        return ir.Constant(self.type, float(x) if self.count == 1 else [float(x)] * self.count)

    def intrinsic(self, name: str, *of: Any) -> Any:
        """One of LLVM's own functions of vectors, such as "sqrt"."""
        lanes = "" if self.count == 1 else f"v{self.count}"
        shape = ir.FunctionType(self.type, [self.type] * len(of))
        name = f"llvm.{name}.{lanes}f{8 * self.size}"
        return self.builder.call(self.builder.module.declare_intrinsic(name, fnty=shape), of)

    def library(self, name: str, *of: Any) -> Any:
        """A function of the C library, lane by lane in float64."""
        if self.count == 1:
            return self._library(name, *of)
        result = ir.Constant(self.type, ir.Undefined)
        for i in range(self.count):
            result = self._set(result, self._library(name, *(self.lane(x, i) for x in of)), i)
        return result

    def _library(self, name: str, *of: Any) -> Any:
        shape = ir.FunctionType(F64, [F64] * len(of))
        function = self.builder.module.globals.get(name) or ir.Function(self.builder.module, shape, name)
        if self.kind is F64:
            return self.builder.call(function, of)
        result = self.builder.call(function, [self.builder.fpext(x, F64) for x in of])
        return self.builder.fptrunc(result, self.kind)

    def lane(self, vector: Any, i: int) -> Any:
        """One number of a vector."""
        return vector if self.count == 1 else self.builder.extract_element(vector, ir.Constant(I32, i))

    def of(self, numbers: Iterable[Any]) -> Any:
        """A vector of these numbers, and zeros where there are fewer."""
        result = self.constant(0.0)
        for i, x in enumerate(numbers):
            result = self._set(result, x, i)
        return result

    def _set(self, vector: Any, x: Any, i: int) -> Any:
        return x if self.count == 1 else self.builder.insert_element(vector, x, ir.Constant(I32, i))

    def mask(self, value: bool) -> Any:
        """The same truth in each lane."""
        return ir.Constant(wide(I1, self.count), int(value) if self.count == 1 else [int(value)] * self.count)

    def any(self, mask: Any) -> Any:
        """Whether a mask holds in some lane."""
        if self.count == 1:
            return mask
        bits = ir.IntType(self.count)
        return self.builder.icmp_unsigned("!=", self.builder.bitcast(mask, bits), ir.Constant(bits, 0))

    def absolute_sum(self, vectors: Iterable[Any], total: Any) -> Any:
        """A total and Σ |x| of vectors, lane by lane."""
        for x in vectors:
            total = self.builder.fadd(total, self.intrinsic("fabs", x), flags=FLAGS)
        return total

    def sum(self, vector: Any) -> Any:
        """The sum of a vector's numbers."""
        if self.count == 1:
            return vector
        shape = ir.FunctionType(self.kind, [self.kind, self.type])
        name = f"llvm.vector.reduce.fadd.v{self.count}f{8 * self.size}"
        made = self.builder.module.declare_intrinsic(name, fnty=shape)
        return self.builder.call(made, [ir.Constant(self.kind, 0.0), vector], fastmath=FLAGS)


def align_stack(function: Any) -> None:
    """Let the vectors that a function keeps on the stack begin at cache lines, wherever it is called from."""
    function.attributes.add("nounwind")  # llvmlite writes no alignment where there is no other attribute
    function.attributes.alignstack = LINE
