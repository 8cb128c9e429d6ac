"""The numbers the equations run in: float32, float64, longdouble, or balls with a proven radius.

Every formulation is written once with NumPy's operators; an `Arithmetic` converts the literals that a file
states, and the functions below hide what NumPy does not do for every kind of number. A ball is an interval
midpoint ± radius that is certain to hold the exact value [Johansson, Arb, 2017].
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass, field
from functools import wraps
from threading import RLock
from typing import Any, final

import numpy as np

from robot_dyn.foundations.errors import QueryError, shown
from robot_dyn.foundations.validate import integer, real

Array = np.ndarray  # of floats, or of flint.arb objects: NumPy's types do not tell them apart
Scalar = float | np.ndarray  # one number, or one for each state of a batch


class Arithmetic(ABC):
    """A kind of number.

    Attributes:
        dtype: Of the arrays that hold these numbers.
    """

    dtype: np.dtype

    @abstractmethod
    def number(self, literal: Any) -> Any:
        """One number from the text of a file, or from a number, which is taken exactly."""

    @abstractmethod
    def scope(self) -> AbstractContextManager[None]:
        """The context in which operations have this arithmetic's precision."""

    @abstractmethod
    def asarray(self, values: Any) -> Array:
        """Array of numbers; TypeError or ValueError if one is not a number. Not copied if of this kind already."""

    @abstractmethod
    def finite(self, x: Array) -> np.ndarray:
        """Which entries are finite numbers."""

    def array(self, literals: Any) -> Array:
        """Array of numbers, of the shape of the nested literals."""
        source = np.asarray(literals, dtype=object)
        result = np.empty(source.size, dtype=self.dtype)
        result[:] = [self.number(literal) for literal in source.flat]
        return result.reshape(source.shape)


@final
@dataclass(frozen=True)
class Float(Arithmetic):
    """Floating-point numbers of one NumPy dtype, rounded to nearest."""

    dtype: np.dtype

    def number(self, literal: Any) -> Any:
        return self.dtype.type(literal)

    def scope(self) -> AbstractContextManager[None]:
        return nullcontext()

    def asarray(self, values: Any) -> Array:
        array = real(values)
        with np.errstate(over="ignore"):  # a longdouble may be too large: then it is not finite
            return array.astype(self.dtype, copy=False)

    def finite(self, x: Array) -> np.ndarray:
        return np.isfinite(x)


FLOAT64 = Float(np.dtype(np.float64))

MOST_BITS = 1_000_000  # of a ball: a product of such takes milliseconds

# flint keeps one working precision for the whole process, so balls of two precisions must take turns.
_flint_turn = RLock()


@final
@dataclass(frozen=True)
class Ball(Arithmetic):
    """Balls (flint.arb) with midpoints of `bits` bits: every result encloses the exact value.

    Attributes:
        bits: Precision of the midpoints, from 2 to a million, 53 for that of float64.
    """

    bits: int = 53
    dtype: np.dtype = field(default_factory=lambda: np.dtype(object), init=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "bits", integer("bits of a Ball", self.bits, least=2, most=MOST_BITS))

    def number(self, literal: Any) -> Any:
        from flint import arb

        if literal.__class__ is np.longdouble:
            high = float(literal)  # two exact parts, each a float64
            return arb(high) + arb(float(literal - np.longdouble(high)))
        exact = (arb, str, int)
        return arb(literal if isinstance(literal, exact) else float(literal))

    @contextmanager
    def scope(self) -> Iterator[None]:
        from flint import ctx

        with _flint_turn, ctx.workprec(self.bits):
            yield

    def asarray(self, values: Any) -> Array:
        array = np.asarray(values, dtype=object) if not isinstance(values, np.ma.MaskedArray) else real(values)
        if any(isinstance(x, bool | np.bool_) for x in array.flat):
            raise ValueError("truth values")
        return self.array(array)

    def finite(self, x: Array) -> np.ndarray:
        return np.vectorize(lambda ball: ball.is_finite(), otypes=[bool])(x)


def arithmetic_of(dtype: Any) -> Arithmetic:
    """The arithmetic that a user names: a float dtype of NumPy, or an `Arithmetic` such as `Ball(200)`.

    Raises:
        QueryError: If it is neither.
    """
    if isinstance(dtype, Arithmetic):
        return dtype
    try:
        found = np.dtype(dtype)
    except Exception:  # whatever a foreign object makes of it
        found = None
    if dtype is None or found is None or found.kind != "f" or found.itemsize < 4:
        raise QueryError(f"no arithmetic {shown(dtype)}: give float32, float64, np.longdouble or Ball(bits)")
    return Float(found)


def in_arithmetic(method: Callable[..., Any]) -> Callable[..., Any]:
    """Run a method in the precision of its object's `arithmetic`."""

    @wraps(method)
    def scoped(self: Any, *args: Any, **options: Any) -> Any:
        with self.arithmetic.scope():
            return method(self, *args, **options)

    return scoped


def midpoint(x: Array) -> Array:
    """The float64 nearest to the midpoint of each ball."""
    return _of_each(x, lambda ball: float(ball.mid()))


def radius(x: Array) -> Array:
    """A float64 upper bound of the radius of each ball."""
    return _of_each(x, lambda ball: float(ball.rad().upper()))


def _of_each(x: Any, of: Callable[[Any], float]) -> Array:
    from flint import arb

    balls = np.asarray(x, dtype=object)
    if not all(isinstance(ball, arb) for ball in balls.flat):
        raise QueryError(
            f"give an array of balls, such as rd.Lagrangian(robot, rd.accuracy.Ball(200)) answers, got {shown(x)}"
        )
    return np.vectorize(of, otypes=[float])(balls)


# NumPy applies these to object arrays by calling the method of the same name on each entry, so one name serves all.
sin, cos, sqrt, tanh = np.sin, np.cos, np.sqrt, np.tanh


def positive_part(x: Array) -> Array:
    """max(x, 0), exactly; of balls (x + |x|) / 2, for the larger of two that overlap is not known."""
    if type(x) is np.ndarray and x.dtype == object:
        return (x + np.abs(x)) / 2
    return np.maximum(x, 0.0)


def transpose(x: Array) -> Array:
    """Transpose of the last two axes."""
    return np.swapaxes(x, -1, -2)


def apply(A: Array, x: Array) -> Array:
    """A x for A (..., m, n) and x (..., n)."""
    return (A @ x[..., None])[..., 0]


def symmetric(A: Array) -> Array:
    """A (..., m, m), symmetric but for rounding, with its upper triangle in place of the lower: less to trace.

    Floats are left as they are, for speed.
    """
    if A.dtype != object:
        return A
    upper = np.triu(np.ones(A.shape[-2:], dtype=bool))
    return np.where(upper, A, transpose(A))


def rounding(x: Array) -> str:
    """The name of what the numbers of an array are rounded to."""
    if x.dtype.kind == "f":
        return x.dtype.name
    from flint import ctx

    return f"balls of {ctx.prec} bits"
