"""MuJoCo's Euler, implicitfast and RK4 in C, from the same file by its own parser."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from importlib import import_module
from time import perf_counter
from typing import Any, final

import numpy as np

from robot_dyn.accuracy.work_precision_diagram.method_under_test import MethodUnderTest, Run, step_ladder
from robot_dyn.accuracy.work_precision_diagram.peers.arm_motion import ArmMotion, desired_motion
from robot_dyn.accuracy.work_precision_diagram.peers.mujoco_model import joint_places, mujoco_model
from robot_dyn.control.independent_joint import PD
from robot_dyn.effects.friction import ViscousFriction
from robot_dyn.effects.line_spring_damper import LineDamper, LineSpring
from robot_dyn.report.time_budget import Limit

_METHODS = {  # name of the option, order, evaluations of the equation of motion in a step
    "RK4": ("mjINT_RK4", 4, 4), "Euler": ("mjINT_EULER", 1, 1), "implicitfast": ("mjINT_IMPLICITFAST", 1, 1),
}  # fmt: skip
_IN_C = ViscousFriction, LineSpring, LineDamper


def methods_under_test(motion: ArmMotion) -> list[MethodUnderTest]:
    """Its three methods."""
    module: Any = import_module("mujoco")
    model, at, callbacks = _model(motion, module)
    data = module.MjData(model)

    def forward(t: float, q: np.ndarray, v: np.ndarray) -> None:
        data.time, data.qpos[at], data.qvel[at] = t, q, v
        with callbacks.installed(module):
            module.mj_forward(model, data)

    def mass_matrix(q: np.ndarray) -> np.ndarray:
        M = np.zeros((model.nv, model.nv))
        forward(0.0, q, 0 * q)
        module.mj_fullM(model, data, M)
        return M[np.ix_(at, at)]

    def bias(q: np.ndarray, v: np.ndarray) -> np.ndarray:
        forward(0.0, q, v)
        return data.qfrc_bias[at]

    def torque(t: float, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        forward(t, q, v)
        return (data.qfrc_passive + data.qfrc_actuator)[at]

    motion.check(mass_matrix, bias, torque)
    return [_method(motion, module, name) for name in _METHODS]


def _method(motion: ArmMotion, module: Any, name: str) -> MethodUnderTest:
    option, order, each = _METHODS[name]
    model, at, callbacks = _model(motion, module)
    model.opt.integrator = getattr(module.mjtIntegrator, option)
    setup, records = motion.setup, len(motion.times) - 1
    period = float(motion.times[-1]) / records

    def run(step: float, limit: Limit) -> Run:
        data, count = module.MjData(model), round(period / step)
        model.opt.timestep = period / count
        data.qpos[at], data.qvel[at] = setup.q0, setup.v0
        q, v = (np.empty((records + 1, motion.robot.n)) for _ in range(2))
        q[0], v[0] = setup.q0, setup.v0
        with callbacks.installed(module), np.errstate(all="ignore"):
            limit(0.0)
            began = perf_counter()
            for k in range(records):
                module.mj_step(model, data, count)
                q[k + 1], v[k + 1] = data.qpos[at], data.qvel[at]
                limit(motion.times[k + 1])
            spent = perf_counter() - began
        lost = any(warning.number for warning in data.warning)
        return motion.run(q * np.nan if lost else q, v, count * records, each * count * records, spent)

    return MethodUnderTest(f"MuJoCo {name}", "", motion.events, order, "step", lambda: step_ladder(period, order), run)


@final
@dataclass(frozen=True)
class _Callbacks:
    """What MuJoCo calls at each evaluation: commands of its servos, and torques that it does not have in C."""

    control: Callable[[Any, Any], None] | None
    passive: Callable[[Any, Any], None] | None

    @contextmanager
    def installed(self, module: Any) -> Iterator[None]:
        """For one run: they are MuJoCo's for all of the process."""
        module.set_mju_user_warning(lambda _: None)  # it would print, and write a file: the outcome says the same
        module.set_mjcb_control(self.control)
        module.set_mjcb_passive(self.passive)
        try:
            yield
        finally:
            module.set_mju_user_warning(None)
            module.set_mjcb_control(None)
            module.set_mjcb_passive(None)


def _model(motion: ArmMotion, module: Any) -> tuple[Any, list[int], _Callbacks]:
    """The arm with viscous friction, lines and servos in C, the places of its joints, and the rest in Python."""
    servo, effects = motion.servo, motion.setup.plant.effects
    damping: Any = sum((each.damping for each in effects if isinstance(each, ViscousFriction)), start=0.0)
    others: Any = [each for each in effects if not isinstance(each, _IN_C)]
    gains = None if servo is None else (servo.kp, servo.kd)
    model = mujoco_model(module, motion.robot, gains, damping, bare=True, lines=motion.lines)
    at = joint_places(model, motion.robot)

    def passive(_: Any, data: Any) -> None:
        for each in others:
            data.qfrc_passive[at] += each.torque(None, data.time, data.qpos[at], data.qvel[at])

    return model, at, _Callbacks(None if servo is None else _command(model, servo), passive if others else None)


def _command(model: Any, servo: PD) -> Callable[[Any, Any], None]:
    """Makes servos whose command is kp q_d + kd v_d: MuJoCo subtracts kp q + kd v."""
    desired = desired_motion(servo.reference)
    model.actuator_gainprm[:, 0] = 1.0

    def control(_: Any, data: Any) -> None:
        q_d, v_d = desired(data.time)
        data.ctrl[:] = servo.kp * q_d + servo.kd * v_d

    return control
