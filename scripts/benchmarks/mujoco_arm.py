"""MuJoCo's model of one of our arms, from the same file by its own parser: M(q) agrees to rounding."""

from __future__ import annotations

from copy import deepcopy
from typing import Any

from lxml import etree  # pyright: ignore[reportAttributeAccessIssue]

import robot_dyn as rd

STEP_S = 1e-3


def mujoco_model(
    mujoco: Any, arm: rd.Robot, gains: tuple[float, float] | None = None, damping: float = 0.0, bare: bool = False
) -> Any:
    """The arm under RK4 at 1 ms: fingers fixed, no limits, no contacts; PD with `gains` (kp, kd) on every joint.

    Args:
        mujoco: The module.
        arm: The robot; its locked joints are prismatic and held at 0.
        gains: Of a position servo u = kp (ctrl − q) − kd v on each joint.
        damping: Viscous friction of each joint, in [N m s/rad].
        bare: Whether the constraint solver is switched off with all it would look for.
    """
    urdf = deepcopy(arm.description.element)
    etree.strip_elements(urdf, "visual", "collision", "limit", "dynamics", "mimic", "safety_controller")
    for joint in urdf.iter("joint"):
        if joint.get("type") == "prismatic":
            joint.set("type", "fixed")
        elif joint.get("type") == "revolute":
            joint.set("type", "continuous")
    options = etree.SubElement(urdf, "mujoco")
    etree.SubElement(options, "compiler", fusestatic="true", balanceinertia="false", boundmass="0", boundinertia="0")
    spec = mujoco.MjSpec.from_string(etree.tostring(urdf, encoding="unicode"))
    if gains is not None:
        for name in arm.joint_names:
            servo = spec.add_actuator()
            servo.target, servo.trntype = name, mujoco.mjtTrn.mjTRN_JOINT
            servo.gaintype, servo.biastype = mujoco.mjtGain.mjGAIN_FIXED, mujoco.mjtBias.mjBIAS_AFFINE
            servo.gainprm[0], servo.biasprm[:3] = gains[0], [0.0, -gains[0], -gains[1]]
    model = spec.compile()
    model.opt.gravity[:] = rd.STANDARD_GRAVITY
    model.opt.timestep, model.opt.integrator = STEP_S, mujoco.mjtIntegrator.mjINT_RK4
    model.dof_damping[:] = damping
    off = mujoco.mjtDisableBit
    model.opt.disableflags |= int(off.mjDSBL_CONTACT)
    if bare:
        for bit in (off.mjDSBL_CONSTRAINT, off.mjDSBL_LIMIT, off.mjDSBL_EQUALITY, off.mjDSBL_FRICTIONLOSS):
            model.opt.disableflags |= int(bit)
    assert tuple(model.joint(i).name for i in range(model.njnt)) == arm.joint_names
    return model
