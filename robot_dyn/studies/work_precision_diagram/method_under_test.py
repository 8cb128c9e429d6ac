"""Methods under test in a work-precision diagram, each with a ladder of settings that can be run.

A run is prepared before it is timed: its time is that of the loop alone.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from fractions import Fraction
from math import ceil, gcd, inf
from time import perf_counter
from typing import Any, final

import numpy as np

from robot_dyn.codegen.trace.right_angles import completed
from robot_dyn.coefficients import with_values
from robot_dyn.effects.plant import Plant
from robot_dyn.integrate.adaptive import Adaptive
from robot_dyn.model.robot import Robot
from robot_dyn.simulation.compiled.engine_choice import choose
from robot_dyn.simulation.dynamics.state_equation import StateEquation
from robot_dyn.simulation.results.samples import ledger
from robot_dyn.simulation.run.make_run import make_run
from robot_dyn.simulation.run.outcome import Ending
from robot_dyn.simulation.setup.setup import Setup
from robot_dyn.simulation.setup.size import MOST_CUT
from robot_dyn.studies.budget import Limit

RECORDS = 25  # times at which errors are looked at, about
_MOST_RECORDS = 400  # where they must fall on what switches
_ON_TIME = 1e-9  # of the record period: times that differ by less are one
_MOST_STEPS = 10**8
_HIGH = 5  # order from which twice as many steps leave a gap in a ladder
_LOOSEST, _TIGHTEST = 2, 13  # tolerances 10⁻ᵏ
_WARM = 64  # part of the record period, of steps that load machine code
_UNKNOWN = 15  # an order, of a method that chooses its own
ATOL = 1e-2  # absolute tolerance, of the relative one, as of `Adaptive`
ORDERS = {"DOP853": 8, "Rosenbrock": 5}  # of methods that choose their steps


@final
@dataclass(frozen=True, eq=False)
class Run:
    """What a run left behind.

    Attributes:
        t: Times of the records, (k,), in [s]; of a method of fixed step those that are ends of steps.
        q: Positions there, (k, n); None if it diverged.
        energy: As of `Point`, as are the others.
    """

    t: np.ndarray
    q: np.ndarray | None
    energy: float
    steps: int | None
    evaluations: int | None
    time_s: float


@final
@dataclass(frozen=True, eq=False)
class MethodUnderTest:
    """A method with a ladder of settings.

    Attributes:
        method, engine, events, order, by: As of `ToleranceLadder`.
        settings: From coarse to fine.
        run: Runs one of them, within a limit of time.
        warm: Loads what its runs need.
    """

    method: str
    engine: str
    events: bool
    order: int | None
    by: str
    settings: Callable[[], Iterator[float]]
    run: Callable[[float, Limit], Run]
    warm: Callable[[], object] = tuple

    def growth(self, before: float, after: float) -> float:
        """By which the cost grows, about, from one setting to the next."""
        return (before / after) ** (1.0 if self.by == "step" else 1 / (self.order or _UNKNOWN))


def whole(setup: Setup) -> Setup:
    """The setup with the right angles of its files written out in full, as machine code has them.

    So both engines run the same equations.
    """
    controller: Any = setup.controller
    models = {} if controller is None else controller.models
    described = {name: completed(model)[0] for name, model in models.items() if isinstance(model, Robot)}
    changed = {name: model for name, model in described.items() if model is not models[name]}
    dynamics: Any = setup.plant.dynamics
    robot = completed(dynamics)[0] if isinstance(dynamics, Robot) else dynamics
    plant = setup.plant if robot is dynamics else Plant(robot, setup.plant.effects)
    return replace(setup, plant=plant, controller=with_values(controller, changed))


def recorded(setup: Setup, duration_s: float) -> Setup:
    """The setup up to that time, with some RECORDS records and no error estimate."""
    return replace(
        setup, integrator=Adaptive(), step_s=None, estimate_error=False, accuracy=None, events=(),
        duration_s=duration_s, record_period_s=_record_period(setup, duration_s),
    )  # fmt: skip


def _record_period(setup: Setup, duration_s: float) -> float:
    """A period whose multiples are ends of steps, whatever their length: on ticks, and of what is between switches."""
    controller: Any = setup.controller
    tick = controller.period_s if controller is not None else 0.0
    if tick and RECORDS * tick <= duration_s:
        return tick * round(duration_s / tick / RECORDS)
    knots = {t for effect in setup.plant.effects for t in effect.switches} | set(controller.knots if controller else ())
    parts = Fraction(str(tick or duration_s))
    for t in () if tick else (t for t in knots if 0.0 < t < duration_s):
        other = Fraction(str(t))
        shared = parts.denominator * other.denominator
        parts = Fraction(gcd(int(parts * shared), int(other * shared)), shared)
    if duration_s > _MOST_RECORDS * parts:
        parts = Fraction(str(duration_s))  # only those that happen to be ends of steps count
    return float(parts) / ceil(RECORDS * float(parts) / duration_s)


def common(t: np.ndarray, of: np.ndarray) -> np.ndarray:
    """The place in ascending times `of` of each of t that is among them; −1 for the others."""
    place = np.clip(np.searchsorted(of, t - _ON_TIME * of[-1] / len(of)), 0, len(of) - 1)
    return np.where(np.abs(of[place] - t) <= _ON_TIME * of[-1], place, -1)


def own(setup: Setup, made: Any, engine: str, events: bool = True) -> MethodUnderTest:
    """A method of this library, or of the same kind.

    Args:
        setup: What to run, as `recorded` gives it.
        made: The method.
        engine: "compiled" or "interpreted".
        events: Whether steps end at the thresholds of the effects.
    """

    def warm() -> None:
        warmed(replace(setup, integrator=made, engine=engine))

    if made.controls_error:
        order = ORDERS.get(made.name)

        def tight(rtol: float, limit: Limit) -> Run:
            changed = replace(setup, integrator=replace(made, rtol=rtol, atol=ATOL * rtol), engine=engine)
            return timed(changed, limit, events)

        return MethodUnderTest(made.name, engine, events, order, "tolerance", tolerances, tight, warm)

    def steps() -> Iterator[float]:
        before = 0
        for step in step_ladder(setup.record_period_s, made.order):
            changed = replace(setup, integrator=made, step_s=step)
            count, most = changed.steps, MOST_CUT if changed.finds_events else _MOST_STEPS
            if count > most:
                return
            if count > before:  # a step longer than a tick, or a segment, is that of the segment
                yield step
            before = count

    def short(step: float, limit: Limit) -> Run:
        return timed(replace(setup, integrator=made, step_s=step, engine=engine), limit, events)

    return MethodUnderTest(made.name, engine, events, made.order, "step", steps, short, warm)


def tolerances() -> Iterator[float]:
    """Relative tolerances, a tenth of the one before each."""
    yield from (10.0**-k for k in range(_LOOSEST, _TIGHTEST + 1))


def step_ladder(period_s: float, order: int) -> Iterator[float]:
    """Steps, each a whole number of times in the record period: halved; of high orders, by √2 about."""
    k, before = 0, 0
    while True:
        parts = round(2 ** (k / 2)) if order >= _HIGH else 2**k
        if parts > before:
            yield period_s / parts
        before, k = parts, k + 1


def warmed(setup: Setup) -> None:
    """A run of one step or a few, which loads the machine code that the setup needs."""
    step = setup.record_period_s / _WARM
    setup = setup if setup.integrator.controls_error else replace(setup, step_s=step)
    timed(replace(setup, duration_s=2 * step, record_period_s=step), Limit(inf))


def timed(setup: Setup, limit: Limit, events: bool = True) -> Run:
    """A run and the time of its loop; OvertimeError if it takes longer than its limit.

    Raises:
        TraceError: As of `choose`.
    """
    equation = StateEquation(setup.plant, setup.controller, setup.integrator.canonical)
    machine, _ = choose(setup, equation)
    run = make_run(setup, equation, machine, on_progress=limit, thresholds=events)
    began = perf_counter()
    record = run.record()
    spent = perf_counter() - began
    if record.outcome.ending is Ending.STOPPED:
        raise KeyboardInterrupt
    finished = record.outcome.ending is Ending.FINISHED
    met = np.ones(len(record.t), bool)
    if not setup.integrator.controls_error and record.ends is not None:
        met = common(record.t, np.append(0.0, record.ends)) >= 0
    return Run(
        record.t[met], record.y[met, : setup.plant.dynamics.n] if finished else None,
        ledger(equation, record).closure if finished else float("nan"), record.steps, record.evaluations, spent,
    )  # fmt: skip
