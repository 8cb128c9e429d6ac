"""The error estimate of a run: companion runs, until one of the verdicts (`verdicts.py`) holds to its end.

Longer steps cost about as much as the run and come first; shorter ones cost five times as much, and are taken where
longer ones are not possible, or do not show the order of the method throughout.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from robot_dyn.foundations.coefficients import with_values
from robot_dyn.integrate.adaptive import LEAST_RTOL, Adaptive
from robot_dyn.integrate.integrator import Integrator
from robot_dyn.simulation.diagnostics.missed_events import cut_alike, stepped_over
from robot_dyn.simulation.diagnostics.smoothness import first_crossing, first_kink
from robot_dyn.simulation.dynamics.state_equation import StateEquation
from robot_dyn.simulation.estimate.verdicts import (
    COARSE,
    FINE,
    PUSH,
    ROUNDED,
    Estimated,
    at_states,
    carried,
    differences,
    meaningless,
    rounding,
)
from robot_dyn.simulation.results.error_estimate import ErrorEstimate, Verdict, no_estimate
from robot_dyn.simulation.results.samples import ledger
from robot_dyn.simulation.run.recording import Path, Recording
from robot_dyn.simulation.run.runner import Runner
from robot_dyn.simulation.run.stiffness import damped_oscillation
from robot_dyn.simulation.setup.schedule import LEAST_STEPS
from robot_dyn.simulation.setup.setup import Setup

_EARLY = 10  # steps of a method that chooses them: by then an error that is not rounding is more than that
_GAIN = 1.1  # in the time resolved, that a shorter step must bring
_FAR_TURN = 1.0  # [rad] in a step: above, longer steps may meet the same angles
_BLIND_TURN = np.pi  # [rad] in a step: above, shorter ones may, too
_STEADY = 4  # order of a method above which the error of steps that events cut varies too much with their lengths
_FAR_PUSH = 1000 * PUSH  # of what a short step adds to q, rounding may lose all until v has grown


def estimate(setup: Setup, run: Recording, runner: Runner) -> ErrorEstimate:
    """Return the estimated error of a run.

    Args:
        setup: The setup of the run.
        run: Its recording.
        runner: Maker of companion runs.
    """
    equation = setup.equation
    if len(run.shared.t) < 2:
        return no_estimate("it ended in its first step")
    if equation.impulses and setup.method.nonsmooth:
        return no_estimate(
            "the error of time stepping falls with the step, but from step to step by no order; compare it with"
            " step_s / 4, or with method='DOP853'"
        )
    n = equation.plant.dynamics.n
    kink, why = first_kink(setup, equation, run.step_log)
    estimated = Estimated(run.shared, n, kink, rounding(run.shared, n), meaningless(run.step_log, n))
    method: Any = setup.method
    if method.controls_error:
        result = _by_refinement(setup, method, run, estimated, runner)
    else:
        damps = method.stiff and not ledger(equation, run).closes
        if damps and (motion := damped_oscillation(setup, run)):
            return no_estimate(
                f"the energy ledger does not close: {motion}, which {method.name} damps in steps longer than"
                f" {1 / abs(motion.eigenvalue):.0e} s, so that runs with other steps do not show it; take shorter ones"
            )
        cut = bool(run.events) and method.order > _STEADY
        result = _by_steps(setup, method, estimated, runner, _turn(equation, run.step_log), cut)
        result = _until_alike(setup, run, result)
    return _advised(setup, _looked_between(setup, run, result), why)


def _by_steps(
    setup: Setup, method: Integrator, estimated: Estimated, runner: Runner, turn: float, cut: bool
) -> ErrorEstimate:
    """Return the estimate from longer steps, or from shorter ones where longer ones are lost or may agree by chance.

    Args:
        setup: What was run.
        method: Method of fixed step.
        estimated: The run.
        runner: Maker of companion runs.
        turn: Largest angle by which a joint turns in a step, in [rad].
        cut: True if events cut steps of a method of high order, so that no error need grow by its order.
    """
    if turn > _BLIND_TURN:
        return no_estimate(
            f"a joint turns by {turn:.3g} rad in a step, so that runs with other steps may meet the same angles"
        )
    result = no_estimate("fewer than 3 steps between ticks, switches or breaks")
    if turn < _FAR_TURN and min(each.steps for each in setup.segments) >= LEAST_STEPS:
        longer = {pace: runner.run(setup, pace) for pace in COARSE}
        paths = {pace: recording.shared for pace, recording in longer.items()}
        magnified = _with_rounding(estimated, runner.run(_pushed(setup), COARSE[1]).shared, paths[COARSE[1]])
        crossed = min(first_crossing(setup.equation, longer[pace].step_log, float(pace))[0] for pace in COARSE)
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


def _until_alike(setup: Setup, run: Recording, result: ErrorEstimate) -> ErrorEstimate:
    """The estimate up to where each companion cuts its steps as the run does, so that all take the same one or two."""
    alike = cut_alike(setup, run)
    if alike is None or alike.t >= result.until_s:
        return result
    return replace(result, until_s=alike.t, note=alike.why)


def _by_refinement(
    setup: Setup, method: Adaptive, run: Recording, estimated: Estimated, runner: Runner
) -> ErrorEstimate:
    """From half as long steps; where something may switch unseen, from a tenth of the tolerance as well.

    Two runs whose errors are rounding alone, magnified, differ by anything: then a push shows how much is magnified.
    Steps of a tenth of the tolerance may err alike where stability bounds them, half as long ones where both step over
    a kink at the same place.
    """
    assert run.ends is not None
    ends = np.append(0.0, run.ends)
    halves = np.unique(np.append(ends[1:], (ends[1:] + ends[:-1]) / 2))
    if run.events:
        halves = np.setdiff1d(halves, [each.t for each in run.events], assume_unique=True)
    tight = None
    if estimated.kink < np.inf and method.rtol / 10 > LEAST_RTOL:
        tight = runner.run(_tolerant(setup, method, 0.1)).shared
    halved = runner.run(setup, halves).shared
    gap = differences(estimated.path, halved, estimated.n)
    if estimated.begins_as_rounding(gap, ends[min(_EARLY, len(ends) - 1)]):
        estimated = _with_rounding(estimated, runner.run(_pushed(setup), halves).shared, halved)
    return estimated.from_refinement(gap, tight)


def _with_rounding(estimated: Estimated, pushed: Path, of: Path, units: float = PUSH) -> Estimated:
    """With magnified rounding as the floor, observed on a companion and another one that was pushed."""
    if not len(of.key):  # it diverged before a state that it shares: nothing is observed
        return estimated
    rounds = carried(of, differences(of, pushed, estimated.n) * (PUSH / units), estimated.n)
    return replace(estimated, floor=np.fmax(estimated.floor, at_states(estimated.path, of, rounds)))


def _tolerant(setup: Setup, method: Adaptive, factor: float) -> Setup:
    method = replace(method, rtol=method.rtol * factor, atol=method.atol * factor)
    return with_values(setup, {"method": method})  # all else was checked


def _pushed(setup: Setup, units: float = PUSH) -> Setup:
    """The setup from a start that differs by units of rounding: its run shows how the motion magnifies rounding."""
    sign = np.where(np.arange(len(setup.q0)) % 2, -1.0, 1.0)
    unit = units * np.finfo(float).eps
    q0, v0 = setup.q0 + sign * unit * (1 + np.abs(setup.q0)), setup.v0 + unit * (1 + np.abs(setup.v0))
    return with_values(setup, {"q0": q0, "v0": v0})


def _turn(equation: StateEquation, step_log: Path) -> float:
    """Largest angle by which a joint turns in a step, in [rad]; joints that slide do not count."""
    dynamics = equation.plant.dynamics
    kinds = getattr(dynamics, "joint_types", ("revolute",) * dynamics.n)
    turns = np.array([kind != "prismatic" for kind in kinds])
    steps = np.maximum(1, np.diff(step_log.key))[:, None]
    return float((np.abs(np.diff(step_log.y[:, : dynamics.n], axis=0)) / steps)[:, turns].max(initial=0.0))


def _looked_between(setup: Setup, run: Recording, result: ErrorEstimate) -> ErrorEstimate:
    """The estimate up to where something acted between two steps only, if that matters beside it."""
    missed = stepped_over(setup, run.step_log, result.at(result.until_s))
    if missed is None or missed.t >= result.until_s:
        return result
    return replace(result, until_s=missed.t, note=missed.why)


def _advised(setup: Setup, result: ErrorEstimate, why: str) -> ErrorEstimate:
    """The estimate with what to do where it ends early, and the reason where it is a bound."""
    if result.verdict is Verdict.BOUND:
        result = replace(result, reason=why or "the order of the method does not show")
    if not result.note:
        return result
    if result.note.startswith(ROUNDED):
        return replace(result, note=f"{result.note}; take a shorter run")
    method: Any = setup.method
    finer = f"rtol = {method.rtol / 100:.0e}" if method.controls_error else f"step_s = {setup.taken_step_s / 4:.0e}"
    return replace(result, note=f"{result.note}; take {finer}, or a shorter run")
