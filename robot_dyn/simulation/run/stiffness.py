"""Stiff runs: stability bounds the steps of an explicit method that chooses them, h |λ| ≈ 6, and a stiff one is faster.

A stiff method damps oscillations of more than a radian a step, and its steps do not show them.
[Hairer, Wanner 1996, IV.2, p. 21]
"""

from __future__ import annotations

import numpy as np

from robot_dyn.foundations.arithmetic import Array
from robot_dyn.foundations.errors import RobotDynError
from robot_dyn.integrate.adaptive import EXPLICIT, STIFF
from robot_dyn.simulation.dynamics.fastest_motion import Fastest, fastest
from robot_dyn.simulation.dynamics.state_equation import StateEquation
from robot_dyn.simulation.observation.remarks import Remark, RemarkKind
from robot_dyn.simulation.run.outcome import Stiff
from robot_dyn.simulation.run.recording import Recording
from robot_dyn.simulation.setup.setup import Setup

_BOUND = (4.0, 9.0)  # h |λ| of explicit steps that stability bounds: by 6.1 for DOP853, about which they go up and down
_WORTH = 1000  # steps still to be made for which starting again is worthwhile
FIRST_LOOK = 500  # steps of a run whose method is to be chosen, then after as many again as there were
_LEAST_STEPS = 1000  # of a finished run that is looked at
_LOOKS = 9  # at steps of it
_MEAN = 20  # steps whose mean length is looked at


def changes_over(setup: Setup, equation: StateEquation, ends: Array, y: Array, held: Array | None) -> Stiff | None:
    """Why a stiff method is to make a run: stability bounds its latest steps, and many more would follow; else None.

    Args:
        setup: What is run.
        equation: The state equation where the run is.
        ends: Ends of its steps so far, in [s].
        y: The state at the last of them.
        held: The actuation in zero-order hold, or None.
    """
    t, h = float(ends[-1]), float(ends[-1] - ends[-1 - _MEAN]) / _MEAN
    if h * _WORTH > setup.duration_s - t:
        return None
    try:
        motion = fastest(equation, t, y, held)
    except (RobotDynError, np.linalg.LinAlgError):
        return None
    return Stiff(_remark(motion, t, t, {"method": STIFF, "before": EXPLICIT})) if _bounds(motion, h) else None


def bounded_by_stability(setup: Setup, record: Recording) -> tuple[Remark, ...]:
    """A remark if stability, and not the tolerance, bounds the steps of an explicit method that chooses them.

    That is where h |λ| is about the end of the stability domain in most of some steps, λ the fastest decay.
    [Hairer, Wanner 1996, IV.2, p. 21]
    """
    method, equation, t, y = setup.method, setup.equation, record.step_log.t, record.step_log.y
    explicit = method.controls_error and method.plain and not method.needs_jacobian
    if not explicit or record.steps < _LEAST_STEPS or len(t) < _LEAST_STEPS:
        return ()
    held, found = np.zeros(equation.plant.dynamics.n) if equation.sampled else None, []
    for k in np.linspace(1, len(t) - 2, _LOOKS).astype(int):
        try:
            motion = fastest(equation, float(t[k]), y[k], held)
        except (RobotDynError, np.linalg.LinAlgError):
            continue
        if _bounds(motion, float(t[k + 1] - t[k])):
            found.append((abs(motion.eigenvalue), k, motion))
    if len(found) <= _LOOKS // 2:
        return ()
    _, k, motion = max(found, key=lambda each: each[0])
    return (_remark(motion, float(t[-1]), float(t[k]), {"method": STIFF}),)


def damped_oscillation(setup: Setup, record: Recording) -> Fastest | None:
    """What a method damps with steps of any length near its own: an oscillation of more than a radian a step.

    None if nothing of the kind is found at some states of the run.
    """
    equation = setup.equation
    t, y, held = record.step_log.t, record.step_log.y, np.zeros(equation.plant.dynamics.n) if equation.sampled else None
    for k in np.unique(np.linspace(0, len(t) - 2, _LOOKS).astype(int)):
        try:
            motion = fastest(equation, float(t[k]), y[k], held, oscillation=True)
        except (RobotDynError, np.linalg.LinAlgError):
            continue
        if abs(motion.eigenvalue) * setup.taken_step_s > 1:
            return motion
    return None


def _bounds(motion: Fastest, h: float) -> bool:
    """Whether stability bounds explicit steps of length h."""
    return motion.decays and _BOUND[0] < abs(motion.eigenvalue) * h < _BOUND[1]


def _remark(motion: Fastest, end: float, at: float, methods: dict[str, str]) -> Remark:
    """Return the remark that stability bounds the steps up to `end`, as seen at time `at`."""
    size, facts = abs(motion.eigenvalue), {"motion": str(motion), **methods}
    return Remark(RemarkKind.STIFF, motion.joint, "v", 0.0, end, at, size, None, facts=dict[str, float | str](facts))
