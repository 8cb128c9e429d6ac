"""Sweeps: many runs of one scene under uncertain parameters, their designs and their statistics.

A sweep is a folder with a file for each finished chunk of runs; chunks without a file are still to be run.

    definition         Sweep of a scene or of a function, from_scene: from a scene's table [sweep]
    distributions      uniform, normal, lognormal, triangular, choice; frozen distributions of scipy.stats
    figures            rms_tracking_error, peak, final; samples of runs; functions of a Run by import path
    execution          run, repeated to resume; read_sweep: open a folder
    results            SweepResult: quantiles, probability and mean as Estimate, Sensitivity, worst, table, report
    errors             SweepError

docs/how_to/sweep.md is a first sweep; robot_dyn/tools/sweeps/README.md lists the files of this folder.
"""

from robot_dyn.foundations import public_names

__getattr__, __dir__, __all__ = public_names(__spec__)  # pyright: ignore[reportUnsupportedDunderAll]
