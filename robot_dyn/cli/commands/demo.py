"""The demo: load, compare, simulate and show an arm, and measure the cost of accuracy."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import typer

import robot_dyn as rd
from robot_dyn.cli.application import INSPECTION, bar, command
from robot_dyn.cli.options import Force
from robot_dyn.cli.terminal import say
from robot_dyn.foundations.errors import QueryError, RobotDynError
from robot_dyn.foundations.files import save, target

_ERROR, _METHOD = 1e-8, "DOP853"  # [rad]
_BUDGET_S = 8.0  # without compiling, which happens once for a version of the library


@command(INSPECTION)
def demo(output: str = "demo", force: Force = False) -> None:
    """Load, compare, simulate, replay and plot a real arm.

    At the end it prints how long this library and other installed programs take here for 1e-8 rad.

    Options:
        output (FOLDER): Folder for its files.
    """
    from robot_dyn.cli import report
    from robot_dyn.scene.scene import SCENE, SceneError
    from robot_dyn.scene.starters import starter
    from robot_dyn.simulation.results.run_file import RUN, RunFileError
    from robot_dyn.view.page import PAGE, ReplayError
    from robot_dyn.view.plots.pictures import PICTURES, PlotError

    folder = Path(output)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise QueryError(f"--output {output}: {error.strerror}; give a writable folder") from None
    kinds = (("toml", SCENE, SceneError), ("html", PAGE, ReplayError), ("png", PICTURES, PlotError))
    kinds += (("npz", RUN, RunFileError),)
    files = {end: target(folder / f"panda.{end}", kind, error, (), force) for end, kind, error in kinds}
    save(files["toml"], lambda stream: stream.write(starter("panda_computed_torque").encode()), SceneError)
    panda = rd.load("panda").with_(lock={"panda_finger_joint1": 0.0})
    with bar(description="comparing"):
        tables = list(report.demo_tables(panda))
    say(*tables, "", "The same arm under computed torque, its model 20 % too heavy", "")
    scene = rd.read_scene(files["toml"])
    with bar(scene.duration_s, at_the_end="estimating the error") as advance:
        run = rd.simulate(scene, on_progress=advance)
    if run.outcome.ending == "stopped":
        say(*run.summary.split("\n"))
        raise typer.Exit(130)
    with bar(description="drawing"):
        run.save(files["npz"])
        rd.replay(run).save(files["html"])
        rd.plot(run).save(files["png"])
    say(*run.summary.split("\n"))
    say(
        "",
        "Now look:",
        f"  {files['html']}  the replay: open it in a browser",
        f"  {files['png']}   its plots",
        f"  {files['npz']}   the run itself",
        f"  {files['toml']}  its scene: change it, then robot-dyn simulate {files['toml']}",
    )
    say(*_price(rd.Setup(rd.Plant(panda), scene.q0, engine="compiled")))


def _price(swing: rd.Setup) -> Iterator[str]:
    """Measure the cost of digits of a free swing on this machine."""
    from robot_dyn.accuracy.work_precision_diagram.work_precision import programs

    yield ""
    yield f"What 1e-8 rad takes here: {swing.duration_s:g} s of the same arm, swinging freely"
    try:
        with bar(_BUDGET_S, "starting") as spent:
            result = rd.accuracy.work_precision(
                swing, methods=[_METHOD], budget_s=_BUDGET_S, repeats=5, on_progress=spent
            )
    except RobotDynError as error:
        yield f"left out: {error}"
        return
    yield from programs(result, _ERROR)
    if result.interrupted:
        raise typer.Exit(130)
    yield "  all methods: robot-dyn work-precision; each effect and algorithm: robot-dyn cost"
