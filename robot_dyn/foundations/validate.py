"""Arguments of public functions, checked where they enter: real numbers, their shape and sign; counts; names; kinds.

Each function returns the argument in one form, or raises the `error` of its caller with one sentence: what must be, and
what was given. Time loops call what is behind these checks.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from math import hypot, inf, isfinite
from numbers import Real
from operator import index
from typing import Any

import numpy as np

from robot_dyn.foundations.errors import (
    NotFiniteError,
    OverflowedError,
    QueryError,
    RobotDynError,
    nearest,
    shorten,
    shown,
)

Shape = tuple[int | str, ...]  # a length with a name, such as "n", may be any but 0
Kind = type[RobotDynError]
LEAST_EXACT = 1e-3  # [rad], [m] or [s]: to which rounding must leave positions and times known
_F8 = np.dtype(np.float64)
_PLAIN = {float, int, np.float64}  # most entries of lists; bool is another class


def real(values: Any) -> np.ndarray:
    """Real numbers as an array of floats or integers; not copied if they are one.

    Raises:
        ValueError: If they are truth values, complex, text, ragged, too large or anything else, or have masked entries;
            its text is what was found.
    """
    if isinstance(values, np.ma.MaskedArray) and np.ma.is_masked(values):
        raise ValueError("masked entries")
    try:
        if isinstance(values, list | tuple) and not set(map(type, values)) <= _PLAIN:
            for each in values:  # NumPy takes True for 1, and ignores masks
                real(each)
        array = np.asarray(values)
        if array.dtype == object and not isinstance(values, np.ndarray):
            array = _of_objects(array)
    except OverflowError:
        raise ValueError("a number too large for a float") from None
    except (MemoryError, KeyboardInterrupt):
        raise
    except Exception:  # a ragged list, or whatever an object's conversion raises
        raise ValueError(shown(values)) from None
    if array.dtype.kind not in "fiu":
        raise ValueError(shown(values))
    return array


def _of_objects(array: np.ndarray) -> np.ndarray:
    """Python numbers that NumPy has no type for, such as 2**64 or a Fraction, as float64."""
    if not all(isinstance(x, Real) and not isinstance(x, bool) for x in array.flat):
        raise TypeError
    return array.astype(float)


def float64(values: Any) -> np.ndarray:
    """Real numbers as float64; ValueError as of `real`. What is too large for it becomes infinite."""
    with np.errstate(over="ignore"):
        return real(values).astype(np.float64, copy=False)


def numbers(
    what: str,
    values: Any,
    *shapes: Shape,
    error: Kind = QueryError,
    above: float | None = None,
    least: float | None = None,
    infinite: bool = False,
) -> np.ndarray:
    """Finite numbers of one of the shapes, copied and frozen.

    Args:
        what: What messages call them.
        values: The argument.
        *shapes: Of which they must have one.
        error: What is raised.
        above: They must be greater than this.
        least: They must not be less than this.
        infinite: Whether ±inf is taken as well.
    """
    lengths = " or ".join(str(shape).replace("'", "") for shape in dict.fromkeys(shapes) if shape)
    one = () in shapes
    try:
        array = np.array(float64(values))
    except ValueError as found:
        kind = f"real numbers{', one or' if one else ''} of shape {lengths}" if lengths else "a real number"
        raise error(f"{what} must be {kind}, got {found}") from None
    if not any(_fits(array.shape, shape) for shape in shapes):
        kind = ("be one number or of shape" if one else "have shape") + f" {lengths}" if lengths else "be one number"
        raise error(f"{what} must {kind}, got {'' if lengths else 'shape '}{array.shape}")
    good = ~np.isnan(array) if infinite else np.isfinite(array)
    if not good.all():
        raise error(f"{what} must be {'a number' if infinite else 'finite'}, got {array[~good][0]}")
    low = (array <= above) if above is not None else (array < (-inf if least is None else least))
    if low.any():
        raise error(f"{what} must {_bound(above, least)}, got {shorten(array[low][0])}")
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
    what: str,
    value: Any,
    *,
    error: Kind = QueryError,
    above: float | None = None,
    least: float | None = None,
    infinite: bool = False,
) -> float:
    """One finite number, as of `numbers`."""
    if value.__class__ is float and isfinite(value) and above is least is None:
        return value
    return float(numbers(what, value, (), error=error, above=above, least=least, infinite=infinite))


def duration(what: str, value: Any, *, zero: bool = False, error: Kind = QueryError) -> float:
    """A time in [s], 1e-12 s or more; or 0, where that has a meaning."""
    seconds = number(what, value, error=error)
    if not (seconds >= 1e-12 or (zero and seconds == 0)):
        least = "1e-12 at least, or 0" if zero else "1e-12 at least"
        raise error(f"{what} must be a positive number of seconds, {least}; got {seconds:g}")
    return seconds


def times(what: str, t: Any) -> np.ndarray:
    """Times in [s], finite or not, of any shape, not copied; QueryError if they are anything else."""
    try:
        return float64(t)
    except ValueError as found:
        raise QueryError(f"{what} must be a time in seconds, got {found}") from None


def rows(what: str, values: Any, *shape: int) -> np.ndarray:
    """Finite numbers of shape (..., *shape), not copied; QueryError if they are anything else."""
    try:
        array = float64(values)
    except ValueError as found:
        raise QueryError(f"{what} must be an array of real numbers, got {found}") from None
    if array.shape[array.ndim - len(shape) :] != shape or array.ndim < len(shape):
        expected = ", ".join(map(str, shape))
        raise QueryError(f"{what} must have shape {shape} or (..., {expected}), got {array.shape}")
    if not np.isfinite(array).all():
        raise QueryError(f"{what} must be finite, got {array[~np.isfinite(array)].flat[0]}")
    return array


def is_state(x: Any, shape: tuple[int] | None) -> bool:
    """Whether x has the form that goes to Pinocchio as it is: float64 of that shape."""
    return x.__class__ is np.ndarray and x.dtype is _F8 and x.shape == shape


def is_moderate(x: np.ndarray, most: float = 1e100) -> bool:
    """Whether ‖x‖ < most: then x holds neither NaN nor inf, nor numbers whose squares overflow."""
    return hypot(*x.tolist()) < most  # faster than any reduction of NumPy at this size, and never warns


def is_plain(x: Any, shape: tuple[int] | None) -> bool:
    """`is_state`, of numbers so moderate that no answer overflows: terms have at most four of them, as q² v²."""
    return x.__class__ is np.ndarray and x.dtype is _F8 and x.shape == shape and hypot(*x.tolist()) < 1e50


def joint_values(what: str, values: Any, joint_names: Sequence[str], arithmetic: Any = None) -> Any:
    """Finite numbers of each joint, shape (..., n), not copied; errors as of `shaped` and `converted`."""
    return converted(what, shaped(what, values, joint_names, arithmetic), joint_names, arithmetic)


def shaped(what: str, values: Any, joint_names: Sequence[str], arithmetic: Any = None) -> Any:
    """Numbers of each joint, finite or not, shape (..., n), not copied; floats and integers keep their type.

    Args:
        what: What messages call them.
        values: The argument.
        joint_names: Of the n joints.
        arithmetic: An `Arithmetic`; float64 unless given.

    Raises:
        QueryError: If they are not real numbers, or have another shape.
    """
    n = len(joint_names)
    try:
        array = real(values) if arithmetic is None or arithmetic.dtype.kind == "f" else arithmetic.asarray(values)
    except (TypeError, ValueError, OverflowError) as found:
        raise QueryError(f"{what} must be an array of {n} real numbers, got {found}") from None
    if array.ndim == 0 or array.shape[-1] != n:
        raise QueryError(f"{what} must have shape ({n},) or (..., {n}), got {array.shape}")
    return array


def converted(what: str, array: Any, joint_names: Sequence[str], arithmetic: Any = None) -> Any:
    """An array of real numbers as numbers of an arithmetic, float64 unless given; not copied if it has them.

    Raises:
        NotFiniteError: If one is not finite; names the joint.
        OverflowedError: If the position q or the time t is rounded so much that it is not known to LEAST_EXACT.
    """
    dtype = _F8 if arithmetic is None else arithmetic.dtype
    numbers = array
    if array.dtype != dtype:  # what is too large for the arithmetic becomes infinite
        numbers = float64(array) if arithmetic is None else arithmetic.asarray(array)
    check_finite(what, numbers, joint_names, arithmetic)
    if numbers is not array and what in ("q", "t"):
        _check_rounding(what, array, numbers, joint_names)
    return numbers


def _check_rounding(what: str, exact: np.ndarray, rounded: np.ndarray, joint_names: Sequence[str]) -> None:
    """Raise OverflowedError where numbers were rounded and are not known to LEAST_EXACT in the arithmetic."""
    far = np.finfo(rounded.dtype).eps * np.abs(rounded) > LEAST_EXACT
    if far.any() and (lost := far & (exact.astype(np.longdouble) != rounded)).any():
        place = tuple(np.argwhere(lost)[0])
        joint = "" if what == "t" else f" of joint {joint_names[place[-1]]!r}"
        raise OverflowedError(
            f"{what}{joint} is so large that {rounded.dtype} does not resolve {LEAST_EXACT:g} rad, m or s, got"
            f" {exact[place]}; take a smaller one, or numbers with more digits"
        )


def check_finite(what: str, array: Any, joint_names: Sequence[str], arithmetic: Any = None) -> None:
    """Raise NotFiniteError, which names the joint, unless every number of an argument (..., n) is finite."""
    finite = np.isfinite(array) if arithmetic is None else arithmetic.finite(array)
    if not finite.all():
        place = tuple(np.argwhere(~finite)[0])
        joint = "" if what == "t" else f" for joint {joint_names[place[-1]]!r}"
        raise NotFiniteError(f"{what} must be finite, got {array[place]}{joint}")


def one_state(what: str, values: Any, joint_names: Sequence[str]) -> np.ndarray:
    """Finite numbers of each joint, shape (n,), copied and frozen; QueryError if they are anything else."""
    array = np.array(joint_values(what, values, joint_names))
    if array.ndim != 1:
        raise QueryError(f"{what} must be one state of shape ({len(joint_names)},), got {array.shape}")
    array.setflags(write=False)
    return array


def check_batches(**arrays: Any) -> tuple[int, ...]:
    """The common batch shape of arguments (..., n); QueryError if they do not broadcast."""
    try:
        return np.broadcast_shapes(*(array.shape[:-1] for array in arrays.values()))
    except ValueError:
        shapes = ", ".join(f"{name} {array.shape}" for name, array in arrays.items())
        raise QueryError(f"batch axes do not match: {shapes}") from None


def integer(what: str, value: Any, *, least: int = 0, most: int | None = None, error: Kind = QueryError) -> int:
    """A whole number from `least` to `most`."""
    try:
        whole = None if isinstance(value, bool) else index(value)
    except TypeError:
        whole = None
    if whole is None or whole < least or (most is not None and whole > most):
        limits = f"{least} or more" if most is None else f"from {least} to {most}"
        raise error(f"{what} must be a whole number, {limits}, got {shown(value)}")
    return whole


def truth(what: str, value: Any, *, error: Kind = QueryError) -> bool:
    """True or False."""
    if not isinstance(value, bool | np.bool_):
        raise error(f"{what} must be True or False, got {shown(value)}")
    return bool(value)


def choice(what: str, value: Any, known: Collection[str], *, error: Kind = QueryError) -> str:
    """One of the known names."""
    if not isinstance(value, str) or value not in known:
        advice = nearest(value if isinstance(value, str) else "", known)
        raise error(f"no {what} {shown(value)}; {advice}")
    return value


def function(what: str, value: Any, arguments: str, *, error: Kind = QueryError) -> Any:
    """A function, or None; `arguments` names those that it takes."""
    if not (value is None or callable(value)):
        raise error(f"{what} must be a function of {arguments}, or None, got {shown(value)}")
    return value


def instance(what: str, value: Any, kind: Any, remedy: str, *, error: Kind = QueryError) -> Any:
    """An object of a kind; the remedy says how to get one."""
    if not isinstance(value, kind):
        raise error(f"{what}: {remedy}, got {shown(value)}")
    return value
