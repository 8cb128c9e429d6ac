"""MuJoCo's Euler, implicitfast and RK4 in C, from the same file by its own parser."""

from __future__ import annotations

from importlib import import_module
from time import perf_counter
from typing import Any

import numpy as np
from lxml import etree  # pyright: ignore[reportAttributeAccessIssue]

from robot_dyn.model.robot import Robot
from robot_dyn.studies.time_budget import Limit
from robot_dyn.studies.work_precision_diagram.method_under_test import MethodUnderTest, Run, step_ladder
from robot_dyn.studies.work_precision_diagram.peers.free_motion import FreeMotion, PeerError, bare_urdf

STEP_S = 1e-3
_METHODS = {  # name of the option, order, evaluations of the equation of motion in a step
    "RK4": ("mjINT_RK4", 4, 4), "Euler": ("mjINT_EULER", 1, 1), "implicitfast": ("mjINT_IMPLICITFAST", 1, 1),
}  # fmt: skip


def mujoco_model(
    mujoco: Any, arm: Robot, gains: tuple[float, float] | None = None, damping: float = 0.0, bare: bool = False,
    ordered: bool = True,
) -> Any:  # fmt: skip
    """The arm under RK4 at 1 ms: locked joints fixed, no limits, no contacts; PD with `gains` (kp, kd) on every joint.

    Args:
        mujoco: The module.
        arm: The robot.
        gains: Of a position servo u = kp (ctrl − q) − kd v on each joint.
        damping: Viscous friction of each joint, in [N m s/rad].
        bare: Whether the constraint solver is switched off with all it would look for.
        ordered: Whether its joints must stand in the order of the robot's.

    Raises:
        PeerError: If it has other joints.
    """
    urdf = bare_urdf(arm)
    options = etree.SubElement(urdf, "mujoco")
    etree.SubElement(options, "compiler", fusestatic="true", balanceinertia="false", boundmass="0", boundinertia="0")
    try:
        spec = mujoco.MjSpec.from_string(etree.tostring(urdf, encoding="unicode"))
        if gains is not None:
            for name in arm.joint_names:
                servo = spec.add_actuator()
                servo.target, servo.trntype = name, mujoco.mjtTrn.mjTRN_JOINT
                servo.gaintype, servo.biastype = mujoco.mjtGain.mjGAIN_FIXED, mujoco.mjtBias.mjBIAS_AFFINE
                servo.gainprm[0], servo.biasprm[:3] = gains[0], [0.0, -gains[0], -gains[1]]
        model = spec.compile()
    except ValueError as error:
        raise PeerError(f"it does not take the file: {' '.join(str(error).split())}") from None
    model.opt.gravity[:] = arm.edits.gravity
    model.opt.timestep, model.opt.integrator = STEP_S, mujoco.mjtIntegrator.mjINT_RK4
    model.dof_damping[:] = damping
    off = mujoco.mjtDisableBit
    model.opt.disableflags |= int(off.mjDSBL_CONTACT)
    if bare:
        for bit in (off.mjDSBL_CONSTRAINT, off.mjDSBL_LIMIT, off.mjDSBL_EQUALITY, off.mjDSBL_FRICTIONLOSS):
            model.opt.disableflags |= int(bit)
    if ordered and tuple(model.joint(i).name for i in range(model.njnt)) != arm.joint_names:
        raise PeerError("it has the joints of the file in another order")
    return model


def methods_under_test(motion: FreeMotion) -> list[MethodUnderTest]:
    """Its three methods."""
    module: Any = import_module("mujoco")
    model = mujoco_model(module, motion.robot, bare=True)
    data = module.MjData(model)

    def mass_matrix(q: np.ndarray) -> np.ndarray:
        M = np.zeros((model.nv, model.nv))
        data.qpos[:], data.qvel[:] = q, 0.0
        module.mj_forward(model, data)
        module.mj_fullM(model, data, M)
        return M

    def bias(q: np.ndarray, v: np.ndarray) -> np.ndarray:
        data.qpos[:], data.qvel[:] = q, v
        module.mj_forward(model, data)
        return data.qfrc_bias.copy()

    motion.check(mass_matrix, bias)
    return [_candidate(motion, module, name) for name in _METHODS]


def _candidate(motion: FreeMotion, module: Any, name: str) -> MethodUnderTest:
    option, order, each = _METHODS[name]
    model = mujoco_model(module, motion.robot, bare=True)
    model.opt.integrator = getattr(module.mjtIntegrator, option)
    setup, records = motion.setup, len(motion.times) - 1
    period = float(motion.times[-1]) / records

    def run(step: float, limit: Limit) -> Run:
        data, count = module.MjData(model), round(period / step)
        module.set_mju_user_warning(lambda _: None)  # it would print, and write a file: the outcome says the same
        model.opt.timestep = period / count
        data.qpos[:], data.qvel[:] = setup.q0, setup.v0
        q, v = (np.empty((records + 1, motion.robot.n)) for _ in range(2))
        q[0], v[0] = setup.q0, setup.v0
        limit(0.0)
        began = perf_counter()
        for k in range(records):
            module.mj_step(model, data, count)
            q[k + 1], v[k + 1] = data.qpos, data.qvel
            limit(motion.times[k + 1])
        spent = perf_counter() - began
        module.set_mju_user_warning(None)
        lost = any(warning.number for warning in data.warning)
        return motion.run(q * np.nan if lost else q, v, count * records, each * count * records, spent)

    return MethodUnderTest(f"MuJoCo {name}", "", True, order, "step", lambda: step_ladder(period, order), run)
