"""SciPy's DOP853 with Pinocchio's articulated-body algorithm, the usual combination in Python."""

from __future__ import annotations

from importlib import import_module
from time import perf_counter
from typing import Any

import numpy as np

from robot_dyn.studies.time_budget import Limit
from robot_dyn.studies.work_precision_diagram.method_under_test import MethodUnderTest, Run, tolerances
from robot_dyn.studies.work_precision_diagram.peers.free_motion import FreeMotion, PeerError

_LEAST = 3e-14  # rtol; SciPy's own lower bound is 100 eps


def methods_under_test(motion: FreeMotion) -> list[MethodUnderTest]:
    """DOP853 from `solve_ivp`."""
    pin: Any = import_module("pinocchio")
    from scipy.integrate import solve_ivp

    robot, setup = motion.robot, motion.setup
    if not robot.couplings.trivial:
        raise PeerError("pin.aba knows no coupled joints")
    n, zero, times = robot.n, np.zeros(robot.n), motion.times
    model: Any = robot.model
    data, start = model.createData(), np.concatenate([setup.q0, setup.v0])

    def run(rtol: float, limit: Limit) -> Run:
        def rate(t: float, y: np.ndarray) -> np.ndarray:
            limit(t)
            return np.concatenate([y[n:], pin.aba(model, data, y[:n], y[n:], zero)])

        began = perf_counter()
        found: Any = solve_ivp(
            rate, (0.0, times[-1]), start, "DOP853", t_eval=times, rtol=max(rtol, _LEAST), atol=1e-2 * rtol
        )
        spent = perf_counter() - began
        y = found.y if found.status == 0 else np.full((2 * n, len(times)), np.nan)
        return motion.run(y[:n].T, y[n:].T, None, found.nfev, spent)

    return [MethodUnderTest("SciPy DOP853 + pin.aba", "", True, 8, "tolerance", tolerances, run)]
