"""The result of a stress test."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from math import inf, isfinite
from typing import final

from robot_dyn.foundations import Block, Table, reported
from robot_dyn.report import Result
from robot_dyn.tools.stress.finding import JudgedRun, Limit, WorstCase


@final
@dataclass(frozen=True, eq=False, repr=False)
class Stress(Result):
    """The worst cases of an arm, what breaks first, and what of that the library fails to report.

    Attributes:
        robot: Its name.
        joints: Their names.
        worst: Worst configurations.
        limits: Of step, gain, speed and payload, each confirmed at 0.98 and 1.02 of it.
        runs: Random runs whose error estimates were judged.
        left_out: What was left out, and why.
        out_of_time: Names of what was not looked at, or not to its end, for lack of time.
        environment: Versions and processor.
        samples, seed: Number of random states; of the random generator.
        spent_s: Time that it took, in [s].
        interrupted: Whether it was ended by the user.
    """

    robot: str
    joints: tuple[str, ...]
    worst: tuple[WorstCase, ...]
    limits: tuple[Limit, ...]
    runs: tuple[JudgedRun, ...]
    left_out: tuple[str, ...]
    out_of_time: tuple[str, ...]
    environment: dict[str, str]
    samples: int
    seed: int
    spent_s: float
    interrupted: bool = False

    @property
    def drawing(self) -> str:
        from robot_dyn.foundations import levels

        steps = {f"{each.what} {each.joint}": each.value for each in self.limits if each.of == "step"}
        return levels("largest step that is stable [s]", steps, inf)

    def tables(self) -> Iterator[Block]:
        """What it fails at, and a line for each finding."""
        yield from (f"FAILURE: {each}" for each in self.failures)
        yield from [""] * bool(self.failures)
        of_worst = ("quantity", "joint", "typical", "worst random", "searched", "at few digits", "note")
        of_limits = ("of", "what", "joint", "limit", "at 0.98", "at 1.02", "")
        of_runs = ("run", "duration", "estimated", "true", "known to", "says", "")
        for title, headings, rows in (
            ("worst configurations", of_worst, map(_worst_row, self.worst)),
            ("limits", of_limits, map(_limit_row, self.limits)),
            ("random runs: errors of q in rad or m", of_runs, map(_run_row, self.runs)),
        ):
            if known := tuple(rows):
                yield from (title, Table(headings, known, wrap=True), "")
        yield from (f"not looked at for lack of time: {each}" for each in self.out_of_time)

    @reported
    def failures(self) -> tuple[str, ...]:
        """What the library fails at: limits that runs refute, and runs that mislead."""
        return (
            *(
                f"{each.of} {each.what}: {_number(each.value)} [{each.unit}] is refuted: {each.within}; {each.beyond}"
                for each in self.limits
                if each.confirmed is False
            ),
            *(
                f"run, {each.what}: estimated {each.estimated:.1e}, true {each.true:.1e}, and nothing says so"
                for each in self.runs
                if each.misleads
            ),
        )

    @reported
    def ok(self) -> bool:
        """Whether there are no failures."""
        return not self.failures

    @reported
    def sentence(self) -> str:
        """The worst of each kind, in a sentence."""
        parts = []
        for what in dict.fromkeys(each.what for each in self.worst):
            top = max((each for each in self.worst if each.what == what), key=lambda each: each.searched)
            joint = f" ({top.joint})" if top.joint else ""
            parts.append(f"{what} up to {top.searched:.3g}{f' {top.unit}' if top.unit else ''}{joint}")
        checked = sum(each.confirmed is not None for each in self.limits) + len(self.runs)
        failed = len(self.failures)
        if late := len(self.out_of_time):
            parts.append(f"{late} not looked at for lack of time")
        return f"{self.robot}: {failed or 'no'} failure{'s' * (failed != 1)} in {checked} checks; {'; '.join(parts)}"


def _number(x: float) -> str:
    return f"{x:.4g}" if isfinite(x) else "none"


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
