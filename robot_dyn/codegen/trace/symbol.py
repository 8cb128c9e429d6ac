"""Symbols: the numbers of a trace, x = c ± s with a constant c and a CasADi node s, so that 0 and 1 stay exact.

A formulation that runs on symbols records its instructions. Constants are folded, signs are kept, and 1 − (1 − cos θ)
becomes cos θ: terms that vanish in every state add nothing to the kernel.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, final

import casadi as ca

from robot_dyn.codegen.trace.condition import Condition, Node

_NOISE = 4 * 2.0**-53  # a sine or cosine of a constant angle below this is rounding of 0


@final
class Symbol:
    """A number c + sign · node; without a node, the constant c.

    Attributes:
        constant: The constant c.
        sign: 1 or −1.
        node: CasADi expression, or None.
    """

    __slots__ = ("constant", "node", "sign")

    def __init__(self, constant: float, sign: int = 1, node: Node | None = None) -> None:
        self.constant, self.sign = constant, sign
        self.node: Any = node

    def __repr__(self) -> str:
        return f"Symbol({self.constant!r}, {self.sign}, {self.node})"

    @property
    def expression(self) -> Node:
        """Symbol as one CasADi expression."""
        if self.node is None:
            return ca.SX(self.constant)
        if self.constant == 0:
            return self.node if self.sign > 0 else -self.node
        return self.constant + self.node if self.sign > 0 else self.constant - self.node

    def __add__(self, other: Symbol | float) -> Symbol:
        if (x := _symbol(other)) is None:
            return NotImplemented
        c = self.constant + x.constant
        if x.node is None:
            return Symbol(c, self.sign, self.node)
        if self.node is None:
            return Symbol(c, x.sign, x.node)
        if self.sign == x.sign:
            return Symbol(c, self.sign, self.node + x.node)
        if self.sign > 0:
            return _simplified(c, 1, self.node - x.node)
        return _simplified(c, 1, x.node - self.node)

    __radd__ = __add__

    def __neg__(self) -> Symbol:
        return Symbol(-self.constant, -self.sign, self.node)

    def __pos__(self) -> Symbol:
        return self

    def __sub__(self, other: Symbol | float) -> Symbol:
        return NotImplemented if (x := _symbol(other)) is None else self + -x

    def __rsub__(self, other: Symbol | float) -> Symbol:
        return -self + other

    def __mul__(self, other: Symbol | float) -> Symbol:
        if (x := _symbol(other)) is None:
            return NotImplemented
        if x.node is None:
            return self._times(x.constant)
        if self.node is None:
            return x._times(self.constant)
        if self.constant == 0 == x.constant:
            return Symbol(0.0, self.sign * x.sign, self.node * x.node)
        return Symbol(0.0, 1, self.expression * x.expression)

    __rmul__ = __mul__

    def _times(self, k: float) -> Symbol:
        """Return the product with a constant, applied to both parts."""
        if k == 0:
            return ZERO
        sign, size = (1, k) if k > 0 else (-1, -k)
        if self.node is None:
            return Symbol(self.constant * k)
        return Symbol(self.constant * k, self.sign * sign, self.node if size == 1 else size * self.node)

    def __truediv__(self, other: Symbol | float) -> Symbol:
        if (x := _symbol(other)) is None:
            return NotImplemented
        if x.node is None:
            return Symbol(self.constant / x.constant) if self.node is None else self._times(1 / x.constant)
        if self.node is None and self.constant == 0:
            return ZERO
        return Symbol(0.0, 1, self.expression / x.expression)

    def __rtruediv__(self, other: Symbol | float) -> Symbol:
        return NotImplemented if (x := _symbol(other)) is None else x / self

    def __pow__(self, exponent: Symbol | float) -> Symbol:
        if (x := _symbol(exponent)) is None:
            return NotImplemented
        if x.node is not None:
            return _simplified(0.0, 1, self.expression**x.expression)
        if self.node is None:
            return Symbol(self.constant**x.constant)
        if x.constant == 2:
            return self * self
        return _simplified(0.0, 1, self.expression**x.constant)

    def __abs__(self) -> Symbol:
        return self._unary(ca.fabs, abs)

    # NumPy calls these for sin(x), … of an object array
    def sin(self) -> Symbol:
        """Return the sine."""
        return self._unary(ca.sin, lambda x: _snapped(math.sin(x)))

    def cos(self) -> Symbol:
        """Return the cosine."""
        return self._unary(ca.cos, lambda x: _snapped(math.cos(x)))

    def sqrt(self) -> Symbol:
        """Return the square root."""
        return self._unary(ca.sqrt, math.sqrt)

    def tanh(self) -> Symbol:
        """Return the hyperbolic tangent."""
        return self._unary(ca.tanh, math.tanh)

    def exp(self) -> Symbol:
        """Return the exponential."""
        return self._unary(ca.exp, math.exp)

    def conjugate(self) -> Symbol:
        """Return the symbol itself, because it is real."""
        return self

    def _unary(self, symbolic: Callable[[Node], Node], exact: Callable[[float], float]) -> Symbol:
        if self.node is None:
            return Symbol(float(exact(self.constant)))
        return _simplified(0.0, 1, symbolic(self.expression))

    def __lt__(self, other: Symbol | float) -> Condition | bool:
        return _compared(self, other, ca.lt)

    def __le__(self, other: Symbol | float) -> Condition | bool:
        return _compared(self, other, ca.le)

    def __gt__(self, other: Symbol | float) -> Condition | bool:
        return _compared(self, other, ca.gt)

    def __ge__(self, other: Symbol | float) -> Condition | bool:
        return _compared(self, other, ca.ge)

    def __eq__(self, other: object) -> Any:
        return _compared(self, other, ca.eq)

    def __ne__(self, other: object) -> Any:
        return _compared(self, other, ca.ne)

    __hash__ = None  # pyright: ignore[reportAssignmentType]


ZERO = Symbol(0.0)


def select(condition: Condition | bool, yes: Symbol | float, no: Symbol | float) -> Symbol:
    """Return `yes` where the condition holds, else `no`."""
    yes, no = symbol(yes), symbol(no)
    if not isinstance(condition, Condition):
        return yes if condition else no
    return _simplified(0.0, 1, ca.if_else(condition.node, yes.expression, no.expression))


def symbol(x: object) -> Symbol:
    """Convert a number or symbol to a symbol; raise TypeError if it is not a number."""
    if (converted := _symbol(x)) is None:
        raise TypeError(f"not a number: {x!r}")
    return converted


def node(expression: Node) -> Symbol:
    """Return the symbol of a CasADi expression."""
    return _simplified(0.0, 1, expression)


def _symbol(x: Any) -> Symbol | None:
    if x.__class__ is Symbol:
        return x
    try:
        return Symbol(float(x))
    except (TypeError, ValueError):
        return None


def _simplified(constant: float, sign: int, expression: Node) -> Symbol:
    """Return the symbol of an expression, or of a constant if it is one."""
    if expression.is_constant():
        return Symbol(constant + sign * float(expression))
    return Symbol(constant, sign, expression)


def _snapped(x: float) -> float:
    """Return a sine or cosine of a constant angle, rounded to its exact values 0 and ±1 if close."""
    nearest = round(x)
    return float(nearest) if abs(x - nearest) < _NOISE else x


def _compared(x: Symbol, other: Any, compare: Callable[[Node, Node], Node]) -> Any:
    if (y := _symbol(other)) is None:
        return NotImplemented
    if (y.node is None and math.isinf(y.constant)) or (x.node is None and math.isinf(x.constant)):
        return bool(compare(ca.SX(x.constant if x.node is None else 0), ca.SX(y.constant if y.node is None else 0)))
    result = compare(x.expression, y.expression)
    return bool(result) if result.is_constant() else Condition(result)
