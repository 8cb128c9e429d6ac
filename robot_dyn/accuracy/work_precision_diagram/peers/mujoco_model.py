"""An arm as a model of MuJoCo, by its own parser of the file."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from lxml import etree  # pyright: ignore[reportAttributeAccessIssue]

from robot_dyn.accuracy.work_precision_diagram.peers.arm_motion import PeerError, bare_urdf
from robot_dyn.effects.line_spring_damper import LineDamper, LineSpring
from robot_dyn.model.robot import Robot

STEP_S = 1e-3


def mujoco_model(
    mujoco: Any, arm: Robot, gains: tuple[Any, Any] | None = None, damping: Any = 0.0, bare: bool = False,
    lines: Sequence[LineSpring | LineDamper] = (),
) -> Any:  # fmt: skip
    """The arm under RK4 at 1 ms: locked joints fixed, no limits, no contacts; PD with `gains` (kp, kd) on every joint.

    Args:
        mujoco: The module.
        arm: The robot.
        gains: Of a position servo u = kp (ctrl − q) − kd v on each joint, scalars or (n,).
        damping: Viscous friction of each joint, a scalar or (n,), in [N m s/rad].
        bare: Whether the constraint solver is switched off with all it would look for.
        lines: Springs and dampers between points: as its tendons.

    Raises:
        PeerError: If it does not take the file, or has other joints or bodies.
    """
    urdf = bare_urdf(arm)
    options = etree.SubElement(urdf, "mujoco")
    etree.SubElement(options, "compiler", fusestatic="true", balanceinertia="false", boundmass="0", boundinertia="0")
    try:
        spec = mujoco.MjSpec.from_string(etree.tostring(urdf, encoding="unicode"))
        for k, line in enumerate(lines):
            _add_tendon(spec, line, f"line {k}")
        if gains is not None:
            _add_servos(mujoco, spec, arm, *gains)
        model = spec.compile()
    except ValueError as error:
        raise PeerError(f"it does not take the file: {' '.join(str(error).split())}") from None
    model.opt.gravity[:] = arm.edits.gravity
    model.opt.timestep, model.opt.integrator = STEP_S, mujoco.mjtIntegrator.mjINT_RK4
    model.dof_damping[joint_places(model, arm)] = damping
    for k, line in enumerate(lines):
        if isinstance(line, LineSpring):
            model.tendon_stiffness[k], model.tendon_lengthspring[k] = line.stiffness, line.length
        else:
            model.tendon_damping[k] = line.damping
    off = mujoco.mjtDisableBit
    model.opt.disableflags |= int(off.mjDSBL_CONTACT)
    if bare:
        for bit in (off.mjDSBL_CONSTRAINT, off.mjDSBL_LIMIT, off.mjDSBL_EQUALITY, off.mjDSBL_FRICTIONLOSS):
            model.opt.disableflags |= int(bit)
    return model


def joint_places(model: Any, arm: Robot) -> list[int]:
    """Where a model has the joints of the arm, in the order of the arm's; PeerError if it has others."""
    names = [model.joint(i).name for i in range(model.njnt)]
    if set(names) != set(arm.joint_names):
        raise PeerError(f"it has other joints: {', '.join(names)}")
    return [names.index(name) for name in arm.joint_names]


def _add_servos(mujoco: Any, spec: Any, arm: Robot, kp: Any, kd: Any) -> None:
    """One for each joint, in the order of the arm's."""
    for name, kp_i, kd_i in zip(arm.joint_names, *(np.broadcast_to(x, arm.n) for x in (kp, kd)), strict=True):
        servo = spec.add_actuator()
        servo.target, servo.trntype = name, mujoco.mjtTrn.mjTRN_JOINT
        servo.gaintype, servo.biastype = mujoco.mjtGain.mjGAIN_FIXED, mujoco.mjtBias.mjBIAS_AFFINE
        servo.gainprm[0], servo.biasprm[:3] = kp_i, [0.0, -kp_i, -kd_i]


def _add_tendon(spec: Any, line: LineSpring | LineDamper, name: str) -> None:
    tendon = spec.add_tendon(name=name)
    for k, (frame, point) in enumerate(((line.frame, line.point), (line.other_frame, line.other_point))):
        body = spec.worldbody if frame is None else spec.body(frame)
        if body is None:
            raise PeerError(f"it has no body {frame!r}")
        body.add_site(name=f"{name}, end {k}", pos=np.asarray(point))
        tendon.wrap_site(f"{name}, end {k}")
