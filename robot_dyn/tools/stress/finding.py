"""What a stress test finds: worst configurations, limits, and runs that were judged; each with what repeats it."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import final

from robot_dyn import Setup
from robot_dyn.foundations import UNREPORTED, reported


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
    within: str
    beyond: str
    confirmed: bool | None
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
