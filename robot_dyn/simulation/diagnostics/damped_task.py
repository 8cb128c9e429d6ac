"""Remarks on operational-space control that damps its task: the smallest eigenvalue of J M⁻¹ Jᵀ is below the threshold.

The arm then does not follow along a commanded direction.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from robot_dyn.control.operational_space import OperationalSpace, task_dynamics
from robot_dyn.foundations.errors import RobotDynError
from robot_dyn.simulation.observation.remarks import Remark, RemarkKind
from robot_dyn.simulation.run.recording import Recording
from robot_dyn.simulation.setup.setup import Setup

_MOST = 2000  # maximum number of states checked


def damped(setup: Setup, record: Recording) -> Iterator[Remark]:
    """Yield a remark for each frame whose task is damped at a sample or at the end of a step."""
    controller, n = setup.controller, setup.plant.dynamics.n
    if controller is None:
        return
    parts = (controller, *(block.part for block in controller.parts))
    tasks = [part for part in parts if isinstance(part, OperationalSpace)]
    if not tasks:
        return
    t, first = np.unique(np.concatenate([record.t, record.step_log.t]), return_index=True)
    q = np.concatenate([record.y[:, :n], record.step_log.y[:, :n]])[first]
    t, q = (x[np.isfinite(q).all(axis=1)] for x in (t, q))
    rows = np.unique(np.linspace(0, len(t) - 1, min(len(t), _MOST)).astype(int))
    for task in tasks:
        yield from _of(task, t[rows], q[rows])


def _of(task: OperationalSpace, t: np.ndarray, q: np.ndarray) -> Iterator[Remark]:
    try:
        in_task = task_dynamics(task.model, q, 0 * q, task.frame, rows=task.rows, threshold=task.threshold)
    except RobotDynError:  # error of the model; the outcome of the run reports it
        return
    smallest = np.asarray(in_task.smallest, float)
    below = smallest < task.threshold
    if not below.any():
        return
    lasts = np.append(np.diff(t), 0.0)
    at, start, duration = int(smallest.argmin()), float(t[below.argmax()]), float(lasts[below].sum())
    least, when = float(smallest[at]), float(t[at])
    facts: dict[str, float | str] = {"least": max(least, 0.0)}  # rounding may leave it below 0
    yield Remark(RemarkKind.DAMPED, task.frame, "q", start, duration, when, least, float(task.threshold), facts=facts)
