"""Sweeps: many runs of one scene under uncertain parameters, their designs and their statistics.

A sweep is a folder: what is done has a file, what has none is left to do, and an engine only fills it.

    what is swept      Sweep of a scene or of a function, from_scene: of a scene's table [sweep]
    from which values  uniform, normal, lognormal, triangular, choice; frozen distributions of scipy.stats
    what is kept       rms_error, peak, final; samples of runs; functions of a Run by import path
    doing it           run, again to resume; read what a folder holds
    what it says       SweepResult: quantiles, probability and mean, each an Estimate, Sensitivity, worst, table, report
    errors             SweepError

docs/how_to/sweep.md is a first sweep; robot_dyn/tools/sweeps/README.md lists the files of this room.
"""

from robot_dyn.foundations import public_names

__getattr__, __dir__, __all__ = public_names(__spec__)  # pyright: ignore[reportUnsupportedDunderAll]
