"""The result of a stress test: worst configurations, limits, and runs that were judged; each with what repeats it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from math import nan
from typing import Any, final

import numpy as np

from robot_dyn import Setup
from robot_dyn.foundations import UNREPORTED, Block, Table, number_or_dash, reported
from robot_dyn.report import Result

_TABLES = {  # by title, the findings in a table and their attributes
    "worst configurations": (
        "worst",
        ("what", "joint", "typical", "random", "searched", "minimal", "unit", "note", "found"),
    ),
    "limits": ("limits", ("of", "what", "joint", "value", "unit", "within", "beyond", "confirmed")),
    "random runs: errors of q in rad or m": (
        "runs",
        ("what", "duration_s", "estimated", "true", "unsure", "report", "misleads"),
    ),
}
_HEADINGS: dict[str, str] = {"within": "at 0.98 of value", "beyond": "at 1.02 of value", "duration_s": "duration [s]"}
_NUMBERS = ("typical", "random", "searched", "minimal", "value", "duration [s]", "estimated", "true", "unsure")


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
    joint: str = ""
    unit: str = ""
    typical: float = nan
    random: float = nan
    searched: float = nan
    minimal: float = nan
    state: dict[str, list[float]] = field(default_factory=dict, hash=False)
    note: str = ""

    def at(
        self, typical: float, random: float, searched: float, state: Mapping[str, np.ndarray], minimal: float
    ) -> WorstCase:
        """Return the case with its sizes; the largest that was found may lie at few digits."""
        sizes = {"typical": typical, "random": random, "searched": max(searched, minimal), "minimal": minimal}
        return replace(self, **sizes, state={name: x.tolist() for name, x in state.items()})

    @reported
    def found(self) -> bool:
        """Whether the search found a worse state than the random ones."""
        return self.searched > self.random


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

    def tables(self) -> Iterator[Block]:
        """What it fails at, and a line for each finding."""
        yield from (f"FAILURE: {failure}" for failure in self.failures)
        yield from [""] * bool(self.failures)
        for title, (part, columns) in _TABLES.items():
            rows = tuple(tuple(_cell(getattr(case, name)) for name in columns) for case in getattr(self, part))
            if rows:
                heading = tuple(_HEADINGS.get(str(name), str(name)) for name in columns)
                yield from (title, Table(heading, rows, right=_NUMBERS, wrap=True), "")
        yield from (f"not looked at for lack of time: {name}" for name in self.out_of_time)

    @reported
    def failures(self) -> tuple[str, ...]:
        """What the library fails at: limits that runs refute, and runs that mislead."""
        refuted = (limit for limit in self.limits if limit.confirmed is False)
        misleading = (run for run in self.runs if run.misleads)
        return (
            *(f"{x.of} {x.what}: {x.value:.4g} [{x.unit}] is refuted: {x.within}; {x.beyond}" for x in refuted),
            *(
                f"run, {x.what}: estimated {x.estimated:.1e}, true {x.true:.1e}, and nothing says so"
                for x in misleading
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
        for what in dict.fromkeys(case.what for case in self.worst):
            top = max((case for case in self.worst if case.what == what), key=lambda case: case.searched)
            joint = f" ({top.joint})" if top.joint else ""
            parts.append(f"{what} up to {f'{top.searched:.3g} {top.unit}'.rstrip()}{joint}")
        checked = sum(limit.confirmed is not None for limit in self.limits) + len(self.runs)
        failed = len(self.failures)
        if late := len(self.out_of_time):
            parts.append(f"{late} not looked at for lack of time")
        return f"{self.robot}: {failed or 'no'} failure{'s' * (failed != 1)} in {checked} checks; {'; '.join(parts)}"


def _cell(x: Any) -> str:
    words: dict[Any, str] = {True: "yes", False: "no", None: ""}
    return number_or_dash(x, 4) if isinstance(x, float) else words.get(x, str(x))
