"""What a cost says: a line for each alternative, by what they are of."""

from __future__ import annotations

from collections.abc import Iterator
from math import isfinite
from typing import TYPE_CHECKING

from robot_dyn.accuracy.costs.ab_comparison import ABComparison, Version
from robot_dyn.foundations.answer import Block, Table
from robot_dyn.queries.units import format_duration

if TYPE_CHECKING:
    from robot_dyn.accuracy.costs.cost import Cost


def cost_tables(result: Cost) -> Iterator[Block]:
    """A line for each alternative, by what they are of."""
    yield f"{result.robot}: {', '.join(result.acting) or 'no effects'}"
    headings = ("per", "what", "first / second", "instructions", "ratio", "time", "ratio")
    yield Table(headings, tuple(map(tuple, cost_rows(result))), right=headings[3:])
    yield "instructions are exact; times of the processor, in machine code on one thread, are the least over turns;"
    yield "± half of the interquartile range of the ratios in a turn; ~ a time that did not repeat to 5 %"


def cost_rows(result: Cost) -> Iterator[list[str]]:
    """A row for each alternative: per, what, versions, instructions and their ratio, times and theirs."""
    for k, each in enumerate(result.alternatives):
        again = k > 0 and result.alternatives[k - 1].per == each.per
        yield ["" if again else each.per, *_cells(each)]


def _cells(each: ABComparison) -> Iterator[str]:
    first, second = each.first, each.second
    yield each.what
    yield f"{first.name} / {second.name}"
    yield f"{first.instructions} / {second.instructions}"
    yield f"{each.instructions_ratio:.3g}" if isfinite(each.instructions_ratio) else "—"
    yield " / ".join(map(_time, (first, second)))
    noise = ", within noise" * each.within_noise
    yield "—" if each.time_ratio is None else f"{each.time_ratio:.2f} ± {each.time_ratio_spread:.2f}{noise}"


def _time(of: Version) -> str:
    return "—" if of.time_s is None else f"{'~' * (not of.repeatable)}{format_duration(of.time_s)}"
