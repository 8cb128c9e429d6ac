"""The march through time: y at the start of each step, of a setup run with 1, 2 or 4 times its step.

The step itself is the integrator's; here are its ends: ticks, switches, samples, and what ends a run before its time.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from fractions import Fraction
from math import ceil
from typing import TypeVar, final

import numpy as np

from robot_dyn.arithmetic import Array
from robot_dyn.errors import RobotDynError
from robot_dyn.integrate.adaptive import Adaptive, Status
from robot_dyn.integrate.integrator import IntegrationError, Integrator, System
from robot_dyn.simulation.motion import Motion
from robot_dyn.simulation.observer import Observer
from robot_dyn.simulation.schedule import Stretch, paced
from robot_dyn.simulation.setup import Setup
from robot_dyn.simulation.trajectory import diverged_advice

WATCHED = 64  # steps between looks at the energy
_RUNAWAY = 1e6  # [rad/s] or [m/s]: an adaptive method would follow an exploding state without end
_SAMPLES = 1000  # of an adaptive run without a record period
_COMPARED = 1000  # times at which an adaptive run is compared with runs of other tolerances
_LOCAL_ORDER = 8  # of DOP853: its steps grow as this root of the tolerance
_PACED = 2000  # steps between looks at the pace of an adaptive method
_MOST_AHEAD = 1e7  # steps that such a run may have before it at the pace it has: about an hour
_STEEP = 1e-3  # of q or v: an effect that bends within less makes a system stiff

T = TypeVar("T")


@final
@dataclass(frozen=True, eq=False)
class Sample:
    """A state on the way.

    Attributes:
        t: In [s].
        y: The state of the motion.
        held: What a sampled controller holds, or None.
        key: Steps of the run, not of a companion, before it; −1 if other runs need not pass here.
        kept: Whether it may be a sample of the record.
    """

    t: float
    y: Array
    held: Array | None
    key: int = -1
    kept: bool = True


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

        return replace(system, rate=rate)


Systems = Callable[[Array | None, Stretch], System]


def march(
    setup: Setup, motion: Motion, pace: Fraction, counter: Counter, systems: Systems | None = None
) -> Iterator[Sample]:
    """The states of a run, at the start of each step and at the end.

    Args:
        setup: What to run.
        motion: Its equation of motion.
        pace: Length of a step, in steps of the setup; tolerances of an adaptive method are multiplied by it.
        counter: Counts what it takes.
        systems: Gives the equation on a stretch, from what a controller holds; that of the motion unless given.

    Raises:
        DivergedError: If it cannot go on.
    """
    y, held = motion.start(setup.q0, setup.v0), None
    watch = Watch(setup, motion)
    adaptive, key = isinstance(setup.integrator, Adaptive), 0
    for stretch in setup.stretches if adaptive else paced(setup.stretches, pace):
        if stretch.tick:
            y, held = watch.tick(stretch.start, y)
        system = counter.counted(systems(held, stretch) if systems else motion.system(held, stretch))
        method = setup.integrator
        if isinstance(method, Adaptive):
            y, key = yield from _adaptively(setup, method, pace, system, stretch, y, held, key, counter, watch)
        else:
            y = yield from _by_steps(method, system, stretch, y, held, counter, watch)
    y, held = watch.tick(setup.duration_s, y)
    yield Sample(setup.duration_s, y, held, key if adaptive else setup.steps)


def _by_steps(
    method: Integrator, system: System, stretch: Stretch, y: Array, held: Array | None, counter: Counter, watch: Watch
) -> Iterator[Sample]:
    h = (stretch.end - stretch.start) / stretch.steps
    for k in range(stretch.steps):
        t, passed = stretch.start + k * h, k * stretch.pace
        yield Sample(t, y, held, stretch.first + int(passed) if passed.denominator == 1 else -1)
        y = one_step(method, system, t, y, h, watch)
        counter.steps += 1
        if counter.observer is not None:
            counter.observer.step(t + h, y, held, held is None or (stretch.tick and k == 0))
        if counter.steps % WATCHED == 0:
            watch.look(t + h, y)
    return y


def one_step(method: Integrator, system: System, t: float, y: Array, h: float, watch: Watch) -> Array:
    """The state after a step; DivergedError if there is none, or it is not finite."""
    after = watch.answer(t, y, lambda: method.step(system, t, y, h))
    if not np.isfinite(after).all():
        raise watch.diverged(t, y, "a number overflowed")
    return after


def _adaptively(
    setup: Setup, method: Adaptive, pace: Fraction, system: System, stretch: Stretch, y: Array, held: Array | None,
    key: int, counter: Counter, watch: Watch,
) -> Iterator[Sample]:  # fmt: skip
    n, factor, period = system.n, float(pace), setup.record_period_s or setup.duration_s / _SAMPLES
    longest = min(method.max_step, setup.longest_step_s)
    if factor < 1:  # where the ends of segments bound the steps, a tolerance by itself changes nothing
        longest = min(longest, stretch.end - stretch.start)
    longest *= factor ** (1 / _LOCAL_ORDER)
    method = replace(method, rtol=method.rtol * factor, atol=method.atol * factor, max_step=longest)

    def sane(_: float, y: Array) -> float:
        return 1.0 if np.abs(y[n : 2 * n]).max() < _RUNAWAY else -1.0

    yield Sample(stretch.start, y, held, key)
    key += 1
    due, end = ceil(stretch.start / period + 1e-9), ceil(stretch.end / period - 1e-9)  # multiples of the period inside
    compared = setup.duration_s / _COMPARED
    met = ceil(stretch.start / compared + 1e-9)
    steps = method.steps(system, stretch.start, y, stretch.end, stop=sane)
    ticked = stretch.tick and held is not None
    for t, y, piece in steps:
        counter.steps += 1
        _observe(counter.observer, watch.motion, t, y, held, ticked)
        ticked = False
        while due < end and due * period <= t:
            yield Sample(due * period, piece(due * period), held)
            due += 1
        while met * compared < min(t, stretch.end):
            yield Sample(met * compared, piece(met * compared), held, key, kept=False)
            met, key = met + 1, key + 1
        yield Sample(t, y, held, kept=False)
        watch.pace(t, counter.steps)
    if steps.status is Status.FAILED:
        raise DivergedError(steps.t, steps.message)
    if steps.status is Status.STOPPED:
        raise DivergedError(steps.t, f"a joint moves faster than {_RUNAWAY:g} rad/s: the control is unstable")
    return steps.y, key


def _observe(observer: Observer | None, motion: Motion, t: float, y: Array, held: Array | None, ticked: bool) -> None:
    """Show a step; the actuation of continuous control is that at its end."""
    if observer is None:
        return
    if held is None:
        try:
            q, v, z, _ = motion.state(y)
            observer.seen[len(q) :] = motion.command(t, q, v, z)
        except RobotDynError:  # y may be far off where a run fails
            return
    observer.step(t, y, held, ticked)


@final
class Watch:
    """Tells when energy grows without a source: the ledger's residual exceeds all there was and came a thousandfold."""

    def __init__(self, setup: Setup, motion: Motion) -> None:
        self.setup, self.motion = setup, motion
        K, V = (float(x[0]) for x in motion.energy(np.zeros(1), setup.q0[None], setup.v0[None]))
        self.energy, self.scale = K + V, 1.0 + abs(K) + abs(V)
        self.paced = 0.0

    def tick(self, t: float, y: Array) -> tuple[Array, Array | None]:
        """A tick of the controller; DivergedError if it fails, or asks for no finite torque."""
        y, held = self.answer(t, y, lambda: self.motion.tick(t, y))
        if held is not None and not np.isfinite(held).all():
            raise self.diverged(t, y, "the controller asks for a torque that is not finite")
        return y, held

    def look(self, t: float, y: Array) -> None:
        """DivergedError if energy grows without a source."""
        if self.answer(t, y, lambda: self.gains(t, y)):
            raise self.diverged(t, y, "energy grows without a source")

    def answer(self, t: float, y: Array, ask: Callable[[], T]) -> T:
        """What the equations answer; DivergedError if they have no answer."""
        try:
            return ask()
        except IntegrationError as error:  # it names its own remedy
            raise DivergedError(t, str(error) + self._steepest()) from None
        except RobotDynError as error:
            raise self.diverged(t, y, str(error)) from None

    def pace(self, t: float, steps: int) -> None:
        """DivergedError if the steps of an adaptive method have become so short that the run would not end."""
        if steps % _PACED:
            return
        made, self.paced = t - self.paced, t
        ahead = (self.setup.duration_s - t) / max(made, 1e-300) * _PACED
        if ahead > _MOST_AHEAD:
            radau = "" if getattr(self.setup.integrator, "method", "") == "Radau" else "Radau, "
            raise DivergedError(
                t, f"the last {_PACED} steps led {made:.1e} s on, at which pace {ahead:.0e} more are left: the system "
                f"is stiff; take {radau}softer effects or a larger tolerance{self._steepest()}"
            )  # fmt: skip

    def _steepest(self) -> str:
        """Words for the effect that bends within the least change of q or v, if that is small."""
        names, found = self.motion.plant.dynamics.joint_names, (_STEEP, "")
        for effect in self.motion.plant.effects:
            for width, unit in zip(effect.widths, ("rad or m", "rad/s or m/s"), strict=True):
                at = np.broadcast_to(width, (len(names),))
                i = int(np.argmin(at))
                found = min(
                    found, (float(at[i]), f"{effect.name} of joint {names[i]!r} bends within {at[i]:.1e} {unit}")
                )
        return found[1] and f" ({found[1]})"

    def gains(self, t: float, y: Array) -> bool:
        """Whether the ledger's residual says so."""
        q, v, _, W = self.motion.state(y)
        K, V = self.motion.energy(np.array([t]), q[None], v[None])
        return bool((K + V)[0] - self.energy - W.sum() > 1e3 * (self.scale + np.abs(W).sum()))

    def diverged(self, t: float, y: Array, why: str) -> DivergedError:
        """The end of a run at time t and state y, with the fastest joint and the remedy."""
        names = self.motion.plant.dynamics.joint_names
        fastest = names[int(np.argmax(np.abs(y[len(names) : 2 * len(names)])))]
        return DivergedError(t, diverged_advice(why, fastest, self.setup.taken_step_s))
