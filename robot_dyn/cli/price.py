"""Commands that say what digits, effects and algorithms cost, and whether steps are short enough."""

from __future__ import annotations

import os
from math import isfinite
from typing import Annotated, Any

import typer

import robot_dyn as rd
from robot_dyn.cli import arguments, completion
from robot_dyn.cli.app import Force, Json, Lock, Name, PackageDir, app, spending
from robot_dyn.cli.terminal import say, say_json, tell
from robot_dyn.errors import QueryError

_DURATION_S = 1.0


@app.command()
def accuracy(
    what: Annotated[
        str,
        typer.Argument(
            metavar="SCENE.toml|ROBOT",
            help="A scene file; or a robot, which then swings freely.",
            autocompletion=completion.robots,
        ),
    ],
    output: Annotated[
        str | None, typer.Option("-o", "--output", metavar="PLOT.png", help="Draw it, as a .png, .svg or .pdf.")
    ] = None,
    csv: Annotated[str | None, typer.Option(metavar="TABLE.csv", help="Write all runs as a table.")] = None,
    budget: Annotated[float, typer.Option(metavar="SECONDS", help="Time to spend, compiling not counted.")] = 30.0,
    repeats: Annotated[int, typer.Option(min=1, help="How often a run is timed at most, while the budget lasts.")] = 9,
    method: Annotated[
        list[str] | None, typer.Option(metavar="METHOD", help="Only this method; may be repeated; all by default.")
    ] = None,
    peers: Annotated[bool, typer.Option(help="Run other programs that are installed beside, where they can.")] = True,
    q: Annotated[str | None, typer.Option(help="Start of a robot: as of query; random by default.")] = None,
    v: Annotated[str | None, typer.Option(help="Its velocities; 0 by default.")] = None,
    duration: Annotated[float | None, typer.Option(metavar="SECONDS", help="Of its motion; 1 by default.")] = None,
    dark: Annotated[bool, typer.Option("--dark", help="Draw for dark screens.")] = False,
    force: Force = False,
    lock: Lock = None,
    package_dir: PackageDir = None,
    as_json: Json = False,
) -> None:
    """Show what each digit of a motion costs in time, by method and program. Ctrl-C ends it and keeps its runs."""
    from robot_dyn.accuracy.diagram import TABLE, DiagramError
    from robot_dyn.cli import prices
    from robot_dyn.view.plots import PICTURES

    inputs = [what] if os.path.isfile(what) else []
    drawn = output and arguments.output(output, PICTURES, DiagramError, inputs, force)
    table = csv and arguments.output(csv, TABLE, DiagramError, [*inputs, *([drawn] if drawn else [])], force)
    setup = _setup(what, q, v, duration, lock, package_dir)
    with spending(budget) as spent:
        result = rd.work_precision(
            setup, methods=method, peers=peers, budget_s=budget, repeats=repeats, on_progress=spent
        )
    theme = "dark" if dark else "light"
    try:  # the files first: a terminal or pipe may be gone
        written = [rd.save_work_precision(result, path, theme=theme) for path in (drawn, table) if path]
    finally:
        say_json(prices.work_precision(result)) if as_json else say(*prices.work_precision_tables(result))
    for path in written:
        tell(f"written: {path}")
    if result.interrupted:
        raise typer.Exit(130)


@app.command()
def cost(
    scene: Annotated[str, typer.Argument(metavar="SCENE.toml", help="A scene file.")],
    output: Annotated[
        str | None, typer.Option("-o", "--output", metavar="PLOT.png", help="Draw it, as a .png, .svg or .pdf.")
    ] = None,
    csv: Annotated[str | None, typer.Option(metavar="TABLE.csv", help="Write all alternatives as a table.")] = None,
    budget: Annotated[float, typer.Option(metavar="SECONDS", help="Time to spend, compiling not counted.")] = 10.0,
    repeats: Annotated[int, typer.Option(min=1, help="How often each is timed at most, while the budget lasts.")] = 25,
    dark: Annotated[bool, typer.Option("--dark", help="Draw for dark screens.")] = False,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Count and time effects, control and terms of a scene, on and off, and algorithms beside each other."""
    from robot_dyn.accuracy.cost_diagram import TABLE
    from robot_dyn.accuracy.diagram import DiagramError
    from robot_dyn.cli import prices
    from robot_dyn.view.plots import PICTURES

    drawn = output and arguments.output(output, PICTURES, DiagramError, [scene], force)
    table = csv and arguments.output(csv, TABLE, DiagramError, [scene, *([drawn] if drawn else [])], force)
    setup = rd.read_scene(scene)
    with spending(budget) as spent:
        result = rd.cost(setup, budget_s=budget, repeats=repeats, on_progress=spent)
    theme = "dark" if dark else "light"
    try:  # the files first: a terminal or pipe may be gone
        written = [rd.save_cost(result, path, theme=theme) for path in (drawn, table) if path]
    finally:
        say_json(prices.cost(result)) if as_json else say(*prices.cost_tables(result))
    for path in written:
        tell(f"written: {path}")
    if result.interrupted:
        raise typer.Exit(130)


@app.command()
def certify(
    robot: Name,
    output: Annotated[
        str | None, typer.Option("-o", "--output", metavar="PLOT.png", help="Draw it, as a .png, .svg or .pdf.")
    ] = None,
    csv: Annotated[str | None, typer.Option(metavar="TABLE.csv", help="Write all digits as a table.")] = None,
    samples: Annotated[int, typer.Option(help="Number of random states.")] = 10_000,
    seed: Annotated[int, typer.Option(help="Of the random states.")] = 0,
    repeats: Annotated[int, typer.Option(min=1, help="How often each query is timed.")] = 7,
    q: Annotated[str | None, typer.Option(help="A state to look at too: as of query.")] = None,
    v: Annotated[str | None, typer.Option(help="Its velocities; 0 by default.")] = None,
    a: Annotated[str | None, typer.Option(help="Its accelerations, of inverse dynamics; 0 by default.")] = None,
    tau: Annotated[str | None, typer.Option(help="Its torques, of forward dynamics; 0 by default.")] = None,
    dark: Annotated[bool, typer.Option("--dark", help="Draw for dark screens.")] = False,
    force: Force = False,
    lock: Lock = None,
    package_dir: PackageDir = None,
    as_json: Json = False,
) -> None:
    """Count the digits of M, C, N, inverse and forward dynamics that are true, by program and numbers, beside times."""
    from robot_dyn.accuracy.certificate_diagram import DIGITS
    from robot_dyn.accuracy.diagram import DiagramError
    from robot_dyn.cli import certificates
    from robot_dyn.view.plots import PICTURES

    inputs = [robot] if os.path.isfile(robot) else []
    drawn = output and arguments.output(output, PICTURES, DiagramError, inputs, force)
    table = csv and arguments.output(csv, DIGITS, DiagramError, [*inputs, *([drawn] if drawn else [])], force)
    arm = arguments.load(robot, lock, package_dir)
    given = {"q": q, "v": v, "a": a, "tau": tau}
    state = {key: arguments.vector(f"--{key}", x, arm.joint_names) for key, x in given.items() if x is not None}
    with spending(1.0) as done:
        result = rd.certify(arm, **state, samples=samples, seed=seed, repeats=repeats, on_progress=done)
    try:  # the files first: a terminal or pipe may be gone
        written = [
            rd.save_certificate(result, path, theme="dark" if dark else "light") for path in (drawn, table) if path
        ]
    finally:
        say_json(certificates.certificate(result)) if as_json else say(*certificates.tables(result))
    for path in written:
        tell(f"written: {path}")
    if result.interrupted:
        raise typer.Exit(130)


@app.command()
def advise(
    scene: Annotated[str, typer.Argument(metavar="SCENE.toml", help="A scene file.")], as_json: Json = False
) -> None:
    """Say whether step and control period are short enough, and what error to expect; exit code 1 if they are not."""
    from robot_dyn.cli import prices

    advice = rd.advise(rd.read_scene(scene))
    say_json(prices.advice(advice)) if as_json else say(*advice.text.split("\n"))
    if not advice.stable:
        raise typer.Exit(1)


def _setup(
    what: str, q: str | None, v: str | None, duration: float | None, lock: list[str] | None,
    package_dir: list[str] | None,
) -> rd.Setup:  # fmt: skip
    """The setup of a scene file, or of the free swing of a robot."""
    given = {"--q": q, "--v": v, "--duration": duration, "--lock": lock, "--package-dir": package_dir}
    if setup := arguments.scene(what, given):
        return setup
    import numpy as np

    robot = arguments.load(what, lock, package_dir)
    names = robot.joint_names
    start: Any = (
        robot.random_configuration(np.random.default_rng(0)) if q is None else arguments.vector("--q", q, names)
    )
    seconds = _DURATION_S if duration is None else duration
    if not (isfinite(seconds) and seconds > 0):
        raise QueryError(f"--duration must be positive, got {seconds:g}")
    return rd.Setup(rd.Plant(robot), start, arguments.vector("--v", v, names), seconds)
