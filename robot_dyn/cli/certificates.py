"""What the command certify says: a plain document for --json (docs/json.md), and the same as tables for a person."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict
from math import isfinite
from typing import Any

from rich.table import Table

from robot_dyn.accuracy.certificate import Certificate, Held
from robot_dyn.cli.prices import finite
from robot_dyn.simulation.seconds import in_words

_HEADINGS = ("quantity", "road", "given", "typical", "worst of", "random", "searched", "time")


def certificate(made: Certificate) -> dict[str, Any]:
    """The digits of each quantity by each road, and what else was found."""
    return {
        "robot": made.robot,
        "joints": list(made.joints),
        "sentence": made.sentence,
        "digits": [asdict(each) for each in made.held],
        "decimals": made.decimals,
        "right_angles": made.right_angles,
        "condition": {key: finite(x) for key, x in asdict(made.condition).items()},
        "lost": made.lost,
        "bits": made.bits,
        "left_out": list(made.left_out),
        "environment": made.environment,
        "seed": made.seed,
        "interrupted": made.interrupted,
    }


def tables(made: Certificate) -> Iterator[Any]:
    """The sentence, a line for each quantity and road, and what it rests on."""
    yield made.sentence
    yield ""
    yield (
        f"{made.robot}: decimal digits that hold, against balls of {made.bits} bits: error of M_ij relative to"
        " √(M_ii M_jj); of C, N and inverse"
    )
    yield "dynamics to the largest entry in the units √M_ii of the joints, or its rms at random states if that is more;"
    yield "of forward dynamics to M⁻¹τ, M⁻¹C v and M⁻¹N, in the norm of M"
    given = any(each.given is not None for each in made.held)
    table = Table(box=None, pad_edge=False, header_style="bold")
    shown = [heading for heading in _HEADINGS if given or heading != "given"]
    for heading in shown:
        words = heading in ("quantity", "road")
        table.add_column(heading, no_wrap=True, justify="left" if words else "right")
    for quantity in made.quantities:
        for k, each in enumerate(each for each in made.held if each.quantity == quantity):
            table.add_row(quantity if not k else "", *_cells(each, given))
        table.add_row(
            "", "decimals of the file as float64", *[""] * (len(shown) - 4), _digits(made.decimals[quantity]), ""
        )
    yield table
    of = made.condition
    yield (
        f"κ of M scaled to a unit diagonal: typical {of.typical:.3g}, largest at random {of.random:.3g}, searched"
        f" {of.searched:.3g}{_to_lose(of.digits)}"
    )
    if lost := [f"{road} {digits:+.1f}" for road, digits in made.lost.items()]:
        yield f"digits of inverse less those of forward dynamics, at the worst states: {', '.join(lost)}"
    if made.right_angles:
        yield (
            "machine code writes right angles out in full, and is judged by these; of the file as it stands that"
            f" leaves {min(made.right_angles.values()):.1f} digits"
        )
    yield "times of one query from Python, medians of calls that take turns; no more than 20 digits are counted"
    yield from (f"left out: {each}" for each in made.left_out)
    yield f"{', '.join(f'{name} {value}' for name, value in made.environment.items())}"


def _cells(each: Held, given: bool) -> list[str]:
    digits = [_digits(x) for x in (each.typical, each.random, each.searched)]
    own = [_digits(each.given)] if given else []
    return [each.road, *own, digits[0], str(each.samples), digits[1], digits[2], in_words(each.time_s)]


def _to_lose(digits: float) -> str:
    return f": up to {digits:.1f} digits for forward dynamics to lose" if isfinite(digits) else ""


def _digits(x: float | None) -> str:
    return "—" if x is None else f"{x:.1f}"
