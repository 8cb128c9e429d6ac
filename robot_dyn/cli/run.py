"""Commands that make a run: simulate, explain, scene."""

from __future__ import annotations

import sys
from typing import Annotated

import typer

import robot_dyn as rd
from robot_dyn.cli.app import Json, app, bar, print_json


@app.command()
def simulate(
    scene: Annotated[str, typer.Argument(metavar="SCENE.toml", help="A scene file; `robot-dyn scene` prints some.")],
    output: Annotated[str | None, typer.Option("-o", "--output", metavar="RUN.npz", help="Keep the run.")] = None,
    csv: Annotated[str | None, typer.Option(metavar="TABLE.csv", help="Write the samples as a table.")] = None,
    as_json: Json = False,
) -> None:
    """Run a scene; exit code 1 if it diverges. Ctrl-C ends the run and keeps its samples."""
    from robot_dyn.cli import report
    from robot_dyn.simulation.table import export_csv

    setup = rd.read_scene(scene)
    with bar(setup.duration_s) as advance:
        run = rd.simulate(setup, on_progress=advance)
    print_json(report.run(run)) if as_json else print(run.summary)
    for path in (output and rd.save_run(run, output), csv and export_csv(run, csv)):
        if path:
            print(f"written: {path}", file=sys.stderr)
    if run.outcome.ending != "finished":
        raise typer.Exit(130 if run.outcome.ending == "stopped" else 1)


@app.command()
def explain(scene: Annotated[str, typer.Argument(metavar="SCENE.toml", help="A scene file.")]) -> None:
    """Say what a scene integrates: each term, what is not simulated, and where every number came from."""
    from robot_dyn.scene.explain import explain as lines
    from robot_dyn.scene.scene import read_both

    print("\n".join(lines(*read_both(scene))))


@app.command()
def scene(
    name: Annotated[str | None, typer.Argument(metavar="NAME", help="Name of a starter; none lists them.")] = None,
) -> None:
    """Print a scene file to start from."""
    from robot_dyn.scene.starters import starter, starters

    print(starter(name) if name else "\n".join(starters()), end="" if name else "\n")
