"""Balls as whole numbers, (m, e, r, s) for m 2ᵉ ± r 2ˢ: exact, of any precision, and plain data to keep or to send."""

from __future__ import annotations

from collections.abc import Sequence

from flint import arb, ctx

from robot_dyn.studies.proof.enclosure.balls import Ball

Packed = tuple[int, int, int, int]


def packed(x: Ball) -> Packed:
    """The numbers of a ball, exactly."""
    (m, e), (r, s) = x.mid().man_exp(), x.rad().man_exp()
    return int(m), int(e), int(r), int(s)


def unpacked(x: Packed) -> Ball:
    """The ball of these numbers; its midpoint exactly, its radius rounded up."""
    m, e, r, s = x
    with ctx.workprec(max(m.bit_length(), r.bit_length(), 2)):
        return arb(arb(m) * arb(2) ** e, arb(r) * arb(2) ** s)


def of_joints(balls: Sequence[Ball]) -> tuple[Packed, ...]:
    """One for each joint."""
    return tuple(map(packed, balls))
