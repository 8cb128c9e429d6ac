"""What errors are measured against: two runs by methods of different kind, tighter than all others.

Their distance is the error of the reference. Where they part, as in chaotic motion, the horizon is cut. Beyond it
energy judges, and the way back:

    |q − q₀|   of a run to the end and, with its velocity turned round, back to the start

A motion that is not driven and loses no energy returns to its start. Rounding grows on the way as
the errors of the method do: a method with smaller errors returns nearer to it, until only rounding is left. [Hairer,
Lubich, Wanner, Geometric Numerical Integration, 2nd ed., 2006, V.1]
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from math import isfinite
from typing import Any, final

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
from robot_dyn.foundations.values import Value, read_only
from robot_dyn.integrate.adaptive import Adaptive
from robot_dyn.integrate.methods import method
from robot_dyn.report.time_budget import Budget, OvertimeError
from robot_dyn.simulation.results.trajectory import Trajectory
from robot_dyn.simulation.run.outcome import Ending
from robot_dyn.simulation.setup.setup import Setup
from robot_dyn.simulation.simulate import simulate

_PARTED = 1e-9  # of the positions: where references differ by more, nothing finer can be shown
_COARSE = 1e-6  # the same where the second one could not be refined until only rounding is left
_STAGNANT = 0.3  # decades that twice as many steps must win
_ORDERLY = 1e-6  # distance at the first record, from which on that is judged
_ENOUGH = {COMPILED: 0.0, INTERPRETED: 1e-12}  # distance that need not be less: where shorter steps take seconds
_ROUGH, _ROUGHLY = 1e-11, 1e-6  # a tolerance, and where its run parts from the first one: beyond, nothing is resolved
_LATE = 3  # runs of one method that may take too long
_LOST = 0.1  # [rad] or [m]: runs that far apart have nothing in common
_LEAST = 1e-3  # of the duration: a horizon that is shorter shows nothing
_ULPS = 4.0  # of rounding in any position
_FIRST = (Adaptive("DOP853", 3e-14, 1e-15), Adaptive("Rodas5P", 1e-12, 1e-14))
_SECOND = ("GaussLegendre6", "Rodas5PFixed")
_SHARE, _LEAST_S = 0.08, 0.5  # of the budget, for one run; and at least, in [s]
_PART = 0.02  # of the budget, for one run


class HorizonError(RobotDynError):
    """A motion that has no reference solution."""


@final
@dataclass(frozen=True, eq=False)
class Reference(Value):
    """What errors are measured against.

    Attributes:
        t: Times of the records, (k,), in [s].
        q: Positions there, (k, n).
        error: Distance of the two runs, in [rad] or [m]: no error below it is believed.
        methods: What made them, the one that q is of first.
        horizon_s: Time up to which it reaches, in [s].
        parted_s: Time at which they, or runs at tolerances of 3e-14 and 1e-11, parted, in [s]: it ends the horizon;
            None if they did not.
        lost_s: Time at which the latter differed by 0.1 rad or m, in [s]; None if they did not.
    """

    t: np.ndarray = field(metadata=UNREPORTED)
    q: np.ndarray = field(metadata=UNREPORTED)
    error: float
    methods: tuple[str, str]
    horizon_s: float
    parted_s: float | None = None
    lost_s: float | None = None

    def __post_init__(self) -> None:
        read_only(self)

    @reported
    def records(self) -> int:
        """Number of times at which errors are looked at."""
        return len(self.t) - 1

    def distance(self, run: Run) -> float:
        """Largest |q − q_ref| of a run over joints and records; inf if it diverged."""
        return np.inf if run.q is None else float(_distance(self.t, self.q, run)[1].max())


def reference(setup: Setup, budget: Budget) -> tuple[Setup, Reference]:
    """Return the setup up to the horizon, and its reference.

    Raises:
        HorizonError: If there is none.
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
            return setup, Reference(run, q, error, (first, other.words), setup.duration_s, parted, lost)
        parted = end = float(f"{end:.2g}") if float(f"{end:.2g}") < setup.duration_s else end
        if end < _LEAST * requested:
            raise HorizonError(
                f"{first} and {other.words} part within {_LEAST:g} of the duration, at t = {end:.2g} s: no error can be"
                " measured; take a shorter run, or a start that is less sensitive"
            )
        setup = replace(setup, duration_s=end, record_every_s=0.0)


def _first(setup: Setup, budget: Budget) -> tuple[str, np.ndarray, np.ndarray]:
    """Words for the tightest run that ends in time, its records and its positions there."""
    for tight in _FIRST:
        description = f"{tight.name}, rtol {tight.rtol:g}"
        budget.report(f"reference: {description}")
        run = _in_time(replace(setup, method=tight), budget)
        if run is not None and run.q is not None:
            return description, run.t, run.q
    raise HorizonError(
        f"no run of {setup.duration_s:g} s ends by {' or '.join(tight.name for tight in _FIRST)} at tight tolerances:"
        " take a shorter run, a larger budget, or look at rd.simulate(…).summary"
    )


def _rough_ends(
    setup: Setup, t: np.ndarray, q: np.ndarray, size: float, budget: Budget
) -> tuple[float | None, float | None]:
    """When a run with a looser tolerance parts from the first one, and when nothing is left; None if it does not."""
    run = _in_time(replace(setup, method=Adaptive("DOP853", _ROUGH, _ROUGH)), budget)
    if run is None or run.q is None:
        return None, None
    times, distance = _distance(t, q, run)
    return _passes(times, distance, _ROUGHLY * size), _passes(times, distance, _LOST)


def _in_time(setup: Setup, budget: Budget) -> Run | None:
    """Run a setup; None if it takes too long."""
    with budget.apart():
        warmed(setup)
    with suppress(OvertimeError):
        return timed(setup, Budget(_longest(budget)).check)
    return None


def _longest(budget: Budget) -> float:
    """Time that a run may take, in [s]."""
    return max(_SHARE * budget.seconds, _LEAST_S)


@final
@dataclass(frozen=True, eq=False)
class _Other:
    """A run by another method: its distance from the first one at times, and whether shorter steps win nothing."""

    words: str
    t: np.ndarray
    distance: np.ndarray
    refined: bool


def _second(setup: Setup, t: np.ndarray, q: np.ndarray, budget: Budget) -> _Other:
    """The finest run by another method."""
    for name in _SECOND:
        try:
            setup_of_other = replace(setup, method=method(name))
        except QueryError:  # it cannot end its steps where joints are held, say
            continue
        if runs := list(_refined(setup_of_other, t, q, budget)):
            return runs[-1]
    raise HorizonError(
        f"no run by {' or '.join(_SECOND)} ends within {_longest(budget):.2g} s: take a larger budget, or a shorter run"
    )


def _refined(setup: Setup, t: np.ndarray, q: np.ndarray, budget: Budget) -> Iterator[_Other]:
    """Runs with ever shorter steps, until these win nothing or take too long."""
    before, limit, late = np.inf, _longest(budget), 0
    for step in step_ladder(setup.record_every_s, 1):
        words = f"{setup.method.name}, step {step:.3g} s"
        budget.report(f"reference: {words}")
        run = _in_time(replace(setup, step_s=step), budget)
        late += run is None  # steps that are too long may bring forth a motion that takes longer
        if late == _LATE:
            return
        if run is not None and run.q is not None:
            times, distance = _distance(t, q, run)
            size = float(np.log10(np.maximum(distance[1:], 1e-17)).mean())
            orderly = distance[1] < _ORDERLY
            refined = bool((orderly and size > before - _STAGNANT) or distance.max() < _ENOUGH[setup.engine])
            yield _Other(words, times, distance, refined)
            if refined or 2 * run.time_s > limit:
                return
            before = size if orderly else np.inf


def _distance(t: np.ndarray, q: np.ndarray, run: Run) -> tuple[np.ndarray, np.ndarray]:
    """Times that the records share with those of a run, (k,), and the largest distance over joints there, (k,)."""
    place = common(run.t, t)
    met = place >= 0
    return t[place[met]], np.abs(np.asarray(run.q)[met] - q[place[met]]).max(axis=1)


def _passes(t: np.ndarray, distance: np.ndarray, level: float) -> float | None:
    """The first time at which a distance passes a level, by its logarithm between records; None if it never does."""
    above = np.flatnonzero(distance > level)
    if not len(above):
        return None
    both = [int(above[0]) - 1, int(above[0])]
    return float(np.interp(np.log(level), np.log(np.maximum(distance[both], 1e-17)), t[both]))


@final
@dataclass(frozen=True)
class PastHorizon:
    """The finest run of a method over the whole requested time.

    Attributes:
        name: Of the method.
        setting: Step, in [s], or relative tolerance.
        energy: Largest residual of the energy ledger, as a part of the energy exchanged.
        returned: Distance from the start of the run there and back, in [rad] or [m]; None if it does not return, or
            the motion is driven or loses energy.
    """

    name: str
    setting: float
    energy: float
    returned: float | None


def past_horizon(
    setup: Setup, horizon_s: float, ladders: Iterable[ToleranceLadder], integrators: Mapping[str, Any], budget: Budget
) -> tuple[PastHorizon, ...]:
    """Return energy and distance of return of each method past the horizon.

    Args:
        setup: Of the whole time.
        horizon_s: Up to which errors were measured.
        ladders: What was measured; the first one of each method counts.
        integrators: The methods, by name.
        budget: Of which a run may take a fiftieth.
    """
    found: dict[str, PastHorizon] = {}
    longest, setup = _PART * budget.seconds, recorded(setup, setup.duration_s)
    for ladder in ladders:
        in_time = [p for p in ladder.points if isfinite(p.error) and p.time_s * setup.duration_s / horizon_s < longest]
        if ladder.peer or not ladder.events or ladder.method in found or not in_time:
            continue
        budget.report(f"beyond the horizon: {ladder.name}")
        with suppress(OvertimeError, RobotDynError):
            setting = in_time[-1].setting
            finest = replace(setup, method=integrators[ladder.method], engine=ladder.engine)
            finest = at_setting(finest, setting)
            with budget.apart():
                warmed(finest)
            found[ladder.method] = PastHorizon(ladder.method, setting, *_there_and_back(finest, longest))
    return tuple(found.values())


def _there_and_back(setup: Setup, longest: float) -> tuple[float, float | None]:
    """Energy and distance of return."""
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
