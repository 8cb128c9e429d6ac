"""Symbolic arithmetic: the formulations run on symbols, and both branches of an `if` in an effect are traced.

A comparison of symbols has no truth value while tracing. `every_branch` runs a function once for each combination of
outcomes and joins the results: x = if_else(c₁, if_else(c₂, x₁₁, x₁₀), x₀).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from typing import Any, final

import casadi as ca
import numpy as np

from robot_dyn.codegen.trace.condition import Condition, Node, deciding, truth
from robot_dyn.codegen.trace.symbol import Symbol, node, select, symbol
from robot_dyn.foundations.arithmetic import Arithmetic, Array, Numeral
from robot_dyn.foundations.errors import TraceError

_MAX_BRANCHES = 64  # each is a copy of the function in the kernel


@final
@dataclass(frozen=True)
class Symbolic(Arithmetic):
    """Symbols; within its scope, comparisons of a formulation that test whether M is regular count as true."""

    dtype: np.dtype = field(default_factory=lambda: np.dtype(object), init=False, repr=False)

    def number(self, literal: Symbol | Numeral) -> Symbol:
        return literal if isinstance(literal, Symbol) else Symbol(float(literal))

    def scope(self) -> AbstractContextManager[None]:
        return deciding(lambda condition: True)

    def asarray(self, values: object) -> Array:
        return self.array(values)

    def finite(self, x: Array) -> np.ndarray:
        return np.ones(np.shape(x), dtype=bool)


@final
class Symbols(np.ndarray):
    """An object array of symbols on which min, max, where and comparisons work as on numbers."""

    def __array_ufunc__(
        self, ufunc: np.ufunc, method: str, *inputs: object, out: tuple[object, ...] | None = None, **options: object
    ) -> object:
        plain = [np.asarray(x) if isinstance(x, Symbols) else x for x in inputs]
        if out is not None:
            options["out"] = tuple(np.asarray(x) if isinstance(x, Symbols) else x for x in out)
        if ufunc in _OF_SYMBOLS:
            function, arguments = _OF_SYMBOLS[ufunc]
            with np.errstate(all="ignore"):  # NumPy reads processor flags that CasADi leaves set
                return _symbols(getattr(np.frompyfunc(function, arguments, 1), method)(*plain, **options))
        return _symbols(getattr(ufunc, method)(*plain, **options))

    def __array_function__(
        self,
        function: Callable[..., object],
        kinds: Iterable[type],
        args: Iterable[object],
        options: Mapping[str, object],
    ) -> object:
        return self._called(function, kinds, tuple(args), options)

    def _called(
        self, function: Any, kinds: Iterable[type], args: tuple[Any, ...], options: Mapping[str, Any]
    ) -> object:
        """Return the result of one of NumPy's functions."""
        if function is np.where and len(args) == 3:
            return _symbols(np.frompyfunc(select, 3, 1)(*(np.asarray(x) for x in args)))
        if function is np.clip and len(args) == 3 and not options and args[1] is not None is not args[2]:
            return np.minimum(np.maximum(args[0], args[1]), args[2])
        if function in (np.linalg.solve, np.linalg.inv) and len(args) == 1 + (function is np.linalg.solve):
            return _solved(*args)
        try:
            return _symbols(super().__array_function__(function, kinds, args, options))
        except TypeError as error:
            if getattr(function, "__module__", "") != "numpy.linalg":
                raise
            raise TypeError(
                f"np.linalg.{function.__name__} cannot be traced; use np.linalg.solve or inv of a matrix (m, m), or"
                " compute the result once when the object is built"
            ) from error


def _solved(A: Any, b: Any = None) -> Any:
    """Return A⁻¹ b of a regular matrix (m, m) and b (m,) or (m, k), or A⁻¹, by QR in symbols."""
    A, shape = np.asarray(A), np.shape(A)
    if len(shape) != 2 or shape[0] != shape[1]:
        raise TypeError(f"np.linalg.solve and inv are traced for one matrix (m, m), got {shape}; write a loop")
    b = np.eye(len(A)) if b is None else np.asarray(b)
    if b.ndim not in (1, 2) or len(b) != len(A):
        raise TypeError(f"np.linalg.solve is traced for b of shape ({len(A)},) or ({len(A)}, k), got {b.shape}")
    sides = b.reshape(len(A), -1)
    solved = ca.solve(column(A).reshape((len(A), -1)).T, column(sides.T).reshape(sides.shape))
    return array_of(ca.densify(solved)).reshape(b.shape).view(Symbols)


def _symbols(x: Any) -> Any:
    return x.view(Symbols) if isinstance(x, np.ndarray) and x.dtype == object else x


def _sign(x: Any) -> Symbol:
    return node(ca.sign(symbol(x).expression))


_OF_SYMBOLS: dict[Any, tuple[Callable[..., Any], int]] = {
    np.maximum: (lambda x, y: node(ca.fmax(symbol(x).expression, symbol(y).expression)), 2),
    np.minimum: (lambda x, y: node(ca.fmin(symbol(x).expression, symbol(y).expression)), 2),
    np.arctan2: (lambda y, x: node(ca.atan2(symbol(y).expression, symbol(x).expression)), 2),
    np.sign: (_sign, 1),
    np.floor: (lambda x: node(ca.floor(symbol(x).expression)), 1),
    np.ceil: (lambda x: node(ca.ceil(symbol(x).expression)), 1),
    np.less: (lambda x, y: symbol(x) < y, 2),
    np.less_equal: (lambda x, y: symbol(x) <= y, 2),
    np.greater: (lambda x, y: symbol(x) > y, 2),
    np.greater_equal: (lambda x, y: symbol(x) >= y, 2),
    np.logical_and: (lambda x, y: Condition(ca.logic_and(truth(x), truth(y))), 2),
    np.logical_or: (lambda x, y: Condition(ca.logic_or(truth(x), truth(y))), 2),
    np.logical_not: (lambda x: Condition(ca.logic_not(truth(x))), 1),
}


def inputs(name: str, n: int) -> tuple[Node, Array]:
    """Return a CasADi vector of n inputs, and the same as an array of symbols."""
    vector = ca.SX.sym(name, n)
    array = np.empty(n, dtype=object)
    array[:] = [node(vector[i]) for i in range(n)]
    return vector, array


def column(array: object) -> Node:
    """Return the entries of an array, row by row, as one CasADi column."""
    return ca.vertcat(*(symbol(x).expression for x in np.asarray(array, dtype=object).flat))


def array_of(expression: Node) -> Array:
    """Return a CasADi matrix as an array of symbols."""
    rows, columns = expression.shape
    array = np.empty((rows, columns), dtype=object)
    for i in range(rows):
        for j in range(columns):
            array[i, j] = node(expression[i, j])
    return array


def every_branch(function: Callable[[], Array]) -> Array:
    """Return the value of a function that compares symbols, for every outcome of its comparisons.

    Raises:
        TraceError: If there are more than 64 combinations of outcomes.
    """
    left = _MAX_BRANCHES

    def follow(decided: list[bool]) -> Array:
        nonlocal left
        conditions: list[Node] = []

        def decide(condition: Node) -> bool:
            conditions.append(condition)
            return decided[len(conditions) - 1] if len(conditions) <= len(decided) else True

        with deciding(decide):
            yes = np.asarray(function(), dtype=object)
        left -= 1
        if left < 0:
            raise TraceError(
                f"more than {_MAX_BRANCHES} branches; write it with np.where or np.clip, without if, min or max"
            )
        result = yes
        # each condition was taken as true above; now as false, from the last one on
        for depth in reversed(range(len(decided), len(conditions))):
            no = follow([*decided, *[True] * (depth - len(decided)), False])
            result = _joined(Condition(conditions[depth]), result, no)
        return result

    return follow([])


def _joined(condition: Condition, yes: Array, no: Array) -> Array:
    return np.frompyfunc(lambda a, b: select(condition, a, b), 2, 1)(*np.broadcast_arrays(yes, no))
