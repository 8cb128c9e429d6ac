"""Commands on scenes: simulate, explain, parameters, scene."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Annotated

import typer

import robot_dyn as rd
from robot_dyn.cli import completion
from robot_dyn.cli.application import DYNAMICS, FILES, SIMULATION, bar, command
from robot_dyn.cli.options import Force, Json, Scene
from robot_dyn.cli.terminal import put, say, show
from robot_dyn.foundations.answer import Table
from robot_dyn.foundations.files import target


@command(SIMULATION)
def simulate(
    scene: Scene,
    /,
    output: str | None = None,
    csv: str | None = None,
    accuracy: float | None = None,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Run a scene.

    The exit code is 1 if the run diverges. Ctrl-C ends the run and keeps its samples.

    Options:
        output (RUN.npz): Save the run: as .npz for replay, plot and diff-runs; or as .csv, .parquet, .nc or .mcap.
        csv (TABLE.csv): Write the samples as a table.
        accuracy (ERROR): Largest acceptable error of q, in rad or m; pilot runs choose the method.
    """
    from robot_dyn.cli import report
    from robot_dyn.simulation.results.formats.save import TABLE, kinds
    from robot_dyn.simulation.results.run_file import RunFileError

    setup = rd.read_scene(scene)
    if accuracy is not None:
        setup = replace(setup, accuracy=accuracy)
    inputs = [scene, setup.plant.dynamics.description.source]  # pyright: ignore[reportAttributeAccessIssue]
    files: list[Path] = []
    for path, allowed in ((output, kinds(rd.Trajectory)), (csv, (TABLE,))):
        if path:
            files.append(target(path, allowed, RunFileError, [*inputs, *files], force))
    with bar(setup.duration_s, at_the_end="estimating the error") as advance:
        run = rd.simulate(setup, on_progress=advance)
    writes = [partial(run.save, path) for path in files]
    show(run.summary.split("\n"), as_json=as_json, document=report.run(run), writes=writes)
    if run.outcome.ending != "finished":
        raise typer.Exit(130 if run.outcome.ending == "stopped" else 1)


@command(DYNAMICS)
def explain(scene: Scene, /, as_json: Json = False) -> None:
    """Print a scene's equation and the source of each number."""
    show(rd.explain(Path(scene)), as_json=as_json)


@command(DYNAMICS)
def parameters(scene: Scene, /, as_json: Json = False) -> None:
    """List the parameters of a scene that a sweep can vary."""
    show(rd.parameters(rd.read_scene(scene)), as_json=as_json)


@command(FILES)
def scene(name: Annotated[str | None, typer.Argument(autocompletion=completion.scenes)] = None, /) -> None:
    """Print a scene file to start from.

    For example `robot-dyn scene pendulum > pendulum.toml`.

    Options:
        name (NAME): Name of a starter; without a name, they are listed.
    """
    from robot_dyn.scene.starters import opening, starter, starter_names

    if name:
        put(starter(name))
    else:
        rows = tuple((starter_name, opening(starter_name)) for starter_name in starter_names())
        say(Table(("scene", "content"), rows, wrap=True))
