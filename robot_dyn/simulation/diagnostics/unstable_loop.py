"""Control loops that are unstable about states of a run, and runs that diverged because of one.

    sampled      δx⁺ = Φ(T) δx over a period T:   ρ(Φ) > 1, and more than the square of e^{T max Re λ} without sampling
    continuous   δx' = J δx:   max Re λ(J) > 0, and more than twice as fast as with the actuation held

A run may end before slow growth is visible. Growth explains a divergence at t if deviations grow by a factor of more
than 1e3 by then. Shorter steps compute such growth more accurately but do not stop it, so the remedy changes the loop.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import replace
from math import inf, log
from typing import NamedTuple

import numpy as np

from robot_dyn.foundations.coefficients import declared
from robot_dyn.foundations.errors import RobotDynError
from robot_dyn.foundations.sentences import stated
from robot_dyn.simulation.diagnostics.runaway import EXPLAINS
from robot_dyn.simulation.dynamics.sampled_loop import SampledLoop, linearised, remedy
from robot_dyn.simulation.dynamics.stability import after, below, periods, shown
from robot_dyn.simulation.observation.remarks import Remark, RemarkKind, line_parts
from robot_dyn.simulation.run.outcome import Ending, Outcome, Reason
from robot_dyn.simulation.setup.setup import Setup

_GAINS = ("kp", "ki", "kd")
_HALVINGS = 20  # number of times the gains are halved in search of a stable loop


def unstable(
    setup: Setup, t: np.ndarray, y: np.ndarray, runs_away: bool, remedies: bool = True, end: float | None = None
) -> Iterator[Remark]:
    """Yield a remark if the loop is unstable about the start, the middle or the end of a run, where states are finite.

    Args:
        setup: The setup of the run.
        t: Times of its samples, (m,), in [s].
        y: States of the loop there, (m, size).
        runs_away: True if the run diverged or reached an implausible speed. A continuous loop is examined only then:
            deviations may grow for a while along a correct motion.
        remedies: True to search for the period or the gains that are stable, which takes most of the time.
        end: Time reached, in [s]; None for the last finite sample, or for the whole run if there is one sample only.
    """
    if setup.controller is None or not (setup.equation.sampled or runs_away):
        return
    finite = np.flatnonzero(np.isfinite(y).all(axis=1))
    rows = sorted({int(k) for k in finite[[0, len(finite) // 2, -1]]}) if len(finite) else []
    if end is None:
        end = float(t[finite[-1]]) if len(t) > 1 and len(finite) else setup.duration_s
    for k in rows:  # only the first unstable one is reported: later states may be far from the motion
        if growing := growing_loop(setup, float(t[k]), y[k]):
            yield growing.remark(setup, remedies, end)
            return


class GrowingLoop(NamedTuple):
    """A loop in which deviations grow.

    Attributes:
        t: Time of the state it is linearised about, in [s].
        joint: Index of the joint with the largest part in the growing deviation.
        rate: Growth factor per period of a sampled loop, or growth rate of a continuous loop in [1/s].
        loop: Linearisation.
    """

    t: float
    joint: int
    rate: float
    loop: SampledLoop

    def remark(self, setup: Setup, remedies: bool, end: float) -> Remark:
        """Return the remark on this loop in a run up to time `end`, in [s]; with facts for a remedy if `remedies`."""
        assert setup.controller is not None
        period, joint, t = setup.controller.period_s, setup.plant.dynamics.joint_names[self.joint], self.t
        facts: dict[str, float | str]
        if period:
            over_the_run = shown(after(self.rate, periods(end, period)))
            facts = {"growth": shown(self.rate), "period_s": period, "over_run": over_the_run}
            facts |= self._other_period(period) if remedies else {}
        else:
            facts = _gains(setup, self.joint) | (self._lower_gains() if remedies else {})
        return Remark(RemarkKind.UNSTABLE, joint, "q", t, 0.0, t, self.rate, 1.0 if period else 0.0, facts=facts)

    def _other_period(self, period_s: float) -> dict[str, float | str]:
        """Return the facts for a remedy of a sampled loop: a longest period, or other gains if none helps."""
        if limit := self.loop.longest_period(period_s):
            return {"limit_s": limit, "shorter_s": below(limit)}
        continuous_rate = self.loop.continuous_growth_rate()
        limit = self.loop.longest_period_without_added_growth(period_s) if continuous_rate else 0.0
        if 0 < limit < inf:
            return {"continuous_rate": continuous_rate, "limit_s": limit, "shorter_s": below(limit)}
        return {"otherwise": remedy(continuous_rate)}

    def _lower_gains(self) -> dict[str, float | str]:
        """Return the largest part s = ½, ¼, … of the gains with A + s B K stable; empty if all are unstable."""
        A, closed = self.loop.A, self.loop.continuous
        if closed.shape == A.shape:
            for s in 0.5 ** np.arange(1, _HALVINGS + 1):
                if replace(self.loop, continuous=A + s * (closed - A)).continuous_growth_rate() == 0.0:
                    return {"stable_with": float(s)}
        return {}


def growing_loop(setup: Setup, t: float, y: np.ndarray) -> GrowingLoop | None:
    """Return the loop about a state y of a run if deviations grow there because of the control; otherwise None.

    If they also grow without it, for example in a falling arm, the control must make them grow twice as fast. Here,
    "without it" means continuous control for a sampled loop, and constant actuation for a continuous loop.
    """
    controller, equation, n = setup.controller, setup.equation, setup.plant.dynamics.n
    motion = equation.equation_of_motion
    if controller is None or equation.canonical:
        return None
    if motion.payloads or any(drive.coupled for drive in motion.drives.values()):  # no single linearisation is valid
        return None
    sampled, period = equation.sampled, controller.period_s
    size = controller.at_period(0.0).state_size
    z = np.zeros(size) if sampled else y[2 * n : 2 * n + size]
    first = 2 * n + equation.state_size
    x = np.concatenate([y[: 2 * n], z, y[first : first + motion.state_size]])
    with suppress(RobotDynError, np.linalg.LinAlgError, ValueError), np.errstate(all="ignore"):  # too far out
        loop = linearised(setup.plant, controller, t, x)
        if sampled:
            if not loop.adds_growth(period):
                return None
            values, vectors = np.linalg.eig(loop.matrix(period))
            worst = vectors[:, int(np.argmax(np.abs(values)))]
            return GrowingLoop(t, _joint(worst, n, period), loop.factor(period), loop)
        rate = loop.continuous_growth_rate()
        if not rate > 2 * replace(loop, continuous=loop.A).continuous_growth_rate():
            return None
        values, vectors = np.linalg.eig(loop.continuous)
        return GrowingLoop(t, _joint(vectors[:, int(np.argmax(np.real(values)))], n, 1 / rate), rate, loop)
    return None


def _joint(deviation: np.ndarray, n: int, time_s: float) -> int:
    """Return the index of the joint with the largest part in a deviation (δq, δv, …) that grows in `time_s`."""
    return int(np.argmax(np.abs(deviation[:n]) + time_s * np.abs(deviation[n : 2 * n])))


def _gains(setup: Setup, joint: int) -> dict[str, float | str]:
    """Return the gains of a joint, for example "kp = 2e+04 N m/rad"; empty for a law that declares none."""
    law, n = setup.controller, setup.plant.dynamics.n
    units = {name: gain.unit for name, gain in declared(type(law)).items() if name in _GAINS}
    values = {name: np.broadcast_to(getattr(law, name), (n,))[joint] for name in units}
    gains = ", ".join(f"{name} = {values[name]:.4g} {unit}" for name, unit in units.items())
    return {"gains": gains} if gains else {}


def explained(outcome: Outcome, setup: Setup, remarks: Iterable[Remark]) -> Outcome:
    """Return the outcome of a run; a remark on its step or loop that explains its divergence becomes the reason."""
    if outcome.ending is not Ending.DIVERGED:
        return outcome
    for remark in remarks:
        if remark.kind is RemarkKind.TOO_LONG:
            return _because(Reason.STEP_TOO_LONG, outcome.t, remark)
        if remark.kind is RemarkKind.UNSTABLE and setup.controller is not None:
            period = setup.controller.period_s
            log_growth = periods(outcome.t, period) * log(remark.value) if period else outcome.t * remark.value
            if log_growth > log(EXPLAINS):
                return _because(Reason.CONTROL_LOOP_UNSTABLE, outcome.t, remark)
    return outcome


def _because(reason: Reason, t: float, remark: Remark) -> Outcome:
    """Return the outcome of a run whose divergence a remark explains."""
    return Outcome(reason, t, remark.joint, stated(line_parts(remark.kind), remark.fields))
