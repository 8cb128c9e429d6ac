"""A motion at its limits, judged by the inverse dynamics of its plant: which limit binds, when, and where none does."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import groupby
from typing import final

import numpy as np

from robot_dyn import Plant
from robot_dyn.control import PiecewisePolynomial, Plan
from robot_dyn.foundations import UNREPORTED, Answer, Block, Table, Value, legend, plot, read_only
from robot_dyn.tools.motors.limits import Limits

JUDGED = 10_000  # times of a motion, in the middle of as many equal parts of it
BINDS = 0.99  # of a limit
_BRIEF = 2e-3  # of the duration: shorter phases are not listed
KINDS = "torque", "velocity", "acceleration"


@final
@dataclass(frozen=True)
class Phase:
    """From one time to another, in [s], one limit binds: that of a kind, of a joint; "" where none does."""

    start: float
    end: float
    joint: str
    kind: str


@final
@dataclass(frozen=True)
class Binding:
    """How much of a limit is used: its greatest share, and the share of time in which it binds, to 1 %."""

    joint: str
    kind: str
    limit: float
    largest: float
    binds: float


@final
@dataclass(frozen=True, eq=False, repr=False)
class PathPlan(Answer, Value):
    """The fastest motion along a path; `reference` is what controllers follow.

    Attributes:
        plan: The motion, from rest to rest, its limits, torques with `share`, and findings.
        share: Of the effort limits that it may take.
        largest: Greatest torque, velocity or acceleration, as a share of its limit; for torques of `share` times it.
        at_limits: Share of the time in which at least one is within 1 % of it.
        elsewhere: Why none is in the rest of the time, with the share of each reason.
        bindings: Each limit that is finite.
        phases: In the order of time, but for those shorter than 0.2 % of the duration.
        ratios: Torque as a share of its limit in 10 000 equal parts of the time, (10 000,) by joint.
    """

    plan: Plan
    share: float
    largest: float
    at_limits: float
    elsewhere: dict[str, float]
    bindings: tuple[Binding, ...]
    phases: tuple[Phase, ...]
    ratios: dict[str, np.ndarray] = field(metadata=UNREPORTED)

    def __post_init__(self) -> None:
        read_only(self)

    @property
    def reference(self) -> PiecewisePolynomial:
        """The motion q(t)."""
        return self.plan.reference

    @property
    def duration(self) -> float:
        """Of the motion, in [s]."""
        return self.plan.duration

    @property
    def findings(self) -> tuple[str, ...]:
        """What is doubtful in it, each with its remedy."""
        return self.plan.findings

    def blocks(self) -> Iterator[Block]:
        yield f"{self.plan.arm}: {self.plan.method}: {self.duration:.6g} s from rest to rest"
        yield f"at a limit for {self.at_limits:.2%} of the time; largest share of a limit {self.largest:.5f}"
        yield from (f"elsewhere, {each:.2%}: {why}" for why, each in self.elsewhere.items())
        rows = tuple((x.joint, x.kind, x.limit, x.largest, f"{x.binds:.1%}") for x in self.bindings)
        yield Table(("joint", "limit of", "value", "largest share", "binds"), rows, digits=4, right=("binds",))
        yield from (f"finding: {each}" for each in self.findings)

    @property
    def drawing(self) -> str:
        return plot("torque, as a share of its limit,", judged_times(self.duration), self.ratios) + legend(self.ratios)


@final
@dataclass(frozen=True, eq=False)
class Judgement:
    """Shares of limits at times t, (m,): of torque, velocity and acceleration, each (m, n), signed."""

    t: np.ndarray
    shares: tuple[np.ndarray, np.ndarray, np.ndarray]

    @property
    def most(self) -> np.ndarray:
        """The greatest share at each time, (m,)."""
        return np.abs(np.concatenate(self.shares, axis=-1)).max(axis=-1)


def judged(plant: Plant, limits: Limits, motion: PiecewisePolynomial, t: np.ndarray) -> Judgement:
    """What a motion takes of the limits of a plant, by its inverse dynamics."""
    q, v, a = motion.at(t)
    tau = plant.inverse_dynamics(0.0, q, v, a)
    return Judgement(t, (tau / limits.effort, v / limits.velocity, a / limits.acceleration))


def judged_times(duration: float) -> np.ndarray:
    """The times at which a motion is judged, (10 000,), in [s]."""
    return (np.arange(JUDGED) + 0.5) * duration / JUDGED


def bindings(found: Judgement, limits: Limits, joint_names: tuple[str, ...]) -> Iterator[Binding]:
    """Each limit that is finite, with the share that the motion takes of it."""
    values = limits.effort, limits.velocity, limits.acceleration
    for kind, share, limit in zip(KINDS, found.shares, values, strict=True):
        for i, name in enumerate(joint_names):
            if np.isfinite(limit[i]):
                each = np.abs(share[:, i])
                yield Binding(name, kind, float(limit[i]), float(each.max()), float((each >= BINDS).mean()))


def phases(found: Judgement, joint_names: tuple[str, ...]) -> Iterator[Phase]:
    """Which limit binds when: the nearest one, where one is within 1 %."""
    n, all_of = len(joint_names), np.abs(np.concatenate(found.shares, axis=-1))
    which = np.where(found.most >= BINDS, np.argmax(all_of, axis=-1), -1).tolist()
    part, k = float(found.t[0] * 2), 0
    for limit, group in groupby(which):
        start, k = k, k + len(list(group))
        if k - start > _BRIEF * len(which):
            joint, kind = ("", "") if limit < 0 else (joint_names[limit % n], KINDS[limit // n])
            yield Phase(start * part, k * part, joint, kind)


def elsewhere(found: Judgement, breaks: np.ndarray) -> dict[str, float]:
    """Why no limit binds, with the share of time: what is not said otherwise has no reason that is known."""
    free = found.most < BINDS
    cell = np.searchsorted(breaks, found.t, side="right") - 1
    bound = np.zeros(len(breaks) + 1, dtype=bool)  # cells in which a limit binds, with one more at either end
    bound[cell[~free] + 1] = True
    at_ends = (cell == 0) | (cell == len(breaks) - 2)
    beside = bound[cell] | bound[cell + 1] | bound[cell + 2]
    reasons = {
        "in the first or last piece of the motion, at rest at one end": free & at_ends,
        "in a piece in which another limit takes over: the acceleration along the path is constant in each": free
        & ~at_ends
        & beside,
        "no reason known": free & ~at_ends & ~beside,
    }
    return {why: float(where.mean()) for why, where in reasons.items() if where.any()}
