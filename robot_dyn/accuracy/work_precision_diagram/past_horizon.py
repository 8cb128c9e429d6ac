"""Beyond the horizon of a chaotic motion no error can be measured: there energy judges, and the way back.

    |q − q₀|   of a run to the end and, with its velocity turned round, back to the start

A motion that is not driven and loses no energy returns to its start. Rounding grows on the way as
the errors of the method do: a method with smaller errors returns nearer to it, until only rounding is left. [Hairer,
Lubich, Wanner, Geometric Numerical Integration, 2nd ed., 2006, V.1]
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from math import isfinite
from typing import Any, final

import numpy as np

from robot_dyn.accuracy.work_precision_diagram.method_under_test import at_setting, recorded
from robot_dyn.accuracy.work_precision_diagram.tolerance_ladder import ToleranceLadder
from robot_dyn.effects.effect import Conservative
from robot_dyn.foundations.errors import RobotDynError
from robot_dyn.report.time_budget import Budget, Limit, OvertimeError
from robot_dyn.simulation.results.trajectory import Trajectory
from robot_dyn.simulation.run.outcome import Ending
from robot_dyn.simulation.setup.setup import Setup
from robot_dyn.simulation.simulate import simulate

_PART = 0.02  # of the budget, for one run


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
            finest = replace(setup, integrator=integrators[ladder.method], engine=ladder.engine)
            found[ladder.method] = PastHorizon(
                ladder.method, setting, *_there_and_back(at_setting(finest, setting), longest)
            )
    return tuple(found.values())


def _there_and_back(setup: Setup, longest: float) -> tuple[float, float | None]:
    """Energy and distance of return."""
    there, returned = _run(setup, longest), None
    if setup.controller is None and all(isinstance(effect, Conservative) for effect in setup.plant.effects):
        back = _run(replace(setup, q0=there.q[-1], v0=-there.v[-1]), longest)
        returned = float(np.abs(back.q[-1] - setup.q0).max())
    return there.ledger.closure, returned


def _run(setup: Setup, longest: float) -> Trajectory:
    run = simulate(setup, on_progress=Limit(longest))
    if run.outcome.ending is Ending.STOPPED:
        raise KeyboardInterrupt
    if run.outcome.ending is not Ending.FINISHED:
        raise RobotDynError(run.outcome.advice)
    return run
