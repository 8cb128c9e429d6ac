"""Reference solution: two runs by methods of different kinds, with tighter settings than all other runs.

The distance between them is the error of the reference. If they diverge, as in chaotic motion, the horizon ends there.
Past the horizon, methods are judged by the energy error and the return error:

    |q − q₀|   after a run to the end and, with reversed velocity, back to the start

A motion without drive or dissipation returns to its start. Rounding errors grow along the way like the errors of the
method: a method with smaller errors returns closer, until only rounding remains. [Hairer, Lubich, Wanner, Geometric
Numerical Integration, 2nd ed., 2006, V.1]
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from math import isfinite
from typing import final

import numpy as np

from robot_dyn.accuracy.work_precision_diagram.method_under_test import (
    COMPILED,
    INTERPRETED,
    Run,
    ToleranceLadder,
    at_setting,
    common,
    recorded,
    step_ladder,
    timed,
    warmed,
)
from robot_dyn.effects.effect import Conservative
from robot_dyn.foundations.errors import QueryError, RobotDynError
from robot_dyn.foundations.result import UNREPORTED, reported
from robot_dyn.foundations.values import ReadOnly
from robot_dyn.integrate.adaptive import Adaptive
from robot_dyn.integrate.integrator import Integrator
from robot_dyn.integrate.methods import method
from robot_dyn.report.time_budget import Budget, OvertimeError
from robot_dyn.simulation.results.trajectory import Trajectory
from robot_dyn.simulation.run.outcome import Ending
from robot_dyn.simulation.setup.setup import Setup
from robot_dyn.simulation.simulate import simulate

_PARTED = 1e-9  # fraction of the positions: runs that differ by more have parted
_COARSE = 1e-6  # same, if the second run could not be refined down to rounding
_STAGNANT = 0.3  # decades: if doubling the number of steps gains less, the run is fully refined
_ORDERLY = 1e-6  # distance at the first record below which refinement is judged
_ENOUGH = {COMPILED: 0.0, INTERPRETED: 1e-12}  # distance that ends refinement: interpreted runs take seconds
_ROUGH, _ROUGHLY = 1e-11, 1e-6  # a looser tolerance; the horizon ends where its run is this far from the first
_MAX_LATE = 3  # runs of one method that may take too long
_LOST = 0.1  # [rad] or [m]: runs that differ by more have nothing in common
_MIN_HORIZON = 1e-3  # fraction of the duration
_ULPS = 4.0  # smallest error of a reference, in units of rounding of the largest position
_FIRST = (Adaptive("DOP853", 3e-14, 1e-15), Adaptive("Rodas5P", 1e-12, 1e-14))
_SECOND = ("GaussLegendre6", "Rodas5PFixed")
_REFERENCE_FRACTION, _MIN_LIMIT_S = 0.08, 0.5  # fraction of the budget for one reference run, with a lower limit in [s]
_RUN_FRACTION = 0.02  # fraction of the budget for one run past the horizon


class HorizonError(RobotDynError):
    """A motion that has no reference solution."""


@final
@dataclass(frozen=True, eq=False)
class Reference(ReadOnly):
    """The reference solution of a motion.

    Attributes:
        t: Times of the records, (k,), in [s].
        q: Positions at these times, (k, n).
        error: Distance of the two runs, in [rad] or [m]; smaller errors are not resolved.
        methods: Descriptions of the two methods; q is from the first.
        horizon_s: End of the reference, in [s].
        parted_s: Time at which the first run parted from the second, or from a run at a tolerance of 1e-11, in [s].
            The horizon ends there. None if they did not part.
        lost_s: Time at which the first run and the one at 1e-11 differed by 0.1 rad or m, in [s]; None if they did not.
    """

    t: np.ndarray = field(metadata=UNREPORTED)
    q: np.ndarray = field(metadata=UNREPORTED)
    error: float
    methods: tuple[str, str]
    horizon_s: float
    parted_s: float | None = None
    lost_s: float | None = None

    @reported
    def records(self) -> int:
        """Number of records after the start, at which errors are evaluated."""
        return len(self.t) - 1

    def distance(self, run: Run) -> float:
        """Return the largest |q − q_ref| of a run over joints and records; inf if it diverged."""
        return np.inf if run.q is None else float(_distance(self.t, self.q, run)[1].max())


def reference(setup: Setup, budget: Budget) -> tuple[Setup, Reference]:
    """Return the setup, shortened to the horizon, and its reference.

    Raises:
        HorizonError: If the motion has no reference.
    """
    requested = setup.duration_s
    parted = lost = None
    while True:
        setup = recorded(setup, setup.duration_s)
        first, run, q = _first(setup, budget)
        size = max(1.0, float(np.abs(q).max()))
        if parted is None:
            parted, lost = _rough_ends(setup, run, q, size, budget)
            if parted is not None:
                setup = replace(setup, duration_s=parted, record_every_s=0.0)
                continue
        other = _second(setup, run, q, budget)
        end = _passes(other.t, other.distance, size * (_PARTED if other.refined else _COARSE))
        if end is None:
            error = max(float(other.distance.max()), _ULPS * np.finfo(float).eps * size)
            return setup, Reference(run, q, error, (first, other.description), setup.duration_s, parted, lost)
        parted = end = float(f"{end:.2g}") if float(f"{end:.2g}") < setup.duration_s else end
        if end < _MIN_HORIZON * requested:
            raise HorizonError(
                f"no error can be measured: {first} and {other.description} diverge from each other within"
                f" {_MIN_HORIZON:g} of the duration, at t = {end:.2g} s; use a shorter run, or a less sensitive start"
            )
        setup = replace(setup, duration_s=end, record_every_s=0.0)


def _first(setup: Setup, budget: Budget) -> tuple[str, np.ndarray, np.ndarray]:
    """Return the description, record times and positions of the tightest run that ends in time."""
    for tight in _FIRST:
        description = f"{tight.name}, rtol {tight.rtol:g}"
        budget.report(f"reference: {description}")
        run = _in_time(replace(setup, method=tight), budget)
        if run is not None and run.q is not None:
            return description, run.t, run.q
    raise HorizonError(
        f"no run of {setup.duration_s:g} s by {' or '.join(tight.name for tight in _FIRST)} finishes at tight"
        " tolerances; use a shorter run or a larger budget, or see rd.simulate(…).summary"
    )


def _rough_ends(
    setup: Setup, t: np.ndarray, q: np.ndarray, size: float, budget: Budget
) -> tuple[float | None, float | None]:
    """Return the times at which a run with a looser tolerance parts from the first and has nothing left in common.

    A time is None if this does not happen.
    """
    run = _in_time(replace(setup, method=Adaptive("DOP853", _ROUGH, _ROUGH)), budget)
    if run is None or run.q is None:
        return None, None
    times, distance = _distance(t, q, run)
    return _passes(times, distance, _ROUGHLY * size), _passes(times, distance, _LOST)


def _in_time(setup: Setup, budget: Budget) -> Run | None:
    """Run a setup; return None if it takes too long."""
    with budget.apart():
        warmed(setup)
    with suppress(OvertimeError):
        return timed(setup, Budget(_longest(budget)).check)
    return None


def _longest(budget: Budget) -> float:
    """Return the time that a reference run may take, in [s]."""
    return max(_REFERENCE_FRACTION * budget.seconds, _MIN_LIMIT_S)


@final
@dataclass(frozen=True, eq=False)
class _Other:
    """A run by another method, with its distance from the first at times t; `refined`: shorter steps gain nothing."""

    description: str
    t: np.ndarray
    distance: np.ndarray
    refined: bool


def _second(setup: Setup, t: np.ndarray, q: np.ndarray, budget: Budget) -> _Other:
    """Return the finest run by another method."""
    for name in _SECOND:
        try:
            setup_of_other = replace(setup, method=method(name))
        except QueryError:  # for example, its steps cannot end where joints are held
            continue
        if runs := list(_refined(setup_of_other, t, q, budget)):
            return runs[-1]
    raise HorizonError(
        f"no run by {' or '.join(_SECOND)} finishes within {_longest(budget):.2g} s; use a larger budget or a shorter"
        " run"
    )


def _refined(setup: Setup, t: np.ndarray, q: np.ndarray, budget: Budget) -> Iterator[_Other]:
    """Yield runs with shorter and shorter steps, until shorter steps gain nothing or take too long."""
    before, limit, late = np.inf, _longest(budget), 0
    for step in step_ladder(setup.record_every_s, 1):
        description = f"{setup.method.name}, step {step:.3g} s"
        budget.report(f"reference: {description}")
        run = _in_time(replace(setup, step_s=step), budget)
        late += run is None  # with steps that are too long, the computed motion may take longer to integrate
        if late == _MAX_LATE:
            return
        if run is not None and run.q is not None:
            times, distance = _distance(t, q, run)
            size = float(np.log10(np.maximum(distance[1:], 1e-17)).mean())
            is_orderly = distance[1] < _ORDERLY
            is_refined = bool((is_orderly and size > before - _STAGNANT) or distance.max() < _ENOUGH[setup.engine])
            yield _Other(description, times, distance, is_refined)
            if is_refined or 2 * run.time_s > limit:
                return
            before = size if is_orderly else np.inf


def _distance(t: np.ndarray, q: np.ndarray, run: Run) -> tuple[np.ndarray, np.ndarray]:
    """Return the times shared by the records and a run, (k,), and the largest distance over joints at each, (k,)."""
    place = common(run.t, t)
    is_shared = place >= 0
    return t[place[is_shared]], np.abs(np.asarray(run.q)[is_shared] - q[place[is_shared]]).max(axis=1)


def _passes(t: np.ndarray, distance: np.ndarray, level: float) -> float | None:
    """Return the first time at which a distance exceeds a level, or None; its logarithm is interpolated in time."""
    above = np.flatnonzero(distance > level)
    if not len(above):
        return None
    bracket = [int(above[0]) - 1, int(above[0])]
    return float(np.interp(np.log(level), np.log(np.maximum(distance[bracket], 1e-17)), t[bracket]))


@final
@dataclass(frozen=True)
class PastHorizon:
    """The finest run of a method over the whole requested time.

    Attributes:
        name: Name of the method.
        setting: Step, in [s], or relative tolerance.
        energy: Largest residual of the energy ledger, as a fraction of the energy exchanged.
        returned: Return error |q − q₀|, in [rad] or [m]; None if the motion is driven or dissipates energy.
    """

    name: str
    setting: float
    energy: float
    returned: float | None


def past_horizon(
    setup: Setup,
    horizon_s: float,
    ladders: Iterable[ToleranceLadder],
    integrators: Mapping[str, Integrator | Adaptive],
    budget: Budget,
) -> tuple[PastHorizon, ...]:
    """Return the energy error and the return error of each method over the whole duration.

    Args:
        setup: The setup over the whole duration.
        horizon_s: The horizon, up to which errors were measured.
        ladders: The measured ladders; for each method, the first one with a run that is fast enough is used.
        integrators: The methods, by name.
        budget: The time budget; a run may take a fiftieth of it.
    """
    results: dict[str, PastHorizon] = {}
    longest, setup = _RUN_FRACTION * budget.seconds, recorded(setup, setup.duration_s)
    for ladder in ladders:
        in_time = [p for p in ladder.points if isfinite(p.error) and p.time_s * setup.duration_s / horizon_s < longest]
        if ladder.peer or not ladder.events or ladder.method in results or not in_time:
            continue
        budget.report(f"beyond the horizon: {ladder.name}")
        with suppress(OvertimeError, RobotDynError):
            setting = in_time[-1].setting
            finest = replace(setup, method=integrators[ladder.method], engine=ladder.engine)
            finest = at_setting(finest, setting)
            with budget.apart():
                warmed(finest)
            results[ladder.method] = PastHorizon(ladder.method, setting, *_there_and_back(finest, longest))
    return tuple(results.values())


def _there_and_back(setup: Setup, longest: float) -> tuple[float, float | None]:
    """Return the energy residual and the return error of a run; None if the motion is driven or dissipates energy."""
    there, returned = _run(setup, longest), None
    if setup.controller is None and all(isinstance(effect, Conservative) for effect in setup.plant.effects):
        back = _run(replace(setup, q0=there.q[-1], v0=-there.v[-1]), longest)
        returned = float(np.abs(back.q[-1] - setup.q0).max())
    return there.ledger.closure, returned


def _run(setup: Setup, longest: float) -> Trajectory:
    run = simulate(setup, on_progress=Budget(longest).check)
    if run.outcome.ending is Ending.STOPPED:
        raise KeyboardInterrupt
    if run.outcome.ending is not Ending.FINISHED:
        raise RobotDynError(run.outcome.text)
    return run
