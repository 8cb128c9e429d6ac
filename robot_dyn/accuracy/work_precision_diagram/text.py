"""What work and precision say: a line for each method, and what an error takes by each program."""

from __future__ import annotations

from collections.abc import Iterator
from math import isfinite
from typing import TYPE_CHECKING, Any

from robot_dyn.accuracy.work_precision_diagram.tolerance_ladder import ToleranceLadder
from robot_dyn.foundations.answer import Block, Table
from robot_dyn.queries.units import format_duration

if TYPE_CHECKING:
    from robot_dyn.accuracy.work_precision_diagram.work_precision import WorkPrecision

_DIGITS = (3, 6, 9)
_OWN = "robot_dyn"


def work_precision_tables(result: WorkPrecision) -> Iterator[Block]:
    """What it rests on, and a line for each method."""
    of = result.reference
    yield f"{result.robot}: {', '.join(result.acting) or 'no effects'}"
    yield (
        f"error: largest |q − q_ref| over joints and {of.records} records in {of.horizon_s:g} s, in {result.unit};"
        f" reference: {of.methods[0]}, {of.error:.1e} from {of.methods[1]}: no error below that is believed"
    )
    if of.parted_s is not None:
        lost = "" if of.lost_s is None else f", and differ by 0.1 at {of.lost_s:.3g} s"
        yield (
            f"horizon: {of.horizon_s:g} s of {result.duration_s:g} s: beyond it runs at tight tolerances part from each"
            f" other{lost}"
        )
    columns = [digits for digits in _DIGITS if 10.0**-digits >= of.error]
    headings = ("method", "order", "measured", *(f"{digits} digits" for digits in columns), "least error", "in")
    yield Table(headings, tuple(map(tuple, _ladder_rows(result, columns))), right=headings[1:])
    yield "times of prepared runs, the least of runs that take turns; * the least; ( ) extrapolated by the order"
    if result.past_horizon:
        yield from _past_horizon(result)


def _ladder_rows(result: WorkPrecision, columns: list[int]) -> Iterator[list[str]]:
    """A row for each method: orders, what so many digits cost, and the finest run."""
    floor = result.reference.error
    best = {digits: min((p.value for _, p in result.digits(10.0**-digits)), default=0.0) for digits in columns}
    for each in result.ladders:
        prices = [(each.price(10.0**-digits), digits) for digits in columns]
        cells = ["—" if p is None else _price(p.value, p.extrapolated, p.value == best[d]) for p, d in prices]
        finest = min(each.points, key=lambda point: point.error)
        error = f"{finest.error:.1e}" if finest.error > floor else f"< {floor:.0e}"
        order = "—" if each.order is None else str(each.order)
        seen = "—" if each.measured_order is None else f"{each.measured_order:.1f}"
        yield [each.name, order, seen, *cells, error if isfinite(finest.error) else "—", format_duration(finest.time_s)]


def _past_horizon(result: WorkPrecision) -> Iterator[Block]:
    """Energy and the way back where no error can be measured, a line for each method."""
    returns = any(each.returned is not None for each in result.past_horizon)
    yield ""
    yield f"over all of {result.duration_s:g} s, where no error can be measured, the finest runs:"
    rows = []
    for each in result.past_horizon:
        back = "—" if each.returned is None else f"{each.returned:.1e}"
        rows.append((each.name, f"{each.setting:.3g}", f"{each.energy:.1e}", *[back] * returns))
    headings = ("method", "setting", "energy", *["there and back"] * returns)
    yield Table(headings, tuple(rows), right=headings[1:])
    yield "energy: largest residual, as a part of the energy exchanged" + (
        f"; there and back: |q − q₀| in {result.unit} of a run that turns round at the end" if returns else ""
    )


def programs(result: WorkPrecision, error: float) -> Iterator[str]:
    """What an error takes by the cheapest method of each program, this library first; and what was left out."""
    best: dict[str, Any] = {}
    for ladder, price in result.digits(error):
        best.setdefault(program_of(ladder), (ladder, price))
    own = best.get(_OWN)
    for program in dict.fromkeys([_OWN, *best, *map(program_of, result.ladders)]):
        if program in best:
            ladder, price = best[program]
            name = f"{_OWN} {ladder.name}" if program == _OWN else ladder.name
            times = f", {float(f'{price.value / own[1].value:.2g}'):g} times as long" if own and program != _OWN else ""
            yield f"  {name}: {format_duration(price.value)}{times}{' (extrapolated)' if price.extrapolated else ''}"
        else:
            ended = dict.fromkeys(each.ended for each in result.ladders if program_of(each) == program)
            yield f"  {program}: reached by no run ({'; '.join(ended)})"
    yield "  times of prepared runs, the least of runs that take turns"
    yield from (f"  left out: {each}" for each in result.left_out)


def program_of(ladder: ToleranceLadder) -> str:
    """The program that a ladder is of."""
    return ladder.method.split(" ")[0] if ladder.peer else _OWN


def _price(seconds: float, extrapolated: bool, least: bool) -> str:
    words = f"({format_duration(seconds)})" if extrapolated else format_duration(seconds)
    return f"{words}{' *' if least else ''}"
