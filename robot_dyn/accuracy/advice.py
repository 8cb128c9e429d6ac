"""Advice on step and control period: linear stability at states of a motion, and the error to expect.

Stability is a property of the method and of the loop, not of the duration; the growth of deviations over the run is
reported separately. The Jacobian J and the linearised sampled loop are evaluated at the fastest states of a pilot run
with continuous control. A motion away from these states may be stable with longer steps, or unstable with shorter ones.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field, replace
from math import exp, inf, isfinite
from typing import Unpack, final

import numpy as np

from robot_dyn.effects.joint_limit import JointStopSpring
from robot_dyn.effects.plant import Plant
from robot_dyn.foundations.answer import Answer, Block, Table
from robot_dyn.foundations.arithmetic import Array
from robot_dyn.foundations.errors import QueryError, RobotDynError, escaped
from robot_dyn.foundations.result import UNREPORTED, reported
from robot_dyn.foundations.validate import JointValues
from robot_dyn.integrate.integrator import Integrator
from robot_dyn.integrate.methods import FIXED_STEP, method
from robot_dyn.queries.dynamics import Dynamics
from robot_dyn.queries.units import joint_units
from robot_dyn.simulation.dynamics.fastest_motion import Fastest, fastest, jacobian
from robot_dyn.simulation.dynamics.sampled_loop import continuous_form, linearised, remedy
from robot_dyn.simulation.dynamics.stability import (
    LARGEST,
    Stability,
    after,
    below,
    excess_rate,
    longest_step,
    periods,
    shown,
    worst,
)
from robot_dyn.simulation.dynamics.state_equation import StateEquation
from robot_dyn.simulation.results.error_estimate import Verdict
from robot_dyn.simulation.results.provenance import joint_types
from robot_dyn.simulation.results.trajectory import Trajectory
from robot_dyn.simulation.run.outcome import Ending
from robot_dyn.simulation.setup.options import Options, setup_of, starts, takes_options
from robot_dyn.simulation.setup.setup import Setup
from robot_dyn.simulation.simulate import simulate

_PILOT_STATES = 9  # along the pilot run
_FAST_STATES = 3  # number of these states, the fastest ones, at which limits are computed
_MAX_STEPS = 200_000  # in a run for the error estimate
_MAX_GROWTH = 1e3  # largest growth of deviations over such a run

State = tuple[float, Array]  # t and y


@final
@dataclass(frozen=True, eq=False, repr=False)
class Advice(Answer):
    """Stability limits of the step and the control period of a setup, and the error to expect.

    Attributes:
        method: The method of the setup.
        step_s: Longest step of the method, in [s]; 0 if the method chooses its steps.
        fastest: The fastest motion along the pilot run, with joint and source.
        at_s: Time of that motion, in [s].
        limits: Longest stable step of the setup's method and of every other fixed-step method, in [s]; inf if every
            step is stable.
        period_s: Period of the sampled control, in [s]; 0 without sampled control.
        longest_period_s: The period up to which the loop is stable, in [s]. It is 0 if no period is stable; inf if
            every period is, or without sampled control.
        at_period: Stability of the loop at its period. This period may be stable although a shorter one is not.
        period_growth: Spectral radius: the asymptotic growth factor of deviations per period; 1 without sampled
            control.
        continuous_growth_rate: Growth rate of deviations under the same control in continuous time, in [1/s]; 0 if
            they decay.
        growth: Factor by which deviations grow over the run because steps or periods are too long.
        run: The run of the setup with its error estimate; None if deviations would grow a thousandfold, or the run
            has too many steps.
    """

    method: str
    step_s: float
    fastest: Fastest
    at_s: float
    limits: dict[str, float]
    period_s: float
    longest_period_s: float
    at_period: Stability = Stability.STABLE
    period_growth: float = 1.0
    continuous_growth_rate: float = 0.0
    growth: float = 1.0
    run: Trajectory | None = field(default=None, metadata=UNREPORTED)

    @reported
    def stable(self) -> bool:
        """True if the step is within its limit and deviations do not grow at the control period."""
        return self.step_s <= self.limits.get(self.method, inf) and self.at_period is not Stability.UNSTABLE

    @reported
    def text(self) -> str:
        """Step, control period, growth over the run, error and fastest motion, one line each."""
        parts = [self._of_step(), *self._of_period(), *self._of_growth(), self._of_error()]
        return "\n".join(map(escaped, [*parts, f"{self.fastest}, at {self.at_s:.3g} s"]))

    def blocks(self) -> Iterator[Block]:
        yield from self.text.split("\n")
        rows = tuple((name, f"{h:.3g}" if isfinite(h) else "any") for name, h in self.limits.items())
        yield Table(("method", "longest stable step [s]"), rows, right=("longest stable step [s]",))

    @property
    def drawing(self) -> str:
        from robot_dyn.foundations.display import levels

        return levels("longest stable step [s]; dashed: the step of the setup", self.limits, self.step_s)

    @reported
    def error(self) -> float | None:
        """Largest estimated error of q over the run; inf if the estimate ends before the run, None without one."""
        return None if self.run is None or self.run.error is None else self.run.error.largest

    @reported
    def error_verdict(self) -> Verdict | None:
        """Verdict on the error estimate; None without one."""
        return None if self.run is None or self.run.error is None else self.run.error.verdict

    def _of_step(self) -> str:
        limit = self.limits.get(self.method, inf)
        if not self.step_s:
            return f"method {self.method}: error control keeps the steps stable"
        if not isfinite(limit):
            return f"step {self.step_s:.3g} s: stable; {self.method} is stable here at every step"
        if self.step_s <= limit:
            return f"step {self.step_s:.3g} s: stable; {self.method} is stable up to {limit:.3g} s"
        best = max(FIXED_STEP, key=lambda name: (min(self.limits[name], 2 * self.step_s), method(name).order))
        other = f", or method={best!r}" if self.limits[best] >= self.step_s else ""
        return (
            f"step {self.step_s:.3g} s: unstable; {self.method} is stable up to {limit:.3g} s: use"
            f" step_s={below(limit)}{other}"
        )

    def _of_period(self) -> Iterator[str]:
        if not self.period_s:
            return
        limit, unstable = self.longest_period_s, self.at_period is Stability.UNSTABLE
        marginal = self.at_period is Stability.MARGINAL
        if unstable and not limit:
            verdict = f"; no period is stable: use {remedy(self.continuous_growth_rate)}"
        elif unstable:
            verdict = f"; the loop is stable up to {limit:.3g} s: use period_s={below(limit)}, or lower gains"
        elif self.period_s > limit:
            verdict = f"; some shorter periods are unstable: the loop is stable up to {limit:.3g} s"
        else:
            verdict = f"; the loop is stable up to {limit:.3g} s" if isfinite(limit) else "; every period is stable"
        if marginal and self.period_s <= limit:
            verdict = (
                f"; no deviation grows for periods up to {limit:.3g} s"
                if isfinite(limit)
                else "; no deviation grows at any period"
            )
        cause = (
            ", because some deviations neither decay nor grow, for example at a joint held by dry friction" * marginal
        )
        yield f"control period {self.period_s:.3g} s: {self.at_period}{cause}{verdict}"

    def _of_growth(self) -> Iterator[str]:
        if not self.stable:
            per_period = f", by {shown(self.period_growth)} in each period" * (self.at_period is Stability.UNSTABLE)
            yield f"deviations grow by a factor of {shown(self.growth)} over this run{per_period}"

    def _of_error(self) -> str:
        if self.run is None:
            return "expected error: not estimated, because deviations grow too fast or the run has too many steps"
        end = self.run.outcome
        if end.ending is not Ending.FINISHED:
            return f"the run {end.ending} at {end.t:.3g} s: {end.text}"
        unit = joint_units("q", joint_types(self.run))
        return f"expected error of q [{unit}]: {self.run.error}"


@takes_options
def advise(
    system: Setup | Plant | Dynamics,
    q0: JointValues | None = None,
    v0: JointValues | None = None,
    **options: Unpack[Options],
) -> Advice:
    """Report whether the step and the control period of a setup are short enough, and estimate the error.

    Args:
        system: A setup, or a plant or robot with a start, see `simulate`.
        q0: Initial position, (n,), in [rad] or [m] by joint; required unless `system` is a setup.
        v0: Initial velocity, (n,), in [rad/s] or [m/s]; by default that of the setup, or 0.
        **options: Options of the setup, see `simulate`.

    Raises:
        QueryError: If the setup is not allowed, or its motion cannot be linearised at any state of the pilot run.
    """
    setup = setup_of("advise", system, {**starts(q0, v0), **options})
    advice = advice_about(setup, _pilot_states)
    worthwhile = advice.growth < _MAX_GROWTH and (setup.method.controls_error or setup.steps <= _MAX_STEPS)
    return replace(advice, run=simulate(replace(setup, estimate_error=True))) if worthwhile else advice


def advice_about(setup: Setup, states_of: Callable[[Setup, StateEquation], list[State]]) -> Advice:
    """Return the advice on a setup without an error estimate.

    Args:
        setup: The setup.
        states_of: Function of the setup and of its state equation with continuous control. It returns the times and
            states y at which to linearise.

    Raises:
        QueryError: If the motion cannot be linearised at any of the states.
    """
    plant, controller, duration = setup.plant, setup.controller, setup.duration_s
    if plant.equation_of_motion.payloads:
        raise QueryError("advise: carried_payload changes the bodies during the run; use plant.at(t), with t in s")
    if coupled := [x.name for x in plant.equation_of_motion.drives.values() if x.coupled]:
        raise QueryError(f"advise: {coupled[0]} couples and releases motors in turn; no single linearisation is valid")
    period = 0.0 if controller is None else controller.period_s
    continuous = None if controller is None else continuous_form(controller, 0.0, setup.q0, setup.v0)
    loop = StateEquation(plant, continuous).in_a_mode
    motion, at, states = _fastest(loop, states_of(setup, loop))
    matrices = [_between_ticks(plant, loop, t, y) if period else jacobian(loop, t, y, None) for t, y in states]
    n, chosen = plant.dynamics.n, setup.method
    methods = {name: method(name) for name in FIXED_STEP}
    step, own_rates = 0.0, []
    if isinstance(chosen, Integrator):
        methods |= {chosen.name: chosen}
        step, own_rates = setup.taken_step_s, [excess_rate(chosen, J, n) for J in matrices]
    limits = {name: min(longest_step(candidate, J, n) for J in matrices) for name, candidate in methods.items()}
    law = controller if period else None
    loops = [] if law is None else [linearised(plant, law, t, _without_works(loop, y)) for t, y in states]
    factors = [after(sampled.factor(period), periods(duration, period)) for sampled in loops]
    factors += [exp(min(max(0.0, rate(step)) * duration, LARGEST)) for rate in own_rates]
    return Advice(
        method=chosen.name,
        step_s=step,
        fastest=motion,
        at_s=at,
        limits=limits,
        period_s=period,
        longest_period_s=min((loop.longest_period(period) for loop in loops), default=inf),
        at_period=worst(loop.growth(period) for loop in loops).verdict if loops else Stability.STABLE,
        period_growth=max((loop.factor(period) for loop in loops), default=1.0),
        continuous_growth_rate=max((loop.continuous_growth_rate() for loop in loops), default=0.0),
        growth=max(1.0, *factors, 1.0),
    )


def at_rest(setup: Setup, loop: StateEquation) -> list[State]:
    """Return the initial state alone, which suffices if it is an equilibrium."""
    return [(0.0, loop.start(setup.q0, setup.v0))]


def _pilot_states(setup: Setup, loop: StateEquation) -> list[State]:
    """Return times and states y along a run with continuous control."""
    run = simulate(
        Setup(
            setup.plant, setup.q0, setup.v0, duration_s=setup.duration_s, controller=loop.controller,
            engine=setup.engine, record_every_s=setup.duration_s / (_PILOT_STATES - 1), estimate_error=False,
        )
    )  # fmt: skip
    z = [] if run.controller_states is None else [run.controller_states]
    y = np.zeros((len(run.t), loop.size))
    recorded = np.hstack([run.q, run.v, *z, *run.effect_states.values()])
    y[:, : recorded.shape[1]] = recorded
    finite = np.isfinite(y).all(axis=1)
    states = list(zip(run.t[finite].tolist(), y[finite], strict=True))
    return [*states, *_in_stops(setup.plant, run, states)]


def _in_stops(plant: Plant, run: Trajectory, states: list[State]) -> Iterator[State]:
    """Return states with a joint at its deepest penetration of a soft stop, which lies between the samples."""
    lowest, highest = (np.zeros(plant.dynamics.n),) * 2 if run.extremes is None else run.extremes[0]
    for stop in plant.effects:
        if isinstance(stop, JointStopSpring):
            for extreme, beyond in ((lowest, lowest < stop.lower), (highest, highest > stop.upper)):
                for i in np.flatnonzero(beyond):
                    t, y = min(states, key=lambda state, i=i, extreme=extreme: abs(state[1][i] - extreme[i]))
                    yield t, np.where(np.arange(len(y)) == i, extreme[i], y)


def _without_works(equation: StateEquation, y: Array) -> Array:
    """Return (q, v, z), the state y without the works."""
    return y[: len(y) - len(equation.sources)]


def _between_ticks(plant: Plant, loop: StateEquation, t: float, y: Array) -> Array:
    """Return J for constant actuation, as between two ticks."""
    free, n, z = StateEquation(plant, None).in_a_mode, plant.dynamics.n, loop.state_size
    bodies = np.concatenate([y[: 2 * n], _without_works(loop, y)[2 * n + z :], np.zeros(len(free.sources))])
    return jacobian(free, t, bodies, np.zeros(n))


def _fastest(equation: StateEquation, states: list[State]) -> tuple[Fastest, float, list[State]]:
    """Return the fastest motion at some states, its time, and the few states of fastest motion."""
    motions: list[tuple[Fastest, float, Array]] = []
    for t, y in states:
        with suppress(RobotDynError, np.linalg.LinAlgError):
            motions.append((fastest(equation, t, y, None), t, y))
    if not motions:
        raise QueryError("the motion cannot be linearised at any state of the pilot run; use a shorter run")
    motions.sort(key=lambda motion: -abs(motion[0].eigenvalue))
    return *motions[0][:2], [motion[1:] for motion in motions[:_FAST_STATES]]
