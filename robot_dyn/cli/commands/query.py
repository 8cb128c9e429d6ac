"""Commands on robots: list, info, query, compare."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

import robot_dyn as rd
from robot_dyn.cli import arguments, completion
from robot_dyn.cli.application import Json, Name, app, progress
from robot_dyn.cli.robots import AS_STATED, RobotOptions, takes_robot
from robot_dyn.cli.terminal import say, say_json
from robot_dyn.foundations.errors import QueryError, RobotDynError

if TYPE_CHECKING:
    import numpy as np


@app.command("list")
def list_(as_json: Json = False) -> None:
    """List the robots that can be named."""
    names = rd.list_robots()
    say_json({"robots": names}) if as_json else say(*names)


@app.command()
@takes_robot
def info(
    robot: Name,
    compiled: Annotated[
        bool, typer.Option("--compiled", help="Also trace each quantity, and say which formulation is compiled.")
    ] = False,
    options: RobotOptions = AS_STATED,
    as_json: Json = False,
) -> None:
    """Show a robot: joints, limits, friction, mass, and findings on its file."""
    from robot_dyn.cli import report

    loaded = options.load(robot, quiet=True)  # the findings are shown below
    implementations = {"compiled": report.formulations(loaded)} if compiled else {}
    answer = rd.info(loaded)
    if as_json:
        say_json(answer, **implementations)
        return
    say(answer)
    if compiled:
        say(*report.formulation_table(implementations["compiled"]))


@app.command()
@takes_robot
def query(
    what: Annotated[
        str,
        typer.Argument(
            metavar="ROBOT|SCENE.toml",
            help="A robot; or a scene file, with its robot, effects and start.",
            autocompletion=completion.robots,
        ),
    ],
    q: Annotated[
        str | None, typer.Option(help="Positions in rad or m: 0.1,-0.2,… or joint=0.1,…; 0 by default.")
    ] = None,
    v: Annotated[str | None, typer.Option(help="Velocities in rad/s or m/s, in the same form.")] = None,
    a: Annotated[str | None, typer.Option(help="Accelerations in rad/s² or m/s²: the torque is computed.")] = None,
    tau: Annotated[str | None, typer.Option(help="Torques in N m or N: the acceleration is computed.")] = None,
    why: Annotated[
        str | None,
        typer.Option(
            metavar="JOINT", help="Split this joint's torque by link and cause.", autocompletion=completion.joints
        ),
    ] = None,
    quantity: Annotated[
        list[str] | None,
        typer.Option(
            metavar="NAME",
            help="Add another query of the rigid bodies, such as momentum; may be repeated.",
            autocompletion=completion.quantities,
        ),
    ] = None,
    frame: Annotated[
        str | None, typer.Option(metavar="LINK", help="The frame of --quantity jacobian and others.")
    ] = None,
    effects: Annotated[str | None, typer.Option(help='"urdf" adds the friction that the file states.')] = None,
    payload: Annotated[
        list[str] | None,
        typer.Option(
            metavar="LINK=MASS@X,Y,Z",
            help="Add a body to a link, in kg and m, as tool0=5kg@0,0,0.1; may be repeated.",
        ),
    ] = None,
    options: RobotOptions = AS_STATED,
    as_json: Json = False,
) -> None:
    """Ask for M, C, N at a state, and for the torque of an acceleration or the acceleration of a torque.

    Of a scene: at its start, under the actuation of its control; what dry friction and rigid stops hold is listed.
    """
    from robot_dyn.cli import report
    from robot_dyn.effects.plant_state import plant_state
    from robot_dyn.effects.why import why_at

    if a is not None and tau is not None:
        raise QueryError("give --a or --tau, not both: one follows from the other")
    setup = arguments.scene(what, {"--effects": effects, "--payload": payload} | options.given)
    if setup is None:
        robot = options.load(what)
        robot = robot.with_(payload=[arguments.payload(each) for each in payload]) if payload else robot
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
    state = plant_state(plant, at, speed, acceleration, torque)
    cause = {} if why is None else {"why": why_at(state, why)}
    answers = report.queries(state, quantity or (), frame)
    if as_json:
        say_json(state, **cause, **({"quantities": answers} if answers else {}))
        return
    say(state, *report.query_lines(answers, names, state.types))
    say(*(part for each in cause.values() for part in ("", each)))


def _actuation(setup: rd.Setup, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """What the control of a setup does at t = 0, within the bounds of the plant, (n,)."""
    from robot_dyn.simulation.dynamics.state_equation import StateEquation

    equation = StateEquation(setup.plant, setup.controller)
    y, held = equation.tick(0.0, equation.start(q, v))
    q, v, z, _ = equation.state(y)
    return equation.actuation(0.0, q, v, z, held)


@app.command()
@takes_robot
def compare(
    robots: Annotated[
        list[str] | None, typer.Argument(metavar="ROBOT...", help="Names or paths.", autocompletion=completion.robots)
    ] = None,
    every: Annotated[bool, typer.Option("--all", help="All robots of `robot-dyn list` that load.")] = False,
    samples: Annotated[int, typer.Option(min=1, help="Random states for each robot.")] = 20,
    seed: Annotated[int, typer.Option(help="Seed of the random states.")] = 0,
    options: RobotOptions = AS_STATED,
    as_json: Json = False,
) -> None:
    """Cross-check Pinocchio against the library's own Lagrangian; exit code 1 if they disagree."""
    from robot_dyn.cli import report

    if robots and every:
        raise QueryError("give the names of robots or --all, not both")
    if not (robots or every):
        raise QueryError("nothing to compare; give the names of robots, or --all")
    results, refused = [], {}
    for name in progress(rd.list_robots() if every else robots or (), "comparing"):
        try:
            results.append((name, rd.compare(options.load(name, quiet=every), samples=samples, seed=seed)))
        except RobotDynError as error:
            if not every:
                raise
            refused[name] = str(error)
    say_json(report.comparison(results, refused)) if as_json else say(*report.comparison_tables(results, refused))
    if not all(result.ok for _, result in results):
        raise typer.Exit(1)
