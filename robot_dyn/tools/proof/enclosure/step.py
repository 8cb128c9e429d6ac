"""One proven step: polynomial, defect, tube, and the error set carried on; shorter until all bounds hold."""

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
_OFF, _SHARE = 30.0, 1e-4  # h |d| at most: of the tolerance, and of the errors at the start
_SHORTER, _TRIES = Fraction(3, 4), 24
_LONGER = 1.2  # than the step before
_GROWTH, _LEAST_GROWTH = 0.6, 0.1  # h L that is tried, and at least
_LARGER = 1.25  # σ than the spectral radius
_LIGHTEST = 1e-12  # weight


@final
@dataclass(frozen=True)
class Effort:
    """What a proof puts into its steps.

    Attributes:
        order: Of the accelerations of a polynomial.
        tolerance: Of the last term of a step's velocity.
    """

    order: int
    tolerance: float


def effort(bits: int) -> Effort:
    """Order and tolerance for a precision: 16 and 1e-16 at 53 bits, 22 and 1e-22 at 100."""
    more = 6 * (bits - 53) / 47
    return Effort(round(16 + more), max(10.0 ** -(16 + more), 1e-300))


@final
@dataclass(frozen=True)
class State:
    """Where a step starts: the centre of a set, and the set about it.

    Attributes:
        t: Time in [s].
        q, v: The centre, exact.
        error: What the true state may be off it.
    """

    t: Fraction
    q: tuple[Ball, ...]
    v: tuple[Ball, ...]
    error: ErrorSet


@final
@dataclass(frozen=True)
class Step:
    """A step that is proven.

    Attributes:
        start: Its start.
        h: In [s].
        p: Its polynomial.
        tube: Around it.
        end: Its end.
    """

    start: State
    h: Fraction
    p: Polynomial
    tube: Tube
    end: State


def proven_step(tape: Tape, start: State, end: Fraction, how: Effort, before: Fraction | None = None) -> Step:
    """The longest step up to `end` that is found to be proven; after one of `before` hardly longer than that.

    Raises:
        NotProvenError: If none is; says why.
    """
    time = exact(start.t)
    try:
        inverse = Inverse.of(tape.mass(start.q))
        p = taylor(tape, time, start.q, start.v, inverse, how.order)
        longest = _longest(p, how, before)
        weights, growth, rate = _weights(tape, time, p, inverse, longest, start.error.bounds, how.tolerance)
        h = _to_grid(start.t, end, Fraction(min(longest, _GROWTH / growth)))
    except ValueError:
        raise NotProvenError("M may be singular") from None
    for attempt in range(_TRIES):
        try:
            return _step(tape, time, start, p, inverse, weights, rate, h, how)
        except NotProvenError as error:
            why = error
        except ValueError:  # a power series is divided by one that may begin with 0
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
    around = tube(tape, time, p, inverse, h, d, errors, weights, rate)
    Y, delta = fundamental(tape, time, p, everywhere, inverse, h, T, around)
    with finer():
        ends = [horner(each, h) for each in (*p.q, *p.v)]
    centre = tuple((+each).mid() for each in ends)
    error = carried(start.error, Y, delta, around, [upper(each - c) for each, c in zip(ends, centre, strict=True)])
    end = State(start.t + step, centre[: tape.n], centre[tape.n :], error)
    return Step(start, step, p, around, end)


def _weights(
    tape: Tape, time: Ball, p: Polynomial, inverse: Inverse, h: float, errors: Sequence[Ball], tolerance: float
) -> tuple[list[Ball], float, float]:
    """Exact weights w = e + A w / σ, the logarithmic norm L ≤ σ at the start, and σ, A = [0 1; |J|], σ = 1.25 ρ(A).

    A box of the shape w holds the errors e of the start, and what grows of them. At some states parts of J are 0, such
    as those of a level arm at rest, but not in a tube around them: a σ below 0.1 / h wins nothing.
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
            e[n:] = np.maximum(e[n:], sigma * e[:n])  # no narrower: those of q make them
            x = np.linalg.solve(sigma * np.eye(2 * n) - A, e)
            x = np.maximum(x / x.max(), _LIGHTEST)
    except (FloatingPointError, np.linalg.LinAlgError):
        raise NotProvenError("the Jacobian is not finite") from None
    w = [arb(float(each)) for each in x]
    return w, float(logarithmic_norm(J, w)), sigma


def _longest(p: Polynomial, how: Effort, before: Fraction | None) -> float:
    """The longest step that is tried: by the last coefficients, and by the step before."""
    found = [_LONGEST_S] if before is None else [_LONGER * float(before)]
    for k in (how.order, how.order + 1):
        size = max(float(abs(each[k])) for each in p.v)
        if size > 0:
            found.append(0.9 * (how.tolerance / size) ** (1 / k))
    return min(found)


def _to_grid(t: Fraction, end: Fraction, h: Fraction) -> Fraction:
    """A step of about h that ends on the grid, or at the end."""
    if t + h >= end:
        return end - t
    after = Fraction(int((t + h) * _GRID), _GRID)
    if not after > t:
        raise NotProvenError("steps become too short")
    return after - t
