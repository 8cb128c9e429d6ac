"""SciPy's methods with Pinocchio's articulated-body algorithm, the usual combination in Python."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress
from importlib import import_module
from time import perf_counter
from typing import Any

import numpy as np

from robot_dyn.accuracy.work_precision_diagram.method_under_test import Limit, MethodUnderTest, Run, tolerances
from robot_dyn.accuracy.work_precision_diagram.peers.arm_motion import ArmMotion, PeerError
from robot_dyn.effects.line_spring_damper import LineDamper, LineSpring

_MIN_RTOL = 3e-14  # SciPy's own lower bound is 100 eps
_FREE = {"DOP853": 8}  # methods with their orders
_DAMPED = {"DOP853": 8, "Radau": 5, "LSODA": None}  # damped motion may be stiff


def methods_under_test(motion: ArmMotion) -> list[MethodUnderTest]:
    """Return the methods of `solve_ivp`."""
    pin: Any = import_module("pinocchio")
    from scipy.integrate import solve_ivp

    robot, setup, n, times = motion.robot, motion.setup, motion.robot.n, motion.times
    if not robot.couplings.trivial:
        raise PeerError("pin.aba does not support coupled joints")
    model: Any = robot.model
    data, torque, zero = model.createData(), _torque(motion, pin), np.zeros(n)
    start = np.concatenate([setup.q0, setup.v0])

    def mass_matrix(q: np.ndarray) -> np.ndarray:
        upper = np.triu(pin.crba(model, data, q))
        return upper + np.triu(upper, 1).T

    motion.check(mass_matrix, lambda q, v: pin.rnea(model, data, q, v, zero), torque)

    def method(name: str, order: int | None) -> MethodUnderTest:
        def run(rtol: float, limit: Limit) -> Run:
            def rate(t: float, y: np.ndarray) -> np.ndarray:
                limit(t)
                q, v = y[:n], y[n:]
                return np.concatenate([v, pin.aba(model, data, q, v, torque(t, q, v))])

            accuracy: Any = {"rtol": max(rtol, _MIN_RTOL), "atol": 1e-2 * rtol}
            q, v, evaluations = *np.full((2, len(times), n), np.nan), None
            began = perf_counter()
            # solve_ivp rejects steps that overflow; Radau raises ValueError if its iteration overflows
            with np.errstate(all="ignore"), suppress(ValueError):
                solution: Any = solve_ivp(rate, (0.0, times[-1]), start, name, t_eval=times, **accuracy)
                evaluations = solution.nfev
                if solution.status == 0:
                    q, v = solution.y[:n].T, solution.y[n:].T
            return motion.run(q, v, None, evaluations, perf_counter() - began)

        return MethodUnderTest(f"SciPy {name} + pin.aba", "", motion.events, order, "tolerance", tolerances, run)

    return [method(name, order) for name, order in (_FREE if motion.free else _DAMPED).items()]


def _torque(motion: ArmMotion, pin: Any) -> Callable[[float, np.ndarray, np.ndarray], np.ndarray]:
    """Return τ(t, q, v): joint torques, plus forces of line springs and dampers through Pinocchio's point Jacobians."""
    if not motion.lines:
        return motion.torque
    model: Any = motion.robot.model
    data, skew, axes = model.createData(), pin.skew, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    lines = [(line, *_ends(motion, model, line)) for line in motion.lines]

    def point(frame: int | None, at: np.ndarray) -> tuple[np.ndarray, Any]:
        if frame is None:
            return at, 0.0
        J, placement = pin.getFrameJacobian(model, data, frame, axes), data.oMf[frame]
        return placement.act(at), J[:3] - skew(placement.rotation @ at) @ J[3:]

    def torque(t: float, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        total = motion.torque(t, q, v)
        pin.computeJointJacobians(model, data, q)
        pin.updateFramePlacements(model, data)
        for line, end, other_end in lines:
            (p, J), (p_other, J_other) = point(*end), point(*other_end)
            length = np.sqrt((p - p_other) @ (p - p_other))
            slope = ((p - p_other) / length) @ (J - J_other)
            is_spring = isinstance(line, LineSpring)
            force = line.stiffness * (length - line.length) if is_spring else line.damping * (slope @ v)
            total = total - slope * force
        return total

    return torque


def _ends(motion: ArmMotion, model: Any, line: LineSpring | LineDamper) -> Iterator[tuple[int | None, np.ndarray]]:
    """Yield the frame and point of both ends of a line; the frame is None for the world, to which the base is fixed."""
    for frame, at in (line.frame, line.point), (line.other_frame, line.other_point):
        if frame is not None and not model.existFrame(frame):
            raise PeerError(f"Pinocchio has no frame {frame!r}")
        yield None if frame is None else model.getFrameId(frame), np.asarray(at)
