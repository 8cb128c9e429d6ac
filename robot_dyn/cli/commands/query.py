"""Commands on robots: list, info, query, compare."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

import robot_dyn as rd
from robot_dyn.cli import arguments, completion
from robot_dyn.cli.application import DYNAMICS, INSPECTION, VERIFICATION, command, progress
from robot_dyn.cli.options import AS_STATED, Effects, Json, Name, Payloads, Positions, RobotOptions
from robot_dyn.cli.terminal import show
from robot_dyn.foundations.errors import QueryError, RobotDynError

if TYPE_CHECKING:
    import numpy as np


@command(INSPECTION, "list")
def list_(as_json: Json = False) -> None:
    """List the robots of the catalog."""
    names = rd.list_robots()
    show([*names], as_json=as_json, document={"robots": names})


@command(INSPECTION)
def info(robot: Name, /, compiled: bool = False, options: RobotOptions = AS_STATED, as_json: Json = False) -> None:
    """Show a robot: joints, limits, friction, mass, findings.

    Options:
        compiled: Also trace each quantity, and print which formulation is compiled.
    """
    from robot_dyn.cli import report
    from robot_dyn.foundations.result import plain

    loaded = options.load(robot, quiet=True)  # the findings are shown below
    answer = rd.info(loaded)
    if compiled:
        counts = report.formulations(loaded)
        document = plain(answer) | {"compiled": counts}
        show([answer, *report.formulation_table(counts)], as_json=as_json, document=document)
    else:
        show(answer, as_json=as_json)


@command(DYNAMICS)
def query(
    source: Annotated[str, typer.Argument(autocompletion=completion.robots)],
    /,
    q: Positions = None,
    v: str | None = None,
    a: str | None = None,
    tau: str | None = None,
    why: Annotated[str | None, typer.Option(autocompletion=completion.joints)] = None,
    quantity: Annotated[list[str] | None, typer.Option(autocompletion=completion.quantities)] = None,
    frame: str | None = None,
    effects: Effects = None,
    payload: Payloads = None,
    options: RobotOptions = AS_STATED,
    as_json: Json = False,
) -> None:
    """Compute M, C, N, torques and accelerations at a state.

    A scene is evaluated at its start, with the actuation of its control. Joints held by dry friction or rigid stops
    are listed.

    Options:
        source (ROBOT|SCENE.toml): A robot; or a scene file, with its robot, effects and start.
        v: Velocities in rad/s or m/s, in the same form.
        a: Accelerations in rad/s² or m/s²: the torque is computed.
        tau: Torques in N m or N: the acceleration is computed.
        why (JOINT): Split this joint's torque by link and cause.
        quantity (NAME): Add another query of the rigid bodies, such as momentum; may be repeated.
        frame (LINK): The frame of --quantity jacobian and others.
    """
    from robot_dyn.cli import report
    from robot_dyn.effects.plant_state import plant_state
    from robot_dyn.effects.why import why_at
    from robot_dyn.foundations.result import plain

    if a is not None and tau is not None:
        raise QueryError("give --a or --tau, not both; each determines the other")
    setup = arguments.scene(source, {"--effects": effects, "--payload": payload} | options.stated)
    if setup is None:
        robot = options.load(source)
        robot = robot.with_(payload=[arguments.payload(text) for text in payload]) if payload else robot
        plant = rd.Plant(robot, effects or ())
    else:
        plant = setup.plant.at(0.0)
    names = plant.dynamics.joint_names
    at = setup.q0 if setup is not None and q is None else arguments.vector("--q", q, names)
    speed = setup.v0 if setup is not None and v is None else arguments.vector("--v", v, names)
    torque = None if tau is None else arguments.vector("--tau", tau, names)
    if setup is not None and a is None and tau is None:
        torque = _actuation(setup, at, speed)
    acceleration = arguments.vector("--a", a, names) if torque is None else None
    state = plant_state(plant, at, speed, acceleration, torque, t=0.0)
    cause = {} if why is None else {"why": why_at(state, why)}
    answers = report.queries(state, quantity or (), frame)
    text = [state, *report.query_lines(answers, names, state.types)]
    document = plain(state) | ({"quantities": answers} if answers else {})
    show(text, as_json=as_json, document=document, more=cause)


def _actuation(setup: rd.Setup, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Return the actuation of a setup at t = 0, within the bounds of the plant, (n,)."""
    from robot_dyn.simulation.dynamics.state_equation import StateEquation

    equation = StateEquation(setup.plant, setup.controller)
    y, held = equation.tick(0.0, equation.start(q, v))
    q, v, z, _ = equation.state(y)
    return equation.actuation(0.0, q, v, z, held)


@command(VERIFICATION)
def compare(
    robots: Annotated[list[str] | None, typer.Argument(autocompletion=completion.robots)] = None,
    /,
    all_: bool = False,
    samples: Annotated[int, typer.Option(min=1)] = 20,
    seed: int = 0,
    options: RobotOptions = AS_STATED,
    as_json: Json = False,
) -> None:
    """Compare Pinocchio with the library's independent Lagrangian.

    The exit code is 1 if they disagree.

    Options:
        robots (ROBOT...): Names or paths.
        all_: All robots of `robot-dyn list` that load.
        samples: Random states for each robot.
        seed: Seed of the random states.
    """
    from robot_dyn.cli import report

    if robots and all_:
        raise QueryError("give the names of robots or --all, not both")
    if not (robots or all_):
        raise QueryError("nothing to compare; give the names of robots, or --all")
    results, refused = [], {}
    for name in progress(rd.list_robots() if all_ else robots or (), "comparing"):
        try:
            results.append((name, rd.compare(options.load(name, quiet=all_), samples=samples, seed=seed)))
        except RobotDynError as error:
            if not all_:
                raise
            refused[name] = str(error)
    document = report.comparison(results, refused)
    show([*report.comparison_tables(results, refused)], as_json=as_json, document=document)
    if not all(result.ok for _, result in results):
        raise typer.Exit(1)
