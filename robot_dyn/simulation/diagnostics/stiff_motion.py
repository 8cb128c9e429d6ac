"""Remarks on stiff motion: a change of method during a run, steps limited by stability, and damped oscillations.

A stiff method damps oscillations of more than a radian a step, and its steps do not show them.
[Hairer, Wanner 1996, IV.2, p. 21]
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from robot_dyn.foundations.errors import RobotDynError
from robot_dyn.integrate.adaptive import EXPLICIT, STIFF
from robot_dyn.simulation.dynamics.fastest_motion import Fastest, fastest
from robot_dyn.simulation.observation.remarks import Remark, RemarkKind
from robot_dyn.simulation.run.outcome import Accumulation, Stiff
from robot_dyn.simulation.run.recording import Recording
from robot_dyn.simulation.run.stiffness import stability_limits
from robot_dyn.simulation.setup.setup import STEP_S, Setup

_LEAST_STEPS = 1000  # shortest run that is checked
_CHECKED = 9  # steps that are checked


def replacement(cause: Stiff | Accumulation) -> Remark:
    """Return the remark on a run that another method continued."""
    match cause:
        case Stiff(t, motion):
            return _limited(motion, t, t, before=EXPLICIT)
        case Accumulation(joint, start, t, speed, changes, span_s):
            facts: dict[str, float | str] = {"changes": changes, "span_s": span_s, "step_s": STEP_S}
            return Remark(RemarkKind.ACCUMULATE, joint, "v", start, t - start, t, speed, None, facts=facts)


def limited_by_stability(setup: Setup, record: Recording) -> tuple[Remark, ...]:
    """Return a remark if stability, rather than the tolerance, limits the steps of an explicit method.

    In most of the checked steps, h |λ| must be near the boundary of the stability region; λ is the eigenvalue of the
    fastest decay.
    """
    method, t = setup.method, record.step_log.t
    explicit = method.controls_error and method.plain and not method.needs_jacobian
    if not explicit or record.steps < _LEAST_STEPS or len(t) < _LEAST_STEPS:
        return ()
    motions = list(_motions(setup, record, np.linspace(1, len(t) - 2, _CHECKED).astype(int)))
    limited = [(motion, k) for motion, k in motions if stability_limits(motion, float(t[k + 1] - t[k]))]
    if len(limited) <= _CHECKED // 2:
        return ()
    motion, k = max(limited, key=lambda pair: abs(pair[0].eigenvalue))
    return (_limited(motion, float(t[-1]), float(t[k])),)


def damped_oscillation(setup: Setup, record: Recording) -> Fastest | None:
    """Return an oscillation of more than a radian a step, which a stiff method damps at any similar step length.

    None if the states checked show none.
    """
    rows = np.unique(np.linspace(0, len(record.step_log.t) - 2, _CHECKED).astype(int))
    motions = _motions(setup, record, rows, oscillation=True)
    return next((motion for motion, _ in motions if abs(motion.eigenvalue) * setup.taken_step_s > 1), None)


def _motions(
    setup: Setup, record: Recording, rows: np.ndarray, *, oscillation: bool = False
) -> Iterator[tuple[Fastest, int]]:
    """Yield the fastest motion at the start of each of these steps, if it exists, and the index of the step."""
    equation, path = setup.equation, record.step_log
    actuation = np.zeros(equation.plant.dynamics.n) if equation.sampled else None
    for k in rows:
        try:
            yield fastest(equation, float(path.t[k]), path.y[k], actuation, oscillation=oscillation), k
        except (RobotDynError, np.linalg.LinAlgError):
            continue


def _limited(motion: Fastest, end: float, at: float, **methods: str) -> Remark:
    """Return the remark that stability limits the steps up to `end`, observed at time `at`."""
    facts = motion.facts | {"method": STIFF, **methods}
    return Remark(RemarkKind.STIFF, motion.joint, "v", 0.0, end, at, abs(motion.eigenvalue), None, facts=facts)
