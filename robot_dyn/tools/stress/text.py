"""What a stress test says: what it fails at, and a line for each finding."""

from __future__ import annotations

from collections.abc import Iterator
from math import isfinite
from typing import TYPE_CHECKING

from robot_dyn.foundations import Block, Table
from robot_dyn.tools.stress.finding import JudgedRun, Limit, WorstCase

if TYPE_CHECKING:
    from robot_dyn.tools.stress.result import Stress


def stress_tables(result: Stress) -> Iterator[Block]:
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
        if known := tuple(rows):
            yield from (title, Table(headings, known, wrap=True), "")
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
