"""What the commands on prices say: plain documents for --json (docs/json.md), and the same as tables for a person."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import asdict
from math import isfinite
from typing import Any

from rich.table import Table

from robot_dyn.accuracy.advisor import Advice
from robot_dyn.accuracy.alternative import Alternative
from robot_dyn.accuracy.cost import Cost
from robot_dyn.accuracy.ladder import Ladder
from robot_dyn.accuracy.work_precision import WorkPrecision
from robot_dyn.simulation.seconds import in_words

Document = dict[str, Any]
_DIGITS = (3, 6, 9)
_OWN = "robot_dyn"


def work_precision(result: WorkPrecision) -> Document:
    """All runs, the front, the reference, and what was left out."""
    of, front = result.reference, {id(point) for _, point in result.front}
    return {
        "robot": result.name,
        "acting": list(result.acting),
        "unit": result.unit,
        "duration_s": result.duration_s,
        "horizon_s": of.horizon_s,
        "reference": {
            "methods": list(of.methods), "error": of.error, "records": len(of.t) - 1, "parted_s": of.parted_s,
            "lost_s": of.lost_s,
        },
        "sentence": result.sentence(),
        "ladders": [
            {
                "name": each.name, "method": each.method, "engine": each.engine, "events": each.events, "by": each.by,
                "order": each.order, "measured_order": each.measured_order, "ended": each.ended,
                "points": [
                    {key: finite(value) for key, value in asdict(point).items()} | {"on_front": id(point) in front}
                    for point in each.points
                ],
            }
            for each in result.ladders
        ],
        "beyond": [{key: finite(value) for key, value in asdict(each).items()} for each in result.beyond],
        "left_out": list(result.left_out),
        "environment": result.environment,
        "budget_s": result.budget_s,
        "spent_s": result.spent_s,
        "interrupted": result.interrupted,
    }  # fmt: skip


def advice(made: Advice) -> Document:
    """Limits, the fastest motion, and the error to expect."""
    error = None if made.run is None else made.run.error
    return {
        "stable": made.stable,
        "text": made.text.split("\n"),
        "method": made.method,
        "step_s": made.step_s,
        "limits": {name: finite(limit) for name, limit in made.limits.items()},
        "period_s": made.period_s,
        "longest_period_s": finite(made.longest_period_s),
        "at_period": str(made.at_period),
        "period_growth": finite(made.period_growth),
        "growth": made.growth,
        "fastest": {
            "rate": abs(made.fastest.eigenvalue), "joint": made.fastest.joint, "source": made.fastest.source,
            "decays": made.fastest.decays, "t": made.at,
        },
        "error": None if error is None else finite(error.final),
        "error_verdict": None if error is None else str(error.verdict),
    }  # fmt: skip


def cost(result: Cost) -> Document:
    """All alternatives, what the parts add, and what was left out."""
    return {
        "robot": result.name,
        "acting": list(result.acting),
        "sentence": result.sentence,
        "alternatives": [
            asdict(each) | {"instructions_ratio": finite(each.instructions_ratio), "time_ratio": each.time_ratio}
            for each in result.alternatives
        ],
        "parts": result.parts,
        "shared": result.shared,
        "left_out": list(result.left_out),
        "environment": result.environment,
        "budget_s": result.budget_s,
        "spent_s": result.spent_s,
        "interrupted": result.interrupted,
    }


def cost_tables(result: Cost) -> Iterator[Any]:
    """The sentence, and a line for each alternative, by what they are of."""
    yield result.sentence
    yield ""
    yield f"{result.name}: {', '.join(result.acting) or 'no effects'}"
    table = Table(box=None, pad_edge=False, header_style="bold")
    for heading in ("per", "what", "first / second", "instructions", "ratio", "time", "ratio"):
        table.add_column(heading, justify="left" if heading in ("per", "what", "first / second") else "right")
    for row in cost_rows(result):
        table.add_row(*row)
    yield table
    yield "instructions are exact; times of the processor, in machine code on one thread, and their ratios are medians"
    yield "over turns; ± half of the interquartile range"
    yield from (f"left out: {each}" for each in result.left_out)
    yield f"{', '.join(f'{name} {value}' for name, value in result.environment.items())}"


def cost_rows(result: Cost) -> Iterator[list[str]]:
    """A row for each alternative: per, what, versions, instructions and their ratio, times and theirs."""
    for k, each in enumerate(result.alternatives):
        again = k > 0 and result.alternatives[k - 1].per == each.per
        yield ["" if again else each.per, *_cells(each)]


def _cells(each: Alternative) -> Iterator[str]:
    first, second = each.first, each.second
    yield each.what
    yield f"{first.name} / {second.name}"
    yield f"{first.instructions} / {second.instructions}"
    yield f"{each.instructions_ratio:.3g}" if isfinite(each.instructions_ratio) else "—"
    yield " / ".join("—" if of.time_s is None else in_words(of.time_s) for of in (first, second))
    yield "—" if each.time_ratio is None else f"{each.time_ratio:.2f} ± {each.time_ratio_spread:.2f}"


def work_precision_tables(result: WorkPrecision) -> Iterator[Any]:
    """The sentence, what it rests on, and a line for each method."""
    of = result.reference
    yield result.sentence()
    yield ""
    yield f"{result.name}: {', '.join(result.acting) or 'no effects'}"
    yield (
        f"error: largest |q − q_ref| over joints and {len(of.t) - 1} records in {of.horizon_s:g} s, in {result.unit};"
        f" reference: {of.methods[0]}, {of.error:.1e} from {of.methods[1]}: no error below that is believed"
    )
    if of.parted_s is not None:
        lost = "" if of.lost_s is None else f", and differ by 0.1 at {of.lost_s:.3g} s"
        yield (
            f"horizon: {of.horizon_s:g} s of {result.duration_s:g} s: beyond it runs at tight tolerances part from each"
            f" other{lost}"
        )
    columns = [digits for digits in _DIGITS if 10.0**-digits >= of.error]
    table = Table(box=None, pad_edge=False, header_style="bold")
    for heading in ("method", "order", "measured", *(f"{digits} digits" for digits in columns), "least error", "in"):
        table.add_column(heading, no_wrap=True, justify="left" if heading == "method" else "right")
    best = {digits: min((p.value for _, p in result.digits(10.0**-digits)), default=0.0) for digits in columns}
    for each in result.ladders:
        prices = [(each.price(10.0**-digits), digits) for digits in columns]
        cells = ["—" if p is None else _price(p.value, p.extrapolated, p.value == best[d]) for p, d in prices]
        finest = min(each.points, key=lambda point: point.error)
        error = f"{finest.error:.1e}" if finest.error > of.error else f"< {of.error:.0e}"
        order = "—" if each.order is None else str(each.order)
        seen = "—" if each.measured_order is None else f"{each.measured_order:.1f}"
        table.add_row(each.name, order, seen, *cells, error if isfinite(finest.error) else "—", in_words(finest.time_s))
    yield table
    yield "times of the loop alone, medians of runs that take turns; * the least; ( ) extrapolated by the order"
    if result.beyond:
        yield from _beyond(result)
    yield from (f"left out: {each}" for each in result.left_out)
    yield f"{', '.join(f'{name} {value}' for name, value in result.environment.items())}"


def _beyond(result: WorkPrecision) -> Iterator[Any]:
    """Energy and the way back where no error can be measured, a line for each method."""
    returns = any(each.returned is not None for each in result.beyond)
    yield ""
    yield f"over all of {result.duration_s:g} s, where no error can be measured, the finest runs:"
    table = Table(box=None, pad_edge=False, header_style="bold")
    for heading in ("method", "setting", "energy", *["there and back"] * returns):
        table.add_column(heading, no_wrap=True, justify="left" if heading == "method" else "right")
    for each in result.beyond:
        back = "—" if each.returned is None else f"{each.returned:.1e}"
        table.add_row(each.name, f"{each.setting:.3g}", f"{each.energy:.1e}", *[back] * returns)
    yield table
    yield "energy: largest residual, as a part of the energy exchanged" + (
        f"; there and back: |q − q₀| in {result.unit} of a run that turns round at the end" if returns else ""
    )


def programs(result: WorkPrecision, error: float) -> Iterator[str]:
    """What an error takes by the cheapest method of each program, this library first; and what was left out."""
    best: dict[str, Any] = {}
    for ladder, price in result.digits(error):
        best.setdefault(_program(ladder), (ladder, price))
    own = best.get(_OWN)
    for program in dict.fromkeys([_OWN, *best, *map(_program, result.ladders)]):
        if program in best:
            ladder, price = best[program]
            name = f"{_OWN} {ladder.name}" if program == _OWN else ladder.name
            times = f", {float(f'{price.value / own[1].value:.2g}'):g} times as long" if own and program != _OWN else ""
            yield f"  {name}: {in_words(price.value)}{times}{' (extrapolated)' if price.extrapolated else ''}"
        else:
            ended = dict.fromkeys(each.ended for each in result.ladders if _program(each) == program)
            yield f"  {program}: reached by no run ({'; '.join(ended)})"
    yield "  times of the loop alone, medians of runs that take turns"
    yield from (f"  left out: {each}" for each in result.left_out)


def _program(ladder: Ladder) -> str:
    """The program that a ladder is of."""
    return ladder.method.split(" ")[0] if ladder.peer else _OWN


def _price(seconds: float, extrapolated: bool, least: bool) -> str:
    words = f"({in_words(seconds)})" if extrapolated else in_words(seconds)
    return f"{words}{' *' if least else ''}"


def finite(x: Any) -> Any:
    """JSON has no infinity: the error of a run that diverged is null."""
    return None if isinstance(x, float) and not isfinite(x) else x
