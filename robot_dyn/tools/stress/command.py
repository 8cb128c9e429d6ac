"""The command stress: search for the first failures of an arm."""

from __future__ import annotations

import os
from functools import partial

import typer

import robot_dyn as rd
from robot_dyn.cli import AS_STATED, Force, Json, Name, RobotOptions, bar, command, show
from robot_dyn.foundations import target


@command("Verification")
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
    """Find limits of an arm: posture, step, gain, speed, payload.

    The exit code is 1 on failures. Ctrl-C ends the search and keeps the results.

    Options:
        output (RESULT.json): Write the whole result, same as --json.
        samples: Number of random states.
        runs: Number of random runs.
        seed: Seed of the random states and runs.
        budget (SECONDS): Time to spend; unfinished parts are listed.
    """
    from robot_dyn.report import JSON, ResultError

    inputs = [robot] if os.path.isfile(robot) else []
    path = target(output, JSON, ResultError, inputs, force) if output else None
    arm = options.load(robot)
    with bar(budget, "starting") as spent:
        result = rd.tools.stress.stress(arm, samples=samples, runs=runs, seed=seed, budget_s=budget, on_progress=spent)
    writes = [] if path is None else [partial(result.save, path)]
    show(result, as_json=as_json, writes=writes)
    if not result.ok:
        raise typer.Exit(1)
