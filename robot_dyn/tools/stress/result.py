"""The result of a stress test: worst configurations, limits, and runs that were judged; each with what repeats it."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from math import isfinite
from typing import final

from robot_dyn import Setup
from robot_dyn.foundations import UNREPORTED, Block, Table, reported
from robot_dyn.report import Result


@final
@dataclass(frozen=True)
class WorstCase:
    """The configuration at which a quantity is largest.

    Attributes:
        what: The quantity.
        joint: It is of, or empty.
        unit: Of the values; empty for numbers.
        typical: Median of random states.
        random: The largest of them.
        searched: The largest that was found.
        minimal: At `state`, at least 0.9 of that.
        state: A state of few digits and few entries that are not zero, q, v, a, tau by name.
        note: More about it.
    """

    what: str
    joint: str
    unit: str
    typical: float
    random: float
    searched: float
    minimal: float
    state: dict[str, list[float]] = field(hash=False)
    note: str

    @reported
    def found(self) -> bool:
        """Whether the search found a worse state than the random ones."""
        return self.searched > self.random

    @property
    def cells(self) -> tuple[str, ...]:
        """Its row of a table."""
        searched = f"{self.searched:.4g}" + ("" if self.found else " (none worse)")
        least = f"{self.minimal:.4g} {self.unit}".rstrip()
        return self.what, self.joint, f"{self.typical:.4g}", f"{self.random:.4g}", searched, least, self.note


@final
@dataclass(frozen=True)
class Limit:
    """Where something breaks first.

    Attributes:
        of: "step", "gain", "speed" or "payload".
        what: What breaks.
        joint: That breaks, or empty.
        value: The limit; inf without one.
        unit: Of it.
        within: What happened at 0.98 of it.
        beyond: What happened at 1.02 of it.
        confirmed: Whether both came as predicted; None if there is nothing to confirm.
        state: Where it was looked for, q and v by name.
        setups: Of the runs that confirm it, at 0.98 and at 1.02 of it; nothing without runs.
    """

    of: str
    what: str
    joint: str
    value: float
    unit: str
    within: str = ""
    beyond: str = ""
    confirmed: bool | None = None
    state: dict[str, list[float]] = field(default_factory=dict, hash=False)
    setups: tuple[Setup, ...] = field(default=(), hash=False, repr=False, metadata=UNREPORTED)

    @property
    def cells(self) -> tuple[str, ...]:
        """Its row of a table."""
        limit = f"{_number(self.value)} {self.unit}" if isfinite(self.value) else "none"
        verdict = {True: "confirmed", False: "REFUTED", None: ""}[self.confirmed]
        return self.of, self.what, self.joint, limit, self.within, self.beyond, verdict


@final
@dataclass(frozen=True)
class JudgedRun:
    """A random run whose error estimate was compared with a better run.

    Attributes:
        what: Effects, control and method.
        duration_s: In [s].
        estimated: Error of q by its own estimate; nan without one.
        true: The largest distance from the better run, up to where the estimate holds.
        unsure: How far two better runs are apart there.
        report: What the run says of its error, or how it ended.
        misleads: Whether nothing warns, and the estimate is below 0.3 of the true error.
        setup: Of the run.
    """

    what: str
    duration_s: float
    estimated: float
    true: float
    unsure: float
    report: str
    misleads: bool
    setup: Setup = field(hash=False, repr=False, metadata=UNREPORTED)

    @property
    def cells(self) -> tuple[str, ...]:
        """Its row of a table."""
        errors = (f"{x:.4g}" if isfinite(x) else "–" for x in (self.estimated, self.true, self.unsure))
        return self.what, f"{self.duration_s:g} s", *errors, self.report, "MISLEADS" * self.misleads


Finding = WorstCase | Limit | JudgedRun


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

    def tables(self) -> Iterator[Block]:
        """What it fails at, and a line for each finding."""
        yield from (f"FAILURE: {each}" for each in self.failures)
        yield from [""] * bool(self.failures)
        of_worst = ("quantity", "joint", "typical", "worst random", "searched", "at few digits", "note")
        of_limits = ("of", "what", "joint", "limit", "at 0.98", "at 1.02", "")
        of_runs = ("run", "duration", "estimated", "true", "known to", "says", "")
        for title, headings, findings in (
            ("worst configurations", of_worst, self.worst),
            ("limits", of_limits, self.limits),
            ("random runs: errors of q in rad or m", of_runs, self.runs),
        ):
            if findings:
                yield from (title, Table(headings, tuple(each.cells for each in findings), wrap=True), "")
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
