"""Lanes: LLVM values under Python's operators, so that one formula serves one number and a vector of them alike.

Every operation may be contracted (a·b + c rounded once) and no more: what is written is what is computed.
"""

from __future__ import annotations

from typing import Any, final

from llvmlite import ir

_CONTRACT = ("contract",)
I64 = ir.IntType(64)
F64 = ir.DoubleType()
F32 = ir.FloatType()


def wide(type_: Any, lanes: int) -> Any:
    """The type of so many lanes; of one, the type itself."""
    return type_ if lanes == 1 else ir.VectorType(type_, lanes)


@final
class Lanes:
    """A floating-point or integer value of one lane or several.

    Attributes:
        builder: Where its instructions go.
        value: The LLVM value.
        kind: Type of one lane.
        count: Number of lanes.
    """

    __slots__ = ("builder", "count", "kind", "value")

    def __init__(self, builder: Any, value: Any, kind: Any, count: int) -> None:
        self.builder, self.value, self.kind, self.count = builder, value, kind, count

    def _new(self, value: Any, kind: Any = None) -> Lanes:
        return Lanes(self.builder, value, kind or self.kind, self.count)

    def of(self, x: Any) -> Any:
        """A constant, or another value, as an LLVM value of this type."""
        if isinstance(x, Lanes):
            return x.value
        return ir.Constant(wide(self.kind, self.count), x if self.count == 1 else [x] * self.count)

    def __add__(self, other: Any) -> Lanes:
        if self.kind is I64:
            return self._new(self.builder.add(self.value, self.of(other)))
        return self._new(self.builder.fadd(self.value, self.of(other), flags=_CONTRACT))

    def __sub__(self, other: Any) -> Lanes:
        return self._new(self.builder.fsub(self.value, self.of(other), flags=_CONTRACT))

    def __rsub__(self, other: Any) -> Lanes:
        return self._new(self.builder.fsub(self.of(other), self.value, flags=_CONTRACT))

    def __mul__(self, other: Any) -> Lanes:
        return self._new(self.builder.fmul(self.value, self.of(other), flags=_CONTRACT))

    def __rtruediv__(self, other: Any) -> Lanes:
        return self._new(self.builder.fdiv(self.of(other), self.value, flags=_CONTRACT))

    def __truediv__(self, other: Any) -> Lanes:
        return self._new(self.builder.fdiv(self.value, self.of(other), flags=_CONTRACT))

    __radd__, __rmul__ = __add__, __mul__

    def __and__(self, mask: int) -> Lanes:
        return self._new(self.builder.and_(self.value, self.of(mask)))

    def __lshift__(self, bits: int) -> Lanes:
        return self._new(self.builder.shl(self.value, self.of(bits)))

    def __xor__(self, other: Lanes) -> Lanes:
        return self._new(self.builder.xor(self.value, other.value))

    def bits(self) -> Lanes:
        """The bits of float64 lanes, as integers."""
        return self._new(self.builder.bitcast(self.value, wide(I64, self.count)), I64)

    def number(self) -> Lanes:
        """The float64 of these bits."""
        return self._new(self.builder.bitcast(self.value, wide(F64, self.count)), F64)

    def double(self) -> Lanes:
        """Float32 lanes as float64."""
        return self._new(self.builder.fpext(self.value, wide(F64, self.count)), F64)

    def single(self) -> Lanes:
        """Float64 lanes rounded to float32."""
        return self._new(self.builder.fptrunc(self.value, wide(F32, self.count)), F32)

    def below(self, other: Any) -> Any:
        """Whether each lane is less than the other: a mask for `choose`."""
        return self.builder.fcmp_ordered("<", self.value, self.of(other))

    def odd(self) -> Any:
        """Whether the lowest bit is set: a mask for `choose`."""
        return self.builder.trunc(self.value, wide(ir.IntType(1), self.count))

    def choose(self, mask: Any, other: Any) -> Lanes:
        """This value where the mask is set, else the other."""
        return self._new(self.builder.select(mask, self.value, self.of(other)))


def polynomial(z: Lanes, coefficients: tuple[float, ...]) -> Any:
    """c₀ + c₁ z + c₂ z² + …, by Horner's rule."""
    value: Any = coefficients[-1]
    for c in coefficients[-2::-1]:
        value = c + z * value
    return value
