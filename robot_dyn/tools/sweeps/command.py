"""The command sweep: run a scene many times into a folder, and evaluate the folder."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from robot_dyn.cli import Force, Json, arguments, command, say, say_json, to_stderr
from robot_dyn.foundations import SweepError, nearest

if TYPE_CHECKING:
    from robot_dyn.tools.sweeps.result import SweepResult
    from robot_dyn.tools.sweeps.sweep import Sweep

ACTIONS = ("run", "status", "verify", "report", "export")


@command("Simulation")
def sweep(
    scene_or_action: str,
    folder: str | None = None,
    /,
    output: str | None = None,
    runs: int | None = None,
    vary: list[str] | None = None,
    figure: list[str] | None = None,
    samples: str | None = None,
    design: str | None = None,
    seed: int | None = None,
    uncut: bool = False,
    threads: int | None = None,
    job: str | None = None,
    scene: str | None = None,
    chunk: int | None = None,
    probability: list[str] | None = None,
    force: Force = False,
    as_json: Json = False,
) -> None:
    """Run a scene many times with varying parameters.

    Repeat the command to resume. Ctrl-C drops unfinished chunks; the folder keeps finished ones. `sweep run FOLDER`
    resumes a sweep, `status` prints the remaining work, `verify` reads all files, `report` writes a page, `export` a
    table as .csv or .parquet.

    Options:
        scene_or_action (SCENE.toml|ACTION): A scene to sweep; or run, status, verify, report, export of a FOLDER.
        folder (FOLDER): Folder of a sweep, for an action.
        output (PATH): Folder to fill; or the file of report, export.
        runs: Number of runs.
        vary (NAME=DISTRIBUTION): Varying parameter, such as 'kp=uniform(low=50, high=100)'; may be repeated.
        figure (NAME=FIGURE): Figure of each run, such as 'peak=peak("u")'; may be repeated.
        samples (SAMPLES): Samples to keep: q, v or u of all runs, or 'samples("q", every=10)'.
        design: random, sobol, halton, latin, saltelli or grid.
        seed: Seed of the design.
        uncut: Let steps pass thresholds, in lock step; 64 runs are compared with runs whose steps end there.
        threads: Threads of this process; by default one for each processor.
        job (3/16): Number of this job of an array, and number of jobs.
        scene: For a folder: present path of its scene, or the function module:function that returns the setup.
        chunk: Runs in a file; by default about 2 s of work.
        probability (EVENT): Estimate the probability of an event such as 'failed | error > 0.1'; may be repeated.
    """
    from robot_dyn.tools import sweeps as sw

    verified, interrupted = list[str](), False
    figures = arguments.pairs("--figure", figure)
    options: dict[str, Any] = {"threads": threads, "job": job}
    if scene_or_action.lower().endswith(".toml"):
        if folder is not None or output is None:
            raise SweepError("give the output folder with -o FOLDER")
        settings = {"runs": runs, "design": design, "seed": seed, "samples": samples}
        changes: dict[str, Any] = {name: value for name, value in settings.items() if value is not None}
        changes |= {"uncut": True} if uncut else {}
        stated = sw.from_scene(scene_or_action, vary=arguments.pairs("--vary", vary), figures=figures, **changes)
        result, interrupted = _run(stated, output, options | {"chunk": chunk})
    else:
        if scene_or_action not in ACTIONS:
            raise SweepError(
                f"{scene_or_action!r} is neither a scene, which ends with .toml, nor an action;"
                f" {nearest(scene_or_action, ACTIONS)}"
            )
        if folder is None:
            raise SweepError(f"{scene_or_action}: give the folder of a sweep, robot-dyn sweep {scene_or_action} FOLDER")
        of_scenes = {
            "--runs": runs, "--vary": vary, "--samples": samples, "--design": design, "--seed": seed, "--chunk": chunk,
            "--uncut": uncut or None,
        }  # fmt: skip
        if ignored := [name for name, value in of_scenes.items() if value not in (None, [], ())]:
            raise SweepError(
                f"{', '.join(ignored)}: for a scene only; the sweep in {folder} keeps its settings; to change them, run"
                " its scene into another folder: robot-dyn sweep SCENE.toml … -o FOLDER"
            )
        result = sw.read_sweep(folder, scene, figures)
        if scene_or_action == "run":
            result, interrupted = _run(result.sweep, folder, options)
        elif scene_or_action == "verify":
            verified = [f"all rows: SHA-256 {result.verify()}"]
            verified += [f"{count} chunks by {name}" for name, count in result.processors.items()]
        elif scene_or_action in ("report", "export"):
            path = Path(output or f"{folder.rstrip('/')}.{'html' if scene_or_action == 'report' else 'csv'}")
            to_stderr(f"written: {result.save(path, force=force)}")
    answers = [result.probability(event) for event in probability or ()] if not result.status["missing"] else []
    if as_json:
        say_json(result, probabilities=dict(zip(probability or (), answers, strict=False)))
    else:
        say(result, *verified, *answers)
    if interrupted:
        raise typer.Exit(130)


def _run(stated: Sweep, folder: str, options: dict[str, Any]) -> tuple[SweepResult, bool]:
    """Fill the folder; return its result, and True if Ctrl-C ended the work."""
    from robot_dyn.tools import sweeps as sw
    from robot_dyn.tools.sweeps.folder import folder_of
    from robot_dyn.tools.sweeps.specification import FILE, stated_in

    to_stderr(f"{stated.runs} runs, {stated.bytes_expected / 2**20:.3g} MiB on disk")
    path = Path(folder)
    try:
        return sw.run(stated, path, **options), False
    except KeyboardInterrupt:
        if not (path / FILE).is_file():  # in the pilot: there is nothing to summarise
            raise
        return sw.SweepResult(stated, folder_of(path, stated, stated_in(path))), True
