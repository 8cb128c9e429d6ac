"""The command that writes a run for other programs: export."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated

import typer

import robot_dyn as rd
from robot_dyn.cli import arguments
from robot_dyn.cli.application import Force, app, bar
from robot_dyn.cli.terminal import say, size_of

if TYPE_CHECKING:
    from robot_dyn.simulation.results.run_data import RunData


@app.command()
def export(
    run: Annotated[str, typer.Argument(metavar="RUN.npz", help="A file of a run, or of rollouts.")],
    output: Annotated[
        str,
        typer.Option("-o", "--output", metavar="FILE", help="A .csv, .parquet, .nc (netCDF) or .mcap (ROS 2) file."),
    ],
    force: Force = False,
) -> None:
    """Write a run, or the runs of a batch, as a table or a log for other programs."""
    from robot_dyn.simulation.export.export import kinds
    from robot_dyn.simulation.results.run_file import RunFileError

    loaded = _loaded(run)
    path = arguments.output(output, kinds(loaded), RunFileError, [run], force)
    with bar(what="writing"):
        file = rd.export(loaded, path)
    say(f"written: {file} ({size_of(file)})")


def _loaded(path: str) -> RunData:
    """What a run file holds."""
    from robot_dyn.simulation.results.run_file import RunFileError

    try:
        return rd.load_run(path)
    except RunFileError as error:
        try:
            return rd.load_rollouts(path)
        except RunFileError:
            raise error from None
