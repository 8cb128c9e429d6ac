"""What a certificate says: a line for each quantity and implementation, and what it rests on."""

from __future__ import annotations

from collections.abc import Iterator
from math import isfinite
from typing import TYPE_CHECKING

from robot_dyn.foundations.answer import Block, Table
from robot_dyn.queries.units import format_duration

if TYPE_CHECKING:
    from robot_dyn.accuracy.certificate.certificate import Certificate, Held

DECIMALS = "decimals of the file as float64"  # name of the implementation that computes exactly with these decimals


def certificate_tables(result: Certificate) -> Iterator[Block]:
    """A line for each quantity and implementation, and what it rests on."""
    yield (
        f"{result.robot}: decimal digits that hold, against balls of {result.bits} bits: error of M_ij relative to"
        " √(M_ii M_jj); of C, N and inverse"
    )
    yield "dynamics to the largest entry in the units √M_ii of the joints, or its rms at random states if that is more;"
    yield "of forward dynamics to M⁻¹τ, M⁻¹C v and M⁻¹N, in the norm of M"
    given = any(each.given is not None for each in result.digits)
    headings = ("quantity", "implementation", *["given"] * given, "typical", "worst of", "random", "searched", "time")
    yield Table(headings, tuple(map(tuple, _digit_rows(result, given))), right=headings[2:])
    of = result.condition
    lose = f": up to {of.digits:.1f} digits for forward dynamics to lose" if isfinite(of.digits) else ""
    yield (
        f"κ of M scaled to a unit diagonal: typical {of.typical:.3g}, largest at random {of.random:.3g}, searched"
        f" {of.searched:.3g}{lose}"
    )
    if lost := [f"{implementation} {digits:+.1f}" for implementation, digits in result.lost.items()]:
        yield f"digits of inverse less those of forward dynamics, at the worst states: {', '.join(lost)}"
    if result.right_angles:
        yield (
            "machine code writes right angles out in full, and is judged by these; of the file as it stands that"
            f" leaves {min(result.right_angles.values()):.1f} digits"
        )
    yield "times of one query from Python, the least of calls that take turns; no more than 20 digits are counted"


def _digit_rows(result: Certificate, given: bool) -> Iterator[list[str]]:
    """A row for each implementation, and one for the decimals of the file, by quantity."""
    for quantity in result.quantities:
        for k, each in enumerate(each for each in result.digits if each.quantity == quantity):
            yield [quantity if not k else "", *_held(each, given)]
        yield ["", DECIMALS, *[""] * (3 + given), f"{result.decimals[quantity]:.1f}", ""]


def _held(each: Held, given: bool) -> list[str]:
    own = ["—" if each.given is None else f"{each.given:.1f}"] if given else []
    worst = [f"{each.random:.1f}", f"{each.searched:.1f}"]
    return [each.implementation, *own, f"{each.typical:.1f}", str(each.samples), *worst, format_duration(each.time_s)]
