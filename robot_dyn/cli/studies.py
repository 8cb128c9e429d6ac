"""What the studies say to a person: a sentence, tables, what was left out, and the versions that it was found with."""

from __future__ import annotations

from collections.abc import Iterator
from math import isfinite
from typing import Any

from robot_dyn.cli.terminal import table
from robot_dyn.queries.units import format_duration
from robot_dyn.studies.certificate.certificate import DECIMALS, Certificate, Held
from robot_dyn.studies.costs.ab_comparison import ABComparison
from robot_dyn.studies.costs.cost import Cost
from robot_dyn.studies.stress_test.finding import JudgedRun, Limit, WorstCase
from robot_dyn.studies.stress_test.result import Stress
from robot_dyn.studies.work_precision_diagram.tolerance_ladder import ToleranceLadder
from robot_dyn.studies.work_precision_diagram.work_precision import WorkPrecision

_DIGITS = (3, 6, 9)
_OWN = "robot_dyn"


def lines(result: Certificate | Cost | Stress | WorkPrecision) -> Iterator[Any]:
    """Texts of one line each, and tables."""
    of = {Certificate: _certificate, Cost: _cost, Stress: _stress, WorkPrecision: _work_precision}
    yield result.sentence
    yield ""
    yield from of[type(result)](result)
    yield from (f"left out: {each}" for each in result.left_out)
    yield ", ".join(f"{name} {value}" for name, value in result.environment.items())


def _cost(result: Cost) -> Iterator[Any]:
    """A line for each alternative, by what they are of."""
    yield f"{result.robot}: {', '.join(result.acting) or 'no effects'}"
    headings = ("per", "what", "first / second", "instructions", "ratio", "time", "ratio")
    yield table(headings, cost_rows(result), words=headings[:3])
    yield "instructions are exact; times of the processor, in machine code on one thread, and their ratios are medians"
    yield "over turns; ± half of the interquartile range"


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
    yield " / ".join("—" if of.time_s is None else format_duration(of.time_s) for of in (first, second))
    yield "—" if each.time_ratio is None else f"{each.time_ratio:.2f} ± {each.time_ratio_spread:.2f}"


def _certificate(result: Certificate) -> Iterator[Any]:
    """A line for each quantity and implementation, and what it rests on."""
    yield (
        f"{result.robot}: decimal digits that hold, against balls of {result.bits} bits: error of M_ij relative to"
        " √(M_ii M_jj); of C, N and inverse"
    )
    yield "dynamics to the largest entry in the units √M_ii of the joints, or its rms at random states if that is more;"
    yield "of forward dynamics to M⁻¹τ, M⁻¹C v and M⁻¹N, in the norm of M"
    given = any(each.given is not None for each in result.digits)
    headings = ("quantity", "implementation", *["given"] * given, "typical", "worst of", "random", "searched", "time")
    yield table(headings, _digit_rows(result, given), words=headings[:2])
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
    yield "times of one query from Python, medians of calls that take turns; no more than 20 digits are counted"


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


def _work_precision(result: WorkPrecision) -> Iterator[Any]:
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
    yield table(headings, _ladder_rows(result, columns), words=headings[:1])
    yield "times of the loop alone, medians of runs that take turns; * the least; ( ) extrapolated by the order"
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


def _past_horizon(result: WorkPrecision) -> Iterator[Any]:
    """Energy and the way back where no error can be measured, a line for each method."""
    returns = any(each.returned is not None for each in result.past_horizon)
    yield ""
    yield f"over all of {result.duration_s:g} s, where no error can be measured, the finest runs:"
    rows = []
    for each in result.past_horizon:
        back = "—" if each.returned is None else f"{each.returned:.1e}"
        rows.append([each.name, f"{each.setting:.3g}", f"{each.energy:.1e}", *[back] * returns])
    yield table(("method", "setting", "energy", *["there and back"] * returns), rows, words=("method",))
    yield "energy: largest residual, as a part of the energy exchanged" + (
        f"; there and back: |q − q₀| in {result.unit} of a run that turns round at the end" if returns else ""
    )


def _stress(result: Stress) -> Iterator[Any]:
    """What it fails at, and a line for each finding."""
    yield from (f"FAILURE: {each}" for each in result.failures)
    yield from [""] * bool(result.failures)
    of_worst = ("quantity", "joint", "typical", "worst random", "searched", "at few digits", "note")
    of_limits = ("of", "what", "joint", "limit", "at 0.98", "at 1.02", "")
    of_runs = ("run", "duration", "estimated", "true", "known to", "says", "")
    for title, headings, rows in (
        ("worst configurations", of_worst, map(_worst_row, result.worst)),
        ("limits", of_limits, map(_limit_row, result.limits)),
        ("random runs: errors of q in rad or m", of_runs, map(_run_row, result.runs)),
    ):
        if known := list(rows):
            yield from (title, table(headings, known, words=headings, wrap=True), "")
    yield from (f"not looked at for lack of time: {each}" for each in result.out_of_time)


def _worst_row(each: WorstCase) -> tuple[str, ...]:
    searched = f"{each.searched:.4g}" + ("" if each.found else " (none worse)")
    least = f"{each.minimal:.4g} {each.unit}".rstrip()
    return each.what, each.joint, f"{each.typical:.4g}", f"{each.random:.4g}", searched, least, each.note


def _limit_row(each: Limit) -> tuple[str, ...]:
    limit = f"{each.value:.4g} {each.unit}" if isfinite(each.value) else "none"
    verdict = {True: "confirmed", False: "REFUTED", None: ""}[each.confirmed]
    return each.of, each.what, each.joint, limit, each.within, each.beyond, verdict


def _run_row(each: JudgedRun) -> tuple[str, ...]:
    errors = (f"{x:.4g}" if isfinite(x) else "–" for x in (each.estimated, each.true, each.unsure))
    return each.what, f"{each.duration_s:g} s", *errors, each.report, "MISLEADS" if each.misleads else ""


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
            yield f"  {name}: {format_duration(price.value)}{times}{' (extrapolated)' if price.extrapolated else ''}"
        else:
            ended = dict.fromkeys(each.ended for each in result.ladders if _program(each) == program)
            yield f"  {program}: reached by no run ({'; '.join(ended)})"
    yield "  times of the loop alone, medians of runs that take turns"
    yield from (f"  left out: {each}" for each in result.left_out)


def _program(ladder: ToleranceLadder) -> str:
    """The program that a ladder is of."""
    return ladder.method.split(" ")[0] if ladder.peer else _OWN


def _price(seconds: float, extrapolated: bool, least: bool) -> str:
    words = f"({format_duration(seconds)})" if extrapolated else format_duration(seconds)
    return f"{words}{' *' if least else ''}"
