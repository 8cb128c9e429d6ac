"""The command that writes a run for other programs: export."""

from __future__ import annotations

from typing import TYPE_CHECKING

import robot_dyn as rd
from robot_dyn.cli.application import FILES, bar, command
from robot_dyn.cli.options import Force
from robot_dyn.cli.terminal import say_written
from robot_dyn.foundations.files import target

if TYPE_CHECKING:
    from robot_dyn.simulation.results.run_data import RunData


@command(FILES)
def export(run: str, /, output: str, force: Force = False) -> None:
    """Write a run as CSV, Parquet, netCDF or a log of ROS 2.

    The runs of a batch are one table.

    Options:
        run (RUN.npz): A file of a run, or of rollouts.
        output (FILE): A .csv, .parquet, .nc (netCDF) or .mcap (ROS 2) file.
    """
    from robot_dyn.simulation.export.export import kinds
    from robot_dyn.simulation.results.run_file import RunFileError

    loaded = _loaded(run)
    path = target(output, kinds(loaded), RunFileError, [run], force)
    with bar(what="writing"):
        file = rd.export(loaded, path)
    say_written(file)


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
