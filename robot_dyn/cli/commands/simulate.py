"""Commands on scenes: simulate, explain, scene."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated

import typer

import robot_dyn as rd
from robot_dyn.cli import arguments, completion
from robot_dyn.cli.app import Force, Json, Scene, app, bar
from robot_dyn.cli.terminal import put, say, say_json, to_stderr


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
    from robot_dyn.simulation.results.run_file import RUN, RunFileError
    from robot_dyn.simulation.table import TABLE, export_csv

    setup = rd.read_scene(scene)
    if accuracy is not None:
        setup = replace(setup, accuracy=accuracy)
    inputs = [scene, setup.plant.dynamics.description.source]  # pyright: ignore[reportAttributeAccessIssue]
    file = output and arguments.output(output, RUN, RunFileError, inputs, force)
    table = csv and arguments.output(csv, TABLE, RunFileError, [*inputs, *([file] if file else [])], force)
    with bar(setup.duration_s) as advance:
        run = rd.simulate(setup, on_progress=advance)
    try:  # the files first: a terminal or pipe may be gone
        written = [path for path in (file and rd.save_run(run, file), table and export_csv(run, table)) if path]
    finally:
        say_json(report.run(run)) if as_json else say(*run.summary.split("\n"))
    for path in written:
        to_stderr(f"written: {path}")
    if run.outcome.ending != "finished":
        raise typer.Exit(130 if run.outcome.ending == "stopped" else 1)


@app.command()
def explain(scene: Scene) -> None:
    """Say what a scene integrates: each term, what is not simulated, and where every number came from."""
    from robot_dyn.scene.explain import explain as lines
    from robot_dyn.scene.scene import read_both

    say(*lines(*read_both(scene)))


@app.command()
def scene(
    name: Annotated[
        str | None,
        typer.Argument(
            metavar="NAME", help="Name of a starter; without a name, they are listed.", autocompletion=completion.scenes
        ),
    ] = None,
) -> None:
    """Print a scene file to start from."""
    from robot_dyn.scene.starters import starter, starters

    put(starter(name)) if name else say(*starters())
