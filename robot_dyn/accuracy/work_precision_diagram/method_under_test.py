"""Methods under test in a work-precision diagram: a method with its ladder of settings, and with its measured runs.

Preparation is not timed: the time of a run is the time of its loop, recording included. For sufficiently small steps,
error ∝ h^p, so log error against log steps is a line of slope −p. [Hairer, Nørsett, Wanner 1993, II.10]
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import partial
from itertools import pairwise
from math import ceil, gcd, isfinite, lcm
from statistics import median
from time import perf_counter
from typing import final

import numpy as np

from robot_dyn.effects.plant import Plant
from robot_dyn.foundations.result import UNREPORTED, reported
from robot_dyn.integrate.adaptive import Adaptive
from robot_dyn.integrate.integrator import Integrator
from robot_dyn.model.right_angles import with_exact_models, with_exact_right_angles
from robot_dyn.model.robot import Robot
from robot_dyn.queries.units import format_duration
from robot_dyn.report.time_budget import Budget
from robot_dyn.report.timing import Repeated
from robot_dyn.simulation.engine.choice import choose
from robot_dyn.simulation.results.samples import ledger
from robot_dyn.simulation.run.outcome import Ending
from robot_dyn.simulation.run.run import Run as SingleRun
from robot_dyn.simulation.setup.schedule import MOST_CUT
from robot_dyn.simulation.setup.setup import Setup

COMPILED, INTERPRETED = "compiled", "interpreted"
Limit = Callable[[float], object]  # called during a run, with its time; raises OvertimeError if it takes too long
_RESOLVED = 0.1  # [rad] or [m]: runs with larger errors show no order
_MORE = 1.1  # ratio of steps: if smaller, stability rather than accuracy chose the steps
_ABOVE = 10.0  # times the reference error: below this, an error is partly that of the reference
RECORDS = 25  # approximate number of times at which errors are evaluated
_MAX_RECORDS = 400  # limit where records must fall on switching times
_ON_TIME = 1e-9  # fraction of the record period: times that differ by less are equal
_MAX_STEPS = 10**8
_HIGH = 5  # from this order on, doubling the steps leaves gaps in a ladder
_LOOSEST, _TIGHTEST = 2, 13  # tolerances 10⁻ᵏ
_WARM = 64  # steps per record period in runs that load machine code
_UNKNOWN = 15  # order assumed for a method that chooses its own
ATOL = 1e-2  # absolute tolerance over the relative one, as in `Adaptive`
ORDERS = {"DOP853": 8, "Rodas5P": 5}  # orders of methods that choose their steps


@final
@dataclass(frozen=True)
class Point(Repeated):
    """One run; its times are those of the prepared run.

    Attributes:
        setting: Step, in [s], or relative tolerance.
        steps: Number of steps; None if the program does not report it.
        evaluations: Evaluations of the equation of motion, excluding those of its Jacobian; None if not reported.
        error: Largest |q − q_ref| over joints and records, in [rad] or [m]; inf if the run diverged.
        energy: Largest residual of the energy ledger at the records, as a fraction of the energy exchanged; nan if
            unknown.
        resolved: True if the error is above that of the reference.
    """

    setting: float
    steps: int | None
    evaluations: int | None
    error: float
    energy: float
    resolved: bool


@final
@dataclass(frozen=True)
class Price:
    """Time to reach an error, in [s]; `extrapolated` is True if no run reached it."""

    value: float
    extrapolated: bool

    def __str__(self) -> str:
        return format_duration(self.value)


@dataclass(frozen=True)
class Method:
    """A method of this library or of another program.

    Attributes:
        method: Name of the method.
        engine: "compiled" or "interpreted"; "" for another program.
        events: True if steps end at the thresholds of the effects.
        order: Order stated by the source of the method; None if there is none.
        by: The setting that varies from run to run: "step" or "tolerance".
    """

    method: str
    engine: str
    events: bool
    order: int | None
    by: str

    @reported
    def name(self) -> str:
        """Name of the method, with any marks that distinguish its engine and events."""
        marks = [INTERPRETED] * (self.engine == INTERPRETED) + ["without events"] * (not self.events)
        return f"{self.method} ({', '.join(marks)})" if marks else self.method

    @property
    def peer(self) -> bool:
        """True if the method is from another program."""
        return not self.engine


@final
@dataclass(frozen=True)
class ToleranceLadder(Method):
    """Runs of one method.

    Attributes:
        points: The runs, from coarse to fine.
        ended: Reason why there is no finer run.
        floor: Error of the reference, in [rad] or [m].
    """

    points: tuple[Point, ...] = field(metadata=UNREPORTED)
    ended: str
    floor: float = field(metadata=UNREPORTED)

    @reported
    def measured_order(self) -> float | None:
        """Median slope of log error against log steps between neighbours; None if too few runs show it.

        Errors below ten times that of the reference, or above 0.1 rad or m, are ignored.
        """
        shown = [p for p in self.points if p.steps and _ABOVE * self.floor < p.error < _RESOLVED]
        slopes = [
            float(np.log(a.error / b.error) / np.log(b.steps / a.steps))
            for a, b in pairwise(shown)
            if a.steps and b.steps and b.steps >= _MORE * a.steps
        ]
        return median(slopes) if len(slopes) > 1 else None

    def price(self, error: float) -> Price | None:
        """Return the time to reach an error; None if it cannot be estimated.

        Between two runs the time is interpolated logarithmically; an error that a finer run exceeds does not count as
        reached. Beyond the finest run it is extrapolated with the stated or the measured order, whichever is lower.
        """
        finite = [p for p in self.points if isfinite(p.error)]
        if error < self.floor or not finite:
            return None
        errors = np.maximum([p.error for p in finite], self.floor)
        errors = np.maximum.accumulate(errors[::-1])[::-1]
        times = np.array([p.time_s for p in finite])
        times = np.minimum.accumulate(times[::-1])[::-1]  # a finer run that took less time counts, too
        reached = np.flatnonzero(errors <= error)
        if len(reached):
            i = int(reached[0])
            if i == 0:
                return Price(float(times[i]), False)
            fraction = np.log(errors[i - 1] / error) / np.log(errors[i - 1] / errors[i])
            return Price(float(times[i - 1] * (times[i] / times[i - 1]) ** fraction), False)
        orders = [p for p in (self.order, self.measured_order) if p is not None and p > 0]
        if errors[-1] > _RESOLVED or not orders:
            return None
        return Price(float(times[-1] * (errors[-1] / error) ** (1 / min(orders))), True)


@final
@dataclass(frozen=True, eq=False)
class Run:
    """Outcome of a run.

    Attributes:
        t: Times of the records, (k,), in [s]; for a fixed-step method, only those that are ends of steps.
        q: Positions at these times, (k, n); None if the run diverged.
        energy, steps, evaluations: See `Point`.
        time_s: Time of the loop, in [s].
    """

    t: np.ndarray
    q: np.ndarray | None
    energy: float
    steps: int | None
    evaluations: int | None
    time_s: float


@final
@dataclass(frozen=True, eq=False)
class MethodUnderTest(Method):
    """A method with a ladder of settings.

    Attributes:
        settings: Yields the settings, from coarse to fine.
        run: Runs one setting within a time limit.
        warm: Loads the machine code that the runs need.
    """

    settings: Callable[[], Iterable[float]]
    run: Callable[[float, Limit], Run]
    warm: Callable[[], object] = tuple

    def growth(self, before: float, after: float) -> float:
        """Return the approximate factor by which the time grows from one setting to the next."""
        return (before / after) ** (1.0 if self.by == "step" else 1 / (self.order or _UNKNOWN))


def whole(setup: Setup) -> Setup:
    """Return the setup with the right angles of its files at full precision, as in machine code.

    Both engines then run the same equations.
    """
    controller = with_exact_models(setup.controller, lambda model: with_exact_right_angles(model)[0])
    dynamics = setup.plant.dynamics
    robot = with_exact_right_angles(dynamics)[0] if isinstance(dynamics, Robot) else dynamics
    plant = setup.plant if robot is dynamics else Plant(robot, setup.plant.effects)
    return replace(setup, plant=plant, controller=controller)


def recorded(setup: Setup, duration_s: float) -> Setup:
    """Return the setup up to `duration_s`, with about RECORDS records and no error estimate."""
    return replace(
        setup, method=Adaptive(), step_s=None, estimate_error=False, accuracy=None, events=(),
        duration_s=duration_s, record_every_s=_record_period(setup, duration_s),
    )  # fmt: skip


def _record_period(setup: Setup, duration_s: float) -> float:
    """Return a period whose multiples are ends of steps: whole ticks, or a divisor of the switching intervals."""
    controller = setup.controller
    tick = controller.period_s if controller is not None else 0.0
    if tick and RECORDS * tick <= duration_s:
        return tick * round(duration_s / tick / RECORDS)
    knots = {t for effect in setup.plant.effects for t in effect.switches} | set(controller.knots if controller else ())
    inside = [] if tick else [t for t in knots if 0.0 < t < duration_s]
    times = [Fraction(str(t)) for t in (tick or duration_s, *inside)]
    unit = lcm(*(t.denominator for t in times))
    parts = Fraction(gcd(*(int(t * unit) for t in times)), unit)  # the longest time that divides all
    if duration_s > _MAX_RECORDS * parts:
        parts = Fraction(str(duration_s))  # only records that happen to be ends of steps count
    return float(parts) / ceil(RECORDS * float(parts) / duration_s)


def common(t: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Return the index of each time t in the ascending `times`; −1 for a time that is not among them."""
    place = np.clip(np.searchsorted(times, t - _ON_TIME * times[-1] / len(times)), 0, len(times) - 1)
    return np.where(np.abs(times[place] - t) <= _ON_TIME * times[-1], place, -1)


def switches(setup: Setup) -> bool:
    """Return True if effects have thresholds at which steps end."""
    return any(effect.thresholds(setup.plant.dynamics.n) for effect in setup.plant.effects)


def own(setup: Setup, method: Integrator | Adaptive, engine: str, events: bool = True) -> MethodUnderTest:
    """Return the test of a method of this library, or of one with the same interface.

    Args:
        setup: The setup to run, as returned by `recorded`.
        method: The method.
        engine: "compiled" or "interpreted".
        events: True if steps end at the thresholds of the effects.
    """
    setup = replace(setup, method=method, engine=engine)

    def run(setting: float, limit: Limit) -> Run:
        return timed(at_setting(setup, setting), limit, events)

    order, by, settings = ORDERS.get(method.name), "tolerance", tolerances
    if isinstance(method, Integrator):
        order, by, settings = method.order, "step", partial(_steps, setup, method.order, events)
    return MethodUnderTest(method.name, engine, events, order, by, settings, run, lambda: warmed(setup))


def at_setting(setup: Setup, setting: float) -> Setup:
    """Return the setup with its method at a step, in [s], or at a relative tolerance."""
    if isinstance(setup.method, Adaptive):
        return replace(setup, method=replace(setup.method, rtol=setting, atol=ATOL * setting))
    return replace(setup, step_s=setting)


def _steps(setup: Setup, order: int, events: bool) -> Iterator[float]:
    """Yield steps from the record period downwards, as long as a run has no more steps than allowed."""
    before, most = 0, MOST_CUT if events and switches(setup) else _MAX_STEPS  # beyond MOST_CUT events end no steps
    for step in step_ladder(setup.record_every_s, order):
        count = at_setting(setup, step).steps
        if count > most:
            return
        if count > before:  # a step longer than a tick or segment is cut to its length
            yield step
        before = count


def tolerances() -> list[float]:
    """Return relative tolerances, each a tenth of the previous one."""
    return [10.0**-k for k in range(_LOOSEST, _TIGHTEST + 1)]


def step_ladder(period_s: float, order: int) -> Iterator[float]:
    """Return steps that divide the record period: each half the previous one, or about 1/√2 of it for high orders."""
    k, before = 0, 0
    while True:
        parts = round(2 ** (k / 2)) if order >= _HIGH else 2**k
        if parts > before:
            yield period_s / parts
        before, k = parts, k + 1


def warmed(setup: Setup) -> None:
    """Run one or a few steps to load the machine code that the setup needs."""
    step = setup.record_every_s / _WARM
    setup = setup if setup.method.controls_error else replace(setup, step_s=step)
    timed(replace(setup, duration_s=2 * step, record_every_s=step), Budget().check)


def timed(setup: Setup, limit: Limit, events: bool = True) -> Run:
    """Run a setup and time its loop; OvertimeError if it takes longer than its limit.

    Raises:
        TraceError: As in `choose`.
    """
    run = SingleRun(setup, choose(setup), on_progress=limit, thresholds=events)
    began = perf_counter()
    record = run.record()
    spent = perf_counter() - began
    if record.outcome.ending is Ending.STOPPED:
        raise KeyboardInterrupt
    finished = record.outcome.ending is Ending.FINISHED
    is_end = np.ones(len(record.t), bool)
    if not setup.method.controls_error and record.ends is not None:
        is_end = common(record.t, np.append(0.0, record.ends)) >= 0
    return Run(
        t=record.t[is_end],
        q=record.y[is_end, : setup.plant.dynamics.n] if finished else None,
        energy=ledger(setup.equation, record).closure if finished else float("nan"),
        steps=record.steps,
        evaluations=record.evaluations,
        time_s=spent,
    )
