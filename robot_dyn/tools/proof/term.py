"""Numbers of a trace without rounding, x = c + node with a ball c and a CasADi node, and their arithmetic.

A ball that is combined with a node becomes an input of the trace, one for each value, so that neither CasADi nor this
library computes with it in floats. Only an exact 0 or ±1 is folded.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field
from functools import reduce
from operator import add
from typing import Any, SupportsFloat, final

import casadi as ca
import numpy as np
from flint import arb

from robot_dyn.codegen.trace.condition import Node
from robot_dyn.foundations import Arithmetic, Array, Ball

BITS = 400  # precision of the constants, whose rounding is negligible
BALLS = Ball(BITS)


@final
class Constants:
    """Balls in the nodes of a trace.

    Attributes:
        symbols: Inputs of the trace for the balls.
        balls: Values of these inputs, in the same order.
    """

    def __init__(self) -> None:
        self.symbols: list[Node] = []
        self.balls: list[arb] = []
        self._nodes: dict[tuple[Any, Any], Node] = {}

    def node(self, ball: arb) -> Node:
        """Return the node of a ball: an exact 0 or ±1 as a constant, any other as an input or its negative."""
        if ball.is_exact() and ball.is_integer() and abs(ball) <= 1:
            return ca.SX(int(float(ball)))
        if ball.mid() < 0:
            return -self.node(-ball)
        key = ball.mid().man_exp(), ball.rad().man_exp()
        if key not in self._nodes:
            self._nodes[key] = ca.SX.sym(f"c{len(self.balls)}")
            self.symbols.append(self._nodes[key])
            self.balls.append(ball)
        return self._nodes[key]


CONSTANTS: ContextVar[Constants] = ContextVar("constants")


@final
class Term:
    """A number c + node; without a node, the constant c.

    Constants are compared by their midpoints, and comparisons with nodes are true: a formulation only chooses one of
    several identities, or tests whether M is regular, which the proof decides by its pivots. Zero means exactly 0.
    """

    __slots__ = ("constant", "node")

    def __init__(self, constant: arb, node: Node | None = None) -> None:
        self.constant: Any = constant
        self.node: Any = node

    @property
    def expression(self) -> Node:
        """Term as one CasADi expression."""
        c = CONSTANTS.get().node(self.constant)
        return c if self.node is None else c + self.node

    def __add__(self, other: Term | float) -> Term:
        if (x := _term(other)) is None:
            return NotImplemented
        nodes = [term.node for term in (self, x) if term.node is not None]
        return Term(self.constant + x.constant, reduce(add, nodes) if nodes else None)

    __radd__ = __add__

    def __neg__(self) -> Term:
        return Term(-self.constant, None if self.node is None else -self.node)

    def __pos__(self) -> Term:
        return self

    def __sub__(self, other: Term | float) -> Term:
        return NotImplemented if (x := _term(other)) is None else self + -x

    def __rsub__(self, other: Term | float) -> Term:
        return -self + other

    def __mul__(self, other: Term | float) -> Term:
        if (x := _term(other)) is None:
            return NotImplemented
        if x.node is None:
            return self._times(x.constant)
        return x._times(self.constant) if self.node is None else _of(self.expression * x.expression)

    __rmul__ = __mul__

    def _times(self, k: Any) -> Term:
        if self.node is None or k.is_zero():
            return Term(self.constant * k)
        return Term(self.constant * k, CONSTANTS.get().node(k) * self.node)

    def __truediv__(self, other: Term | float) -> Term:
        if (x := _term(other)) is None:
            return NotImplemented
        if x.node is None:
            return self._times(1 / x.constant)
        return self if self.node is None and self.constant.is_zero() else _of(self.expression / x.expression)

    def __rtruediv__(self, other: Term | float) -> Term:
        return NotImplemented if (x := _term(other)) is None else x / self

    def __pow__(self, exponent: float) -> Term:
        if exponent != 2:
            raise TypeError("only squares are supported")
        return self * self

    def sin(self) -> Term:
        """Return the sine."""
        return self._unary(ca.sin, "sin")

    def cos(self) -> Term:
        """Return the cosine."""
        return self._unary(ca.cos, "cos")

    def tanh(self) -> Term:
        """Return the hyperbolic tangent."""
        return self._unary(ca.tanh, "tanh")

    def sqrt(self) -> Term:
        """Return the square root."""
        return self._unary(ca.sqrt, "sqrt")

    def conjugate(self) -> Term:
        """Return the term itself, because it is real."""
        return self

    def _unary(self, symbolic: Callable[[Node], Node], name: str) -> Term:
        return Term(getattr(self.constant, name)()) if self.node is None else _of(symbolic(self.expression))

    def __abs__(self) -> Term:
        if self.node is not None:
            raise TypeError("|x| is not analytic")
        return Term(abs(self.constant))

    def __bool__(self) -> bool:
        return self != 0

    def _below(self, other: Any, or_equal: bool) -> bool:
        x = _term(other)
        assert x is not None
        if self.node is not None or x.node is not None:
            return True
        a, b = self.constant.mid(), x.constant.mid()
        return bool(a <= b if or_equal else a < b)

    def __lt__(self, other: Term | float) -> bool:
        return self._below(other, or_equal=False)

    def __le__(self, other: Term | float) -> bool:
        return self._below(other, or_equal=True)

    def __gt__(self, other: Term | float) -> bool:
        return (-self)._below(-other, or_equal=False)

    def __ge__(self, other: Term | float) -> bool:
        return (-self)._below(-other, or_equal=True)

    def __eq__(self, other: object) -> bool:
        if (x := _term(other)) is None:
            return NotImplemented
        return self.node is None and x.node is None and bool(self.constant == x.constant)  # both exact

    __hash__ = None  # pyright: ignore[reportAssignmentType]


def expressions(array: Array) -> Node:
    """Return the entries of an array, row by row, as one CasADi column."""
    terms = (_term(x) for x in np.asarray(array, dtype=object).flat)
    return ca.vertcat(*(x.expression for x in terms if x is not None))


def _of(expression: Node) -> Term:
    return Term(arb(0), expression)


def _term(x: Any) -> Term | None:
    if x.__class__ is Term:
        return x
    try:
        return Term(BALLS.number(x))
    except (TypeError, ValueError):
        return None


@final
@dataclass(frozen=True, eq=False)
class Literals(Arithmetic):
    """Numbers of a trace, with constants in balls of 400 bits.

    Attributes:
        constants: Constants that became inputs.
    """

    constants: Constants = field(default_factory=Constants, repr=False)
    dtype: np.dtype = field(default_factory=lambda: np.dtype(object), init=False, repr=False)

    def number(self, literal: Term | str | SupportsFloat) -> Term:
        return literal if isinstance(literal, Term) else Term(BALLS.number(literal))

    @contextmanager
    def scope(self) -> Iterator[None]:
        token = CONSTANTS.set(self.constants)
        try:
            with BALLS.scope():
                yield
        finally:
            CONSTANTS.reset(token)

    def asarray(self, values: object) -> Array:
        return self.array(values)

    def finite(self, x: Array) -> np.ndarray:
        return np.ones(np.shape(x), dtype=bool)

    def inputs(self, name: str, n: int) -> tuple[Node, Array]:
        """Return a CasADi vector of n inputs, and the same as an array of terms."""
        vector = ca.SX.sym(name, n)
        return vector, self.array([Term(BALLS.number(0), vector[i]) for i in range(n)])
