"""Bounds of balls: what is not finite bounds nothing, and ends a proof instead of passing a comparison."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from fractions import Fraction
from typing import Any

from flint import arb, arb_mat, ctx, fmpq

Ball = Any  # flint.arb
Matrix = Any  # flint.arb_mat

_GUARD = 24  # with 100 bits no more than two words


class NotProvenError(Exception):
    """Internal: a bound does not hold, or a step is too long for it; says why."""


@contextmanager
def finer() -> Iterator[None]:
    """More bits, where numbers cancel: of a residual those of its terms would be left otherwise."""
    with ctx.workprec(ctx.prec + _GUARD):
        yield


def upper(x: Ball) -> Ball:
    """An exact number that |x| does not exceed."""
    if not x.is_finite():
        raise NotProvenError("a ball is not finite: a divisor may be 0")
    return x.abs_upper()


def largest(balls: Iterable[Ball]) -> Ball:
    """An exact number that none of |x| exceeds."""
    most = None
    for x in balls:
        bound = upper(x)
        most = bound if most is None or bound > most else most
    return most


def dot(x: Sequence[Ball], y: Sequence[Ball]) -> Ball:
    """Σ xᵢ yᵢ."""
    total = x[0] * y[0]
    for a, b in zip(x[1:], y[1:], strict=True):
        total = total + a * b
    return total


def horner(coefficients: Sequence[Ball], x: Ball) -> Ball:
    """Σ cₖ xᵏ."""
    total = coefficients[-1]
    for c in coefficients[-2::-1]:
        total = total * x + c
    return total


def exact(x: Fraction) -> Ball:
    """A fraction with a power of two below it, as a number without radius."""
    with ctx.workprec(x.numerator.bit_length() + 2):
        made = arb(fmpq(x.numerator, x.denominator))
    assert made.is_exact()
    return made


def between(low: Ball, high: Ball) -> Ball:
    """A ball that holds the interval between two exact numbers."""
    return low.union(high)


def matrix(rows: Sequence[Sequence[Ball]]) -> Matrix:
    """The matrix of its rows."""
    return arb_mat([list(row) for row in rows])
