"""Commands that say what digits, effects and algorithms cost, and whether steps are short enough."""

from __future__ import annotations

import os
from math import isfinite
from typing import Annotated, Any

import typer

import robot_dyn as rd
from robot_dyn.cli import arguments, completion
from robot_dyn.cli.application import Budget, Csv, Dark, Force, Json, Name, Plot, Repeats, Scene, app, bar
from robot_dyn.cli.outcome import give, outputs
from robot_dyn.cli.robots import AS_STATED, RobotOptions, takes_robot
from robot_dyn.cli.terminal import say, say_json
from robot_dyn.foundations.errors import QueryError

_DURATION_S = 1.0


@app.command()
@takes_robot
def accuracy(
    what: Annotated[
        str,
        typer.Argument(
            metavar="SCENE.toml|ROBOT",
            help="A scene file; or a robot, which then swings freely.",
            autocompletion=completion.robots,
        ),
    ],
    output: Plot = None,
    csv: Csv = None,
    budget: Budget = 30.0,
    repeats: Repeats = 25,
    method: Annotated[
        list[str] | None, typer.Option(metavar="METHOD", help="Only this method; may be repeated; all by default.")
    ] = None,
    peers: Annotated[bool, typer.Option(help="Run other programs that are installed beside, where they can.")] = True,
    q: Annotated[str | None, typer.Option(help="Start of a robot: as of query; random by default.")] = None,
    v: Annotated[str | None, typer.Option(help="Its velocities; 0 by default.")] = None,
    duration: Annotated[float | None, typer.Option(metavar="SECONDS", help="Of its motion; 1 by default.")] = None,
    dark: Dark = False,
    force: Force = False,
    options: RobotOptions = AS_STATED,
    as_json: Json = False,
) -> None:
    """Show what each digit of a motion costs in time, by method and program. Ctrl-C ends it and keeps its runs."""
    paths = outputs(rd.accuracy.WorkPrecision, output, csv, [what] if os.path.isfile(what) else [], force)
    setup = _setup(what, q, v, duration, options)
    with bar(budget, "starting") as spent:
        result = rd.accuracy.work_precision(
            setup, methods=method, peers=peers, budget_s=budget, repeats=repeats, on_progress=spent
        )
    give(result, paths, as_json, dark)


@app.command()
def cost(
    scene: Scene,
    output: Plot = None,
    csv: Csv = None,
    budget: Budget = 10.0,
    repeats: Repeats = 25,
    dark: Dark = False,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Count and time effects, control and terms of a scene, on and off, and algorithms beside each other."""
    paths = outputs(rd.accuracy.Cost, output, csv, [scene], force)
    setup = rd.read_scene(scene)
    with bar(budget, "starting") as spent:
        result = rd.accuracy.cost(setup, budget_s=budget, repeats=repeats, on_progress=spent)
    give(result, paths, as_json, dark)


@app.command()
@takes_robot
def certify(
    robot: Name,
    output: Plot = None,
    csv: Csv = None,
    samples: Annotated[int, typer.Option(help="Number of random states.")] = 10_000,
    seed: Annotated[int, typer.Option(help="Of the random states.")] = 0,
    repeats: Annotated[int, typer.Option(min=1, help="How often each query is timed.")] = 7,
    q: Annotated[str | None, typer.Option(help="A state to look at too: as of query.")] = None,
    v: Annotated[str | None, typer.Option(help="Its velocities; 0 by default.")] = None,
    a: Annotated[str | None, typer.Option(help="Its accelerations, of inverse dynamics; 0 by default.")] = None,
    tau: Annotated[str | None, typer.Option(help="Its torques, of forward dynamics; 0 by default.")] = None,
    dark: Dark = False,
    force: Force = False,
    options: RobotOptions = AS_STATED,
    as_json: Json = False,
) -> None:
    """Count the digits of M, C, N, inverse and forward dynamics that are true, by program and numbers, beside times."""
    paths = outputs(rd.accuracy.Certificate, output, csv, [robot] if os.path.isfile(robot) else [], force)
    arm = options.load(robot)
    given = {"q": q, "v": v, "a": a, "tau": tau}
    state = {key: arguments.vector(f"--{key}", x, arm.joint_names) for key, x in given.items() if x is not None}
    with bar(1.0, "starting") as done:
        result = rd.accuracy.certify(arm, **state, samples=samples, seed=seed, repeats=repeats, on_progress=done)
    give(result, paths, as_json, dark)


@app.command()
def advise(scene: Scene, as_json: Json = False) -> None:
    """Say whether step and control period are short enough, and what error to expect; exit code 1 if they are not."""
    setup = rd.read_scene(scene)
    with bar(what="looking at the loop"):
        advice = rd.advise(setup)
    say_json(advice) if as_json else say(advice)
    if not advice.stable:
        raise typer.Exit(1)


def _setup(what: str, q: str | None, v: str | None, duration: float | None, options: RobotOptions) -> rd.Setup:
    """The setup of a scene file, or of the free swing of a robot."""
    if setup := arguments.scene(what, {"--q": q, "--v": v, "--duration": duration} | options.given):
        return setup
    import numpy as np

    robot = options.load(what)
    names = robot.joint_names
    start: Any = (
        robot.random_configuration(np.random.default_rng(0)) if q is None else arguments.vector("--q", q, names)
    )
    seconds = _DURATION_S if duration is None else duration
    if not (isfinite(seconds) and seconds > 0):
        raise QueryError(f"--duration must be positive, got {seconds:g}")
    return rd.Setup(rd.Plant(robot), start, arguments.vector("--v", v, names), seconds)
