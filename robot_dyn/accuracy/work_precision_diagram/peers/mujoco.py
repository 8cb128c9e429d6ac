"""MuJoCo's Euler, implicitfast, discrete (since 4.0) and RK4 in C, from the same file by its own parser."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from importlib import import_module
from types import ModuleType
from typing import TYPE_CHECKING, Any

import numpy as np
from lxml import etree  # pyright: ignore[reportAttributeAccessIssue]
from numpy.typing import ArrayLike

from robot_dyn.accuracy.work_precision_diagram.method_under_test import Limit, MethodUnderTest, Run, step_ladder
from robot_dyn.accuracy.work_precision_diagram.peers.arm_motion import ArmMotion, PeerError, bare_urdf, desired_motion
from robot_dyn.control.independent_joint import PD
from robot_dyn.effects.friction import ViscousFriction
from robot_dyn.effects.line_spring_damper import LineDamper, LineSpring
from robot_dyn.model.robot import Robot

if TYPE_CHECKING:
    from mujoco import MjModel  # pyright: ignore[reportAttributeAccessIssue]

STEP_S = 1e-3
_METHODS = {  # name of the option, order, evaluations of the equation of motion per step
    "RK4": ("mjINT_RK4", 4, 4), "Euler": ("mjINT_EULER", 1, 1), "implicitfast": ("mjINT_IMPLICITFAST", 1, 1),
    "discrete": ("mjINT_DISCRETE", 1, 1),
}  # fmt: skip
_IN_C = ViscousFriction, LineSpring, LineDamper


def methods_under_test(motion: ArmMotion) -> list[MethodUnderTest]:
    """Return MuJoCo's methods; viscous friction, lines and servos run in C, other torques in Python."""
    module: Any = import_module("mujoco")
    robot, setup, servo, effects = motion.robot, motion.setup, motion.servo, motion.setup.plant.effects
    damping: Any = sum((effect.viscous for effect in effects if isinstance(effect, ViscousFriction)), start=0.0)
    gains = None if servo is None else (servo.kp, servo.kd)
    model = mujoco_model(module, robot, gains, damping, bare=True, lines=motion.lines)
    at = joint_places(model, robot)
    others: Any = [effect for effect in effects if not isinstance(effect, _IN_C)]
    control = None if servo is None else _command(model, servo)

    def passive(_: Any, data: Any) -> None:
        for effect in others:
            data.qfrc_passive[at] += effect.torque(None, data.time, data.qpos[at], data.qvel[at])

    @contextmanager
    def callbacks() -> Iterator[None]:
        """Install the callbacks of one run; MuJoCo has one set of callbacks per process."""
        module.set_mju_user_warning(lambda _: None)  # no prints and log files: the outcome reports the warning
        module.set_mjcb_control(control)
        module.set_mjcb_passive(passive if others else None)
        try:
            yield
        finally:
            for install in (module.set_mju_user_warning, module.set_mjcb_control, module.set_mjcb_passive):
                install(None)

    def forward(t: float, q: np.ndarray, v: np.ndarray) -> Any:
        data = module.MjData(model)
        data.time, data.qpos[at], data.qvel[at] = t, q, v
        with callbacks():
            module.mj_forward(model, data)
        return data

    def mass_matrix(q: np.ndarray) -> np.ndarray:
        M = np.zeros((model.nv, model.nv))
        module.mj_fullM(model, forward(0.0, q, 0 * q), M)
        return M[np.ix_(at, at)]

    def torque(t: float, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        data = forward(t, q, v)
        return (data.qfrc_passive + data.qfrc_actuator)[at]

    motion.check(mass_matrix, lambda q, v: forward(0.0, q, v).qfrc_bias[at], torque)
    records = len(motion.times) - 1
    period = float(motion.times[-1]) / records

    def method(name: str, option: str, order: int, evaluations: int) -> MethodUnderTest:
        def run(step: float, limit: Limit) -> Run:
            data, count = module.MjData(model), round(period / step)
            model.opt.integrator, model.opt.timestep = getattr(module.mjtIntegrator, option), period / count
            data.qpos[at], data.qvel[at] = setup.q0, setup.v0

            def advance(_: float) -> tuple[np.ndarray, np.ndarray]:
                module.mj_step(model, data, count)
                return data.qpos[at], data.qvel[at]

            with callbacks(), np.errstate(all="ignore"):
                q, v, spent = motion.recorded(advance, limit)
            has_failed = any(warning.number for warning in data.warning)
            return motion.run(q * np.nan if has_failed else q, v, count * records, evaluations * count * records, spent)

        steps = partial(step_ladder, period, order)
        return MethodUnderTest(f"MuJoCo {name}", "", motion.events, order, "step", steps, run)

    available = vars(module.mjtIntegrator)
    return [method(name, *details) for name, details in _METHODS.items() if details[0] in available]


def mujoco_model(
    mujoco: ModuleType,
    arm: Robot,
    gains: tuple[ArrayLike, ArrayLike] | None = None,
    damping: ArrayLike = 0.0,
    bare: bool = False,
    lines: Sequence[LineSpring | LineDamper] = (),
) -> MjModel:
    """Return the MuJoCo model of an arm, with RK4 at 1 ms; locked joints are fixed, without limits and contacts.

    Args:
        mujoco: The module.
        arm: The robot.
        gains: Gains (kp, kd) of a position servo u = kp (ctrl − q) − kd v on every joint, scalars or (n,).
        damping: Viscous friction of each joint, a scalar or (n,), in [N m s/rad].
        bare: True to switch off the constraint solver with all constraints.
        lines: Springs and dampers between points, which become tendons.

    Raises:
        PeerError: If MuJoCo cannot read the file, or has other joints or bodies.
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
        raise PeerError(f"it cannot read the file: {' '.join(str(error).split())}") from None
    model.opt.gravity[:] = arm.edits.gravity
    model.opt.timestep, model.opt.integrator = STEP_S, mujoco.mjtIntegrator.mjINT_RK4
    model.dof_damping[joint_places(model, arm)] = damping
    for k, line in enumerate(lines):
        if isinstance(line, LineSpring):
            model.tendon_stiffness[k], model.tendon_lengthspring[k] = line.stiffness, line.length
        else:
            model.tendon_damping[k] = line.damping
    off = mujoco.mjtDisableBit
    bits = (off.mjDSBL_CONSTRAINT, off.mjDSBL_LIMIT, off.mjDSBL_EQUALITY, off.mjDSBL_FRICTIONLOSS)
    for bit in (off.mjDSBL_CONTACT, *(bits if bare else ())):
        model.opt.disableflags |= int(bit)
    return model


def joint_places(model: MjModel, arm: Robot) -> list[int]:
    """Return the indices of the arm's joints in a model, in the order of the arm.

    Raises:
        PeerError: If the model has other joints.
    """
    names = [model.joint(i).name for i in range(model.njnt)]
    if set(names) != set(arm.joint_names):
        raise PeerError(f"it has other joints: {', '.join(names)}")
    return [names.index(name) for name in arm.joint_names]


def _add_servos(mujoco: Any, spec: Any, arm: Robot, kp: Any, kd: Any) -> None:
    """Add a position servo for every joint, in the order of the arm."""
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
            raise PeerError(f"its model has no body {frame!r}")
        body.add_site(name=f"{name}, end {k}", pos=np.asarray(point))
        tendon.wrap_site(f"{name}, end {k}")


def _command(model: Any, servo: PD) -> Callable[[Any, Any], None]:
    """Return the callback that commands kp q_d + kd v_d; MuJoCo subtracts kp q + kd v."""
    desired = desired_motion(servo.reference)
    model.actuator_gainprm[:, 0] = 1.0

    def control(_: Any, data: Any) -> None:
        q_d, v_d = desired(data.time)
        data.ctrl[:] = servo.kp * q_d + servo.kd * v_d

    return control
