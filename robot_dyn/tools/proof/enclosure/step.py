"""One proven step: polynomial, defect, tube and the propagated error set; shortened until all bounds hold."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import final

import numpy as np
from flint import arb

from robot_dyn.tools.proof.enclosure.balls import (
    Ball,
    Inverse,
    NotProvenError,
    between,
    exact,
    finer,
    horner,
    largest,
    upper,
)
from robot_dyn.tools.proof.enclosure.linearised import jacobian
from robot_dyn.tools.proof.enclosure.lohner import ErrorSet, carried, fundamental
from robot_dyn.tools.proof.enclosure.polynomial import Polynomial, defect, taylor
from robot_dyn.tools.proof.enclosure.tube import Tube, logarithmic_norm, tube
from robot_dyn.tools.proof.tape import Tape

_GRID = 2**40  # steps end at multiples of 1/grid, so that times are floats
_LONGEST_S = 1.0
_OFF, _SHARE = 30.0, 1e-4  # largest h |d|, relative to the tolerance and to the errors at the start
_SHORTER, _TRIES = Fraction(3, 4), 24
_LONGER = 1.2  # relative to the previous step
_GROWTH, _LEAST_GROWTH = 0.6, 0.1  # h L to try first, and its minimum
_LARGER = 1.25  # σ relative to the spectral radius
_LIGHTEST = 1e-12  # weight


@final
@dataclass(frozen=True)
class Effort:
    """Settings of the steps of a proof.

    Attributes:
        order: Order of the accelerations of a polynomial.
        tolerance: Size of the last term of a step's velocity.
    """

    order: int
    tolerance: float


def effort(bits: int) -> Effort:
    """Return order and tolerance for a precision: 16 and 1e-16 at 53 bits, 22 and 1e-22 at 100."""
    more = 6 * (bits - 53) / 47
    return Effort(round(16 + more), max(10.0 ** -(16 + more), 1e-300))


@final
@dataclass(frozen=True)
class State:
    """Start of a step: the centre of a set, and the set around it.

    Attributes:
        t: Time in [s].
        q, v: Centre, exact.
        error: Set of deviations of the true state from the centre.
    """

    t: Fraction
    q: tuple[Ball, ...]
    v: tuple[Ball, ...]
    error: ErrorSet


@final
@dataclass(frozen=True)
class Step:
    """A proven step.

    Attributes:
        start: State at the start.
        h: Length, in [s].
        p: Polynomial.
        tube: Tube around the polynomial.
        end: State at the end.
    """

    start: State
    h: Fraction
    p: Polynomial
    tube: Tube
    end: State


def proven_step(tape: Tape, start: State, end: Fraction, how: Effort, before: Fraction | None = None) -> Step:
    """Return the longest step up to `end` that can be proven, at most slightly longer than the step `before`.

    Raises:
        NotProvenError: If there is none; the message gives the reason.
    """
    time = exact(start.t)
    try:
        inverse = Inverse.from_matrix(tape.mass(start.q))
        p = taylor(tape, time, start.q, start.v, inverse, how.order)
        longest = _longest(p, how, before)
        weights, growth, rate = _weights(tape, time, p, inverse, longest, start.error.bounds, how.tolerance)
        h = _to_grid(start.t, end, Fraction(min(longest, _GROWTH / growth)))
    except ValueError:
        raise NotProvenError("M may be singular") from None
    for attempt in range(_TRIES):
        try:
            return _step(tape, time, start, p, inverse, weights=weights, rate=rate, step=h, how=how)
        except NotProvenError as error:
            why = error
        except ValueError:  # the leading coefficient of a divisor may be 0
            why = NotProvenError("a divisor may be 0 within a step")
        h = _to_grid(start.t, end, h * _SHORTER)
        if attempt == _TRIES - 1:
            raise why
    raise AssertionError


def _step(
    tape: Tape, time: Ball, start: State, p: Polynomial, inverse: Inverse, weights: Sequence[Ball], rate: float,
    step: Fraction, how: Effort,
) -> Step:  # fmt: skip
    h = exact(step)
    T = between(0 * h, h)
    everywhere = p.about(T)
    d = defect(tape, time, p, everywhere, inverse, h, T, how.order)
    errors = start.error.bounds
    most = _OFF * how.tolerance + _SHARE * largest(errors) + 2 * h * largest(d.rounding)
    if not h * largest(d.d) < most:
        raise NotProvenError("a step is too long for its polynomial")
    around = tube(tape, time, p, inverse, h, d, start=errors, weights=weights, rate=rate)
    Y, delta = fundamental(tape, time, p, everywhere, inverse, h, T, around)
    with finer():
        ends = [horner(coefficients, h) for coefficients in (*p.q, *p.v)]
    centre = tuple((+x).mid() for x in ends)
    error = carried(start.error, Y, delta, around, [upper(x - c) for x, c in zip(ends, centre, strict=True)])
    end = State(start.t + step, centre[: tape.n], centre[tape.n :], error)
    return Step(start, step, p, around, end)


def _weights(
    tape: Tape, time: Ball, p: Polynomial, inverse: Inverse, h: float, errors: Sequence[Ball], tolerance: float
) -> tuple[list[Ball], float, float]:
    """Return exact weights w = e + A w / σ, the logarithmic norm L ≤ σ at the start, and σ.

    A = [0 1; |J|] and σ = 1.25 ρ(A). A box of the shape w contains the errors e of the start and their growth. Some
    entries of J vanish at special states, for example of a level arm at rest, but not in a tube around them: a σ below
    0.1 / h has no benefit.
    """
    n = tape.n
    (J,) = jacobian(tape, inverse, (time, *p.at(arb(0))))
    A = np.zeros((2 * n, 2 * n))
    A[:n, n:] = np.eye(n)
    A[n:] = [[abs(float(J[i, j].mid())) for j in range(2 * n)] for i in range(n)]
    e = np.array([float(x) for x in errors]) + tolerance
    try:
        with np.errstate(over="raise", invalid="raise"):  # the Jacobian may be beyond a float64
            A[n:, :n] += np.eye(n) * (_LEAST_GROWTH / max(h, 1 / _GRID)) ** 2
            sigma = _LARGER * float(np.abs(np.linalg.eigvals(A)).max())
            e[n:] = np.maximum(e[n:], sigma * e[:n])  # at least the errors caused by those of q
            x = np.linalg.solve(sigma * np.eye(2 * n) - A, e)
            x = np.maximum(x / x.max(), _LIGHTEST)
    except (FloatingPointError, np.linalg.LinAlgError):
        raise NotProvenError("the Jacobian is not finite") from None
    w = [arb(float(weight)) for weight in x]
    return w, float(logarithmic_norm(J, w)), sigma


def _longest(p: Polynomial, how: Effort, before: Fraction | None) -> float:
    """Return the longest step to try, from the last coefficients and from the previous step."""
    lengths = [_LONGEST_S] if before is None else [_LONGER * float(before)]
    for k in (how.order, how.order + 1):
        size = max(float(abs(coefficients[k])) for coefficients in p.v)
        if size > 0:
            lengths.append(0.9 * (how.tolerance / size) ** (1 / k))
    return min(lengths)


def _to_grid(t: Fraction, end: Fraction, h: Fraction) -> Fraction:
    """Return a step of about h that ends on the grid, or at the end."""
    if t + h >= end:
        return end - t
    after = Fraction(int((t + h) * _GRID), _GRID)
    if not after > t:
        raise NotProvenError("steps become too short")
    return after - t
