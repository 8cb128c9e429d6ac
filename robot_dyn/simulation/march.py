"""The march through time: y at the start of each step, of a setup run with 1, 2 or 4 times its step.

The step itself is the integrator's; here are its ends: ticks, switches, samples, and what ends a run before its time.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import final

import numpy as np

from robot_dyn.arithmetic import Array
from robot_dyn.errors import RobotDynError
from robot_dyn.integrate.adaptive import Adaptive, Solution, Status
from robot_dyn.integrate.integrator import IntegrationError, Integrator, System
from robot_dyn.simulation.motion import Motion
from robot_dyn.simulation.observer import Observer
from robot_dyn.simulation.setup import Setup, Stretch

WATCHED = 64  # steps between looks at the energy
_RUNAWAY = 1e6  # [rad/s] or [m/s]: an adaptive method would follow an exploding state without end
_SAMPLES = 1000  # of an adaptive run without a record period


@final
@dataclass(frozen=True)
class Sample:
    """A state on the way.

    Attributes:
        t: In [s].
        y: The state of the motion.
        held: What a sampled controller holds, or None.
        shared: Whether the companion runs pass here too.
    """

    t: float
    y: Array
    held: Array | None
    shared: bool


class DivergedError(Exception):
    """Internal: the run cannot go on from `t`; the message is advice."""

    def __init__(self, t: float, advice: str) -> None:
        super().__init__(advice)
        self.t = t


@final
class Counter:
    """Counts the steps and evaluations of a march, and shows each step to an observer."""

    def __init__(self, observer: Observer | None = None) -> None:
        self.steps = 0
        self.evaluations = 0
        self.observer = observer

    def counted(self, system: System) -> System:
        """The same system, its evaluations counted."""

        def rate(t: float, y: Array) -> Array:
            self.evaluations += 1
            return system.rate(t, y)

        return System(rate, system.n)


Systems = Callable[[Array | None, Stretch], System]


def march(
    setup: Setup, motion: Motion, factor: int, counter: Counter, systems: Systems | None = None
) -> Iterator[Sample]:
    """The states of a run, at the start of each step and at the end.

    Args:
        setup: What to run.
        motion: Its equation of motion.
        factor: Length of a step, in steps of the setup; tolerances of an adaptive method are multiplied by it.
        counter: Counts what it takes.
        systems: Gives the equation on a stretch, from what a controller holds; that of the motion unless given.

    Raises:
        DivergedError: If it cannot go on.
    """
    y, held = motion.start(setup.q0, setup.v0), None
    watch = Watch(setup, motion)
    for stretch in setup.stretches:
        if stretch.tick:
            y, held = watch.tick(stretch.start, y)
        system = counter.counted(systems(held, stretch) if systems else motion.system(held, stretch))
        method = setup.integrator
        if isinstance(method, Adaptive):
            method = replace_tolerance(method, factor)
            y = yield from _adaptively(setup, method, system, stretch, y, held, counter, motion)
        else:
            y = yield from _by_steps(setup, method, system, stretch, y, held, factor, counter, watch)
    y, held = watch.tick(setup.duration_s, y)
    yield Sample(setup.duration_s, y, held, shared=True)


def replace_tolerance(method: Adaptive, factor: int) -> Adaptive:
    """The method with its tolerances multiplied."""
    return method if factor == 1 else replace(method, rtol=method.rtol * factor, atol=method.atol * factor)


def _by_steps(
    setup: Setup, method: Integrator, system: System, stretch: Stretch, y: Array, held: Array | None,
    factor: int, counter: Counter, watch: Watch,
) -> Iterator[Sample]:  # fmt: skip
    count = setup.steps(stretch)
    h = (stretch.end - stretch.start) / count * factor
    for k in range(max(1, count // factor)):
        t = stretch.start + k * h
        yield Sample(t, y, held, shared=k * factor % 4 == 0)
        y = one_step(method, system, t, y, h, watch)
        counter.steps += 1
        if counter.observer is not None:
            counter.observer.step(t + h, y, held, held is None or (stretch.tick and k == 0))
        if counter.steps % WATCHED == 0:
            watch.look(t + h, y)
    return y


def one_step(method: Integrator, system: System, t: float, y: Array, h: float, watch: Watch) -> Array:
    """The state after a step; DivergedError if there is none, or it is not finite."""
    try:
        after = method.step(system, t, y, h)
    except IntegrationError as error:  # it names its own remedy
        raise DivergedError(t, str(error)) from None
    except RobotDynError as error:
        raise watch.diverged(t, y, str(error)) from None
    if not np.isfinite(after).all():
        raise watch.diverged(t, y, "a number overflowed")
    return after


def _adaptively(
    setup: Setup, method: Adaptive, system: System, stretch: Stretch, y: Array, held: Array | None, counter: Counter,
    motion: Motion,
) -> Iterator[Sample]:  # fmt: skip
    n = system.n

    def sane(_: float, y: Array) -> float:
        return 1.0 if np.abs(y[n : 2 * n]).max() < _RUNAWAY else -1.0

    solution = method.solve(system, stretch.start, y, stretch.end, stop=sane)
    counter.steps += len(solution.times) - 1
    _observe(counter.observer, motion, solution, held, stretch.tick)
    reached = float(solution.times[-1])
    period = setup.record_period_s or setup.duration_s / _SAMPLES
    first = max(0.0, np.ceil(stretch.start / period - 1e-9))
    times = np.clip(period * np.arange(first, np.ceil(stretch.end / period - 1e-9)), stretch.start, stretch.end)
    for t in np.unique(np.append(times[times <= reached], stretch.start)):
        yield Sample(float(t), solution(float(t)), held, shared=True)
    if solution.status is Status.INTERRUPTED:
        raise KeyboardInterrupt
    if solution.status is Status.FAILED:
        raise DivergedError(reached, solution.message)
    if solution.status is Status.STOPPED:
        raise DivergedError(reached, f"a joint moves faster than {_RUNAWAY:g} rad/s: the control is unstable")
    return solution.states[-1]


def _observe(observer: Observer | None, motion: Motion, solution: Solution, held: Array | None, tick: bool) -> None:
    """Show the steps of a solution; the actuation of continuous control is that at their ends."""
    if observer is None:
        return
    for k, (t, y) in enumerate(zip(solution.times[1:], solution.states[1:], strict=True)):
        if held is None:
            q, v, z, _ = motion.state(y)
            try:
                observer.seen[len(q) :] = motion.command(float(t), q, v, z)
            except RobotDynError:  # y may be far off where a run fails
                continue
        observer.step(float(t), y, held, held is not None and tick and k == 0)


@final
class Watch:
    """Tells when energy grows without a source: the ledger's residual exceeds all there was and came a thousandfold."""

    def __init__(self, setup: Setup, motion: Motion) -> None:
        self.setup, self.motion = setup, motion
        K, V = (float(x[0]) for x in motion.energy(np.zeros(1), setup.q0[None], setup.v0[None]))
        self.energy, self.scale = K + V, 1.0 + abs(K) + abs(V)

    def tick(self, t: float, y: Array) -> tuple[Array, Array | None]:
        """A tick of the controller; DivergedError if it fails, or asks for no finite torque."""
        try:
            y, held = self.motion.tick(t, y)
        except RobotDynError as error:
            raise self.diverged(t, y, str(error)) from None
        if held is not None and not np.isfinite(held).all():
            raise self.diverged(t, y, "the controller asks for a torque that is not finite")
        return y, held

    def look(self, t: float, y: Array) -> None:
        """DivergedError if energy grows without a source."""
        if self.gains(t, y):
            raise self.diverged(t, y, "energy grows without a source")

    def gains(self, t: float, y: Array) -> bool:
        """Whether the ledger's residual says so."""
        q, v, _, W = self.motion.state(y)
        K, V = self.motion.energy(np.array([t]), q[None], v[None])
        return bool((K + V)[0] - self.energy - W.sum() > 1e3 * (self.scale + np.abs(W).sum()))

    def diverged(self, t: float, y: Array, why: str) -> DivergedError:
        names = self.motion.plant.dynamics.joint_names
        fastest = names[int(np.argmax(np.abs(y[len(names) : 2 * len(names)])))]
        remedy = f"take a smaller step than {self.setup.step_s:g} s, or an implicit method"
        return DivergedError(t, f"{why}; the fastest joint is {fastest!r}: {remedy}")
