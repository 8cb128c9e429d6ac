"""Remarks on stiff runs: steps bounded by stability, and oscillations that a stiff method damps."""

from __future__ import annotations

import numpy as np

from robot_dyn.foundations.errors import RobotDynError
from robot_dyn.integrate.adaptive import STIFF
from robot_dyn.simulation.dynamics.fastest_motion import Fastest, fastest
from robot_dyn.simulation.observation.remarks import Remark
from robot_dyn.simulation.results.samples import ledger
from robot_dyn.simulation.run.recording import Recording
from robot_dyn.simulation.run.stiffness import bounds, remark
from robot_dyn.simulation.setup.setup import Setup

_LEAST_STEPS = 1000  # of a run that is looked at
_LOOKS = 9  # at steps of it


def bounded_by_stability(setup: Setup, record: Recording) -> tuple[Remark, ...]:
    """A remark if stability, and not the tolerance, bounds the steps of an explicit method that chooses them.

    That is where h |λ| is about the end of the stability domain in most of some steps, λ the fastest decay.
    [Hairer, Wanner 1996, IV.2, p. 21]
    """
    method, equation, t, y = setup.integrator, setup.equation, record.step_log.t, record.step_log.y
    explicit = method.controls_error and method.plain and not method.needs_jacobian
    if not explicit or record.steps < _LEAST_STEPS or len(t) < _LEAST_STEPS:
        return ()
    held, found = np.zeros(equation.plant.dynamics.n) if equation.sampled else None, []
    for k in np.linspace(1, len(t) - 2, _LOOKS).astype(int):
        try:
            motion = fastest(equation, float(t[k]), y[k], held)
        except (RobotDynError, np.linalg.LinAlgError):
            continue
        if bounds(motion, float(t[k + 1] - t[k])):
            found.append((abs(motion.eigenvalue), k, motion))
    if len(found) <= _LOOKS // 2:
        return ()
    _, k, motion = max(found, key=lambda each: each[0])
    return (remark(motion, 0.0, float(t[-1]), float(t[k]), f"take integrator={STIFF!r}"),)


def damped_oscillation(setup: Setup, record: Recording) -> Fastest | None:
    """What a stiff method damps with steps of any length near its own: an oscillation of more than a radian a step.

    None if the energy ledger closes, or nothing of the kind is found at some states of the run.
    """
    equation = setup.equation
    if not setup.integrator.stiff or ledger(equation, record).closes:
        return None
    t, y, held = record.step_log.t, record.step_log.y, np.zeros(equation.plant.dynamics.n) if equation.sampled else None
    for k in np.unique(np.linspace(0, len(t) - 2, _LOOKS).astype(int)):
        try:
            motion = fastest(equation, float(t[k]), y[k], held, oscillation=True)
        except (RobotDynError, np.linalg.LinAlgError):
            continue
        if abs(motion.eigenvalue) * setup.taken_step_s > 1:
            return motion
    return None
