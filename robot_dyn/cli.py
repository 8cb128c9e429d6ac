"""The command line: parse, call, print. Every command has --help; errors go to stderr with exit code 2."""

from __future__ import annotations

import json
import sys
import warnings
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import Annotated, Any

import typer

import robot_dyn as rd
from robot_dyn import arguments
from robot_dyn.errors import ModelWarning, QueryError, RobotDynError

app = typer.Typer(
    name="robot-dyn",
    help="Dynamics of robot arms from a URDF: M(q) a + C(q, v) v + N(t, q, v) = τ.",
    no_args_is_help=True,
    add_completion=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)

Name = Annotated[str, typer.Argument(metavar="ROBOT", help="A name of `robot-dyn list`, or the path of a URDF file.")]
Lock = Annotated[
    list[str] | None, typer.Option(metavar="JOINT=VALUE", help="Hold a joint at a value; may be repeated.")
]
PackageDir = Annotated[
    list[str] | None, typer.Option(help="Folder in which ROS packages are searched; may be repeated.")
]
Json = Annotated[bool, typer.Option("--json", help="Print JSON, as documented in docs/json.md.")]


@app.command("list")
def list_(as_json: Json = False) -> None:
    """List the robots that can be named."""
    names = rd.list_robots()
    _print_json({"robots": names}) if as_json else print("\n".join(names))


@app.command()
def info(robot: Name, lock: Lock = None, package_dir: PackageDir = None, as_json: Json = False) -> None:
    """Show a robot: joints, limits, friction, mass, and what is odd about it."""
    from robot_dyn import report

    loaded = arguments.load(robot, lock, package_dir)
    _print_json(report.info(loaded)) if as_json else _show(report.info_tables(loaded))


@app.command()
def query(
    robot: Name,
    q: Annotated[str | None, typer.Option(help="Positions: 0.1,-0.2,… or joint=0.1,…; 0 if not given.")] = None,
    v: Annotated[str | None, typer.Option(help="Velocities, in the same form.")] = None,
    a: Annotated[str | None, typer.Option(help="Accelerations: the torque is computed.")] = None,
    tau: Annotated[str | None, typer.Option(help="Torques: the acceleration is computed.")] = None,
    why: Annotated[
        str | None, typer.Option(metavar="JOINT", help="Split this joint's torque by link and cause.")
    ] = None,
    effects: Annotated[str | None, typer.Option(help='"urdf" adds the friction that the file states.')] = None,
    lock: Lock = None,
    package_dir: PackageDir = None,
    as_json: Json = False,
) -> None:
    """Ask for M, C, N at a state, and for the torque of an acceleration or the acceleration of a torque."""
    from robot_dyn import report

    loaded = arguments.load(robot, lock, package_dir)
    if a is not None and tau is not None:
        raise QueryError("give --a or --tau, not both: one follows from the other")
    state = {name: arguments.vector(f"--{name}", text, loaded.joint_names) for name, text in (("q", q), ("v", v))}
    given = None if tau is None else arguments.vector("--tau", tau, loaded.joint_names)
    answer = report.query(loaded, effects or "", **state, a=arguments.vector("--a", a, loaded.joint_names), tau=given)
    if why is not None:
        answer |= report.why(loaded, answer, why)
    _print_json(answer) if as_json else _show(report.query_tables(answer))


@app.command()
def compare(
    robots: Annotated[list[str] | None, typer.Argument(metavar="ROBOT...", help="Names or paths.")] = None,
    every: Annotated[bool, typer.Option("--all", help="All robots of `robot-dyn list` that load.")] = False,
    samples: Annotated[int, typer.Option(min=1, help="Random states for each robot.")] = 20,
    seed: Annotated[int, typer.Option(help="Of the random states.")] = 0,
    lock: Lock = None,
    package_dir: PackageDir = None,
    as_json: Json = False,
) -> None:
    """Cross-check Pinocchio against the library's own Lagrangian; exit code 1 if they disagree."""
    from robot_dyn import report

    if bool(robots) == every:
        raise QueryError("name the robots to compare, or give --all, not both")
    results, refused = [], {}
    for name in _progress(rd.list_robots() if every else robots or (), "comparing"):
        try:
            results.append(
                (name, rd.compare(arguments.load(name, lock, package_dir, quiet=every), samples=samples, seed=seed))
            )
        except RobotDynError as error:
            if not every:
                raise
            refused[name] = str(error)
    _print_json(report.comparison(results, refused)) if as_json else _show(report.comparison_tables(results, refused))
    if not all(result.ok for _, result in results):
        raise typer.Exit(1)


@app.command()
def simulate(
    scene: Annotated[str, typer.Argument(metavar="SCENE.toml", help="A scene file; `robot-dyn scene` prints some.")],
    output: Annotated[str | None, typer.Option("-o", "--output", metavar="RUN.npz", help="Keep the run.")] = None,
    csv: Annotated[str | None, typer.Option(metavar="TABLE.csv", help="Write the samples as a table.")] = None,
    as_json: Json = False,
) -> None:
    """Run a scene; exit code 1 if it diverges. Ctrl-C ends the run and keeps its samples."""
    from robot_dyn import report
    from robot_dyn.simulation.run_file import export_csv

    setup = rd.read_scene(scene)
    with _bar(setup.duration_s) as advance:
        run = rd.simulate(setup, on_progress=advance)
    _print_json(report.run(run)) if as_json else print(run.summary)
    for path in (output and rd.save_run(run, output), csv and export_csv(run, csv)):
        if path:
            print(f"written: {path}", file=sys.stderr)
    if run.outcome.ending != "finished":
        raise typer.Exit(130 if run.outcome.ending == "stopped" else 1)


@app.command()
def explain(scene: Annotated[str, typer.Argument(metavar="SCENE.toml", help="A scene file.")]) -> None:
    """Say what a scene integrates: each term, what is not simulated, and where every number came from."""
    from robot_dyn.scene.explain import explain as lines
    from robot_dyn.scene.scene import read_both

    print("\n".join(lines(*read_both(scene))))


@app.command()
def scene(
    name: Annotated[str | None, typer.Argument(metavar="NAME", help="Name of a starter; none lists them.")] = None,
) -> None:
    """Print a scene file to start from."""
    from robot_dyn.scene.starters import starter, starters

    print(starter(name) if name else "\n".join(starters()), end="" if name else "\n")


@app.command()
def demo() -> None:
    """Load a real arm, show its joints, M, C and N at a state, and cross-check the two roads."""
    from robot_dyn import report

    panda = rd.load("panda").with_(lock={"panda_finger_joint1": 0.0})
    _show(report.demo_tables(panda))


def main() -> None:
    """Entry point: run the command; say what went wrong in one line."""
    for stream in (sys.stdout, sys.stderr):  # a terminal without mathematical signs shows ? for them
        stream.reconfigure(errors="replace")  # pyright: ignore[reportAttributeAccessIssue]
    with warnings.catch_warnings():
        warnings.simplefilter("always", ModelWarning)
        warnings.showwarning = _show_warning
        try:
            app()
        except RobotDynError as error:
            print(f"robot-dyn: error: {error}", file=sys.stderr)
            sys.exit(2)
        except BrokenPipeError:  # the reader of a pipe has seen enough
            sys.stderr.close()
            sys.exit(0)


def _show(renderables: Iterable[Any]) -> None:
    from rich.console import Console

    watched = sys.stdout.isatty()
    console = Console(highlight=False, markup=False, emoji=False, width=None if watched else 1000)  # a pipe has no edge
    for each in renderables:
        print(each) if isinstance(each, str) else console.print(each)


def _progress(items: Iterable[str], description: str) -> Iterator[str]:
    """The items, with a bar on stderr while a person watches."""
    from rich.console import Console
    from rich.progress import track

    items = list(items)
    return iter(
        track(items, description, console=Console(stderr=True), transient=True, disable=not sys.stderr.isatty())
    )


@contextmanager
def _bar(duration_s: float) -> Iterator[Callable[[float], object]]:
    """A progress bar on stderr while a person watches; what it gives is called with the time reached."""
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), transient=True, disable=not sys.stderr.isatty()) as progress:
        task = progress.add_task("simulating", total=duration_s)
        yield lambda t: progress.update(task, completed=t)


def _print_json(value: Any) -> None:
    print(json.dumps(value, indent=1, ensure_ascii=False, allow_nan=False))


def _show_warning(message: Any, *_: Any, **__: Any) -> None:
    print(f"robot-dyn: warning: {message}", file=sys.stderr)
