"""The command budget: compare the demand of a motion with the limits of motors."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

import robot_dyn as rd
from robot_dyn.cli import (
    AS_STATED,
    PRINTED,
    Effects,
    Payloads,
    Results,
    RobotOptions,
    arguments,
    bar,
    command,
    completion,
)
from robot_dyn.foundations import QueryError

if TYPE_CHECKING:
    from robot_dyn import Trajectory
    from robot_dyn.tools.motors.motor_budget.result import MotorBudget

_RUNS = ".toml", ".npz"


@command("Dynamics")
def budget(
    source: Annotated[str, typer.Argument(autocompletion=completion.robots)],
    plan: str | None = None,
    /,
    payload: Payloads = None,
    effects: Effects = None,
    limits: str | None = None,
    max_payload: str | None = None,
    fastest: bool = False,
    fraction: float | None = None,
    unit: str | None = None,
    period: float | None = None,
    time: str | None = None,
    ends: str | None = None,
    joint: list[str] | None = None,
    options: RobotOptions = AS_STATED,
    results: Results = PRINTED,
) -> None:
    """Check whether motors suffice for a motion, and show why.

    Compare the demand on each motor with its limits, by cause. The exit code is 1 if a motor is too small.
    With --fastest it is 1 if a motor is too small for the given motion or for the fastest one.
    Show torque and speed peaks, rms torque, power, energy, the torque at which dry friction breaks away, and the loads
    on the bearings of the joints.

    Options:
        source (ROBOT|SCENE.toml|RUN.npz): A robot, with a plan; a scene, which is simulated; or a run file.
        plan (PLAN.csv): Way points or samples: a column t in s, and one for each joint.
        limits (MOTORS.csv): Motors: joint, peak, continuous, speed, gear_ratio, …, with units; else the
            robot's file.
        max_payload (LINK@X,Y,Z): Find the largest payload there that still fits.
        fastest: Plan the same path as fast as the limits allow; -o and --csv then write its budget.
        fraction: With --fastest: fraction of the peak torques that it may use, up to 1.
        unit: rad or deg, for angles in the plan without a unit in the heading.
        period (SECONDS): Time between rows of a plan without times.
        time (COLUMN): Heading of the times in the plan, unless it is t or time.
        ends: rest or measured: the plan stops at its ends, or is part of a longer motion.
        joint (JOINT=COLUMN): Heading of a joint in the plan; repeat it for each joint, others are ignored.
    """
    from robot_dyn.tools.motors.motor_budget.result import MotorBudget

    paths = results.files(MotorBudget, source, plan, limits)
    if fraction is not None and not fastest:
        raise QueryError("--fraction is for the fastest motion: add --fastest, or remove --fraction")
    if time is not None and period is not None:
        raise QueryError("--time and --period both give the times: remove one of them")
    motors = None if limits is None else rd.tools.motors.read_motors(limits)
    of_robots = {
        "PLAN.csv": plan, "--payload": payload, "--effects": effects, "--max-payload": max_payload,
        "--fastest": fastest, "--unit": unit, "--period": period, "--time": time, "--joint": joint,
        "--ends": ends,
        **options.stated,
    }  # fmt: skip
    if source.lower().endswith(_RUNS):
        if unused := [name for name, value in of_robots.items() if value]:
            raise QueryError(f"{unused[0]} applies to a robot with a plan; a scene or a run has its own, so remove it")
        result = rd.tools.motors.budget(_run(source), motors=motors)
    else:
        if plan is None:
            raise QueryError(f"{source}: give a motion as well, a CSV file with a column t [s] and one for each joint")
        robot = options.load(source)
        times = time if period is None else period
        columns = arguments.pairs("--joint", joint, "JOINT=COLUMN") or None
        motion = rd.control.from_samples(robot, plan, time=times, joints=columns, unit=unit, ends=ends)
        bodies = [arguments.payload(text) for text in payload or ()] or None
        with bar(description="computing the torque"):
            result = rd.tools.motors.budget(motion, rd.Plant(robot, effects or ()), payload=bodies, motors=motors)
    more = _more(result, max_payload, fastest, 1.0 if fraction is None else fraction)
    budgets = [result, more["fastest"].budget] if fastest else [result]
    first = more["fastest"].cycle_times if fastest else ""
    results.give(result, paths, budgets[-1], first, **more)
    if not all(x.fits for x in budgets):
        raise typer.Exit(1)


def _run(path: str) -> Trajectory:
    """Return the run of a file, or simulate a scene."""
    if path.lower().endswith(".npz"):
        return arguments.run(path)
    setup = rd.read_scene(path)
    with bar(setup.duration_s) as advance:
        return rd.simulate(setup, on_progress=advance)


def _more(result: MotorBudget, max_payload: str | None, fastest: bool, fraction: float) -> dict[str, Any]:
    """Return further results of a budget, by key."""
    more: dict[str, Any] = {}
    if max_payload is not None:
        with bar(description="computing the largest payload"):
            more["max_payload"] = rd.tools.motors.max_payload(
                result, *arguments.link_and_place("--max-payload", max_payload)
            )
    if fastest:
        with bar(description="planning the fastest motion"):
            more["fastest"] = rd.tools.motors.fastest(result, fraction)
    return more
