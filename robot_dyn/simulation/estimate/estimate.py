"""The error estimate of a run: companion runs, until one of the verdicts (`verdicts.py`) is valid to its end.

Companions of longer steps take about as long as the run and come first. Those of shorter steps take five times as long;
they follow if longer steps are not possible, or do not show the order of the method throughout.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from robot_dyn.foundations.coefficients import with_values
from robot_dyn.integrate.adaptive import MIN_RTOL, Adaptive
from robot_dyn.integrate.integrator import Integrator
from robot_dyn.simulation.diagnostics.imbalance import finer
from robot_dyn.simulation.diagnostics.missed_events import cut_alike, stepped_over
from robot_dyn.simulation.diagnostics.smoothness import first_crossing, first_kink
from robot_dyn.simulation.diagnostics.stiff_motion import damped_oscillation
from robot_dyn.simulation.dynamics.state_equation import StateEquation
from robot_dyn.simulation.estimate.verdicts import (
    COARSE,
    FINE,
    PUSH,
    Estimated,
    at_states,
    carried,
    differences,
    meaningless,
    rounding,
)
from robot_dyn.simulation.results.doubts import Doubt, DoubtKind, Onset
from robot_dyn.simulation.results.error_estimate import ErrorEstimate, Verdict, no_estimate
from robot_dyn.simulation.results.samples import ledger
from robot_dyn.simulation.run.recording import Path, Recording
from robot_dyn.simulation.run.runner import Runner
from robot_dyn.simulation.setup.schedule import LEAST_STEPS
from robot_dyn.simulation.setup.setup import Setup

_EARLY = 10  # steps of an adaptive method after which any error other than rounding exceeds rounding
_GAIN = 1.1  # least factor in the time resolved that makes shorter steps worthwhile
_FAR_TURN = 1.0  # [rad] in a step: above, longer steps may reach the same angles
_BLIND_TURN = np.pi  # [rad] in a step: above, shorter steps may reach the same angles, too
_STEADY = 4  # order of a method above which the error of steps that events cut varies too much with their lengths
_FAR_PUSH = 1000 * PUSH  # rounding may absorb the whole increment of q in a short step until v has grown


def estimate(setup: Setup, run: Recording, runner: Runner) -> ErrorEstimate:
    """Return the estimated error of a run.

    Args:
        setup: The setup of the run.
        run: Recording of the run.
        runner: Runner of companion runs.
    """
    equation = setup.equation
    if len(run.shared.t) < 2:
        return no_estimate(Doubt(DoubtKind.ENDED_AT_ONCE))
    if equation.impulses and setup.method.nonsmooth:
        return no_estimate(Doubt(DoubtKind.NO_ORDER_OF_IMPACTS))
    n = equation.plant.dynamics.n
    kink = first_kink(setup, equation, run.step_log)
    estimated = Estimated(run.shared, n, kink.t, rounding(run.shared, n), meaningless(run.step_log, n))
    method = setup.method
    if isinstance(method, Adaptive):
        result = _by_refinement(setup, method, run, estimated, runner)
    else:
        damps = method.stiff and not ledger(equation, run).closes
        if damps and (motion := damped_oscillation(setup, run)):
            facts = motion.facts | {"method": method.name, "longest_s": 1 / abs(motion.eigenvalue)}
            return no_estimate(Doubt(DoubtKind.OSCILLATION_DAMPED, facts))
        cut = bool(run.events) and method.order > _STEADY
        result = _by_steps(setup, method, estimated, runner, _turn(equation, run.step_log), cut)
        result = _up_to(result, cut_alike(setup, run))
    result = _up_to(result, stepped_over(setup, run.step_log, result.at(result.until_s)))
    if result.verdict is Verdict.BOUND:
        result = replace(result, no_order=kink.doubt or Doubt(DoubtKind.ORDER_NOT_SEEN))
    if result.ends_early is None or result.ends_early.kind is DoubtKind.ROUNDING:
        return result
    return replace(result, ends_early=finer(setup, result.ends_early))


def _by_steps(
    setup: Setup, method: Integrator, estimated: Estimated, runner: Runner, turn: float, cut: bool
) -> ErrorEstimate:
    """Return the estimate from longer steps, or from shorter ones if longer ones diverge or may agree by chance.

    Args:
        setup: The setup of the run.
        method: Method of the run, with a fixed step.
        estimated: The run.
        runner: Runner of companion runs.
        turn: Largest angle by which a joint turns in a step, in [rad].
        cut: True if events cut steps of a method of high order, so that no error need grow by its order.
    """
    if turn > _BLIND_TURN:
        return no_estimate(Doubt(DoubtKind.TURNS_TOO_FAR, {"turn": turn}))
    result = no_estimate(Doubt(DoubtKind.FEW_STEPS))
    if turn < _FAR_TURN and min(segment.steps for segment in setup.segments) >= LEAST_STEPS:
        longer = {pace: runner.run(setup, pace) for pace in COARSE}
        paths = {pace: recording.shared for pace, recording in longer.items()}
        magnified = _with_rounding(estimated, runner.run(_pushed(setup), COARSE[1]).shared, paths[COARSE[1]])
        crossed = min(first_crossing(setup.equation, longer[pace].step_log, float(pace)).t for pace in COARSE)
        result = replace(magnified, kink=min(crossed, estimated.kink)).from_longer_steps(paths, method.order)
        resolved = min(result.until_s, crossed) >= estimated.path.t[-1]
        if resolved and not cut and not estimated.doubts(result, paths, method.order):
            return result
    half = runner.run(setup, FINE[0]).shared
    if result.until_s > 0 and estimated.lost_at(half) < _GAIN * result.until_s:
        return result  # chaos: no step of practical length resolves it
    magnified = estimated
    for units in (PUSH, _FAR_PUSH):
        pushed = runner.run(_pushed(setup, units)).shared
        magnified = _with_rounding(magnified, pushed, estimated.path, units)
    shorter = magnified.from_shorter_steps({FINE[0]: half, FINE[1]: runner.run(setup, FINE[1]).shared}, method.order)
    return shorter if shorter.until_s >= result.until_s else result


def _up_to(result: ErrorEstimate, missed: Onset) -> ErrorEstimate:
    """Return the estimate, which ends at the time of a missed event."""
    return result if missed.t >= result.until_s else replace(result, until_s=missed.t, ends_early=missed.doubt)


def _by_refinement(
    setup: Setup, method: Adaptive, run: Recording, estimated: Estimated, runner: Runner
) -> ErrorEstimate:
    """Return the estimate from half as long steps and, after a kink, from a tenth of the tolerance as well.

    The difference of two runs with magnified rounding errors only is arbitrary; a pushed start then shows the factor.
    Runs at a tenth of the tolerance may have the same error where stability limits the steps; half as long steps may
    where both runs step over a kink at the same place.
    """
    assert run.ends is not None
    ends = np.append(0.0, run.ends)
    halves = np.unique(np.append(ends[1:], (ends[1:] + ends[:-1]) / 2))
    if run.events:
        halves = np.setdiff1d(halves, [event.t for event in run.events], assume_unique=True)
    tight = None
    if estimated.kink < np.inf and method.rtol / 10 > MIN_RTOL:
        tenth = method.with_tolerances(0.1, method.max_step_s)
        tight = runner.run(with_values(setup, {"method": tenth})).shared  # the other values were checked
    halved = runner.run(setup, halves).shared
    gap = differences(estimated.path, halved, estimated.n)
    if estimated.begins_as_rounding(gap, ends[min(_EARLY, len(ends) - 1)]):
        estimated = _with_rounding(estimated, runner.run(_pushed(setup), halves).shared, halved)
    return estimated.from_refinement(gap, tight)


def _with_rounding(estimated: Estimated, pushed: Path, companion: Path, units: float = PUSH) -> Estimated:
    """Return the run with magnified rounding as its floor, from a companion and the same with a pushed start."""
    if not len(companion.key):  # it diverged before the first shared state: nothing is observed
        return estimated
    rounds = carried(companion, differences(companion, pushed, estimated.n) * (PUSH / units), estimated.n)
    return replace(estimated, floor=np.fmax(estimated.floor, at_states(estimated.path, companion, rounds)))


def _pushed(setup: Setup, units: float = PUSH) -> Setup:
    """Return the setup with a start moved by units of rounding; its run shows how the motion magnifies rounding."""
    sign = np.where(np.arange(len(setup.q0)) % 2, -1.0, 1.0)
    unit = units * np.finfo(float).eps
    q0, v0 = setup.q0 + sign * unit * (1 + np.abs(setup.q0)), setup.v0 + unit * (1 + np.abs(setup.v0))
    return with_values(setup, {"q0": q0, "v0": v0})


def _turn(equation: StateEquation, step_log: Path) -> float:
    """Return the largest angle by which a revolute joint turns in a step, in [rad]."""
    dynamics = equation.plant.dynamics
    kinds = getattr(dynamics, "joint_types", ("revolute",) * dynamics.n)
    turns = np.array([kind != "prismatic" for kind in kinds])
    steps = np.maximum(1, np.diff(step_log.key))[:, None]
    return float((np.abs(np.diff(step_log.y[:, : dynamics.n], axis=0)) / steps)[:, turns].max(initial=0.0))
