"""The command that compares two runs: diff-runs."""

from __future__ import annotations

import robot_dyn as rd
from robot_dyn.cli import arguments
from robot_dyn.cli.application import INSPECTION, command
from robot_dyn.cli.options import PRINTED, Results


@command(INSPECTION)
def diff_runs(a: str, b: str, /, tolerance: float = 1e-06, results: Results = PRINTED) -> None:
    """Compare two runs: when they part, and their settings.

    It prints the rms and the largest difference b − a by joint, and the settings that differ. The exit code is 0.

    Options:
        a (A.npz): A run file written by `robot-dyn simulate … -o`.
        b (B.npz): A run file of the same robot.
        tolerance: In rad or m: runs without an estimate of their error part beyond it.
    """
    from robot_dyn.accuracy.run_difference import RunDifference

    paths = results.files(RunDifference, a, b)
    results.give(rd.diff_runs(arguments.run(a), arguments.run(b), tolerance=tolerance), paths)
