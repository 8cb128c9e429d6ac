"""The command that looks for what breaks first: stress."""

from __future__ import annotations

import os
from collections.abc import Iterator
from dataclasses import asdict
from typing import Annotated, Any

import typer

import robot_dyn as rd
from robot_dyn.cli import arguments
from robot_dyn.cli.app import Force, Json, Lock, Name, PackageDir, Xacro, app, spending
from robot_dyn.cli.terminal import say, say_json, tell


@app.command()
def stress(
    robot: Name,
    output: Annotated[
        str | None,
        typer.Option("-o", "--out", metavar="PAGE.html", help="Write the report, with lines that repeat it."),
    ] = None,
    samples: Annotated[int, typer.Option(help="Number of random states.")] = 10_000,
    runs: Annotated[int, typer.Option(help="Number of random runs.")] = 7,
    seed: Annotated[int, typer.Option(help="Of the random states and runs.")] = 0,
    budget: Annotated[
        float, typer.Option(metavar="SECONDS", help="Time to spend; what is not looked at by then is named.")
    ] = 90.0,
    force: Force = False,
    lock: Lock = None,
    package_dir: PackageDir = None,
    xacro: Xacro = None,
    as_json: Json = False,
) -> None:
    """Look for what breaks first on an arm: worst configurations, step, gain, speed, payload; exit code 1 on failures.

    Ctrl-C ends it and keeps what was found.
    """
    from robot_dyn.stress_test.lines import Loading
    from robot_dyn.stress_test.page import REPORT, ReportError, save_stress
    from robot_dyn.stress_test.stress import stressed

    inputs = [robot] if os.path.isfile(robot) else []
    to = output and arguments.output(output, REPORT, ReportError, inputs, force)
    arm = arguments.load(robot, lock, package_dir, xacro)
    loading = Loading.of(arm, package_dir or (), None if xacro is None else arguments.expansion(xacro))
    with spending(budget) as spent:
        made = stressed(arm, loading, samples, runs, seed, budget, spent)
    try:  # the page first: a terminal or pipe may be gone
        written = save_stress(made, to) if to else None
    finally:
        say_json(document(made)) if as_json else say(*_tables(made))
    if written:
        tell(f"written: {written}")
    if made.interrupted:
        raise typer.Exit(130)
    if not made.ok:
        raise typer.Exit(1)


def document(made: rd.Stress) -> dict[str, Any]:
    """The plain document of --json."""
    from robot_dyn.cli.prices import finite

    def plain(each: Any) -> dict[str, Any]:
        return {key: finite(x) for key, x in asdict(each).items()} | {"python": made.python(each)}

    return {
        "robot": made.robot,
        "joints": list(made.joints),
        "sentence": made.sentence,
        "ok": made.ok,
        "failures": list(made.failures),
        "worst": [plain(each) | {"found": each.found} for each in made.worst],
        "limits": [plain(each) for each in made.limits],
        "runs": [plain(each) for each in made.runs],
        "left_out": list(made.left_out),
        "out_of_time": list(made.out_of_time),
        "environment": made.environment,
        "samples": made.samples,
        "seed": made.seed,
        "spent_s": made.spent_s,
        "interrupted": made.interrupted,
    }


def _tables(made: rd.Stress) -> Iterator[Any]:
    from rich.table import Table

    from robot_dyn.stress_test.page import LIMITS, RUNS, WORST, cells

    yield made.sentence
    yield from (f"FAILURE: {each}" for each in made.failures)
    for title, headings, findings in (
        ("worst configurations", WORST, made.worst),
        ("limits", LIMITS, made.limits),
        ("random runs: errors of q in rad or m", RUNS, made.runs),
    ):
        if findings:
            yield ""
            yield title
            table = Table(box=None, pad_edge=False, header_style="bold")
            for heading in headings:
                table.add_column(heading)
            for each in findings:
                table.add_row(*cells(each))
            yield table
    yield ""
    yield from (f"not looked at for lack of time: {each}" for each in made.out_of_time)
    yield from (f"left out: {each}" for each in made.left_out)
    yield "lines that repeat each finding: --out PAGE.html, or --json"
