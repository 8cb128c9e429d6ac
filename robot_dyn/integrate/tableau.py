"""The coefficients of a Runge–Kutta method as data.

    k_i = f(t + c_i h, y + h Σ_j a_ij k_j),    y⁺ = y + h Σ_i b_i k_i

[Butcher, 1964; Hairer, Nørsett, Wanner, Solving Ordinary Differential Equations I, 2nd ed., 1993, II.1 and II.7]
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from math import sqrt as root
from typing import Any, NamedTuple, final

import numpy as np

from robot_dyn.foundations.arithmetic import Arithmetic, Array, sqrt
from robot_dyn.foundations.errors import QueryError

_ROUNDINGS = 8  # allowed error of a sum, in units of float64 rounding of Σ |a_ij|


@final
@dataclass(frozen=True)
class Surd:
    """The number rational + factor · √radicand, which every arithmetic rounds to its nearest number."""

    rational: Fraction
    factor: Fraction
    radicand: int

    def __float__(self) -> float:
        return float(self.rational) + float(self.factor) * root(self.radicand)


Coefficient = int | Fraction | float | Surd


class Coefficients(NamedTuple):
    """A tableau as arrays a (s, s), b (s,), c (s,) of one arithmetic, with 0 and 1 of this arithmetic."""

    a: Array
    b: Array
    c: Array
    zero: Any
    one: Any


@final
@dataclass(frozen=True)
class ButcherTableau:
    """Coefficients a, b, c of a Runge–Kutta method, exact where they are fractions or surds.

    Attributes:
        a: One row for each stage; missing entries at the end of a row are zero.
        b: Weights, Σ b_i = 1.
        c: Nodes, c_i = Σ_j a_ij.
        order: Order of convergence stated by the source; the tests measure it.

    Raises:
        QueryError: If the lengths do not match, or a sum is wrong by more than rounding.
    """

    a: tuple[tuple[Coefficient, ...], ...]
    b: tuple[Coefficient, ...]
    c: tuple[Coefficient, ...]
    order: int
    _arrays: dict[np.dtype, Coefficients] = field(default_factory=dict, init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        stages = len(self.b)
        if not stages or len(self.a) != stages or len(self.c) != stages or any(len(row) > stages for row in self.a):
            raise QueryError(f"a tableau of {stages} weights needs {stages} nodes and rows of up to {stages} entries")
        if self.order < 1:
            raise QueryError(f"order must be positive, got {self.order}")
        _require_sum("b", self.b, 1)
        for i, (row, node) in enumerate(zip(self.a, self.c, strict=True)):
            _require_sum(f"a[{i}]", row, node)

    @property
    def explicit(self) -> bool:
        """True if each stage depends only on earlier stages."""
        return all(len(row) <= i for i, row in enumerate(self.a))

    def arrays(self, kind: Arithmetic) -> Coefficients:
        """Return the coefficients in an arithmetic, including zeros."""
        cached = self._arrays.get(kind.dtype)
        if cached is not None:
            return cached
        s, zero = len(self.b), kind.number(0)
        rows = [[*(_number(kind, x) for x in row), *[zero] * (s - len(row))] for row in self.a]
        b, c = ([_number(kind, x) for x in row] for row in (self.b, self.c))
        coefficients = Coefficients(kind.array(rows).reshape(s, s), kind.array(b), kind.array(c), zero, kind.number(1))
        if kind.dtype != object:  # balls change with the precision, which the caller sets
            self._arrays[kind.dtype] = coefficients
        return coefficients


def combine(weights: Array, k: Sequence[Array] | Array) -> Array:
    """Return Σ_j w_j k_j over the nonzero weights; there must be at least one."""
    first, *rest = [stage * weight for weight, stage in zip(weights, k, strict=True) if weight != 0]
    for term in rest:
        first = first + term
    return first


def _require_sum(name: str, row: Sequence[Coefficient], expected: Coefficient) -> None:
    total, size = sum(map(float, row)), sum(abs(float(entry)) for entry in row)
    if not abs(total - float(expected)) <= _ROUNDINGS * np.finfo(float).eps * max(size, 1.0):
        raise QueryError(f"tableau: the sum of {name} must be {float(expected)!r}, got {total!r}")


def _number(kind: Arithmetic, coefficient: Coefficient) -> Any:
    if isinstance(coefficient, Surd):
        surd = sqrt(kind.array([coefficient.radicand]))[0]
        return _number(kind, coefficient.rational) + _number(kind, coefficient.factor) * surd
    if isinstance(coefficient, float):
        return kind.number(float(coefficient))
    return kind.number(coefficient.numerator) / kind.number(coefficient.denominator)
