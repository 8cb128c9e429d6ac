"""Whether the loop of a sampled controller is unstable about states of a run, and whether a run diverged for that.

    δx⁺ = Φ(T) δx over a period T:   ρ(Φ) > 1, and more than the square of e^{T max Re λ} under control at all times

Slow growth may end before it shows. It explains a divergence at t if ρ(Φ)^(t/T) > 1e3: shorter steps follow such growth
more closely, and do not end it, so that the advice is then that on the loop.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import replace
from math import inf, log
from typing import NamedTuple

import numpy as np

from robot_dyn.foundations.errors import RobotDynError
from robot_dyn.simulation.dynamics.sampled_loop import SampledLoop, linearised, remedy
from robot_dyn.simulation.dynamics.stability import after, below, periods, shown
from robot_dyn.simulation.observation.remarks import Remark, RemarkKind, remark_lines
from robot_dyn.simulation.run.outcome import Ending, Outcome
from robot_dyn.simulation.setup.setup import Setup

_EXPLAINS = 1e3  # growth of deviations


def unstable(setup: Setup, t: np.ndarray, y: np.ndarray) -> Iterator[Remark]:
    """A remark if the loop is unstable about the start, the middle or the end of a run, as far as it is finite there.

    Args:
        setup: What ran.
        t: Times of its samples, (m,), in [s].
        y: Its states there, (m, size).
    """
    good = np.flatnonzero(np.isfinite(y).all(axis=1))
    looks = sorted({int(k) for k in good[[0, len(good) // 2, -1]]}) if len(good) else []
    for k in looks:  # the first of them: later ones may be far out
        if found := growing(setup, float(t[k]), y[k]):
            yield _remark(setup, found)
            return


class Growing(NamedTuple):
    """A loop in which deviations grow: the time, the joint, the factor in each period, and its linearisation."""

    t: float
    joint: str
    factor: float
    loop: SampledLoop

    def remedy(self, period_s: float) -> str:
        """What to do about it."""
        if limit := self.loop.longest_period(period_s):
            return f"the loop is stable up to {limit:.3g} s: take period_s={below(limit)}, or lower gains"
        anyway = self.loop.grows_anyway()
        limit = self.loop.longest_that_adds_none(period_s) if anyway else 0.0
        if 0 < limit < inf:
            slower = f"under control at all times they grow, too, at {anyway:.3g} per second"
            return f"{slower}; sampling adds to that beyond {limit:.3g} s: take period_s={below(limit)}, or lower gains"
        return f"so it is with every period: take {remedy(anyway)}"


def growing(setup: Setup, t: float, y: np.ndarray) -> Growing | None:
    """The loop about a state y of a run, if it is sampled and deviations grow there because it is; otherwise None.

    Where they grow under control at all times too, as of an arm that falls, that is if they grow twice as fast.
    """
    controller, equation, n = setup.controller, setup.equation, setup.plant.dynamics.n
    motion = equation.equation_of_motion
    if controller is None or not equation.sampled or equation.canonical:
        return None
    if motion.payloads or any(drive.coupled for drive in motion.drives.values()):  # no one linearisation holds
        return None
    z, first, period = np.zeros(controller.at_period(0.0).state_size), 2 * n + equation.state_size, controller.period_s
    x = np.concatenate([y[: 2 * n], z, y[first : first + motion.state_size]])
    with suppress(RobotDynError, np.linalg.LinAlgError, ValueError), np.errstate(all="ignore"):  # too far out
        loop = linearised(setup.plant, controller, t, x)
        if not loop.adds_growth(period):
            return None
        factor = loop.factor(period)
        values, vectors = np.linalg.eig(loop.matrix(period))
        worst = vectors[:, int(np.argmax(np.abs(values)))]
        part = np.abs(worst[:n]) + period * np.abs(worst[n : 2 * n])
        return Growing(t, setup.plant.dynamics.joint_names[int(np.argmax(part))], factor, loop)
    return None


def _remark(setup: Setup, found: Growing) -> Remark:
    assert setup.controller is not None
    period, joint, t = setup.controller.period_s, found.joint, found.t
    text = (
        f"{joint} by {shown(found.factor)} in each period of {period:.4g} s about the state at {t:.4g} s, by"
        f" {shown(after(found.factor, periods(setup.duration_s, period)))} over the run"
    )
    return Remark(RemarkKind.UNSTABLE, joint, "q", t, 0.0, t, found.factor, 1.0, text, found.remedy(period))


def explained(outcome: Outcome, setup: Setup, remarks: Iterable[Remark]) -> Outcome:
    """The outcome of a run; if it diverged and a remark on its loop explains it, with that as advice."""
    if outcome.ending is not Ending.DIVERGED or setup.controller is None:
        return outcome
    for remark in remarks:
        if remark.kind is RemarkKind.UNSTABLE:
            elapsed = periods(outcome.t, setup.controller.period_s)
            if elapsed * log(remark.value) > log(_EXPLAINS):
                return replace(outcome, advice=remark_lines([remark])[0])
    return outcome
