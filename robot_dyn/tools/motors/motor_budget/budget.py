"""The motor budget of a motion: the demand on each joint, its limits, and its causes."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import replace
from math import inf
from typing import Any

from robot_dyn import Plant, Robot, Trajectory
from robot_dyn.control import PiecewisePolynomial, Plan
from robot_dyn.effects import EffortLimit
from robot_dyn.foundations import PlanError, QueryError, instance, shown
from robot_dyn.report import processor_and_versions
from robot_dyn.simulation import Ending, RemarkKind, remark_lines, robot_of
from robot_dyn.tools.motors.limits import Limits, check_motors, limits_of, outside_positions, same_rotor
from robot_dyn.tools.motors.motor_budget import bearing_loads
from robot_dyn.tools.motors.motor_budget.demand import Demand, of_motion, of_run
from robot_dyn.tools.motors.motor_budget.holding import holdings
from robot_dyn.tools.motors.motor_budget.joint_budget import JointBudget, joint_budgets
from robot_dyn.tools.motors.motor_budget.result import MotorBudget
from robot_dyn.tools.motors.motors_file import Motors
from robot_dyn.tools.motors.planning.path_plan import PathPlan

_CUT = RemarkKind.EFFORT_REACHED, RemarkKind.LINE_REACHED
_DRIVES = "series_elastic", "rigid_backlash"  # their motors turn at other speeds than their joints


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
    """Compute the demand of a motion on the motors: torque by cause, speed, power and energy, and the headroom.

        τ = M(q) a + C(q, v) v + ∂V/∂q − Σ τ_effect

    For a plan, τ is computed by inverse dynamics; for a run, it is the recorded actuation. |τ| is compared with the
    peak torque, its root mean square over the motion with the continuous torque. If motors have torque–speed lines, |τ|
    at |v| is compared with the line where they drive (τ v > 0), and the continuous torque is the one at the mean of
    |v|. Powers are τ v at the joint, without losses of the motor. If motors have gear efficiencies, τ is the torque of
    the motor times the gear ratio, and "gear loss" is one of its causes:

        τ_motor = J a + (τ − J a) η^−s,    s = sign((τ − J a) v),    J the rotor at the joint

    A rotor inertia in `motors` acts as armature if the arm has none. A run that simulates
    gears has its own rotors; those in `motors` must agree to 1 %. Loads on bearings are those of `joint_wrenches`.

    Args:
        motion: A plan, a `PiecewisePolynomial`, or a run of `rd.simulate`.
        plant: The arm, or a plant with effects; only for plans.
        payload: A `Payload` or several, carried along a plan.
        motors: Motors of `rd.tools.motors.read_motors`, with peak and continuous torques, speeds and rotors.
        effort: Peak torques, one number, by joint name or (n,), in [N m] or [N]; by default those of the motors or,
            without motors, of the robot's file.
        velocity: Speed limits, one number, by joint name or (n,), in [rad/s] or [m/s]; same default.
        continuous: Continuous torques, one number, by joint name or (n,), in [N m] or [N]; by default of the motors.

    Raises:
        QueryError: If the motion has other joints, or a run is passed with a plant or a payload, has diverged or cannot
            be split by cause, or bearings with limits have unknown loads.
        PlanError: If a limit is invalid, or a rotor differs from the arm's.
        EffectError: If an effect has states, which a plan does not determine: pass a run.

    Source: Siciliano et al. 2009, sec. 5.2; Armstrong-Hélouvry 1991 for breaking away.
    """
    check_motors(motors)
    given = {"effort": effort, "velocity": velocity, "continuous": continuous}
    if isinstance(motion, Trajectory):
        if plant is not None or payload is not None:
            raise QueryError(
                f"a run has its own {'plant' if plant is not None else 'payload'}: simulate again without it, or pass"
                " the motion, budget(rd.control.from_samples(arm, run.table(), ends='measured'), plant, payload=…)"
            )
        return _of_run(motion, motors, given)
    if not isinstance(motion, PiecewisePolynomial | Plan | PathPlan):
        raise QueryError(f"motion: give a plan, a PiecewisePolynomial, or a run of rd.simulate, got {shown(motion)}")
    if plant is None:
        raise QueryError(
            "plant: a plan has no arm; give the arm, rd.tools.motors.budget(plan, arm), or a plant with effects"
        )
    loaded = _loaded(plant, payload, motors)
    return of_plan(motion, loaded, limits_of(loaded, motors, **given), _sources(motors, given))


def _sources(motors: Motors | None, given: Mapping[str, Any]) -> str:
    """Return the sources of the limits, in words."""
    stated = [
        ("continuous torque", "continuous", motors and motors.continuous, "unknown"),
        ("peak torque", "effort", motors, "the robot's file"),
        ("speed", "velocity", motors and motors.speed, "the robot's file"),
    ]
    names: dict[str, list[str]] = {}
    for name, key, of_motors, otherwise in stated:
        source = "given" if given[key] is not None else motors.source if motors and of_motors else otherwise
        names.setdefault(source, []).append(name)
    return "; ".join(f"{', '.join(limits)}: {source}" for source, limits in names.items())


def _loaded(plant: Any, payload: Any, motors: Motors | None) -> Plant:
    """Return the plant with a payload, and with the rotors of motors for joints without armature."""
    plant = plant if isinstance(plant, Plant) else Plant(plant)
    robot = instance("plant", plant.dynamics, Robot, "give the plant of a robot, such as rd.Plant(rd.load('ur5'))")
    if payload is not None:
        robot = robot.with_(payload=payload)
    if motors is not None and motors.armature:
        stated = zip(robot.joint_names, robot.armature.tolist(), strict=True)
        robot = robot.with_(armature={**motors.armature, **{name: x for name, x in stated if x}})
    return plant if robot is plant.dynamics else replace(plant, dynamics=robot)


def of_plan(motion: PiecewisePolynomial | Plan | PathPlan, plant: Plant, limits: Limits, sources: str) -> MotorBudget:
    """Compute the budget of a plan under limits from sources, in words."""
    robot: Any = plant.dynamics
    plan = motion.plan if isinstance(motion, PathPlan) else motion if isinstance(motion, Plan) else None
    reference = motion if isinstance(motion, PiecewisePolynomial) else motion.reference
    joints = robot.joint_names if plan is None else plan.joint_names
    if reference.n != robot.n or joints != robot.joint_names:
        raise QueryError(
            f"the motion has {reference.n} joints{'' if plan is None else ', ' + ', '.join(joints)}; {robot.name} has"
            f" {robot.n}, {', '.join(robot.joint_names)}; use a motion of this arm"
        )
    demand = of_motion(reference, plant, limits)
    assert demand.cells is not None
    bearings = bearing_loads.of_plan(demand.cells, plant, limits.bearing)
    outside = (f"{where}; check the motion" for where in outside_positions(robot, reference))
    findings = [*robot.announced_findings, *limits.findings, *(() if plan is None else plan.findings), *outside]
    if any(isinstance(effect, EffortLimit) for effect in plant.effects):
        findings.append("the EffortLimit of the plant bounds the peak torques; remove it to use those of the motors")
    return _budget(
        robot, "motion" if plan is None else plan.method, demand,
        tuple(joint_budgets(demand, limits, holdings(robot, limits.brake), bearings)),
        sources, findings, bearings.left_out, (plant, reference, limits),
    )  # fmt: skip


def _of_run(run: Trajectory, motors: Motors | None, given: Mapping[str, Any]) -> MotorBudget:
    robot = robot_of(run)
    simulated = _simulated_rotors(run, robot)
    motors = _with_rotors(motors, simulated)
    limits = limits_of(Plant(robot), motors, **given)
    demand = of_run(run, limits.gear)
    cut = frozenset(remark.joint for remark in run.remarks if remark.kind in _CUT)
    bearings = bearing_loads.of_run(run, robot, limits.bearing)
    joints = tuple(joint_budgets(demand, limits, holdings(robot, limits.brake), bearings, cut))
    reported = *_CUT, RemarkKind.COARSE
    remarks = remark_lines(remark for remark in run.remarks if remark.kind in reported)
    findings = [*limits.findings, *remarks, *bearings.findings]
    if run.outcome.ending == Ending.STOPPED:
        findings.append(f"the run was stopped at {run.outcome.t:.6g} s; the budget covers the simulated part")
    left = ["torque at which joints break away: a run does not contain its static friction"]
    left += bearings.left_out
    if driven := [name for name in run.effect_torques or {} if name.startswith(_DRIVES)]:
        left.append(f"power at the motors of {', '.join(driven)}, which turn at other speeds than their joints")
    if simulated:
        joined = ", ".join(simulated)
        findings.append(f"the run simulates the gears of {joined}, so their rotors come from the run")
        left.append(f"gear losses of {joined}, whose gears the run simulates")
    return _budget(robot, "run of", demand, joints, _sources(motors, given), findings, left, None)


def _simulated_rotors(run: Trajectory, robot: Robot) -> dict[str, float]:
    """Return the inertias, at the joints, of the rotors that a run simulates.

    Raises:
        PlanError: If the arm has the same inertia as armature, so that the rotor counts twice.
    """
    rotors: dict[str, float] = json.loads(run.metadata.get("rotors", "{}"))
    for name, armature in zip(robot.joint_names, robot.armature.tolist(), strict=True):
        if name in rotors and same_rotor(armature, rotors[name]):
            raise PlanError(
                f"the rotor of {name!r} is counted twice: the gears of the run simulate {rotors[name]:.6g} kg m² at the"
                f" joint, and the arm has an armature of {armature:.6g} kg m²; simulate without one of them"
            )
    return rotors


def _with_rotors(motors: Motors | None, simulated: Mapping[str, float]) -> Motors | None:
    """Return motors without the rotors and gear losses of gears that a run simulates.

    Raises:
        PlanError: If the inertia of a motor differs from the one in the run.
    """
    if motors is None:
        return None
    for name, stated in motors.armature.items():
        if name in simulated and not same_rotor(stated, simulated[name]):
            raise PlanError(
                f"{motors.source}: the rotor of {name!r} has {stated:.6g} kg m² at the joint, but the run simulates"
                f" {simulated[name]:.6g} kg m²; correct the file, or simulate with that inertia"
            )
    armature, efficiency = (
        {name: x for name, x in of_joints.items() if name not in simulated}
        for of_joints in (motors.armature, motors.efficiency)
    )
    return replace(motors, armature=armature, efficiency=efficiency)


def _budget(
    robot: Robot, method: str, demand: Demand, joints: tuple[JointBudget, ...], limits: str, findings: Iterable[str],
    left_out: Iterable[str], case: Any,
) -> MotorBudget:  # fmt: skip
    motion = f"{method}{'' if case is None else ','} {demand.duration_s:.6g} s"
    carried = ", ".join(f"{payload.mass:g} kg on {payload.frame}" for payload in robot.edits.payloads)
    unknown = {
        "peak torque": [x.joint for x in joints if x.peak_limit == inf and x.peak > 0],
        "speed": [x.joint for x in joints if x.speed_limit == inf and x.speed > 0],
    }
    not_judged = (
        f"the {kind} limit of {', '.join(names)} is unknown, so it is not checked; give motors or limits"
        for kind, names in unknown.items()
        if names
    )
    return MotorBudget(
        robot=robot.name,
        motion=f"{motion}, carrying {carried}" if carried else motion,
        duration_s=demand.duration_s,
        joints=joints,
        limits=limits,
        resolution=demand.resolution,
        error=demand.error,
        findings=tuple(dict.fromkeys((*findings, *not_judged))),
        left_out=tuple(left_out),
        environment=processor_and_versions(("robot-dyn", "pin", "numpy")),
        demand=demand,
        case=case,
    )
