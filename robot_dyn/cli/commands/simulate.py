"""Commands on scenes: simulate, explain, sweepable, scene."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated

import typer

import robot_dyn as rd
from robot_dyn.cli import arguments, completion
from robot_dyn.cli.application import Force, Json, Scene, app, bar
from robot_dyn.cli.terminal import put, say, say_json, to_stderr
from robot_dyn.foundations.answer import Table


@app.command()
def simulate(
    scene: Scene,
    output: Annotated[
        str | None, typer.Option("-o", "--output", metavar="RUN.npz", help="Write the run to a file.")
    ] = None,
    csv: Annotated[str | None, typer.Option(metavar="TABLE.csv", help="Write the samples as a table.")] = None,
    accuracy: Annotated[
        float | None,
        typer.Option(metavar="ERROR", help="Largest error of q to have, in rad and m; pilot runs choose the method."),
    ] = None,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Run a scene; exit code 1 if it diverges. Ctrl-C ends the run and keeps its samples."""
    from robot_dyn.cli import report
    from robot_dyn.simulation.export.export import TABLE
    from robot_dyn.simulation.results.run_file import RUN, RunFileError

    setup = rd.read_scene(scene)
    if accuracy is not None:
        setup = replace(setup, accuracy=accuracy)
    inputs = [scene, setup.plant.dynamics.description.source]  # pyright: ignore[reportAttributeAccessIssue]
    file = output and arguments.output(output, RUN, RunFileError, inputs, force)
    table = csv and arguments.output(csv, TABLE, RunFileError, [*inputs, *([file] if file else [])], force)
    with bar(setup.duration_s, at_the_end="estimating the error") as advance:
        run = rd.simulate(setup, on_progress=advance)
    try:  # the files first: a terminal or pipe may be gone
        written = [path for path in (file and rd.save_run(run, file), table and rd.export(run, table)) if path]
    finally:
        say_json(report.run(run)) if as_json else say(*run.summary.split("\n"))
    for path in written:
        to_stderr(f"written: {path}")
    if run.outcome.ending != "finished":
        raise typer.Exit(130 if run.outcome.ending == "stopped" else 1)


@app.command()
def explain(scene: Scene, as_json: Json = False) -> None:
    """Say what a scene integrates: each term, what is not simulated, and where every number came from."""
    answer = rd.explain(Path(scene))
    say_json(answer) if as_json else say(answer)


@app.command()
def sweepable(scene: Scene, as_json: Json = False) -> None:
    """List the parameters of a scene that `rd.rollouts` can sweep, with values and units."""
    answer = rd.sweepable(rd.read_scene(scene))
    say_json(answer) if as_json else say(answer)


@app.command()
def scene(
    name: Annotated[
        str | None,
        typer.Argument(
            metavar="NAME", help="Name of a starter; without a name, they are listed.", autocompletion=completion.scenes
        ),
    ] = None,
) -> None:
    """Print a scene file to start from, as `robot-dyn scene pendulum > pendulum.toml`."""
    from robot_dyn.scene.starters import opening, starter, starter_names

    if name:
        put(starter(name))
    else:
        say(Table(("scene", "what it is"), tuple((each, opening(each)) for each in starter_names()), wrap=True))
