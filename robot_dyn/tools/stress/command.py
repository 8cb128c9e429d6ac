"""The command that looks for what breaks first: stress."""

from __future__ import annotations

import os
from functools import partial

import typer

import robot_dyn as rd
from robot_dyn.cli import AS_STATED, Force, Json, Name, RobotOptions, bar, command, show
from robot_dyn.foundations import target


@command("Trust it")
def stress(
    robot: Name,
    /,
    output: str | None = None,
    samples: int = 10000,
    runs: int = 7,
    seed: int = 0,
    budget: float = 90.0,
    force: Force = False,
    options: RobotOptions = AS_STATED,
    as_json: Json = False,
) -> None:
    """Look for what breaks first on an arm.

    Worst configurations, step, gain, speed and payload; the exit code is 1 on failures.
    Ctrl-C ends it and keeps what was found.

    Options:
        output (RESULT.json): Write all that was found, as of --json.
        samples: Number of random states.
        runs: Number of random runs.
        seed: Of the random states and runs.
        budget (SECONDS): Time to spend; what is not looked at by then is named.
    """
    from robot_dyn.report import JSON, ResultError

    inputs = [robot] if os.path.isfile(robot) else []
    path = target(output, JSON, ResultError, inputs, force) if output else None
    arm = options.load(robot)
    with bar(budget, "starting") as spent:
        result = rd.tools.stress.stress(arm, samples=samples, runs=runs, seed=seed, budget_s=budget, on_progress=spent)
    writes = [] if path is None else [partial(rd.accuracy.save_result, result, path)]
    show(result, as_json=as_json, writes=writes)
    if not result.ok:
        raise typer.Exit(1)
