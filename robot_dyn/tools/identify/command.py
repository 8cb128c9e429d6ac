"""The command identify: an arm from a log."""

from __future__ import annotations

import os
from pathlib import Path

import robot_dyn as rd
from robot_dyn.cli import AS_STATED, Effects, Force, Json, Name, RobotOptions, command, show
from robot_dyn.foundations import QueryError, target


@command("Dynamics")
def identify(
    robot: Name,
    log: str,
    /,
    output: str | None = None,
    repeat: str | None = None,
    gains: str | None = None,
    effects: Effects = None,
    cutoff: float = 8.0,
    force: Force = False,
    options: RobotOptions = AS_STATED,
    as_json: Json = False,
) -> None:
    """Identify inertia and friction of an arm from a log.

    Columns of the log: t [s]; "q JOINT", "tau JOINT" or, with --gains, "current JOINT"; "desired JOINT" if known.

    Options:
        log (LOG.csv): The log.
        output (FILE): Write the corrected URDF (.urdf), a report (.html) or all data (.json).
        repeat (LOG.csv): A second log of the same motion.
        gains (K1,K2,…): Drive gains in N m/A, one or one for each joint.
        cutoff (HZ): Cutoff of the filters.
    """
    from robot_dyn.report import ResultError
    from robot_dyn.tools.identify.result import KINDS

    inputs: list[str | Path] = [path for path in (robot, log, repeat) if path and os.path.isfile(path)]
    path = target(output, KINDS, ResultError, inputs, force) if output else None
    try:
        factors = None if gains is None else [float(x) for x in gains.split(",")]
    except ValueError:
        raise QueryError(f"--gains must be numbers separated by commas, got {gains!r}") from None
    if factors is not None and len(factors) == 1:
        factors = factors[0]
    arm = options.load(robot)
    result = rd.tools.identify.identify(arm, log, repeat=repeat, gains=factors, effects=effects, cutoff_hz=cutoff)
    show(result, as_json=as_json, writes=[] if path is None else [lambda: result.save(path)])
