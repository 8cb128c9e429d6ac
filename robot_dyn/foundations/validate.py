"""Checks of arguments of public functions: real numbers, shape and sign; counts; names; types.

A check returns the argument in one form, or raises the caller's `error` with one sentence: the requirement and the
value. Time loops skip these checks.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from math import hypot, inf, isfinite
from numbers import Real
from operator import index
from types import UnionType
from typing import Any, Protocol, SupportsIndex, TypeAlias, TypeGuard, TypeVar, overload

import numpy as np
from numpy.typing import ArrayLike

from robot_dyn.foundations.errors import (
    MissingTimeError,
    NotFiniteError,
    OverflowedError,
    QueryError,
    RobotDynError,
    nearest,
    shorten,
    shown,
)

Shape = tuple[int | str, ...]  # a named length, such as "n", is any length except 0
Kind = type[RobotDynError]
JointValues: TypeAlias = ArrayLike | Mapping[str, ArrayLike] | Sequence[Mapping[str, ArrayLike] | ArrayLike]
"""Numbers of each joint, (..., n); or by joint name, (...), with 0 for omitted joints; or a list of such rows."""
Instance = TypeVar("Instance")
Function = TypeVar("Function")
MAX_ROUNDING_ERROR = 1e-3  # [rad], [m] or [s]: largest rounding error of positions and times
_F8 = np.dtype(np.float64)
_PLAIN = {float, int, np.float64}  # usual types of entries in lists; bool is excluded


class ArithmeticLike(Protocol):
    """A kind of number to which arguments are converted, such as an `Arithmetic`."""

    @property
    def dtype(self) -> np.dtype:
        """Type of the entries of arrays."""
        ...

    def asarray(self, values: object) -> np.ndarray:
        """Return an array of this kind of number; raise TypeError or ValueError if the values are not numbers."""
        ...

    def finite(self, x: np.ndarray) -> np.ndarray:
        """Return True for entries that are finite numbers."""
        ...


def real(values: object) -> np.ndarray:
    """Return real numbers as an array of floats or integers, not copied if they are one.

    Raises:
        ValueError: If they are truth values, complex, text, ragged, too large, masked or anything else; its text
            describes the value.
    """
    if isinstance(values, np.ma.MaskedArray) and np.ma.is_masked(values):
        raise ValueError("masked entries")
    try:
        if isinstance(values, list | tuple) and not set(map(type, values)) <= _PLAIN:
            for value in values:  # NumPy converts True to 1 and ignores masks
                real(value)
        array = np.asarray(values)
        if array.dtype == object and not isinstance(values, np.ndarray):
            array = _of_objects(array)
    except OverflowError:
        raise ValueError("a number too large for a float") from None
    except (MemoryError, KeyboardInterrupt, MissingTimeError):
        raise
    except Exception:  # a ragged list, or any error in the conversion of an object
        raise ValueError(shown(values)) from None
    if array.dtype.kind not in "fiu":
        raise ValueError(shown(values))
    return array


def _of_objects(array: np.ndarray) -> np.ndarray:
    """Return Python numbers without a NumPy type, such as 2**64 or a Fraction, as float64."""
    if not all(isinstance(x, Real) and not isinstance(x, bool) for x in array.flat):
        raise TypeError
    return array.astype(float)


def float64(values: object) -> np.ndarray:
    """Return real numbers as float64; numbers that are too large become infinite. Raise ValueError like `real`."""
    with np.errstate(over="ignore"):
        return real(values).astype(np.float64, copy=False)


def numbers(
    label: str,
    values: object,
    *shapes: Shape,
    error: Kind = QueryError,
    above: float | None = None,
    least: float | None = None,
    infinite: bool = False,
) -> np.ndarray:
    """Return finite numbers of one of the shapes as a read-only copy.

    Args:
        label: Name of the argument in messages.
        values: The argument.
        *shapes: Allowed shapes.
        error: Type of the error.
        above: Exclusive lower bound.
        least: Inclusive lower bound.
        infinite: True if ±inf is allowed.
    """
    lengths = " or ".join(str(shape).replace("'", "") for shape in dict.fromkeys(shapes) if shape)
    one = () in shapes
    try:
        array = np.array(float64(values))
    except ValueError as fault:
        kind = f"real numbers{', one or' if one else ''} of shape {lengths}" if lengths else "a real number"
        raise error(f"{label} must be {kind}, got {fault}") from None
    if not any(_fits(array.shape, shape) for shape in shapes):
        kind = ("be one number or of shape" if one else "have shape") + f" {lengths}" if lengths else "be one number"
        raise error(f"{label} must {kind}, got {'' if lengths else 'shape '}{array.shape}")
    good = ~np.isnan(array) if infinite else np.isfinite(array)
    if not good.all():
        raise error(f"{label} must be {'a number' if infinite else 'finite'}, got {array[~good][0]}")
    low = (array <= above) if above is not None else (array < (-inf if least is None else least))
    if low.any():
        raise error(f"{label} must {_bound(above, least)}, got {shorten(array[low][0])}")
    array.setflags(write=False)
    return array


def _bound(above: float | None, least: float | None) -> str:
    if above is not None:
        return "be positive" if above == 0 else f"be greater than {above:g}"
    return "not be negative" if least == 0 else f"be at least {least:g}"


def _fits(shape: tuple[int, ...], expected: Shape) -> bool:
    if len(shape) != len(expected):
        return False
    return all(a > 0 if isinstance(b, str) else a == b for a, b in zip(shape, expected, strict=True))


def number(
    label: str,
    value: object,
    *,
    error: Kind = QueryError,
    above: float | None = None,
    least: float | None = None,
    infinite: bool = False,
) -> float:
    """Return one finite number; for the arguments, see `numbers`."""
    if type(value) is float and isfinite(value) and above is least is None:
        return value
    return float(numbers(label, value, (), error=error, above=above, least=least, infinite=infinite))


def duration(label: str, value: object, *, zero: bool = False, error: Kind = QueryError) -> float:
    """Return a time in [s], at least 1e-12 s, or 0 if `zero`."""
    seconds = number(label, value, error=error)
    if not (seconds >= 1e-12 or (zero and seconds == 0)):
        least = "at least 1e-12, or 0" if zero else "at least 1e-12"
        raise error(f"{label} must be a positive number of seconds, {least}; got {seconds:g}")
    return seconds


def times(label: str, t: object) -> np.ndarray:
    """Return times in [s], finite or not, of any shape, not copied; raise a QueryError for other values."""
    try:
        return float64(t)
    except ValueError as fault:
        raise QueryError(f"{label} must be a time in seconds, got {fault}") from None


def rows(label: str, values: object, *shape: int) -> np.ndarray:
    """Return finite numbers of shape (..., *shape), not copied; raise a QueryError for other values."""
    try:
        array = float64(values)
    except ValueError as fault:
        raise QueryError(f"{label} must be an array of real numbers, got {fault}") from None
    if array.shape[array.ndim - len(shape) :] != shape or array.ndim < len(shape):
        expected = ", ".join(map(str, shape))
        raise QueryError(f"{label} must have shape {shape} or (..., {expected}), got {array.shape}")
    if not np.isfinite(array).all():
        raise QueryError(f"{label} must be finite, got {array[~np.isfinite(array)].flat[0]}")
    return array


def is_state(x: object, shape: tuple[int] | None) -> TypeGuard[np.ndarray]:
    """Return True if Pinocchio can take x unchanged: float64 of that shape."""
    return type(x) is np.ndarray and x.dtype is _F8 and x.shape == shape


def is_moderate(x: np.ndarray, most: float = 1e100) -> bool:
    """Return True if ‖x‖ < most: x then contains neither NaN nor inf, nor numbers whose squares overflow."""
    return hypot(*x.tolist()) < most  # faster than any reduction of NumPy at this size, and never warns


def is_plain(x: object, shape: tuple[int] | None) -> TypeGuard[np.ndarray]:
    """Return True for an `is_state` of moderate numbers: no result overflows, as terms have at most four factors."""
    return type(x) is np.ndarray and x.dtype is _F8 and x.shape == shape and hypot(*x.tolist()) < 1e50


def joint_values(
    label: str, values: object, joint_names: Sequence[str], arithmetic: ArithmeticLike | None = None
) -> np.ndarray:
    """Return finite numbers of each joint, shape (..., n), not copied; for errors, see `shaped` and `converted`."""
    return converted(label, shaped(label, values, joint_names, arithmetic), joint_names, arithmetic)


def shaped(
    label: str, values: object, joint_names: Sequence[str], arithmetic: ArithmeticLike | None = None
) -> np.ndarray:
    """Return numbers of each joint, finite or not, shape (..., n), not copied; floats and integers keep their type.

    Args:
        label: Name of the argument in messages.
        values: The argument: an array, or numbers by joint name, of shape (…), with 0 for omitted joints.
        joint_names: Names of the n joints.
        arithmetic: An `Arithmetic`; float64 by default.

    Raises:
        QueryError: If they are not real numbers, have another shape, or a joint is unknown.
    """
    n = len(joint_names)
    try:
        array = real(values) if arithmetic is None or arithmetic.dtype.kind == "f" else arithmetic.asarray(values)
    except (TypeError, ValueError, OverflowError) as fault:
        if (array := in_order(label, values, joint_names)) is not values:
            return shaped(label, array, joint_names, arithmetic)
        raise QueryError(f"{label} must be an array of {n} real numbers, got {fault}") from None
    if array.ndim == 0 or array.shape[-1] != n:
        raise QueryError(f"{label} must have shape ({n},) or (..., {n}), got {array.shape}")
    return array


def in_order(
    label: str, values: object, joint_names: Sequence[str] | None, *, fill_value: float = 0.0, error: Kind = QueryError
) -> Any:
    """Return numbers by joint name, or a list with such rows, as an array, (..., n); other values unchanged.

    Args:
        label: Name of the argument in messages.
        values: The argument.
        joint_names: Names of the n joints, in the order of q; None if unknown.
        fill_value: Number for omitted joints.
        error: Type of the error.
    """
    rows = values if isinstance(values, list | tuple) else ()
    if not isinstance(values, Mapping) and not any(isinstance(row, Mapping) for row in rows):
        return values
    if joint_names is None:
        raise error(f"{label}: numbers by joint name need an order; give joint_names=arm.joint_names")
    if rows:
        arrays = {
            i: in_order(f"{label}[{i}]", row, joint_names, fill_value=fill_value, error=error)
            if isinstance(row, Mapping)
            else numbers(f"{label}[{i}]", row, (len(joint_names),), error=error)
            for i, row in enumerate(rows)
        }
        return np.stack(_one_shape(label, arrays, error))
    assert isinstance(values, Mapping)
    if not values:
        raise error(f"{label}: no joint is named; give numbers by joint, for example {{{joint_names[0]!r}: 0.1}}")
    for name in values:
        if name not in joint_names:
            raise error(f"{label}: no joint {shown(name)}; {nearest(str(name), joint_names)}")
    return np.stack(_one_shape(label, {name: values.get(name, fill_value) for name in joint_names}, error), axis=-1)


def _one_shape(label: str, arrays: Mapping[Any, object], error: Kind) -> list[np.ndarray]:
    try:
        return [*np.broadcast_arrays(*map(np.asarray, arrays.values()))]
    except ValueError:
        shapes = {name: np.shape(np.asarray(x)) for name, x in arrays.items()}
        raise error(f"{label}: numbers of all joints must have one shape, got {shapes}") from None


def converted(
    label: str, array: np.ndarray, joint_names: Sequence[str], arithmetic: ArithmeticLike | None = None
) -> np.ndarray:
    """Convert an array of real numbers to an arithmetic, by default float64; not copied if it has that type.

    Raises:
        NotFiniteError: If a number is not finite; the message names the joint.
        OverflowedError: If rounding changes the position q or the time t by more than MAX_ROUNDING_ERROR.
    """
    dtype = _F8 if arithmetic is None else arithmetic.dtype
    numbers = array
    if array.dtype != dtype:  # numbers too large for the arithmetic become infinite
        numbers = float64(array) if arithmetic is None else arithmetic.asarray(array)
    check_finite(label, numbers, joint_names, arithmetic)
    if numbers is not array and label in ("q", "t"):
        _check_rounding(label, array, numbers, joint_names)
    return numbers


def _check_rounding(label: str, exact: np.ndarray, rounded: np.ndarray, joint_names: Sequence[str]) -> None:
    """Raise an OverflowedError if numbers were rounded and the arithmetic does not resolve MAX_ROUNDING_ERROR there."""
    far = np.finfo(rounded.dtype).eps * np.abs(rounded) > MAX_ROUNDING_ERROR
    if far.any() and (lost := far & (exact.astype(np.longdouble) != rounded)).any():
        place = tuple(np.argwhere(lost)[0])
        joint = "" if label == "t" else f" of joint {joint_names[place[-1]]!r}"
        raise OverflowedError(
            f"{label}{joint} is too large for {rounded.dtype} to resolve {MAX_ROUNDING_ERROR:g} rad, m or s, got"
            f" {exact[place]}; use a smaller value, or a dtype with more digits"
        )


def check_finite(
    label: str, array: np.ndarray, joint_names: Sequence[str], arithmetic: ArithmeticLike | None = None
) -> None:
    """Raise a NotFiniteError that names the joint unless all numbers of an argument, (..., n), are finite."""
    finite = np.isfinite(array) if arithmetic is None else arithmetic.finite(array)
    if not finite.all():
        place = tuple(np.argwhere(~finite)[0])
        joint = "" if label == "t" else f" for joint {joint_names[place[-1]]!r}"
        raise NotFiniteError(f"{label} must be finite, got {array[place]}{joint}")


def one_state(label: str, values: object, joint_names: Sequence[str]) -> np.ndarray:
    """Return finite numbers of each joint, shape (n,), as a read-only copy; raise a QueryError for other values."""
    array = np.array(joint_values(label, values, joint_names))
    if array.ndim != 1:
        raise QueryError(f"{label} must be one state of shape ({len(joint_names)},), got {array.shape}")
    array.setflags(write=False)
    return array


def check_batches(**arrays: np.ndarray) -> tuple[int, ...]:
    """Return the common batch shape of arguments (..., n); raise a QueryError if they do not broadcast."""
    try:
        return np.broadcast_shapes(*(array.shape[:-1] for array in arrays.values()))
    except ValueError:
        shapes = ", ".join(f"{name} {array.shape}" for name, array in arrays.items())
        raise QueryError(f"batch axes do not match: {shapes}") from None


def integer(
    label: str, value: SupportsIndex, *, least: int = 0, most: int | None = None, error: Kind = QueryError
) -> int:
    """Return an integer from `least` to `most`."""
    try:
        whole = None if isinstance(value, bool) else index(value)
    except TypeError:
        whole = None
    if whole is None or whole < least or (most is not None and whole > most):
        limits = f"{least} or more" if most is None else f"from {least} to {most}"
        raise error(f"{label} must be a whole number, {limits}, got {shown(value)}")
    return whole


def truth(label: str, value: object, *, error: Kind = QueryError) -> bool:
    """Return a truth value."""
    if not isinstance(value, bool | np.bool_):
        raise error(f"{label} must be True or False, got {shown(value)}")
    return bool(value)


def choice(label: str, value: object, names: Collection[str], *, error: Kind = QueryError) -> str:
    """Return a name if it is one of the valid ones."""
    if not isinstance(value, str) or value not in names:
        advice = nearest(value if isinstance(value, str) else "", names)
        raise error(f"no {label} {shown(value)}; {advice}")
    return value


def function(label: str, value: Function, arguments: str, *, error: Kind = QueryError) -> Function:
    """Return a function or None; `arguments` lists its arguments for the message."""
    if not (value is None or callable(value)):
        raise error(f"{label} must be a function of {arguments}, or None, got {shown(value)}")
    return value


@overload
def instance(label: str, value: object, kind: type[Instance], remedy: str, *, error: Kind = ...) -> Instance: ...
@overload
def instance(label: str, value: object, kind: UnionType, remedy: str, *, error: Kind = ...) -> object: ...
def instance(label: str, value: object, kind: type | UnionType, remedy: str, *, error: Kind = QueryError) -> object:
    """Return an object of a type; the remedy in the message describes how to get one."""
    if not isinstance(value, kind):
        raise error(f"{label}: got {shown(value)}; {remedy}")
    return value
