"""Whether motors suffice for a motion: what each joint needs, its limits, and which cause asks for it."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import replace
from math import inf, nan
from typing import Any, NamedTuple

import numpy as np

from robot_dyn import Plant, Robot, Trajectory
from robot_dyn.control import PiecewisePolynomial, Plan, extreme_values
from robot_dyn.effects import EffortLimit
from robot_dyn.foundations import PlanError, QueryError, instance, shown
from robot_dyn.queries import of_joint
from robot_dyn.report import processor_and_versions
from robot_dyn.simulation import Ending, RemarkKind, remark_lines, robot_of
from robot_dyn.tools.motors.limits import Limits, limits_of, same_rotor
from robot_dyn.tools.motors.motor_budget.breakaway import breakaway, static_friction
from robot_dyn.tools.motors.motor_budget.demand import Demand, of_motion, of_run
from robot_dyn.tools.motors.motor_budget.joint_budget import JointBudget, joint_budgets
from robot_dyn.tools.motors.motor_budget.result import MotorBudget
from robot_dyn.tools.motors.motors_file import Motors
from robot_dyn.tools.motors.planning.path_plan import PathPlan

_DRIVES = "series_elastic", "rigid_backlash"  # whose motors turn at other speeds than their joints
_BEYOND = 1e-9  # of a position limit, that rounding may pass


def budget(
    motion: Any,
    plant: Any = None,
    *,
    payload: Any = None,
    motors: Motors | None = None,
    effort: Any = None,
    velocity: Any = None,
    continuous: Any = None,
) -> MotorBudget:
    """What a motion asks of the motors: torque by cause, speed, power and energy of each joint, and its headroom.

        τ = M(q) a + C(q, v) v + ∂V/∂q − Σ τ_effect

    Along a plan τ is that of the inverse dynamics; of a run it is the actuation that was recorded. It is compared with
    peak torque, its root mean square over the motion with continuous torque. Powers are those at the joint, τ v,
    without losses of motor and gear. A rotor inertia of `motors` acts as armature where the arm has none. A run that
    simulates its gears has its own rotors; those of `motors` must be the same, to 1 %.

    Args:
        motion: A plan, a `PiecewisePolynomial`, or a run of `rd.simulate`.
        plant: The arm, or a plant with effects; of a run it is known.
        payload: What a plan's arm carries, a `Payload` or several.
        motors: Of `rd.tools.motors.read_motors`: peak and continuous torques, speeds and rotors.
        effort: Peak torques, one number, by joint name or (n,), in [N m] or [N]; those of the motors or, without them,
            of the robot's file unless given.
        velocity: Speed limits, likewise, in [rad/s] or [m/s].
        continuous: Continuous torques, likewise, in [N m] or [N]; those of the motors unless given.

    Raises:
        QueryError: If the motion is of other joints, or a run is given with a plant or a payload, has diverged or
            cannot be split by cause.
        PlanError: If a limit is not allowed, or a rotor is not that of the arm.
        EffectError: If an effect has states, which a plan does not determine: give a run.

    Source: Siciliano et al. 2009, sec. 5.2; Armstrong-Hélouvry 1991 for breaking away.
    """
    if motors is not None:
        instance("motors", motors, Motors, "read them with rd.tools.motors.read_motors(path)", error=PlanError)
    given = _Given(motors, effort, velocity, continuous)
    if isinstance(motion, Trajectory):
        if plant is not None or payload is not None:
            raise QueryError(
                f"a run has its own {'plant' if plant is not None else 'payload'}: leave it out and simulate again, or"
                " give its motion, budget(rd.control.from_samples(arm, run.table(), ends='measured'), plant, payload=…)"
            )
        return _of_run(motion, given)
    if not isinstance(motion, PiecewisePolynomial | Plan | PathPlan):
        raise QueryError(f"motion: give a plan, a PiecewisePolynomial, or a run of rd.simulate, got {shown(motion)}")
    if plant is None:
        raise QueryError(
            "plant: a plan does not know its arm; give it, rd.tools.motors.budget(plan, arm), or a plant with effects"
        )
    return _of_plan(motion, _loaded(plant, payload, motors), given)


class _Given(NamedTuple):
    """Limits as they were given."""

    motors: Motors | None
    effort: Any
    velocity: Any
    continuous: Any

    def limits(self, plant: Plant) -> tuple[Limits, np.ndarray]:
        """Peak torques and speeds of a plant, and continuous torques, (n,)."""
        stated = (self.motors.continuous if self.motors is not None else None) or inf
        lasting = Limits(effort=stated if self.continuous is None else self.continuous).on(plant.dynamics).effort
        return limits_of(plant, self.motors, self.effort, self.velocity, None), lasting

    @property
    def words(self) -> str:
        """Where they are from."""
        file, motors = "the robot's file", self.motors
        stated = {
            "continuous torque": (self.continuous, motors.source if motors and motors.continuous else "not known")
        }
        stated["peak torque"] = self.effort, motors.source if motors else file
        stated["speed"] = self.velocity, motors.source if motors and motors.speed else file
        sources: dict[str, list[str]] = {}
        for name, (given, otherwise) in stated.items():
            sources.setdefault(otherwise if given is None else "given", []).append(name)
        return "; ".join(f"{', '.join(names)}: {source}" for source, names in sources.items())


def _loaded(plant: Any, payload: Any, motors: Motors | None) -> Plant:
    """The plant with a payload, and with the rotors of motors where the arm has none."""
    plant = plant if isinstance(plant, Plant) else Plant(plant)
    robot = instance("plant", plant.dynamics, Robot, "give that of a robot, such as rd.Plant(rd.load('ur5'))")
    if payload is not None:
        robot = robot.with_(payload=payload)
    if motors is not None and motors.armature:
        stated = zip(robot.joint_names, robot.armature.tolist(), strict=True)
        robot = robot.with_(armature={**motors.armature, **{name: x for name, x in stated if x}})
    return plant if robot is plant.dynamics else replace(plant, dynamics=robot)


def _of_plan(motion: PiecewisePolynomial | Plan | PathPlan, plant: Plant, given: _Given) -> MotorBudget:
    robot: Any = plant.dynamics
    plan = motion.plan if isinstance(motion, PathPlan) else motion if isinstance(motion, Plan) else None
    reference = motion if isinstance(motion, PiecewisePolynomial) else motion.reference
    joints = robot.joint_names if plan is None else plan.joint_names
    if reference.n != robot.n or joints != robot.joint_names:
        raise QueryError(
            f"the motion is of {reference.n} joints{'' if plan is None else ', ' + ', '.join(joints)}; {robot.name} has"
            f" {robot.n}, {', '.join(robot.joint_names)}"
        )
    limits, continuous = given.limits(plant)
    demand = of_motion(reference, plant)
    assert demand.cells is not None
    found = joint_budgets(demand, limits, continuous, static_friction(plant), breakaway(demand.cells, plant))
    findings = (*robot.findings, *(() if plan is None else plan.findings), *_outside(reference, robot))
    what = f"{'motion' if plan is None else plan.method}, {demand.duration:.6g} s"
    if any(isinstance(each, EffortLimit) for each in plant.effects):
        findings += ("peak torques are never above the EffortLimit of the plant; leave it out for those of the motors",)
    return _result(robot, what, demand, tuple(found), given, findings, (), (plant, reference, limits, continuous))


def _of_run(run: Trajectory, given: _Given) -> MotorBudget:
    demand, robot = of_run(run), robot_of(run)
    simulated = _simulated_rotors(run, robot)
    given = given._replace(motors=_with_rotors(given.motors, simulated))
    limits, continuous = given.limits(Plant(robot))
    cut = frozenset(each.joint for each in run.remarks if each.kind == RemarkKind.EFFORT_REACHED)
    found = joint_budgets(demand, limits, continuous, np.full(robot.n, nan), None, cut)
    findings = remark_lines(each for each in run.remarks if each.kind in (RemarkKind.EFFORT_REACHED, RemarkKind.COARSE))
    if run.outcome.ending == Ending.STOPPED:
        findings.append(f"the run was stopped at {run.outcome.t:.6g} s; the budget is of what was simulated")
    left = ["torque at which joints break away: a run does not hold its static friction"]
    if driven := [name for name in run.effect_torques or {} if name.startswith(_DRIVES)]:
        left.append(f"power at the motors of {', '.join(driven)}, which turn at other speeds than their joints")
    if simulated:
        findings.append(f"the rotors of {', '.join(simulated)} are those of the run, which simulates its gears")
    what = f"run of {demand.duration:.6g} s"
    return _result(robot, what, demand, tuple(found), given, tuple(findings), tuple(left), None)


def _simulated_rotors(run: Trajectory, robot: Robot) -> dict[str, float]:
    """Return the inertia at its joint of each rotor that the drives of a run simulate.

    Raises:
        PlanError: If the arm has the same inertia as armature, which counts the rotor twice.
    """
    rotors: dict[str, float] = json.loads(run.about.get("rotors", "{}"))
    for name, armature in zip(robot.joint_names, robot.armature.tolist(), strict=True):
        if name in rotors and same_rotor(armature, rotors[name]):
            raise PlanError(
                f"the rotor of {name!r} is counted twice: the gears of the run simulate {rotors[name]:.6g} kg m² at the"
                f" joint, and the arm has an armature of {armature:.6g} kg m²; simulate without one of them"
            )
    return rotors


def _with_rotors(motors: Motors | None, simulated: Mapping[str, float]) -> Motors | None:
    """Return motors without the rotors that a run simulates itself.

    Raises:
        PlanError: If a motor states another inertia than the run simulates.
    """
    if motors is None:
        return None
    for name, stated in motors.armature.items():
        if name in simulated and not same_rotor(stated, simulated[name]):
            raise PlanError(
                f"{motors.source}: the rotor of {name!r} is felt as {stated:.6g} kg m² at the joint, the gears of the"
                f" run simulate {simulated[name]:.6g} kg m²; correct the file, or simulate with that inertia"
            )
    return replace(motors, armature={name: x for name, x in motors.armature.items() if name not in simulated})


def _result(
    robot: Robot, what: str, demand: Demand, joints: tuple[JointBudget, ...], given: _Given, findings: tuple[str, ...],
    left_out: tuple[str, ...], case: Any,
) -> MotorBudget:  # fmt: skip
    carried = ", ".join(f"{each.mass:g} kg on {each.frame}" for each in robot.edits.payloads)
    return MotorBudget(
        robot=robot.name,
        motion=f"{what}, carrying {carried}" if carried else what,
        duration=demand.duration,
        joints=joints,
        limits=given.words,
        resolution=demand.resolution,
        error=demand.error,
        findings=(*findings, *_unknown(joints)),
        left_out=left_out,
        environment=processor_and_versions(("robot-dyn", "pin", "numpy")),
        demand=demand,
        case=case,
    )


def _unknown(joints: tuple[JointBudget, ...]) -> Iterator[str]:
    """Limits that are not known of joints that move or bear a load."""
    for what, names in {
        "peak torque": [x.joint for x in joints if x.peak_limit == inf and x.peak > 0],
        "speed": [x.joint for x in joints if x.speed_limit == inf and x.speed > 0],
    }.items():
        if names:
            yield f"no limit of {what} is known of {', '.join(names)}, so it is not judged; give motors or limits"


def _outside(motion: PiecewisePolynomial, robot: Robot) -> Iterator[str]:
    """Positions beyond the limits of the joints."""
    found = extreme_values(motion)
    for i, name in enumerate(robot.joint_names):
        low, high = robot.lower[i] - found.least[i], found.greatest[i] - robot.upper[i]
        if max(low, high) > _BEYOND:
            q, t = (found.least, found.at_least) if low > high else (found.greatest, found.at_greatest)
            unit = of_joint("rad", robot.joint_types[i])
            yield (
                f"{name} is at {q[i]:.5g} {unit} at {t[i]:.4g} s, outside its limits {robot.lower[i]:.5g} to"
                f" {robot.upper[i]:.5g}; check the motion"
            )
