"""Whether steps are short enough: stability about states of a motion, and the error to expect.

It is that of the method and of the loop, however short the run: by how much deviations grow over it is said beside.
J, and the derivatives of a sampled loop, are taken at the fastest of some states along a pilot run with control at all
times; a motion that leaves them behind may be stable with longer steps, or unstable with shorter ones.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field, replace
from math import exp, inf, isfinite
from typing import Any, Unpack, final

import numpy as np

from robot_dyn.effects.joint_limit import JointStopSpring
from robot_dyn.effects.plant import Plant
from robot_dyn.foundations.answer import Answer, Block, Table
from robot_dyn.foundations.arithmetic import Array
from robot_dyn.foundations.errors import QueryError, RobotDynError, escaped
from robot_dyn.foundations.result import UNREPORTED, reported
from robot_dyn.integrate.methods import FIXED_STEP, method
from robot_dyn.queries.dynamics import Dynamics
from robot_dyn.queries.units import joint_units
from robot_dyn.simulation.dynamics.fastest_motion import Fastest, fastest, jacobian
from robot_dyn.simulation.dynamics.sampled_loop import linearised, remedy
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

_LOOKS = 9  # states along the pilot run
_FAST = 3  # of them, where motion is fastest: limits are looked for there
_MOST_STEPS = 200_000  # of a run that is made for its error estimate
_BEARS = 1e3  # growth of deviations over such a run

State = tuple[float, Array]  # t and y


@final
@dataclass(frozen=True, eq=False, repr=False)
class Advice(Answer):
    """What may be expected of a setup.

    Attributes:
        method: The method of the setup.
        step_s: Its longest step, in [s]; 0 if it chooses its steps.
        fastest: The fastest motion along a pilot run, with joint and source.
        at: When it was met, in [s].
        limits: Longest stable step of the setup's method and each other of fixed step, in [s]; inf where every step is.
        period_s: Period of the sampled control, in [s]; 0 without.
        longest_period_s: The period up to which the loop is stable, in [s]; 0 if it is stable at
            none, inf if at every one, or without sampled control.
        at_period: What the loop is at its own period, which may be stable though a shorter one is not.
        period_growth: Spectral radius: the factor by which deviations grow in each period in the long run; 1 without.
        grows_anyway: Rate at which they grow under the same control at all times, in [1/s]; 0 if they do not.
        growth: Factor by which they grow over the run, by steps or periods that are too long.
        run: The run of the setup with its error estimate; None if deviations grow a thousandfold in it, or it has too
            many steps.
    """

    method: str
    step_s: float
    fastest: Fastest
    at: float
    limits: dict[str, float]
    period_s: float
    longest_period_s: float
    at_period: Stability = Stability.STABLE
    period_growth: float = 1.0
    grows_anyway: float = 0.0
    growth: float = 1.0
    run: Trajectory | None = field(default=None, metadata=UNREPORTED)

    @reported
    def stable(self) -> bool:
        """Whether the step is within its limit, and deviations do not grow at the period."""
        return self.step_s <= self.limits.get(self.method, inf) and self.at_period is not Stability.UNSTABLE

    @reported
    def text(self) -> str:
        """A line for each thing: the step, the period, growth over the run, the error, the fastest motion."""
        parts = [self._of_step(), *self._of_period(), *self._of_growth(), self._of_error()]
        return "\n".join(map(escaped, [*parts, f"{self.fastest}, at {self.at:.3g} s"]))

    def blocks(self) -> Iterator[Block]:
        yield from self.text.split("\n")
        rows = tuple((name, f"{h:.3g}" if isfinite(h) else "every step") for name, h in self.limits.items())
        yield Table(("method", "stable up to a step of [s]"), rows, right=("stable up to a step of [s]",))

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
        """What it rests on."""
        return None if self.run is None or self.run.error is None else self.run.error.verdict

    def _of_step(self) -> str:
        limit = self.limits.get(self.method, inf)
        if not self.step_s:
            return f"{self.method} chooses its steps, so that none is unstable for long"
        if not isfinite(limit):
            return f"step {self.step_s:.3g} s: stable, as every step of {self.method} is here"
        if self.step_s <= limit:
            return f"step {self.step_s:.3g} s: stable; {self.method} is up to {limit:.3g} s"
        best = max(FIXED_STEP, key=lambda name: (min(self.limits[name], 2 * self.step_s), method(name).order))
        other = f", or method={best!r}" if self.limits[best] >= self.step_s else ""
        return (
            f"step {self.step_s:.3g} s: unstable; {self.method} is stable up to {limit:.3g} s: take"
            f" step_s={below(limit)}{other}"
        )

    def _of_period(self) -> Iterator[str]:
        if not self.period_s:
            return
        limit, unstable = self.longest_period_s, self.at_period is Stability.UNSTABLE
        if unstable and not limit:
            to = f", as every period is: take {remedy(self.grows_anyway)}"
        elif unstable:
            to = f"; the loop is stable up to {limit:.3g} s: use period_s={below(limit)}, or lower gains"
        elif self.period_s > limit:
            to = f"; but not every shorter one: the loop is stable up to {limit:.3g} s"
        else:
            to = f"; the loop is up to {limit:.3g} s" if isfinite(limit) else "; as every period is here"
        between = ", some deviations neither decay nor grow" * (self.at_period is Stability.MARGINAL)
        yield f"control period {self.period_s:.3g} s: {self.at_period}{between}{to}"

    def _of_growth(self) -> Iterator[str]:
        if not self.stable:
            each = f", by {shown(self.period_growth)} in each period" * (self.at_period is Stability.UNSTABLE)
            yield f"over this run deviations grow by {shown(self.growth)}{each}"

    def _of_error(self) -> str:
        if self.run is None:
            return "error to expect: not estimated for a run in which deviations grow so, or of too many steps"
        end = self.run.outcome
        if end.ending is not Ending.FINISHED:
            return f"the run {end.ending} at {end.t:.3g} s: {end.text}"
        unit = joint_units("q", joint_types(self.run))
        return f"error of q [{unit}] to expect: {self.run.error}"


@takes_options
def advise(what: Setup | Plant | Dynamics, q0: Any = None, v0: Any = None, **options: Unpack[Options]) -> Advice:
    """Whether the step of a setup and the period of its control are short enough, and what error to expect.

    Args:
        what: What to run, as of `simulate`.
        q0: Position at the start, (n,), in [rad] or [m] by joint; required unless `what` is a setup.
        v0: Velocity at the start, (n,), in [rad/s] or [m/s]; 0, or that of the setup, unless given.
        **options: As of `simulate`.

    Raises:
        QueryError: If the setup is not allowed, or its motion cannot be linearised at any state of the pilot run.
    """
    setup = setup_of("advise", what, {**starts(q0, v0), **options})
    advice = advice_about(setup, _along)
    worthwhile = advice.growth < _BEARS and (setup.method.controls_error or setup.steps <= _MOST_STEPS)
    return replace(advice, run=simulate(replace(setup, estimate_error=True))) if worthwhile else advice


def advice_about(setup: Setup, states_of: Callable[[Setup, StateEquation], list[State]]) -> Advice:
    """The same without a run.

    Args:
        setup: As of `simulate`.
        states_of: Gives times and states y of the setup, by its state equation with control at all times.
    """
    plant, controller, duration = setup.plant, setup.controller, setup.duration_s
    if plant.equation_of_motion.payloads:
        raise QueryError("advise: carried_payload changes the bodies in the run; ask of plant.at(t), t in [s]")
    if coupled := [x.name for x in plant.equation_of_motion.drives.values() if x.coupled]:
        raise QueryError(f"advise: {coupled[0]} frees and couples motors by turns, and no one linearisation holds")
    period = 0.0 if controller is None else controller.period_s
    loop = StateEquation(plant, None if controller is None else controller.at_period(0.0)).in_a_mode
    motion, at, states = _fastest(loop, states_of(setup, loop))
    matrices = [_between_ticks(plant, loop, t, y) if period else jacobian(loop, t, y, None) for t, y in states]
    n, own = plant.dynamics.n, setup.method
    methods = {name: method(name) for name in FIXED_STEP} | ({} if own.controls_error else {own.name: own})
    limits = {name: min(longest_step(each, J, n) for J in matrices) for name, each in methods.items()}
    step = 0.0 if own.controls_error else setup.taken_step_s
    sampled = [] if controller is None or not period else [(controller, t, _own(loop, y)) for t, y in states]
    loops = [linearised(plant, *state) for state in sampled]
    factors = [after(each.factor(period), periods(duration, period)) for each in loops]
    factors += [exp(min(max(0.0, excess_rate(own, J, n)(step)) * duration, LARGEST)) for J in matrices if step]
    return Advice(
        method=own.name,
        step_s=step,
        fastest=motion,
        at=at,
        limits=limits,
        period_s=period,
        longest_period_s=min((loop.longest_period(period) for loop in loops), default=inf),
        at_period=worst(loop.growth(period) for loop in loops).verdict if loops else Stability.STABLE,
        period_growth=max((loop.factor(period) for loop in loops), default=1.0),
        grows_anyway=max((loop.grows_anyway() for loop in loops), default=0.0),
        growth=max(1.0, *factors, 1.0),
    )


def at_rest(setup: Setup, loop: StateEquation) -> list[State]:
    """The start alone: enough where it is an equilibrium."""
    return [(0.0, loop.start(setup.q0, setup.v0))]


def _along(setup: Setup, loop: StateEquation) -> list[State]:
    """Times and states y along a run with control at all times."""
    run = simulate(
        Setup(
            setup.plant, setup.q0, setup.v0, duration_s=setup.duration_s, controller=loop.controller,
            engine=setup.engine, record_every_s=setup.duration_s / (_LOOKS - 1), estimate_error=False,
        )
    )  # fmt: skip
    z = [] if run.controller_states is None else [run.controller_states]
    y = np.zeros((len(run.t), loop.size))
    known = np.hstack([run.q, run.v, *z, *run.effect_states.values()])
    y[:, : known.shape[1]] = known
    good = np.isfinite(y).all(axis=1)
    states = list(zip(run.t[good].tolist(), y[good], strict=True))
    return [*states, *_pressed(setup.plant, run, states)]


def _pressed(plant: Plant, run: Trajectory, states: list[State]) -> Iterator[State]:
    """The states with joints as far beyond soft stops as they come, which is between the samples."""
    least, most = (np.zeros(plant.dynamics.n),) * 2 if run.extremes is None else run.extremes[0]
    for stop in plant.effects:
        if isinstance(stop, JointStopSpring):
            for far, beyond in ((least, least < stop.lower), (most, most > stop.upper)):
                for i in np.flatnonzero(beyond):
                    t, y = min(states, key=lambda each, i=i, far=far: abs(each[1][i] - far[i]))
                    yield t, np.where(np.arange(len(y)) == i, far[i], y)


def _own(equation: StateEquation, y: Array) -> Array:
    """(q, v, z) of y, without works."""
    return y[: len(y) - len(equation.sources)]


def _between_ticks(plant: Plant, loop: StateEquation, t: float, y: Array) -> Array:
    """J where the actuation is held."""
    free, n, z = StateEquation(plant, None).in_a_mode, plant.dynamics.n, loop.state_size
    bodies = np.concatenate([y[: 2 * n], _own(loop, y)[2 * n + z :], np.zeros(len(free.sources))])
    return jacobian(free, t, bodies, np.zeros(n))


def _fastest(equation: StateEquation, states: list[State]) -> tuple[Fastest, float, list[State]]:
    """The fastest motion at some states, when, and the states where motion is fastest."""
    found: list[tuple[Fastest, float, Array]] = []
    for t, y in states:
        with suppress(RobotDynError, np.linalg.LinAlgError):
            found.append((fastest(equation, t, y, None), t, y))
    if not found:
        raise QueryError("the motion cannot be linearised at any state of a run; take a shorter one")
    found.sort(key=lambda each: -abs(each[0].eigenvalue))
    return *found[0][:2], [each[1:] for each in found[:_FAST]]
