"""Simulate: a setup → a Trajectory with its energy ledger and an estimate of its error.

The plant moves in continuous time. A controller with a period acts at its ticks, with a zero-order hold between them;
steps end at ticks, at the switches of effects, and at the end. All samples of a run are returned, however it ends.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import fields, replace
from time import perf_counter
from typing import Any, NamedTuple, Unpack, cast

from robot_dyn.effects.plant import Plant
from robot_dyn.foundations.validate import JointValues, function
from robot_dyn.foundations.values import cached, derived
from robot_dyn.integrate.adaptive import AUTO, EXPLICIT, STIFF, Adaptive
from robot_dyn.integrate.time_stepping import MoreauJean
from robot_dyn.queries.dynamics import Dynamics
from robot_dyn.simulation.derived import Results
from robot_dyn.simulation.diagnostics.runaway import runaway, runaway_outcome
from robot_dyn.simulation.diagnostics.stiff_motion import replacement
from robot_dyn.simulation.dynamics.declarations import named
from robot_dyn.simulation.engine.choice import choose
from robot_dyn.simulation.engine.engine import Engine
from robot_dyn.simulation.estimate.estimate import estimate
from robot_dyn.simulation.estimate.requested_accuracy import trials
from robot_dyn.simulation.observation.observer import Observer, observer_of
from robot_dyn.simulation.observation.remarks import Remark
from robot_dyn.simulation.results.doubts import Doubt, DoubtKind
from robot_dyn.simulation.results.error_estimate import ErrorEstimate, no_estimate
from robot_dyn.simulation.results.statistics import Statistics
from robot_dyn.simulation.results.trajectory import Trajectory
from robot_dyn.simulation.run.outcome import Accumulation, Ending, Outcome, Reason, Stiff, TooLong
from robot_dyn.simulation.run.recording import Recording
from robot_dyn.simulation.run.run import Run
from robot_dyn.simulation.run.runner import Runner
from robot_dyn.simulation.setup.options import Options, setup_of, starts, takes_options
from robot_dyn.simulation.setup.setup import Setup, check_record


@takes_options
def simulate(
    system: Setup | Plant | Dynamics,
    q0: JointValues | None = None,
    v0: JointValues | None = None,
    *,
    on_progress: Callable[[float], object] | None = None,
    **options: Unpack[Options],
) -> Trajectory:
    """Run a plant or a robot from a start, or a setup with other options.

    Args:
        system: A plant, a robot or a setup.
        q0: Position at the start, (n,), in [rad] or [m] by joint; required unless `system` is a setup.
        v0: Velocity at the start, (n,), in [rad/s] or [m/s]; by default 0, or that of the setup.
        on_progress: Called with the time reached, in [s], at each step, and with the time of the end at the steps of
            companion runs; in machine code some ten times a second. An exception from it ends the call.
        **options: The other attributes of a `Setup`, with its defaults: duration_s, controller, method, step_s,
            record_every_s, estimate_error, metadata, engine, events and accuracy. `rtol` and `atol` are the tolerances
            of an adaptive method, 1e-10 and 1e-12 by default.

    Raises:
        QueryError: If the setup is not allowed, if a method of fixed step is given `rtol` or `atol`, or if the record
            would not fit into memory. The trajectory's outcome reports what happens during the run.
        AccuracyError: If the requested accuracy cannot be reached.
    """
    function("on_progress", on_progress, "the time reached")
    setup = setup_of("simulate", system, {**starts(q0, v0), **options})
    if setup.accuracy is None:
        return _simulated(setup, on_progress)
    search, run = trials(replace(setup, accuracy=None), setup.accuracy), None
    while True:
        try:
            trial = next(search) if run is None else search.send(run)
        except StopIteration as end:
            return end.value
        run = _simulated(trial, on_progress)


def _simulated(setup: Setup, on_progress: Callable[[float], object] | None) -> Trajectory:
    """Run a setup without a requested accuracy, and return its trajectory."""
    check_record(setup)
    began = perf_counter()
    ran = _recorded(setup, on_progress)
    finished = perf_counter()
    runner = Runner(ran.engine, on_progress, ran.recording.outcome.t)
    recording, error = _estimated(ran, runner)
    estimated = perf_counter()
    results = Results(
        ran.setup, recording, ran.observer, error, dict(setup.metadata), ran.engine.is_compiled, ran.remarks
    )
    attributes: dict[str, Any] = {
        "joint_names": setup.plant.dynamics.joint_names,
        "t": recording.t,
        "events": recording.events,
        "error": error,
        "accuracy": None,
    }
    if not (ran.setup.is_value and recording.outcome.ending is Ending.FINISHED):  # later reads are not allowed
        later = [field.name for field in fields(Trajectory) if field.name not in (*attributes, "statistics")]
        attributes |= {name: getattr(results, name) for name in later}
    method = ran.setup.method
    statistics = Statistics(
        method=EXPLICIT if method.name == AUTO else method.name,
        step_s=0.0 if method.controls_error else recording.outcome.t / max(recording.steps, 1),
        steps=recording.steps,
        evaluations=recording.evaluations,
        wall_s=ran.run_s,
        companions_s=0.0 if error is None else estimated - finished,
        engine=ran.engine.label,
        compile_s=finished - began - ran.run_s,
        samples_s=perf_counter() - estimated,
        companion_evaluations=runner.evaluations,
        companion_runs=runner.runs,
        user_code=", ".join(named(part) for part, _ in setup.undeclared),
    )
    return derived(Trajectory, results, statistics=statistics, **attributes)


class _Ran(NamedTuple):
    """A run that has ended.

    Attributes:
        setup: The setup, with the method of the run.
        engine: The engine of its state equation.
        observer: Observer of the run.
        recording: Recording of the run.
        run_s: Time of the run, without compiling, in [s].
        remarks: Remarks on a run that it replaces.
        runaway: The joint that reached an implausible speed, with its speed and limit; empty if there is none.
    """

    setup: Setup
    engine: Engine
    observer: Observer
    recording: Recording
    run_s: float
    remarks: tuple[Remark, ...]
    runaway: dict[str, float | str]


def _recorded(setup: Setup, on_progress: Callable[[float], object] | None) -> _Ran:
    """Run a setup; restart with another engine or method if it turns out to be better suited."""
    seen, remarks, may_replace = 0, (), setup.method.name == AUTO
    while True:
        engine, observer = choose(setup, seen), observer_of(setup)
        run = Run(
            setup,
            engine,
            on_progress=on_progress,
            observer=observer,
            max_evaluations=engine.most_evaluations,
            may_replace=may_replace,
        )
        match run.run():
            case TooLong(evaluations):
                seen = evaluations
            case Stiff() | Accumulation() as given_up:
                other = with_stiff_method if isinstance(given_up, Stiff) else with_time_stepping
                setup, may_replace, remarks = cached(setup, other), False, (*remarks, replacement(given_up))
            case recording:
                observer.end()
                if too_fast := runaway(setup, observer.fastest):
                    recording = replace(recording, outcome=runaway_outcome(setup, recording, too_fast))
                return _Ran(setup, engine, observer, recording, run.seconds, remarks, too_fast)


def with_stiff_method(setup: Setup) -> Setup:
    """Return the setup by the stiff method with the same tolerances."""
    return replace(setup, method=replace(cast(Adaptive, setup.method), method=STIFF))


def with_time_stepping(setup: Setup) -> Setup:
    """Return the setup by time stepping."""
    return replace(setup, method=MoreauJean())


def _estimated(ran: _Ran, runner: Runner) -> tuple[Recording, ErrorEstimate | None]:
    """Return the recording, with another outcome if Ctrl-C stopped the estimate; and the estimated error, if any."""
    setup, recording = ran.setup, ran.recording
    if not setup.estimate_error or recording.outcome.ending is Ending.STOPPED:
        return recording, None
    if ran.runaway:
        return recording, no_estimate(Doubt(DoubtKind.IMPLAUSIBLE_SPEED, ran.runaway))
    try:
        return recording, estimate(setup, recording, runner)
    except KeyboardInterrupt:
        if recording.outcome.ending is Ending.FINISHED:
            recording = replace(recording, outcome=Outcome(Reason.INTERRUPTED_IN_ESTIMATE, recording.outcome.t))
        return recording, no_estimate(Doubt(DoubtKind.INTERRUPTED))
