"""Desired motions as piecewise polynomials: q(t) = Σⱼ cᵢⱼ (t − tᵢ)ʲ on tᵢ ≤ t ≤ tᵢ₊₁.

Every reference consists of such tables, so one evaluator serves all of them, traced or not.
Each piece is the Hermite polynomial of the values and derivatives at its two ends. [Siciliano et al. 2009, ch. 4]
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from math import factorial, isfinite, perm
from typing import TYPE_CHECKING

import numpy as np

from robot_dyn.foundations import validate
from robot_dyn.foundations.arithmetic import Array, Scalar
from robot_dyn.foundations.errors import ControlError, QueryError, shown
from robot_dyn.foundations.validate import choice, duration, times
from robot_dyn.foundations.values import ArrayField, Value

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from robot_dyn.foundations.validate import JointValues


_DERIVATIVES = {"cubic": 1, "quintic": 2}  # number of prescribed derivatives at each end, by kind of spline
_MAX_POINTS = 2000  # steps of a run end at each point; use `Samples` for measurements
_MISSED = 1e-6  # relative to the largest sample: far above rounding, far below the error of a failed spline
_FACTORIALS = np.array([factorial(j) for j in range(6)], dtype=float)
# The inverse of [j!/(j − r)!] with r < m ≤ j < 2m: maps the remainder of the low half at s = 1 to the high half.
_UPPER = {
    2: np.array([[3, -1], [-2, 1.0]]),
    3: np.array([[10, -4, 0.5], [-15, 7, -1], [6, -3, 0.5]]),
}
number = partial(validate.number, error=ControlError)
numbers = partial(validate.numbers, error=ControlError)


class Reference(Value, ABC):
    """A desired motion: a function of time that consists of piecewise polynomials."""

    @property
    @abstractmethod
    def knots(self) -> np.ndarray:
        """Times in [s] at which the polynomial changes."""

    @property
    def polynomials(self) -> dict[str, PiecewisePolynomial]:
        """The piecewise polynomials by attribute; by "" if the reference is one itself."""
        return {name: value for name, value in vars(self).items() if isinstance(value, PiecewisePolynomial)}


@dataclass(frozen=True, eq=False)
class PiecewisePolynomial(Reference):
    """A motion q(t) with its velocity and acceleration; it rests before its first and after its last break.

    Attributes:
        breaks: Times tᵢ, increasing, shape (k + 1,), in [s].
        coefficients: cᵢⱼ of (t − tᵢ)ʲ, shape (k, d + 1, n), in [rad/sʲ] or [m/sʲ].
    """

    breaks: ArrayField
    coefficients: ArrayField

    def __post_init__(self) -> None:
        table = numbers("coefficients", self.coefficients, ("k", "d + 1", "n"))
        object.__setattr__(self, "coefficients", table)
        object.__setattr__(self, "breaks", increasing("breaks", self.breaks, len(table) + 1))

    def __repr__(self) -> str:
        pieces, terms, n = self.coefficients.shape
        kind = f"{pieces} polynomial{'s' * (pieces != 1)} of degree {terms - 1}"
        return f"<{type(self).__name__}: {n} joint{'s' * (n != 1)}, {kind}, {self.start_s:g} to {self.end_s:g} s>"

    @property
    def n(self) -> int:
        """Number of joints or coordinates."""
        return self.coefficients.shape[-1]

    @property
    def knots(self) -> np.ndarray:
        """Times in [s] at which the polynomial changes: the breaks, or none for a motion at rest."""
        return self.breaks[:0] if self.coefficients.shape[:2] == (1, 1) else self.breaks

    @property
    def polynomials(self) -> dict[str, PiecewisePolynomial]:
        return {"": self}

    @property
    def start_s(self) -> float:
        """Time of the first break, in [s]."""
        return float(self.breaks[0])

    @property
    def end_s(self) -> float:
        """Time of the last break, in [s]."""
        return float(self.breaks[-1])

    def at(self, t: Scalar) -> tuple[Array, Array, Array]:
        """Evaluate position, velocity and acceleration at t by Horner's rule.

        At a break the piece to its right is evaluated; at the last break, the piece to its left. The search for the
        piece is the only branch on a value: traced code must look it up in `breaks`.

        Args:
            t: Time, shape () or (...), in [s].

        Returns:
            (q, v, a), all of shape (n,) or (..., n).
        """
        if not (isinstance(t, float) and isfinite(t)):
            t = times("t", t)
            if np.isnan(t).any():
                raise QueryError("t must be a time in seconds, got nan")
        t, breaks = np.asarray(t), self.breaks
        inside = np.clip(t, breaks[0], breaks[-1])
        piece = np.searchsorted(breaks[1:-1], inside, side="right")
        s, c = (inside - breaks[piece])[..., None], self.coefficients[piece]
        q, v, a = polynomial(c, s)
        moves = ((breaks[0] <= t) & (t <= breaks[-1]))[..., None]
        return q, np.where(moves, v, 0), np.where(moves, a, 0)


def polynomial(c: Array, s: Array) -> tuple[Array, Array, Array]:
    """Evaluate Σⱼ cⱼ sʲ and two derivatives, (..., n), by Horner's rule, for c (..., d + 1, n) and s (..., 1)."""
    q = c[..., -1, :] + 0 * s  # a new array even if the degree is 0
    v = a = 0 * q
    for j in reversed(range(c.shape[-2] - 1)):
        a = a * s + v
        v = v * s + q
        q = q * s + c[..., j, :]
    return q, v, 2 * a


def hold(q: JointValues, *, joint_names: Sequence[str] | None = None) -> PiecewisePolynomial:
    """Return a reference at rest at q.

    Args:
        q: Position, shape (n,), in [rad] or [m]; or by joint name, 0 for omitted joints.
        joint_names: Joints in the order of q, such as `arm.joint_names`; required for values by joint name.

    Raises:
        ControlError: If q has another shape, or names an unknown joint.
    """
    return PiecewisePolynomial([0.0, 1.0], _joint_numbers("q", q, joint_names, ("n",))[None, None])


@np.errstate(all="ignore")  # the check for finite values catches overflow
def quintic(
    q0: JointValues,
    q1: JointValues,
    duration_s: float,
    *,
    start_s: float = 0.0,
    v0: JointValues = 0.0,
    v1: JointValues = 0.0,
    a0: JointValues = 0.0,
    a1: JointValues = 0.0,
    joint_names: Sequence[str] | None = None,
) -> PiecewisePolynomial:
    """Return the quintic from q0 to q1.

    From rest to rest it is the minimum-jerk motion q0 + (q1 − q0)(10 s³ − 15 s⁴ + 6 s⁵), whose velocity peaks halfway,
    at 15/8 · (q1 − q0)/duration_s.

    Args:
        q0: Initial position, shape (n,), in [rad] or [m]; like all values of joints, also by joint name, 0 for omitted
            joints.
        q1: Final position, shape (n,).
        duration_s: Duration, in [s], positive.
        start_s: Start time, in [s].
        v0: Velocity at the start, a scalar or (n,), in [rad/s] or [m/s].
        v1: Velocity at the end, a scalar or (n,), in [rad/s] or [m/s].
        a0: Acceleration at the start, a scalar or (n,), in [rad/s²] or [m/s²].
        a1: Acceleration at the end, a scalar or (n,), in [rad/s²] or [m/s²].
        joint_names: Joints in the order of q, such as `arm.joint_names`; required for values by joint name.

    Raises:
        ControlError: If a value is not finite, has the wrong shape, or names an unknown joint.

    Source: Siciliano et al. 2009, sec. 4.2.1; Flash and Hogan, The coordination of arm movements, 1985.
    """
    T, begin = duration("duration_s", duration_s, error=ControlError), number("start_s", start_s)
    first = _joint_numbers("q0", q0, joint_names, ("n",))
    last = _joint_numbers("q1", q1, joint_names, first.shape)
    rates = {"v0": v0, "a0": a0, "v1": v1, "a1": a1}
    v, a, v_end, a_end = (_joint_numbers(name, x, joint_names, (), first.shape) for name, x in rates.items())
    ends = np.stack(np.broadcast_arrays(first, v, a, last, v_end, a_end))
    return PiecewisePolynomial([begin, begin + T], hermite(np.array([T]), ends[None]))


@np.errstate(all="ignore")  # the check for finite values catches overflow
def via_points(
    times_s: ArrayLike, points: JointValues, *, kind: str = "quintic", v0: JointValues = 0.0, v1: JointValues = 0.0,
    joint_names: Sequence[str] | None = None,
) -> PiecewisePolynomial:  # fmt: skip
    """Return the spline through points at prescribed times, from rest to rest unless end velocities are passed.

    "quintic" has four continuous derivatives and starts and ends with zero acceleration; "cubic" has two, and its
    acceleration jumps at both ends.

    Args:
        times_s: Increasing times, shape (k + 1,), in [s].
        points: Shape (k + 1, n), in [rad] or [m]; like velocities, also by joint name, 0 for omitted joints: a list
            of such points, or (k + 1,) by joint.
        kind: "quintic" or "cubic".
        v0: Velocity at the start, a scalar or (n,), in [rad/s] or [m/s].
        v1: Velocity at the end, a scalar or (n,), in [rad/s] or [m/s].
        joint_names: Joints in the order of q, such as `arm.joint_names`; required for values by joint name.

    Raises:
        ControlError: If times do not increase, shapes do not match, the kind is unknown, or there are over 2000 points.

    Source: de Boor, A Practical Guide to Splines, 2001; Siciliano et al. 2009, sec. 4.2.2.
    """
    kind = choice("kind of spline", kind, _DERIVATIVES, error=ControlError)
    rows = _joint_numbers("points", points, joint_names, ("k + 1", "n"))
    if len(rows) < 2:
        raise ControlError(f"points: at least 2 are needed, got {len(rows)}; use hold(q) to rest at one point")
    if len(rows) > _MAX_POINTS:
        raise ControlError(f"points: at most {_MAX_POINTS} are allowed, got {len(rows)}; use rd.control.Samples")
    t = increasing("times_s", times_s, len(rows))
    ends = np.zeros((2, _DERIVATIVES[kind], rows.shape[1]))
    for end, name, v in zip(ends, ("v0", "v1"), (v0, v1), strict=True):
        end[0] = _joint_numbers(name, v, joint_names, (), rows.shape[1:])
    return PiecewisePolynomial(*spline(t, rows, ends))


def _joint_numbers(
    label: str, values: object, joint_names: Sequence[str] | None, *shapes: validate.Shape
) -> np.ndarray:
    """Return finite numbers of one of the shapes, from an array or by joint name."""
    return numbers(label, validate.in_order(label, values, joint_names, error=ControlError), *shapes)


def hermite(h: np.ndarray, ends: np.ndarray) -> np.ndarray:
    """Compute polynomials of degree 2m − 1 on [0, h] from the value and m − 1 derivatives at both ends.

    Args:
        h: Lengths of the pieces, shape (k,), in [s].
        ends: q, q̇, … at the left end, then at the right end, shape (k, 2m, n).

    Returns:
        Coefficients by ascending power, shape (k, 2m, n).
    """
    m = ends.shape[-2] // 2
    powers = h[:, None, None] ** np.arange(2 * m)[:, None]
    left, right = ends[:, :m] * powers[:, :m], ends[:, m:] * powers[:, :m]  # derivatives in s = t/h
    low = left / _FACTORIALS[:m, None]
    rest = right - np.array([[perm(j, r) for j in range(m)] for r in range(m)], dtype=float) @ low
    return np.concatenate([low, _UPPER[m] @ rest], axis=1) / powers


@np.errstate(all="ignore")  # overflow raises an error
def spline(t: np.ndarray, q: np.ndarray, ends: np.ndarray | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Return breaks and coefficients of the spline through m samples.

    With `ends`, the first k derivatives at both ends, (2, k, n), the degree is 2 k + 1, and 2 samples suffice. Without,
    the ends are not-a-knot and the degree is 5 or, if m < 6, m − 1.

    Raises:
        ControlError: If the spline does not pass through the samples in floating point.
    """
    from scipy.interpolate import make_interp_spline

    unit = (t[-1] - t[0]) / (len(t) - 1)  # time unit: derivatives of similar size keep the solve well conditioned
    s, degree, at_ends = (t - t[0]) / unit, min(5, len(t) - 1), None
    if ends is not None:
        degree = 2 * ends.shape[1] + 1
        at_ends = tuple([(r, unit**r * x) for r, x in enumerate(derivatives, 1)] for derivatives in ends)
    try:
        curve = make_interp_spline(s, q, k=degree, bc_type=at_ends)
        inside = np.isin(s, curve.t)  # not-a-knot omits two samples next to each end, for an even degree one
        inside[[0, -1]] = True
        starts = s[inside][:-1]
        terms = [curve.derivative(r)(starts) / factorial(r) if r else curve(starts) for r in range(degree + 1)]
        coefficients = np.stack(terms, axis=1) / unit ** np.arange(degree + 1)[:, None]
        if ends is not None:  # without rounding, so that a reference from rest is at rest
            coefficients[0, 1 : degree // 2 + 1] = ends[0] / _FACTORIALS[1 : degree // 2 + 1, None]
        missed = float(np.abs(curve(s) - q).max())
    except (ValueError, np.linalg.LinAlgError):  # steps or samples overflow, or vanish next to others
        raise _without_spline(t, q, degree) from None
    if not (np.isfinite(coefficients).all() and missed <= _MISSED * float(np.abs(q).max())):
        raise _without_spline(t, q, degree)
    return t[inside], coefficients


def _without_spline(t: np.ndarray, q: np.ndarray, degree: int) -> ControlError:
    """Return the error for samples that no spline passes through in floating point."""
    steps = np.diff(t)
    return ControlError(
        f"no spline of degree {degree} passes through the samples in floating point: times are {steps.min():.3g} to"
        f" {steps.max():.3g} s apart, and positions up to {np.abs(q).max():.3g}; remove samples that nearly coincide,"
        " and check the units"
    )


def increasing(name: str, values: ArrayLike, count: int) -> np.ndarray:
    """Return increasing times as a read-only array, (count,); raise a ControlError if they do not increase."""
    times = numbers(name, values, (count,))
    if not (np.diff(times) > 0).all():
        raise ControlError(f"{name} must increase, got {shown(values)}")
    return times
