"""The command that compares two runs: diff."""

from __future__ import annotations

from typing import Annotated

import typer

import robot_dyn as rd
from robot_dyn.cli.application import Csv, Dark, Force, Json, Plot, app
from robot_dyn.cli.outcome import give, outputs


@app.command()
def diff(
    a: Annotated[str, typer.Argument(metavar="A.npz", help="A run file, as `robot-dyn simulate … -o` writes.")],
    b: Annotated[str, typer.Argument(metavar="B.npz", help="A run file of the same robot.")],
    output: Plot = None,
    csv: Csv = None,
    tolerance: Annotated[
        float, typer.Option(help="In rad or m: runs without an estimate of their error part beyond it.")
    ] = 1e-6,
    dark: Dark = False,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Compare two runs of one robot: rms and largest difference by joint, when they part, which settings differ.

    The difference is b − a. The exit code is 0 whether they differ or not.
    """
    from robot_dyn.accuracy.run_difference import RunDifference

    paths = outputs(RunDifference, output, csv, [a, b], force)
    give(rd.compare_runs(rd.load_run(a), rd.load_run(b), tolerance=tolerance), paths, as_json, dark)
