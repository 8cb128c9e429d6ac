"""Four runs whose end is known, by every program that is installed, each with its best settings, named in the row.

1. Energy of the free planar_2r, 10 s from (2, 1) rad at rest: constant, to 1e-9 of the potential it passes through.
2. A pendulum in oil, c = 1e4 N m s/rad: where inertia is nothing, tan(θ/2) = tan(θ₀/2) exp(−m g l t / c), which is left
   out of by (I m g l / c²) = 1e-7 rad at most; in steps of 1 ms.
3. A block on a vertical rail, dry friction 1 % above its weight, 10 s: it does not move.
4. A block that falls 1 m on a rigid stop and loses its velocity there: it ends at the stop, to 1e-9 m.

Drake has no dry friction of joints: not asked in 3, which its row says.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any, NamedTuple

import numpy as np

import robot_dyn as rd
from robot_dyn.accuracy import PeerError
from tests.campaigns.hard.case import OURS, Case, Row
from tests.campaigns.hard.chains import planar, text
from tests.campaigns.hard.other_engines import Drake, MuJoCo, PyBullet, installed

TITLE = "The peers: runs"
LEAST = 0.3  # part of the true error that an estimate has to be
G, STEP_S, WEIGHT, FALL = 9.80665, 1e-3, 2.0, 1.0
RAIL = (
    '<robot name="rail"><link name="world"/><link name="block"><inertial><mass value="2"/>'
    '<inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial></link>'
    '<joint name="slide" type="prismatic"><parent link="world"/><child link="block"/><axis xyz="0 0 1"/>'
    '<limit lower="-1e9" upper="1e9" effort="1e9" velocity="1e9"/></joint></robot>'
)


class End(NamedTuple):
    """The state at the end of a run, and what was said of its error."""

    q: np.ndarray
    v: np.ndarray
    said: str = ""
    estimate: float = np.nan  # of the error; nan if none is given


def ours(robot: rd.Robot, q0: Any, duration: float, effects: list[Any], **options: Any) -> End:
    """The end of a run of this library."""
    run = rd.simulate(rd.Plant(robot, effects), q0, duration_s=duration, **options)
    end = run.outcome
    said = f"error of q: {run.error}" if end.ending == "finished" else f"{end.ending}: {end.text}"
    return End(run.q[-1], run.v[-1], said, run.error.largest if end.ending == "finished" else np.nan)


def mujoco(robot: rd.Robot, q0: Any, duration: float, change: Callable[[Any, Any], None]) -> End:
    """The end of a run of MuJoCo after `change(module, model)`."""
    made = MuJoCo(robot)
    module, model, data = made.module, made.model, made.data
    off = module.mjtDisableBit
    for bit in (off.mjDSBL_CONSTRAINT, off.mjDSBL_LIMIT, off.mjDSBL_FRICTIONLOSS):
        model.opt.disableflags &= ~int(bit)
    model.opt.timestep = STEP_S
    change(module, model)
    data.qpos[made.at] = q0
    module.mj_step(model, data, round(duration / STEP_S))
    return End(data.qpos[made.at].copy(), data.qvel[made.at].copy())


def drake(robot: rd.Robot, q0: Any, duration: float, scheme: str, damping: float = 0.0) -> End:
    """The end of a run of Drake by an integrator at accuracy 1e-10."""
    from importlib import import_module

    analysis = import_module("pydrake.systems.analysis")
    made = Drake(robot, damping)
    simulator: Any = analysis.Simulator(made.plant)
    analysis.ResetIntegratorFromFlags(simulator, scheme, STEP_S)
    simulator.get_mutable_integrator().set_target_accuracy(1e-10)
    context = simulator.get_mutable_context()
    made.plant.get_applied_generalized_force_input_port().FixValue(context, np.zeros(robot.n))
    made.plant.SetPositions(context, np.atleast_1d(q0)[np.argsort(made.at)])
    simulator.AdvanceTo(duration)
    return End(made.plant.GetPositions(context)[made.at], made.plant.GetVelocities(context)[made.at])


def bullet(robot: rd.Robot, q0: Any, duration: float, damping: float, force: float, stop: float | None = None) -> End:
    """The end of a run of PyBullet; friction as a velocity motor of that force."""
    made = PyBullet(robot)
    p, body, client = made.module, made.body, {"physicsClientId": made.client}
    p.setPhysicsEngineParameter(fixedTimeStep=STEP_S, numSolverIterations=1000, **client)
    moving = [i for i in range(p.getNumJoints(body, **client)) if p.getJointInfo(body, i, **client)[2] != p.JOINT_FIXED]
    for link in range(-1, p.getNumJoints(body, **client)):
        p.changeDynamics(body, link, linearDamping=0, angularDamping=0, jointDamping=damping, restitution=0, **client)
    for k, i in enumerate(moving):
        p.resetJointState(body, i, float(np.atleast_1d(q0)[made.at[k]]), **client)
        p.setJointMotorControl2(body, i, p.VELOCITY_CONTROL, targetVelocity=0, force=force, **client)
        if stop is not None:
            p.changeDynamics(body, i, jointLowerLimit=stop, jointUpperLimit=1e9, **client)
    for _ in range(round(duration / STEP_S)):
        p.stepSimulation(**client)
    found = [p.getJointState(body, moving[k], **client)[:2] for k in np.argsort(made.at)]
    return End(np.array([x[0] for x in found]), np.array([x[1] for x in found]))


def judged(
    case: str, measure: str, allowed: float, error: Callable[[End], float], runs: dict[str, Callable[[], End]]
) -> Iterator[Row]:
    """A row for each program that is installed."""
    here = {name.split()[0]: name for name, _ in installed()} | {OURS: OURS}
    for program, run in runs.items():
        name, _, settings = program.partition(", ")
        if name not in here:
            continue
        found, said = float("nan"), ""
        try:
            end = run()
            found = error(end)
            said = "" if end.estimate < LEAST * found else end.said
        except (PeerError, RuntimeError) as refusal:
            said = str(refusal)
        yield Row(case, measure, found, allowed, said, f"{here[name]}, {settings}")


def energy(seed: int) -> Iterator[Row]:
    """A free double pendulum."""
    robot, q0 = rd.load("planar_2r"), np.array([2.0, 1.0])
    size = abs(robot.potential_energy(q0)) + abs(robot.potential_energy(np.zeros(2)))

    def drift(end: End) -> float:
        energy = robot.kinetic_energy(end.q, end.v) + robot.potential_energy(end.q)
        return abs(energy - robot.potential_energy(q0)) / size

    def rk4(module: Any, model: Any) -> None:
        model.opt.integrator = module.mjtIntegrator.mjINT_RK4

    yield from judged(
        "planar_2r, free, 10 s", "energy, relative", 1e-9, drift,
        {
            f"{OURS}, default": lambda: ours(robot, q0, 10.0, []),
            f"{OURS}, GaussLegendre4, 1 ms": lambda: ours(robot, q0, 10.0, [], method="GaussLegendre4", step_s=STEP_S),
            f"{OURS}, RK4, 1 ms": lambda: ours(robot, q0, 10.0, [], method="RK4", step_s=STEP_S),
            "MuJoCo, RK4, 1 ms": lambda: mujoco(robot, q0, 10.0, rk4),
            "Drake, runge_kutta5, accuracy 1e-10": lambda: drake(robot, q0, 10.0, "runge_kutta5"),
            "PyBullet, 1 ms": lambda: bullet(robot, q0, 10.0, 0.0, 0.0),
        },
    )  # fmt: skip


def oil(seed: int) -> Iterator[Row]:
    """A pendulum whose damping is stiff."""
    robot, c, start, duration = rd.Robot.from_text(text("pendulum", planar(1))), 1e4, 2.0, 10.0
    lowest, weight = np.pi / 2, abs(robot.N(np.zeros(1))[0])  # m g l
    known = lowest + 2 * np.arctan(np.tan((start - lowest) / 2) * np.exp(-weight * duration / c))

    def implicit(module: Any, model: Any) -> None:
        model.opt.integrator, model.dof_damping[:] = module.mjtIntegrator.mjINT_IMPLICITFAST, c

    effects = [rd.effects.ViscousFriction(c)]
    yield from judged(
        "a pendulum in oil, c = 1e4, 10 s", "q, rad", 1e-6, lambda end: abs(end.q[0] - known),
        {
            f"{OURS}, default": lambda: ours(robot, [start], duration, effects),
            f"{OURS}, GaussLegendre4, 1 ms": lambda: ours(
                robot, [start], duration, effects, method="GaussLegendre4", step_s=STEP_S
            ),
            "MuJoCo, implicitfast, 1 ms": lambda: mujoco(robot, start, duration, implicit),
            "Drake, radau3, accuracy 1e-10": lambda: drake(robot, start, duration, "radau3", c),
            "PyBullet, 1 ms": lambda: bullet(robot, start, duration, c, 0.0),
        },
    )  # fmt: skip


def rest(seed: int) -> Iterator[Row]:
    """A block that friction holds."""
    robot = rd.Robot.from_text(RAIL)
    force = 1.01 * WEIGHT * G

    def stiffest(module: Any, model: Any) -> None:
        model.dof_frictionloss[:], model.dof_solref[:] = force, [2 * STEP_S, 1.0]
        model.dof_solimp[:] = [0.9999, 0.9999, 0.001, 0.5, 2.0]
        model.opt.tolerance, model.opt.iterations = 0.0, 100

    def no_friction() -> End:
        raise PeerError("has no dry friction of joints")

    yield from judged(
        "a block held by friction 1 % above its weight, 10 s", "moved, m", 0.0, lambda end: abs(end.q[0]),
        {
            f"{OURS}, default": lambda: ours(robot, [0.0], 10.0, [rd.effects.DryFriction(force)]),
            f"{OURS}, MoreauJean, 1 ms": lambda: ours(
                robot, [0.0], 10.0, [rd.effects.DryFriction(force)], method="MoreauJean", step_s=STEP_S
            ),
            "MuJoCo, frictionloss, solref 2 h, solimp 0.9999, 1 ms": lambda: mujoco(robot, 0.0, 10.0, stiffest),
            "Drake, runge_kutta5, accuracy 1e-10": no_friction,
            "PyBullet, velocity motor of that force, 1 ms": lambda: bullet(robot, 0.0, 10.0, 0.0, force),
        },
    )  # fmt: skip


def stopped(seed: int) -> Iterator[Row]:
    """A block that falls on a stop."""
    robot = rd.Robot.from_text(RAIL)

    def limited(module: Any, model: Any) -> None:
        model.jnt_limited[:], model.jnt_range[:] = 1, [-FALL, 1e9]
        model.jnt_solref[:], model.jnt_solimp[:] = [2 * STEP_S, 1.0], [0.9999, 0.9999, 0.001, 0.5, 2.0]
        model.opt.tolerance, model.opt.iterations = 0.0, 100

    stops = [rd.effects.RigidStops(-FALL, 10.0)]
    yield from judged(
        "a block that falls on a stop, 2 s", "from the stop at the end, m", 1e-9, lambda end: abs(end.q[0] + FALL),
        {
            f"{OURS}, default": lambda: ours(robot, [0.0], 2.0, stops),
            f"{OURS}, MoreauJean, 1 ms": lambda: ours(
                robot, [0.0], 2.0, stops, method="MoreauJean", step_s=STEP_S
            ),
            "MuJoCo, solref 2 h, solimp 0.9999, 1 ms": lambda: mujoco(robot, 0.0, 2.0, limited),
            "PyBullet, 1 ms": lambda: bullet(robot, 0.0, 2.0, 0.0, 0.0, -FALL),
        },
    )  # fmt: skip


LONG = energy, oil  # make test has their laws in the examples and in the family of stiffness
CASES = [Case(run.__name__, partial(run), run in LONG) for run in (energy, oil, rest, stopped)]
