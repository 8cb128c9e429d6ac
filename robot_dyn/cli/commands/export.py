"""The command that writes a run for other programs: export."""

from __future__ import annotations

import robot_dyn as rd
from robot_dyn.cli.application import FILES, bar, command
from robot_dyn.cli.options import Force
from robot_dyn.cli.terminal import say_written
from robot_dyn.foundations.files import target


@command(FILES)
def export(run: str, /, output: str, force: Force = False) -> None:
    """Write a run as CSV, Parquet, netCDF or a log of ROS 2.

    The runs of a batch are one table.

    Options:
        run (RUN.npz): A file of a run, or of rollouts.
        output (FILE): A .csv, .parquet, .nc (netCDF) or .mcap (ROS 2) file.
    """
    from robot_dyn.simulation.results.formats.save import kinds
    from robot_dyn.simulation.results.run_file import RunFileError

    loaded = rd.read(run)
    path = target(output, kinds(type(loaded)), RunFileError, [run], force)
    with bar(description="writing"):
        loaded.save(path)
    say_written(path)
