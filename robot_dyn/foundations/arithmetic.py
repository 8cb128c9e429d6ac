"""Number types of the equations: float32, float64, longdouble, or balls with a proven radius.

Every formulation is written once with NumPy's operators. An `Arithmetic` converts the literals of a file; the functions
below extend NumPy to other kinds of numbers. A ball is an interval midpoint ± radius that contains the exact value
[Johansson, Arb, 2017].
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass, field
from functools import wraps
from threading import RLock
from typing import TYPE_CHECKING, Any, Concatenate, ParamSpec, SupportsFloat, TypeVar, final

import numpy as np

from robot_dyn.foundations.errors import QueryError, shown
from robot_dyn.foundations.validate import integer, real

if TYPE_CHECKING:
    from flint import arb
    from numpy.typing import DTypeLike

Array = np.ndarray  # array of floats or flint.arb objects; NumPy has one type for both
Numeral = str | SupportsFloat  # a number in the text of a file, or a number
Scalar = float | np.ndarray  # one number, or one for each state of a batch
Arguments = ParamSpec("Arguments")
Result = TypeVar("Result")
Owner = TypeVar("Owner")


class Arithmetic(ABC):
    """A kind of number.

    Attributes:
        dtype: Type of the entries of arrays.
    """

    dtype: np.dtype

    @abstractmethod
    def number(self, literal: Numeral) -> Any:
        """Return one number, of the type of array entries, from the text of a file or from a number.

        Numbers are converted exactly if possible. The type is `Any` because no type covers floats, balls and symbols.
        """

    @abstractmethod
    def scope(self) -> AbstractContextManager[None]:
        """Return the context in which operations have the precision of this arithmetic."""

    @abstractmethod
    def asarray(self, values: object) -> Array:
        """Return an array of this kind of number, not copied if it is one; raise TypeError or ValueError if invalid."""

    @abstractmethod
    def finite(self, x: Array) -> np.ndarray:
        """Return True for entries that are finite numbers."""

    def array(self, literals: object) -> Array:
        """Return an array of numbers with the shape of the nested literals."""
        source = np.asarray(literals, dtype=object)
        result = np.empty(source.size, dtype=self.dtype)
        result[:] = [self.number(literal) for literal in source.flat]
        return result.reshape(source.shape)


@final
@dataclass(frozen=True)
class Float(Arithmetic):
    """Floating-point numbers of one NumPy dtype, rounded to nearest."""

    dtype: np.dtype

    def number(self, literal: Numeral) -> np.floating:
        return self.dtype.type(literal)

    def scope(self) -> AbstractContextManager[None]:
        return nullcontext()

    def asarray(self, values: object) -> Array:
        array = real(values)
        with np.errstate(over="ignore"):  # a longdouble that is too large becomes infinite
            return array.astype(self.dtype, copy=False)

    def finite(self, x: Array) -> np.ndarray:
        return np.isfinite(x)


FLOAT64 = Float(np.dtype(np.float64))

MAX_BITS = 1_000_000  # largest precision of a ball: a product then takes milliseconds

# flint has one working precision per process, so only one precision can be in use at a time.
_flint_turn = RLock()


@final
@dataclass(frozen=True)
class Ball(Arithmetic):
    """Balls (flint.arb) with midpoints of `bits` bits: every result encloses the exact value.

    Attributes:
        bits: Precision of the midpoints, from 2 to a million; 53 is the precision of float64.
    """

    bits: int = 53
    dtype: np.dtype = field(default_factory=lambda: np.dtype(object), init=False, repr=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "bits", integer("bits of a Ball", self.bits, least=2, most=MAX_BITS))

    def number(self, literal: Numeral) -> arb:
        from flint import arb

        if type(literal) is np.longdouble:
            high = float(literal)  # two exact parts, each a float64
            return arb(high) + arb(float(literal - np.longdouble(high)))
        exact = (arb, str, int)
        return arb(literal if isinstance(literal, exact) else float(literal))

    @contextmanager
    def scope(self) -> Iterator[None]:
        from flint import ctx

        with _flint_turn, ctx.workprec(self.bits):
            yield

    def asarray(self, values: object) -> Array:
        array = np.asarray(values, dtype=object) if not isinstance(values, np.ma.MaskedArray) else real(values)
        if any(isinstance(x, bool | np.bool_) for x in array.flat):
            raise ValueError("truth values")
        return self.array(array)

    def finite(self, x: Array) -> np.ndarray:
        return np.vectorize(lambda ball: ball.is_finite(), otypes=[bool])(x)


def arithmetic_of(dtype: DTypeLike | Arithmetic) -> Arithmetic:
    """Return the arithmetic for a float dtype of NumPy, or an `Arithmetic` such as `Ball(200)`.

    Raises:
        QueryError: If the argument is neither.
    """
    if isinstance(dtype, Arithmetic):
        return dtype
    try:
        numpy_dtype = np.dtype(dtype)
    except Exception:  # any error in the conversion of a foreign object
        numpy_dtype = None
    if dtype is None or numpy_dtype is None or numpy_dtype.kind != "f" or numpy_dtype.itemsize < 4:
        raise QueryError(f"dtype {shown(dtype)} is not supported: use float32, float64, np.longdouble or Ball(bits)")
    return Float(numpy_dtype)


def in_arithmetic(
    method: Callable[Concatenate[Owner, Arguments], Result],
) -> Callable[Concatenate[Owner, Arguments], Result]:
    """Wrap a method so that it runs in the precision of its object's `arithmetic`."""

    @wraps(method)
    def scoped(self: Any, *args: Arguments.args, **options: Arguments.kwargs) -> Result:
        with self.arithmetic.scope():
            return method(self, *args, **options)

    return scoped


def midpoint(x: Array) -> Array:
    """Return the float64 nearest to the midpoint of each ball."""
    return _per_ball(x, lambda ball: float(ball.mid()))


def radius(x: Array) -> Array:
    """Return a float64 upper bound of the radius of each ball."""
    return _per_ball(x, lambda ball: float(ball.rad().upper()))


def _per_ball(x: Array, function: Callable[[arb], float]) -> Array:
    from flint import arb

    balls = np.asarray(x, dtype=object)
    if not all(isinstance(ball, arb) for ball in balls.flat):
        raise QueryError(
            f"expected an array of balls, for example from rd.Lagrangian(robot, rd.accuracy.Ball(200)), got {shown(x)}"
        )
    return np.vectorize(function, otypes=[float])(balls)


# NumPy applies these to object arrays by calling the method of the same name on each entry, so one name serves all.
sin, cos, sqrt, tanh = np.sin, np.cos, np.sqrt, np.tanh


def positive_part(x: Array) -> Array:
    """Return max(x, 0); for balls (x + |x|) / 2, because the larger of two overlapping balls is unknown."""
    if type(x) is np.ndarray and x.dtype == object:
        return (x + np.abs(x)) / 2
    return np.maximum(x, 0.0)


def transpose(x: Array) -> Array:
    """Transpose the last two axes."""
    return np.swapaxes(x, -1, -2)


def apply(A: Array, x: Array) -> Array:
    """Return A x for A (..., m, n) and x (..., n)."""
    return (A @ x[..., None])[..., 0]


def symmetric(A: Array) -> Array:
    """Return A (..., m, m), symmetric up to rounding, with the upper triangle copied to the lower, to trace less.

    Arrays of floats are returned unchanged, for speed.
    """
    if A.dtype != object:
        return A
    upper = np.triu(np.ones(A.shape[-2:], dtype=bool))
    return np.where(upper, A, transpose(A))


def rounding(x: Array) -> str:
    """Return the precision of an array for messages: "float64", or "balls of 200 bits"."""
    if x.dtype.kind == "f":
        return x.dtype.name
    from flint import ctx

    return f"balls of {ctx.prec} bits"
