"""Runs with a requested accuracy: the tolerance bounds the error per step; the error of the run is estimated.

    e = c · tol,   c from a pilot run at a loose tolerance

The error of a method of order p whose step is chosen by an estimate of that order is proportional to the tolerance.
[Hairer, Nørsett, Wanner, Solving Ordinary Differential Equations I, 2nd ed., 1993, II.4; Stetter 1980]
"""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import replace
from math import inf, isfinite
from typing import NamedTuple

import numpy as np

from robot_dyn.foundations.errors import RobotDynError
from robot_dyn.integrate.adaptive import AUTO, EXPLICIT, MIN_RTOL, STIFF, Adaptive
from robot_dyn.integrate.explicit import RK4
from robot_dyn.simulation.dynamics.fastest_motion import fastest
from robot_dyn.simulation.observation.remarks import RemarkKind
from robot_dyn.simulation.results.statistics import Accuracy
from robot_dyn.simulation.results.trajectory import Trajectory
from robot_dyn.simulation.run.outcome import Ending
from robot_dyn.simulation.setup.setup import Setup

_AIM = 0.3  # fraction of the requested error
_TRUSTED = 0.5  # smallest fraction of the true error that an estimate at a loose tolerance may be
_LOOSE = {EXPLICIT: 0.75, STIFF: 0.5}  # power of the requested error: tolerance of the pilot run
_LOOSEST = 1e-3
_ATOL = 0.01  # ratio to rtol
_TRIES = 4  # maximum number of tolerances tried
_LAST = 0.1  # of the previous tolerance at most: errors of coarse steps may not be proportional
_TOO_MUCH = 1.7  # accepted excess cost, relative to a run with the requested error
_FEW = 1.5  # steps between ticks, switches and events if these determine the steps
_MANY = 20  # segments of sampled control; from here on, one RK4 step in each may suffice
_LONG = 500.0  # |λ| T: with |λ| h ≤ 6, as many explicit steps as in a nonstiff run
_ORDER = {EXPLICIT: 8, STIFF: 5, RK4.name: 4}
_WEIGHT = {STIFF: 2}  # cost per evaluation, including Jacobians and eliminations


class AccuracyError(RobotDynError):
    """Raised if the requested accuracy cannot be reached; the message states why, and a remedy.

    Attributes:
        best: Smallest estimated error of the trial runs, in [rad] or [m]; inf if no estimate is valid to the end.
    """

    def __init__(self, message: str, best: float = inf) -> None:
        super().__init__(message)
        self.best = best


def trials(setup: Setup, requested: float) -> Generator[Setup, Trajectory, Trajectory]:
    """Generate the setups to run for a requested accuracy, each after the run of the one before is sent.

    The return value is a run whose estimated error is at most the requested one, or the first run that does not finish.

    The target is an estimate of at most half the requested error. If no run reaches the target, the best run is
    returned, provided that its estimate is at most the requested error.

    Args:
        setup: The setup to run.
        requested: Largest error of q at any time, over the joints, in [rad] and [m].

    Raises:
        AccuracyError: If the requested accuracy cannot be reached.
    """
    simple, spent = yield from _in_each_segment(setup, requested)
    if simple is not None:
        return simple
    least, stiff = 1.01 * MIN_RTOL, _stiff(setup)
    method = STIFF if stiff else AUTO
    rtol = max(least, min(_LOOSEST, requested ** _LOOSE[STIFF if stiff else EXPLICIT]))
    tried: list[_Try] = []
    for k in range(_TRIES):
        trial, more = yield from _at(setup, method, rtol, requested)
        spent += more
        if trial.outcome.ending is not Ending.FINISHED:
            return trial
        error, method = _resolved(trial), trial.statistics.method
        tried.append(_Try(error, rtol, trial))
        least_cost = trial.statistics.evaluations * _WEIGHT.get(method, 1) / _TOO_MUCH
        if error <= _TRUSTED * requested and (
            k > 0 or rtol == _LOOSEST or not _decides(setup, trial) or _predicted(trial, requested) > least_cost
        ):
            return _achieved(tried[-1], requested, spent)
        if rtol == least or method not in _ORDER:  # time stepping, after events that accumulate, has no tolerance
            break
        factor = _AIM * requested / error if isfinite(error) else 1e-2
        rtol = max(least, min(_LOOSEST, rtol * (min(factor, _LAST) if k == _TRIES - 2 else factor)))
    best = min(tried, key=lambda trial: trial.error)
    if best.error <= requested:
        return _achieved(best, requested, spent)
    raise AccuracyError(_refusal(best, requested, tried[-1].rtol), best.error)


def _at(
    setup: Setup, method: str, rtol: float, requested: float
) -> Generator[Setup, Trajectory, tuple[Trajectory, int]]:
    """Return the run at a tolerance, by the cheaper method if stability limits explicit steps; and the evaluations."""
    trial = yield replace(setup, method=Adaptive(method, rtol, _ATOL * rtol))
    if method != AUTO or trial.statistics.method != EXPLICIT or setup.equation.sampled or not _stable_at_most(trial):
        return trial, _in_all(trial)
    other = yield replace(setup, method=Adaptive(STIFF, rtol, _ATOL * rtol))
    return min((trial, other), key=lambda run: _predicted(run, requested)), _in_all(trial) + _in_all(other)


class _Try(NamedTuple):
    """A run with its tolerance (0 for a fixed step) and its estimated error."""

    error: float
    rtol: float
    trial: Trajectory


def _in_each_segment(setup: Setup, requested: float) -> Generator[Setup, Trajectory, tuple[Trajectory | None, int]]:
    """Return the run of one RK4 step between ticks of sampled control, if accurate enough; and the evaluations."""
    if not setup.equation.sampled or len(setup.segments) < _MANY:
        return None, 0
    trial = yield replace(setup, method=RK4, step_s=setup.duration_s)
    error, spent = _resolved(trial), _in_all(trial)
    good = trial.outcome.ending is Ending.FINISHED and error <= _TRUSTED * requested
    return (_achieved(_Try(error, 0.0, trial), requested, spent) if good else None), spent


def _stiff(setup: Setup) -> bool:
    """Return True if the fastest decay at the start would require many explicit steps."""
    if setup.equation.sampled:
        return False
    equation = setup.equation.in_a_mode
    try:
        motion = fastest(equation, 0.0, equation.start(setup.q0, setup.v0), None)
    except (RobotDynError, np.linalg.LinAlgError):
        return False
    return motion.decays and abs(motion.eigenvalue) * setup.duration_s > _LONG


def _stable_at_most(trial: Trajectory) -> bool:
    """Return True if stability limits the steps."""
    return any(remark.kind is RemarkKind.STIFF for remark in trial.remarks)


def _decides(setup: Setup, trial: Trajectory) -> bool:
    """Return True if the tolerance, rather than stability, ticks, switches or events, determines the steps."""
    return not _stable_at_most(trial) and trial.statistics.steps > _FEW * (len(setup.segments) + len(trial.events))


def _in_all(trial: Trajectory) -> int:
    """Return the evaluations of a run and its companions."""
    return trial.statistics.evaluations + trial.statistics.companion_evaluations


def _predicted(trial: Trajectory, requested: float) -> float:
    """Return the predicted evaluations of a run by the same method with the requested error."""
    if trial.outcome.ending is not Ending.FINISHED:
        return inf
    name, factor = trial.statistics.method, _resolved(trial) / (_AIM * requested)
    return trial.statistics.evaluations * _WEIGHT.get(name, 1) * factor ** (1 / _ORDER[name])


def _resolved(trial: Trajectory) -> float:
    """Return the estimated error of a run; inf if the estimate is not valid to the end."""
    error = trial.error
    return inf if error is None else error.largest


def _achieved(chosen: _Try, requested: float, spent: int) -> Trajectory:
    """Return the chosen run with the total of evaluations, and those for 10 and 0.1 times the accuracy, e = O(hᵖ)."""
    trial, s = chosen.trial, chosen.trial.statistics
    factor = 10 ** (1 / _ORDER[s.method])
    return replace(
        trial,
        accuracy=Accuracy(
            requested, chosen.error, chosen.rtol, s.evaluations, spent - _in_all(trial), s.companion_evaluations,
            s.evaluations * factor, s.evaluations / factor,
        ),
    )  # fmt: skip


def _refusal(best: _Try, requested: float, rtol: float) -> str:
    """Return why the best run misses the requested error, with tolerances down to `rtol`, and the remedy."""
    doubt = None if best.trial.error is None else best.trial.error.ends_early
    if doubt is not None:
        why = doubt.text  # its remedy is for a single run
    else:
        method = best.trial.statistics.method
        least = f"{method}'s smallest tolerance" if rtol <= 1.01 * MIN_RTOL else "the tolerance"
        why = f"the estimated error is {best.error:.1e} at {least}, {rtol:.1e}"
    remedy = f"use accuracy {1.1 * best.error / _TRUSTED:.1e}" if isfinite(best.error) else "use a shorter run"
    return f"accuracy {requested:.1e} is not attainable: {why}; {remedy}"
