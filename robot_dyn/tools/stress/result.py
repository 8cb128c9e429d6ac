"""Result of a stress test: worst configurations, limits and judged runs, with the data to reproduce them."""

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
        ("quantity", "joint", "typical", "random", "searched", "minimal", "unit", "note", "is_worse_than_random"),
    ),
    "limits": ("limits", ("kind", "description", "joint", "value", "unit", "within", "beyond", "confirmed")),
    "random runs: errors of q in rad or m": (
        "runs",
        ("description", "duration_s", "estimated", "true", "unsure", "report", "misleads"),
    ),
}
_HEADINGS: dict[str, str] = {
    "within": "at 0.98 of value",
    "beyond": "at 1.02 of value",
    "duration_s": "duration [s]",
    "is_worse_than_random": "worse than random",
}
_NUMBERS = ("typical", "random", "searched", "minimal", "value", "duration [s]", "estimated", "true", "unsure")


@final
@dataclass(frozen=True)
class WorstCase:
    """The configuration at which a quantity is largest.

    Attributes:
        quantity: Name of the quantity.
        joint: Name of its joint, or empty.
        unit: Unit of the values; empty for dimensionless ones.
        typical: Median over random states.
        random: Largest value over random states.
        searched: Largest value found by the search.
        minimal: Value at `state`, at least 0.9 of the largest.
        state: A state with few digits and few nonzero entries: q, v, a, tau by name.
        note: Further description.
    """

    quantity: str
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
        """Return the case with its values; `searched` is raised to `minimal` if that is larger."""
        sizes = {"typical": typical, "random": random, "searched": max(searched, minimal), "minimal": minimal}
        return replace(self, **sizes, state={name: x.tolist() for name, x in state.items()})

    @reported
    def is_worse_than_random(self) -> bool:
        """True if the search found a worse state than all random ones."""
        return self.searched > self.random


@final
@dataclass(frozen=True)
class Limit:
    """The smallest step, gain, speed or payload at which something fails.

    Attributes:
        kind: "step", "gain", "speed" or "payload".
        description: Description of the failure.
        joint: Name of the failing joint, or empty.
        value: The limit; inf without one.
        unit: Unit of the limit.
        within: Outcome at 0.98 of the limit.
        beyond: Outcome at 1.02 of the limit.
        confirmed: True if both outcomes were as predicted; None if there is nothing to confirm.
        state: State at which the limit holds, q and v by name.
        setups: Setups of the runs at 0.98 and 1.02 of the limit; empty without runs.
    """

    kind: str
    description: str
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
    """A random run whose error estimate was compared with a more accurate run.

    Attributes:
        description: Effects, control and method.
        duration_s: Duration, in [s].
        estimated: Estimated error of q, in [rad] or [m]; nan without an estimate.
        true: Largest distance from the more accurate run, up to the end of the estimate.
        unsure: Largest distance between two more accurate runs in this time.
        report: Report of the run about its error, or its outcome.
        misleads: True if there is no warning, and the estimate is below 0.3 of the true error.
        setup: Setup of the run.
    """

    description: str
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
    """The worst cases and limits of an arm, and cases in which the library failed to predict or report them.

    Attributes:
        robot: Name of the robot.
        joints: Names of the joints.
        worst: Worst configurations.
        limits: Limits of step, gain, speed and payload, checked at 0.98 and 1.02 of their values.
        runs: Random runs with checked error estimates.
        left_out: Omitted parts, with reasons.
        out_of_time: Names of parts that were not finished in time.
        environment: Versions and processor.
        samples: Number of random states.
        seed: Seed of the random generator.
        spent_s: Elapsed time, in [s].
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
        """Yield the failures, and a table for each kind of finding."""
        yield from (f"FAILURE: {failure}" for failure in self.failures)
        yield from [""] * bool(self.failures)
        for title, (part, columns) in _TABLES.items():
            rows = tuple(tuple(_cell(getattr(case, name)) for name in columns) for case in getattr(self, part))
            if rows:
                heading = tuple(_HEADINGS.get(str(name), str(name)) for name in columns)
                yield from (title, Table(heading, rows, right=_NUMBERS, wrap=True), "")
        yield from (f"not finished in time: {name}" for name in self.out_of_time)

    @reported
    def failures(self) -> tuple[str, ...]:
        """Failures of the library: refuted limits, and misleading runs."""
        refuted = (limit for limit in self.limits if limit.confirmed is False)
        misleading = (run for run in self.runs if run.misleads)
        return (
            *(
                f"{x.kind} {x.description}: {x.value:.4g} [{x.unit}] is refuted: {x.within}; {x.beyond}"
                for x in refuted
            ),
            *(
                f"run, {x.description}: estimated {x.estimated:.1e}, true {x.true:.1e}, without a warning"
                for x in misleading
            ),
        )

    @reported
    def ok(self) -> bool:
        """True if there are no failures."""
        return not self.failures

    @reported
    def sentence(self) -> str:
        """Number of failures and the worst case of each kind, in one sentence."""
        parts = []
        for quantity in dict.fromkeys(case.quantity for case in self.worst):
            top = max((case for case in self.worst if case.quantity == quantity), key=lambda case: case.searched)
            joint = f" ({top.joint})" if top.joint else ""
            parts.append(f"{quantity} up to {f'{top.searched:.3g} {top.unit}'.rstrip()}{joint}")
        checked = sum(limit.confirmed is not None for limit in self.limits) + len(self.runs)
        failed = len(self.failures)
        if late := len(self.out_of_time):
            parts.append(f"{late} not finished in time")
        return f"{self.robot}: {failed or 'no'} failure{'s' * (failed != 1)} in {checked} checks; {'; '.join(parts)}"


def _cell(x: Any) -> str:
    words: dict[Any, str] = {True: "yes", False: "no", None: ""}
    return number_or_dash(x, 4) if isinstance(x, float) else words.get(x, str(x))
