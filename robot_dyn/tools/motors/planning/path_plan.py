"""Analysis of a motion along a path by inverse dynamics: the limits that bind, and why none does at other times."""

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

CHECKED = 10_000  # number of times at which a motion is checked, in the middle of equal parts
BINDS = 0.99  # a limit binds if at least this share of it is used
_BRIEF = 2e-3  # fraction of the duration; shorter phases are not listed
KINDS = "torque", "velocity", "acceleration"


@final
@dataclass(frozen=True)
class Phase:
    """An interval of time, in [s], in which the limit of one kind and joint binds; both are "" if none does."""

    start_s: float
    end_s: float
    joint: str
    kind: str


@final
@dataclass(frozen=True)
class Binding:
    """The use of a limit: its largest share, and the share of time in which it binds, to 1 %."""

    joint: str
    kind: str
    limit: float
    largest: float
    binds: float


@final
@dataclass(frozen=True, eq=False, repr=False)
class PathPlan(Answer, Value):
    """The fastest motion along a path; pass `reference` to a controller.

    Attributes:
        plan: The motion, from rest to rest, with limits (torques times `fraction`) and findings.
        fraction: Fraction of the effort limits that the motion may use.
        largest: Largest torque, velocity or acceleration as a share of its limit; for torques, of `fraction` times it.
        at_limits: Share of the time in which at least one limit is reached to 1 %.
        elsewhere: Reasons why no limit binds in the rest of the time, with the share of time of each.
        bindings: Use of each finite limit.
        phases: Phases in the order of time, except phases shorter than 0.2 % of the duration.
        ratios: Torque as a share of its limit in 10 000 equal parts of the time, (10 000,), by joint.
    """

    plan: Plan
    fraction: float
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
    def duration_s(self) -> float:
        """Duration of the motion, in [s]."""
        return self.plan.duration_s

    @property
    def findings(self) -> tuple[str, ...]:
        """Findings about doubtful parts, with remedies."""
        return self.plan.findings

    def blocks(self) -> Iterator[Block]:
        yield f"{self.plan.arm}: {self.plan.method}: {self.duration_s:.6g} s from rest to rest"
        yield f"at a limit for {self.at_limits:.2%} of the time; largest share of a limit {self.largest:.5f}"
        yield from (f"elsewhere, {part:.2%}: {why}" for why, part in self.elsewhere.items())
        rows = tuple((x.joint, x.kind, x.limit, x.largest, f"{x.binds:.1%}") for x in self.bindings)
        yield Table(("joint", "limit of", "value", "largest share", "binds"), rows, digits=4, right=("binds",))
        yield from (f"finding: {finding}" for finding in self.findings)

    @property
    def drawing(self) -> str:
        return plot("torque, as a share of its limit,", checked_times(self.duration_s), self.ratios) + legend(
            self.ratios
        )


@final
@dataclass(frozen=True, eq=False)
class LimitUse:
    """Signed shares of the limits of torque, velocity and acceleration, (m, n), at times t, (m,)."""

    t: np.ndarray
    shares: tuple[np.ndarray, np.ndarray, np.ndarray]

    @property
    def largest(self) -> np.ndarray:
        """The largest absolute share at each time, (m,)."""
        return np.abs(np.concatenate(self.shares, axis=-1)).max(axis=-1)


def limit_use(plant: Plant, limits: Limits, motion: PiecewisePolynomial, t: np.ndarray) -> LimitUse:
    """Compute the shares of a plant's limits that a motion uses, by inverse dynamics."""
    q, v, a = motion.at(t)
    tau = plant.inverse_dynamics(q, v, a, t=0.0)
    tau += 0.0 if limits.gear is None else limits.gear.loss(tau, v, a)
    torque = tau / limits.effort if limits.line is None else np.copysign(limits.used(tau, v), tau)
    return LimitUse(t, (torque, v / limits.velocity, a / limits.acceleration))


def checked_times(duration: float) -> np.ndarray:
    """Return the times at which a motion is checked, (10 000,), in [s]."""
    return (np.arange(CHECKED) + 0.5) * duration / CHECKED


def bindings(use: LimitUse, limits: Limits, joint_names: tuple[str, ...]) -> Iterator[Binding]:
    """Yield each finite limit with the share that the motion uses."""
    values = limits.effort, limits.velocity, limits.acceleration
    for kind, share, limit in zip(KINDS, use.shares, values, strict=True):
        for i, name in enumerate(joint_names):
            if np.isfinite(limit[i]):
                used = np.abs(share[:, i])
                yield Binding(name, kind, float(limit[i]), float(used.max()), float((used >= BINDS).mean()))


def phases(use: LimitUse, joint_names: tuple[str, ...]) -> Iterator[Phase]:
    """Yield the intervals in which a limit binds to 1 %; if several bind, the one with the largest share."""
    n, all_shares = len(joint_names), np.abs(np.concatenate(use.shares, axis=-1))
    binding = np.where(use.largest >= BINDS, np.argmax(all_shares, axis=-1), -1).tolist()
    part, k = float(use.t[0] * 2), 0
    for limit, group in groupby(binding):
        start, k = k, k + len(list(group))
        if k - start > _BRIEF * len(binding):
            joint, kind = ("", "") if limit < 0 else (joint_names[limit % n], KINDS[limit // n])
            yield Phase(start * part, k * part, joint, kind)


def elsewhere(use: LimitUse, breaks: np.ndarray) -> dict[str, float]:
    """Return reasons why no limit binds, with the share of time; the last reason is unknown."""
    free = use.largest < BINDS
    cell = np.searchsorted(breaks, use.t, side="right") - 1
    bound = np.zeros(len(breaks) + 1, dtype=bool)  # cells in which a limit binds, with one more at either end
    bound[cell[~free] + 1] = True
    at_ends = (cell == 0) | (cell == len(breaks) - 2)
    next_to = bound[cell] | bound[cell + 1] | bound[cell + 2]
    reasons = {
        "in the first or last piece of the motion, at rest at one end": free & at_ends,
        "in a piece in which another limit takes over: the acceleration along the path is constant in each": free
        & ~at_ends
        & next_to,
        "no reason known": free & ~at_ends & ~next_to,
    }
    return {why: float(where.mean()) for why, where in reasons.items() if where.any()}
