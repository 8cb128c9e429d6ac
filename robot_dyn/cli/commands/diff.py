"""The command that compares two runs: diff."""

from __future__ import annotations

from typing import Annotated

import typer

import robot_dyn as rd
from robot_dyn.cli.application import LOOK, command
from robot_dyn.cli.options import PRINTED, Results


@command(LOOK)
def diff(
    a: Annotated[str, typer.Argument(metavar="A.npz", help="A run file, as `robot-dyn simulate … -o` writes.")],
    b: Annotated[str, typer.Argument(metavar="B.npz", help="A run file of the same robot.")],
    tolerance: Annotated[
        float, typer.Option(help="In rad or m: runs without an estimate of their error part beyond it.")
    ] = 1e-6,
    results: Results = PRINTED,
) -> None:
    """Compare two runs: when they part, what differs.

    It prints the rms and the largest difference b − a by joint, and the settings that differ. The exit code is 0.
    """
    from robot_dyn.accuracy.run_difference import RunDifference

    paths = results.files(RunDifference, a, b)
    results.give(rd.compare_runs(rd.load_run(a), rd.load_run(b), tolerance=tolerance), paths)
