"""Vectors of numbers, one number for each state, with operations of LLVM and the C library.

For one state, a vector is a number. There are two levels of exactness: `Vectors` writes instructions whose sums may be
reordered and whose products may be contracted, with NaN and infinities preserved; `Lanes` gives vectors Python's
operators for formulas in which only contraction is allowed (a·b + c rounded once).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import final

from llvmlite import ir

from robot_dyn.foundations.values import LINE

FLAGS = ("afn", "arcp", "contract", "nsz", "reassoc")  # LLVM's fast-math flags except nnan and ninf
I1, I32, I64 = ir.IntType(1), ir.IntType(32), ir.IntType(64)
F32, F64 = ir.FloatType(), ir.DoubleType()


def wide(kind: ir.Type, count: int) -> ir.Type:
    """Return the type of a vector of `count` numbers; for one, the type of the number."""
    return kind if count == 1 else ir.VectorType(kind, count)


@final
@dataclass(frozen=True)
class Vectors:
    """Vectors of one length and type.

    Attributes:
        builder: Builder of the instructions.
        kind: LLVM type of a number.
        count: Number of numbers in a vector.
    """

    builder: ir.IRBuilder
    kind: ir.Type
    count: int

    @property
    def type(self) -> ir.Type:
        """LLVM type of a vector."""
        return wide(self.kind, self.count)

    @property
    def size(self) -> int:
        """Size of a floating-point number, in [bytes]."""
        return 8 if self.kind is F64 else 4

    def constant(self, x: float) -> ir.Value:
        """Return a vector of equal numbers."""
        return ir.Constant(self.type, x if self.count == 1 else [x] * self.count)

    def intrinsic(self, name: str, *operands: ir.Value) -> ir.Value:
        """Call one of LLVM's vector functions, such as "sqrt"."""
        lanes = "" if self.count == 1 else f"v{self.count}"
        shape = ir.FunctionType(self.type, [self.type] * len(operands))
        name = f"llvm.{name}.{lanes}f{8 * self.size}"
        return self.builder.call(self.builder.module.declare_intrinsic(name, fnty=shape), operands)

    def library(self, name: str, *operands: ir.Value) -> ir.Value:
        """Call a function of the C library, lane by lane in float64."""
        if self.count == 1:
            return self._library(name, *operands)
        result = ir.Constant(self.type, ir.Undefined)
        for i in range(self.count):
            result = self._set(result, self._library(name, *(self.lane(x, i) for x in operands)), i)
        return result

    def _library(self, name: str, *operands: ir.Value) -> ir.Value:
        shape = ir.FunctionType(F64, [F64] * len(operands))
        function = self.builder.module.globals.get(name) or ir.Function(self.builder.module, shape, name)
        if self.kind is F64:
            return self.builder.call(function, operands)
        result = self.builder.call(function, [self.builder.fpext(x, F64) for x in operands])
        return self.builder.fptrunc(result, self.kind)

    def lane(self, vector: ir.Value, i: int) -> ir.Value:
        """Return one number of a vector."""
        return vector if self.count == 1 else self.builder.extract_element(vector, ir.Constant(I32, i))

    def packed(self, numbers: Iterable[ir.Value]) -> ir.Value:
        """Return the vector of these numbers, padded with zeros."""
        result = self.constant(0.0)
        for i, x in enumerate(numbers):
            result = self._set(result, x, i)
        return result

    def _set(self, vector: ir.Value, x: ir.Value, i: int) -> ir.Value:
        return x if self.count == 1 else self.builder.insert_element(vector, x, ir.Constant(I32, i))

    def any(self, mask: ir.Value) -> ir.Value:
        """Return a condition that is true if a mask is true in any lane."""
        if self.count == 1:
            return mask
        bits = ir.IntType(self.count)
        return self.builder.icmp_unsigned("!=", self.builder.bitcast(mask, bits), ir.Constant(bits, 0))

    @property
    def none(self) -> ir.Value:
        """Mask that is false in every lane."""
        return Vectors(self.builder, I1, self.count).constant(0)

    def absolute_sum(self, vectors: Iterable[ir.Value], total: ir.Value) -> ir.Value:
        """Return a total plus Σ |x| of vectors, lane by lane."""
        for x in vectors:
            total = self.builder.fadd(total, self.intrinsic("fabs", x), flags=FLAGS)
        return total

    def sum(self, vector: ir.Value) -> ir.Value:
        """Return the sum of the numbers of a vector."""
        if self.count == 1:
            return vector
        shape = ir.FunctionType(self.kind, [self.kind, self.type])
        name = f"llvm.vector.reduce.fadd.v{self.count}f{8 * self.size}"
        function = self.builder.module.declare_intrinsic(name, fnty=shape)
        return self.builder.call(function, [ir.Constant(self.kind, 0.0), vector], fastmath=FLAGS)


def _operator(instruction: str, *flags: str, reflected: bool = False) -> Callable[[Lanes, Lanes | float], Lanes]:
    """Return an operator of `Lanes`: one instruction with two operands."""

    def operator(self: Lanes, other: Lanes | float) -> Lanes:
        """Apply the instruction to two vectors, lane by lane."""
        x, y = self.value, self.operand(other)
        return self.like(getattr(self.vectors.builder, instruction)(*((y, x) if reflected else (x, y)), flags=flags))

    return operator


@final
class Lanes:
    """A vector of floats or integers with Python's operators, so that one formula serves vectors of any length.

    Attributes:
        vectors: Length and type.
        value: LLVM value.
    """

    __slots__ = ("value", "vectors")

    def __init__(self, vectors: Vectors, value: ir.Value) -> None:
        self.vectors, self.value = vectors, value

    __add__ = __radd__ = _operator("fadd", "contract")
    __mul__ = __rmul__ = _operator("fmul", "contract")
    __sub__ = _operator("fsub", "contract")
    __rsub__ = _operator("fsub", "contract", reflected=True)
    __truediv__ = _operator("fdiv", "contract")
    __rtruediv__ = _operator("fdiv", "contract", reflected=True)
    plus, __and__, __lshift__, __xor__ = map(_operator, ("add", "and_", "shl", "xor"))  # operations on integers

    def operand(self, x: Lanes | float) -> ir.Value:
        """Return a constant, or other lanes, as an LLVM value of this type."""
        return x.value if isinstance(x, Lanes) else self.vectors.constant(x)

    def like(self, value: ir.Value, kind: ir.Type | None = None) -> Lanes:
        """Return lanes of the same length, of this type or another."""
        vectors = self.vectors
        return Lanes(vectors if kind is None else Vectors(vectors.builder, kind, vectors.count), value)

    def cast(self, instruction: str, kind: ir.Type) -> Lanes:
        """Convert the lanes to another type: "bitcast" keeps the bits, "fpext" and "fptrunc" the numbers."""
        return self.like(getattr(self.vectors.builder, instruction)(self.value, wide(kind, self.vectors.count)), kind)

    def below(self, other: Lanes | float) -> ir.Value:
        """Return the mask of lanes that are less than the other."""
        return self.vectors.builder.fcmp_ordered("<", self.value, self.operand(other))

    def choose(self, mask: ir.Value, other: Lanes | float) -> Lanes:
        """Return this value where the mask is true, otherwise the other."""
        return self.like(self.vectors.builder.select(mask, self.value, self.operand(other)))


def polynomial(z: Lanes, coefficients: tuple[float, ...]) -> Lanes:
    """Return c₀ + c₁ z + c₂ z² + …, by Horner's rule."""
    value = coefficients[-2] + z * coefficients[-1]
    for c in coefficients[-3::-1]:
        value = c + z * value
    return value


def align_stack(function: ir.Function) -> None:
    """Align the vectors that a function stores on the stack to cache lines, even if the caller is less aligned."""
    function.attributes.add("nounwind")  # llvmlite omits the alignment without another attribute
    function.attributes.alignstack = LINE
