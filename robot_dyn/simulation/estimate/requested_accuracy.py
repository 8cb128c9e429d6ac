"""A run to an accuracy that is asked for: a tolerance bounds the error of a step, what that leaves is measured.

    e = c · tol,   c from a pilot run at a loose tolerance

The error of a method of order p whose step is chosen by an estimate of that order is proportional to the tolerance.
[Hairer, Nørsett, Wanner, Solving Ordinary Differential Equations I, 2nd ed., 1993, II.4; Stetter 1980]
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from math import inf, isfinite
from typing import NamedTuple

import numpy as np

from robot_dyn.errors import RobotDynError
from robot_dyn.integrate.adaptive import AUTO, EXPLICIT, LEAST_RTOL, STIFF, Adaptive
from robot_dyn.integrate.explicit import RK4
from robot_dyn.simulation.dynamics.fastest_motion import fastest
from robot_dyn.simulation.dynamics.state_equation import StateEquation
from robot_dyn.simulation.observation.remarks import Kind
from robot_dyn.simulation.results.trajectory import Accuracy, Trajectory
from robot_dyn.simulation.run.outcome import Ending
from robot_dyn.simulation.setup.setup import Setup

_AIM = 0.3  # of what is asked
_TRUSTED = 0.5  # of what is asked: the estimate of a run at a loose tolerance may be this part of its error
_LOOSE = {EXPLICIT: 0.75, STIFF: 0.5}  # tolerance of the pilot, a power of what is asked; what is fast has decayed
_LOOSEST = 1e-3
_ATOL = 0.01  # over rtol
_TRIES = 4  # runs of a tolerance, at most
_LAST = 0.1  # of the tolerance before, at most, in the last run: coarse steps may show no proportion
_TOO_MUCH = 1.7  # times the cost of a run with the error that is asked
_FEW = 1.5  # steps between ticks, switches and events, where these decide on them
_MANY = 20  # segments of sampled control, in each of which one step of RK4 may do
_LONG = 500.0  # |λ| T: explicit steps, of |λ| h = 6 at most, are then as many as those of a run that is not stiff
_ORDER = {EXPLICIT: 8, STIFF: 5, RK4.name: 4}
_WEIGHT = {STIFF: 2}  # of its evaluations, Jacobians and eliminations included


class AccuracyError(RobotDynError):
    """An accuracy that cannot be had; says which can, and why.

    Attributes:
        best: The least estimated error of the runs that were made, in [rad] or [m]; inf if none holds to the end.
    """

    def __init__(self, message: str, best: float = inf) -> None:
        super().__init__(message)
        self.best = best


def run_to(setup: Setup, asked: float, run: Callable[[Setup], Trajectory]) -> Trajectory:
    """The run of a setup whose estimated error is at most what is asked; one that does not finish is returned as it is.

    The estimate is to be half of it at most. Where no run has that, the best one is returned if its estimate is at
    most what is asked.

    Args:
        setup: What to run.
        asked: Largest error of q at any time, over the joints, in [rad] and [m].
        run: Runs a setup, and estimates its error.

    Raises:
        AccuracyError: If it cannot be had.
    """
    simple, spent = _in_each_segment(setup, asked, run)
    if simple is not None:
        return simple
    least, stiff = 1.01 * LEAST_RTOL, _stiff(setup)
    method = STIFF if stiff else AUTO
    rtol = max(least, min(_LOOSEST, asked ** _LOOSE[STIFF if stiff else EXPLICIT]))
    tried: list[_Try] = []
    for k in range(_TRIES):
        made, more = _at(setup, method, rtol, asked, run)
        spent += more
        if made.outcome.ending is not Ending.FINISHED:
            return made
        error, method = _resolved(made), made.statistics.method
        tried.append(_Try(error, rtol, made))
        least_cost = made.statistics.evaluations * _WEIGHT.get(method, 1) / _TOO_MUCH
        if error <= _TRUSTED * asked and (
            k > 0 or rtol == _LOOSEST or not _decides(setup, made) or _predicted(made, asked) > least_cost
        ):
            return _achieved(tried[-1], asked, spent)
        if rtol == least:
            break
        factor = _AIM * asked / error if isfinite(error) else 1e-2
        rtol = max(least, min(_LOOSEST, rtol * (min(factor, _LAST) if k == _TRIES - 2 else factor)))
    best = min(tried, key=lambda each: each.error)
    if best.error <= asked:
        return _achieved(best, asked, spent)
    raise AccuracyError(_refusal(best, asked, tried[-1].rtol), best.error)


def _at(
    setup: Setup, method: str, rtol: float, asked: float, run: Callable[[Setup], Trajectory]
) -> tuple[Trajectory, int]:
    """The run at a tolerance, of the cheaper method where stability bounds explicit steps; what all of it took."""
    made = run(replace(setup, integrator=Adaptive(method, rtol, _ATOL * rtol)))
    if method != AUTO or made.statistics.method != EXPLICIT or _sampled(setup) or not _stable_at_most(made):
        return made, _in_all(made)
    other = run(replace(setup, integrator=Adaptive(STIFF, rtol, _ATOL * rtol)))
    return min((made, other), key=lambda each: _predicted(each, asked)), _in_all(made) + _in_all(other)


class _Try(NamedTuple):
    """A run, the tolerance it was made with, 0 for a fixed step, and its estimated error."""

    error: float
    rtol: float
    made: Trajectory


def _in_each_segment(setup: Setup, asked: float, run: Callable[[Setup], Trajectory]) -> tuple[Trajectory | None, int]:
    """One step of RK4 between ticks of sampled control, if that is accurate enough; what that took."""
    if not _sampled(setup) or len(setup.segments) < _MANY:
        return None, 0
    made = run(replace(setup, integrator=RK4, step_s=setup.duration_s))
    error, spent = _resolved(made), _in_all(made)
    good = made.outcome.ending is Ending.FINISHED and error <= _TRUSTED * asked
    return (_achieved(_Try(error, 0.0, made), asked, spent) if good else None), spent


def _stiff(setup: Setup) -> bool:
    """Whether explicit steps would be many for the fastest decay at the start."""
    if _sampled(setup):
        return False
    equation = StateEquation(setup.plant, setup.controller).in_a_mode
    try:
        motion = fastest(equation, 0.0, equation.start(setup.q0, setup.v0), None)
    except (RobotDynError, np.linalg.LinAlgError):
        return False
    return motion.decays and abs(motion.eigenvalue) * setup.duration_s > _LONG


def _sampled(setup: Setup) -> bool:
    return setup.controller is not None and setup.controller.period_s > 0


def _stable_at_most(made: Trajectory) -> bool:
    """Whether stability bounds the steps."""
    return any(each.kind is Kind.STIFF for each in made.remarks)


def _decides(setup: Setup, made: Trajectory) -> bool:
    """Whether the tolerance decides on the steps, and not stability, ticks, switches or events."""
    return not _stable_at_most(made) and made.statistics.steps > _FEW * (len(setup.segments) + len(made.events))


def _in_all(made: Trajectory) -> int:
    return made.statistics.evaluations + made.statistics.companion_evaluations


def _predicted(made: Trajectory, asked: float) -> float:
    """Cost of a run of its method with the error that is asked, in evaluations."""
    if made.outcome.ending is not Ending.FINISHED:
        return inf
    name, factor = made.statistics.method, _resolved(made) / (_AIM * asked)
    return made.statistics.evaluations * _WEIGHT.get(name, 1) * factor ** (1 / _ORDER[name])


def _resolved(made: Trajectory) -> float:
    """The estimated error of a run; inf where it does not hold to the end."""
    error = made.error
    return error.final if error is not None and not error.note else inf


def _achieved(chosen: _Try, asked: float, spent: int) -> Trajectory:
    """With the evaluations of all runs, and those of one ten times as accurate, and of one a tenth: e = O(hᵖ)."""
    made, s = chosen.made, chosen.made.statistics
    factor = 10 ** (1 / _ORDER[s.method])
    return replace(
        made,
        accuracy=Accuracy(
            asked, chosen.error, chosen.rtol, s.evaluations, spent - _in_all(made), s.companion_evaluations,
            s.evaluations * factor, s.evaluations / factor,
        ),
    )  # fmt: skip


def _refusal(best: _Try, asked: float, rtol: float) -> str:
    """Why the best run does not have what is asked, although tolerances went down to the given one."""
    why = "" if best.made.error is None else best.made.error.note
    if not why:
        method = best.made.statistics.method
        least = f"{method}'s least tolerance" if rtol <= 1.01 * LEAST_RTOL else "the tolerance"
        why = f"the estimated error is {best.error:.1e} at {least}, {rtol:.1e}"
    remedy = f"ask for {1.1 * best.error / _TRUSTED:.1e}" if isfinite(best.error) else "take a shorter run"
    return f"accuracy {asked:.1e} cannot be had: {why}; {remedy}"
