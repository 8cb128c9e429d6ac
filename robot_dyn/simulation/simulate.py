"""Simulate: a setup → a Trajectory with its energy ledger and an estimate of its error.

The plant moves in continuous time. A controller with a period acts at its ticks, with a zero-order hold between them;
steps end at ticks, at the switches of effects, and at the end. All samples of a run are returned, however it ends.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, replace
from time import perf_counter
from typing import Any, NamedTuple, Unpack

from robot_dyn.effects.plant import Plant
from robot_dyn.foundations.validate import function
from robot_dyn.foundations.values import cached, derived
from robot_dyn.integrate.adaptive import AUTO, EXPLICIT, STIFF
from robot_dyn.integrate.time_stepping import TimeStepping
from robot_dyn.queries.dynamics import Dynamics
from robot_dyn.simulation.derived import Results
from robot_dyn.simulation.diagnostics.runaway import judged, runaway
from robot_dyn.simulation.diagnostics.step_remarks import observer_of
from robot_dyn.simulation.dynamics.declarations import named
from robot_dyn.simulation.engine.choice import choose
from robot_dyn.simulation.engine.engine import Engine
from robot_dyn.simulation.estimate.estimate import estimate
from robot_dyn.simulation.estimate.requested_accuracy import run_to
from robot_dyn.simulation.observation.observer import Observer
from robot_dyn.simulation.observation.remarks import Remark, sentence
from robot_dyn.simulation.results.error_estimate import ErrorEstimate, no_estimate
from robot_dyn.simulation.results.statistics import Statistics
from robot_dyn.simulation.results.trajectory import Trajectory
from robot_dyn.simulation.run.make_run import make_run
from robot_dyn.simulation.run.outcome import TOO_FAST, Accumulation, Ending, Outcome, Reason, Stiff, TooLong
from robot_dyn.simulation.run.recording import Recording
from robot_dyn.simulation.setup.options import Options, setup_of, starts, takes_options
from robot_dyn.simulation.setup.setup import Setup, check_record


@takes_options
def simulate(
    what: Setup | Plant | Dynamics,
    q0: Any = None,
    v0: Any = None,
    *,
    on_progress: Callable[[float], object] | None = None,
    **options: Unpack[Options],
) -> Trajectory:
    """Run a plant or a robot from a start; or a setup, with the given options in place of those of the setup.

    Args:
        what: What to run.
        q0: Position at the start, (n,), in [rad] or [m] by joint; required unless `what` is a setup.
        v0: Velocity at the start, (n,), in [rad/s] or [m/s]; 0, or that of the setup, unless given.
        on_progress: Called with the time reached, in [s], at each step, and with that of the end at the steps of
            companion runs; in machine code some ten times a second. An exception from it ends the call.
        **options: The other attributes of a `Setup`, with its defaults: duration_s, controller, integrator, step_s,
            record_period_s, estimate_error, about, engine, events and accuracy.

    Raises:
        QueryError: If the setup is not allowed, or its record would not fit into memory. Whatever happens later is
            reported by the trajectory's outcome.
        AccuracyError: If the requested accuracy cannot be reached.
    """
    function("on_progress", on_progress, "the time reached")
    setup = setup_of("simulate", what, {**starts(q0, v0), **options})
    if setup.accuracy is not None:
        pilot = replace(setup, accuracy=None)
        return run_to(pilot, setup.accuracy, lambda each: simulate(each, on_progress=on_progress))
    check_record(setup)
    began = perf_counter()
    ran = _by_choice(setup, on_progress)
    finished, setup = perf_counter(), ran.setup
    record, error, spent, companions = _with_estimate(ran, on_progress)
    estimated = perf_counter()
    exact = ran.engine.exact_right_angles
    results = Results(setup, record, ran.observer, error, dict(setup.about), exact, ran.remarks)
    known = {"joint_names": setup.plant.dynamics.joint_names, "t": record.t, "events": record.events, "error": error}
    known["accuracy"] = None
    if not (setup.is_value and record.outcome.ending is Ending.FINISHED):  # nothing may be read later
        missing = (each.name for each in fields(Trajectory) if each.name not in (*known, "statistics"))
        known |= {name: getattr(results, name) for name in missing}
    statistics = Statistics(
        EXPLICIT if setup.integrator.name == AUTO else setup.integrator.name,
        0.0 if setup.integrator.controls_error else record.outcome.t / max(record.steps, 1),
        record.steps, record.evaluations, finished - ran.ready, 0.0 if error is None else estimated - finished,
        ran.engine.label, ran.ready - began, perf_counter() - estimated, spent, companions,
        ", ".join(named(part) for part, _ in setup.undeclared),
    )  # fmt: skip
    return derived(Trajectory, results, statistics=statistics, **known)


class _Ran(NamedTuple):
    """A run that has ended.

    Attributes:
        setup: With the method of the run.
        engine: What evaluated its state equation.
        observer: Its observer.
        record: Its record.
        ready: When it began, on the clock, put later by what it compiled.
        remarks: On a run before it.
        runaway: Which joint reached an implausible speed; empty if none did.
    """

    setup: Setup
    engine: Engine
    observer: Observer
    record: Recording
    ready: float
    remarks: tuple[Remark, ...]
    runaway: dict[str, float | str]


def _by_choice(setup: Setup, on_progress: Callable[[float], object] | None) -> _Ran:
    """The run of a setup: begun again where another engine, or another method, turns out to be the one for it."""
    seen, said, chooses = 0, (), setup.integrator.name == AUTO
    while True:
        engine = choose(setup, seen)
        ready, before, observer = perf_counter(), engine.compiling_s(), observer_of(setup)
        run = make_run(
            setup, engine, on_progress=on_progress, observer=observer, most=engine.most_evaluations, chooses=chooses
        )
        match run.run():
            case TooLong(evaluations):
                seen = evaluations
            case Stiff(remark):
                setup, chooses, said = cached(setup, _stiff), False, (remark,)
            case Accumulation(remark):
                setup, chooses, said = cached(setup, _nonsmooth), False, (*said, remark)
            case record:
                observer.end()
                far = runaway(setup, observer.fastest)
                if far:
                    record = replace(record, outcome=judged(setup, record, far))
                return _Ran(setup, engine, observer, record, ready + engine.compiling_s() - before, said, far)


def _stiff(setup: Setup) -> Setup:
    return replace(setup, integrator=replace(setup.integrator, method=STIFF))


def _nonsmooth(setup: Setup) -> Setup:
    return replace(setup, integrator=TimeStepping())


def _with_estimate(
    ran: _Ran, on_progress: Callable[[float], object] | None
) -> tuple[Recording, ErrorEstimate | None, int, int]:
    """The record of a run, stopped if its estimate is; its estimated error, with evaluations and number of companions.

    None where no error is estimated.
    """
    setup, record, spent, companions = ran.setup, ran.record, 0, 0
    if not setup.estimate_error or record.outcome.ending is Ending.STOPPED:
        return record, None, 0, 0
    if ran.runaway:
        return record, no_estimate(sentence(TOO_FAST, ran.runaway)), 0, 0
    at_the_end = None if on_progress is None else lambda _: on_progress(record.outcome.t)

    def companion(pace: Any, of: Setup) -> Recording:
        nonlocal spent, companions
        made = make_run(of, ran.engine, pace, at_the_end, samples=False).record()
        if made.outcome.ending is Ending.STOPPED:
            raise KeyboardInterrupt
        spent, companions = spent + made.evaluations, companions + 1
        return made

    try:
        error = estimate(setup, record, companion)
    except KeyboardInterrupt:
        error = no_estimate("it was interrupted")
        if record.outcome.ending is Ending.FINISHED:
            record = replace(record, outcome=Outcome(Reason.INTERRUPTED_IN_ESTIMATE, record.outcome.t))
    return record, error, spent, companions
