"""The command that runs a scene many times into a folder, and what is asked of the folder: sweep."""

from __future__ import annotations

from pathlib import Path
from time import perf_counter
from typing import TYPE_CHECKING, Annotated, Any

import typer

from robot_dyn.cli import Force, Json, app, bar, say, say_json, to_stderr
from robot_dyn.foundations import SweepError, nearest, shorten

if TYPE_CHECKING:
    from robot_dyn.tools.sweeps.result import SweepResult
    from robot_dyn.tools.sweeps.sweep import Sweep

ACTIONS = ("run", "status", "verify", "report", "export")


@app.command(rich_help_panel="Run it", short_help="Run a scene many times, with what varies, into a folder.")
def sweep(
    what: Annotated[
        str, typer.Argument(metavar="SCENE.toml|ACTION", help=f"A scene to sweep; or {', '.join(ACTIONS)} of a FOLDER.")
    ],
    folder: Annotated[str | None, typer.Argument(metavar="FOLDER", help="Of a sweep, for an action.")] = None,
    output: Annotated[
        str | None,
        typer.Option("-o", "--output", metavar="PATH", help="Folder to fill; or the file of report, export."),
    ] = None,
    runs: Annotated[int | None, typer.Option(help="Number of runs.")] = None,
    vary: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME=DISTRIBUTION", help="What varies, as 'kp=uniform(low=50, high=100)'; repeated."),
    ] = None,
    figure: Annotated[
        list[str] | None,
        typer.Option(metavar="NAME=FIGURE", help="What is kept of each run, as 'peak=peak(\"u\")'; repeated."),
    ] = None,
    samples: Annotated[
        str | None,
        typer.Option(metavar="SAMPLES", help="Samples to keep: q, v or u of all runs, or 'samples(\"q\", every=10)'."),
    ] = None,
    design: Annotated[str | None, typer.Option(help="random, sobol, halton, latin, saltelli or grid.")] = None,
    seed: Annotated[int | None, typer.Option(help="Of the design.")] = None,
    threads: Annotated[int | None, typer.Option(help="Of this process; all processors unless given.")] = None,
    cluster: Annotated[
        str | None, typer.Option(help="Workers of Dask in place of threads: local:2, or tls://host:8786.")
    ] = None,
    share: Annotated[str | None, typer.Option(metavar="3/16", help="The part of one job of an array.")] = None,
    scene: Annotated[
        str | None,
        typer.Option(help="Of a folder: where its scene lies now, or the function module:function that makes it."),
    ] = None,
    chunk: Annotated[int | None, typer.Option(help="Runs of a file; about 2 s of work unless given.")] = None,
    probability: Annotated[
        list[str] | None,
        typer.Option(metavar="EVENT", help="Say how likely it is, as 'failed | error > 0.1'; repeated."),
    ] = None,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Run a scene many times, with what varies, into a folder; again, it is resumed.

    Ctrl-C drops the chunks under way, and the folder keeps the others. `sweep run FOLDER` resumes it, `status` says
    what is left, `verify` reads all files, `report` writes a page, `export` a table as .csv or .parquet.
    """
    from robot_dyn.tools import sweeps as sw

    verified: list[str] = []
    options: dict[str, Any] = {"threads": threads, "cluster": cluster, "share": share}
    if what.lower().endswith(".toml"):
        if folder is not None or output is None:
            raise SweepError("give the folder to fill with -o FOLDER")
        changes: dict[str, Any] = {"runs": runs, "design": design, "seed": seed, "samples": samples}
        changes = {name: value for name, value in changes.items() if value is not None}
        changes |= {"vary": _assignments("--vary", vary), "figures": _assignments("--figure", figure)}
        result = _run(sw.from_scene(what, **changes), output, options | {"chunk": chunk})
    else:
        if what not in ACTIONS:
            raise SweepError(
                f"{what!r} is neither a scene, which ends with .toml, nor an action; {nearest(what, ACTIONS)}"
            )
        if folder is None:
            raise SweepError(f"{what}: of which folder? robot-dyn sweep {what} FOLDER")
        result = sw.read(folder, scene, _assignments("--figure", figure))
        if what == "run":
            result = _run(result.sweep, folder, options)
        elif what == "verify":
            verified = [f"all rows: SHA-256 {result.verify()}"]
            verified += [f"{count} chunks by {name}" for name, count in result.processors.items()]
        elif what in ("report", "export"):
            path = Path(output or f"{folder.rstrip('/')}.{'html' if what == 'report' else 'csv'}")
            write = result.save_report if what == "report" else result.export
            written = write(path, force=force)
            to_stderr(f"written: {written}")
    answers = [result.probability(event) for event in probability or ()] if not result.status["missing"] else []
    if as_json:
        say_json(result, probabilities=dict(zip(probability or (), answers, strict=False)))
    else:
        say(result, *verified, *answers)
    if result.status["missing"] and what != "status" and share is None:
        raise typer.Exit(130)


def _assignments(option: str, texts: list[str] | None) -> dict[str, str]:
    """Names and values of texts NAME=VALUE; SweepError if one has another form."""
    values = {}
    for text in texts or ():
        name, equals, value = text.partition("=")
        if not equals or not name.strip():
            raise SweepError(f"{option} must be NAME=VALUE, got {shorten(text)!r}")
        values[name.strip()] = value.strip()
    return values


def _run(stated: Sweep, folder: str, options: dict[str, Any]) -> SweepResult:
    """Fill the folder, with a bar of the time left."""
    from robot_dyn.tools import sweeps as sw

    to_stderr(f"{stated.runs} runs, {stated.bytes_expected / 2**20:.3g} MiB on disk")
    began, first = perf_counter(), [-1]
    with bar(stated.runs, "preparing") as advance:

        def on_progress(done: int, runs: int) -> None:
            first[0] = done if first[0] < 0 else first[0]
            rate = (done - first[0]) / max(perf_counter() - began, 1e-9)
            advance(done, f"{done} of {runs} runs, {rate:.0f} a second")

        return sw.run(stated, folder, on_progress=on_progress, **options)
