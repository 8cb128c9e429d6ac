"""The typer application, the options that commands share, and progress bars."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from typing import Annotated

import typer

from robot_dyn.cli import completion
from robot_dyn.cli.terminal import put
from robot_dyn.foundations.errors import escaped

app = typer.Typer(
    name="robot-dyn",
    help="Dynamics of robot arms from a URDF: M(q) a + C(q, v) v + N(t, q, v) = τ.",
    no_args_is_help=True,
    add_completion=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)

Name = Annotated[
    str,
    typer.Argument(
        metavar="ROBOT",
        help="A name of `robot-dyn list`, or the path of a URDF or MJCF file.",
        autocompletion=completion.robots,
    ),
]
PackageDir = Annotated[
    list[str] | None, typer.Option(help="Folder in which ROS packages are searched; may be repeated.")
]
Xacro = Annotated[
    list[str] | None,
    typer.Option(
        metavar="NAME=VALUE",
        help="Expand a xacro file, which runs its expressions; may be repeated; '' for no argument.",
    ),
]
Plot = Annotated[
    str | None, typer.Option("-o", "--output", metavar="PLOT.png", help="Draw it, as a .png, .svg or .pdf.")
]
Csv = Annotated[str | None, typer.Option("--csv", metavar="TABLE.csv", help="Write its rows as a table.")]
Dark = Annotated[bool, typer.Option("--dark", help="Draw for dark screens.")]
Budget = Annotated[float, typer.Option(metavar="SECONDS", help="Time to spend, compiling not counted.")]
Repeats = Annotated[int, typer.Option(min=1, help="How often each is timed at most, while the budget lasts.")]
Scene = Annotated[str, typer.Argument(metavar="SCENE.toml", help="A scene file; `robot-dyn scene` prints some.")]
Force = Annotated[bool, typer.Option("--force", help="Replace files that are there already.")]
Json = Annotated[bool, typer.Option("--json", help="Print JSON, as documented in docs/reference/json.md.")]


def _version(asked: bool) -> None:
    if asked:
        import robot_dyn

        put(f"robot-dyn {robot_dyn.__version__}\n")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version, and end.")
    ] = False,
) -> None:
    """Dynamics of robot arms from a URDF: M(q) a + C(q, v) v + N(t, q, v) = τ."""


def progress(items: Iterable[str], description: str) -> Iterator[str]:
    """Yield the items, with a progress bar on stderr if it is a terminal, that names the item being worked on."""
    items = list(items)
    with bar(len(items)) as advance:
        for done, item in enumerate(items):
            advance(done, f"{description} {escaped(item)}")
            yield item


@contextmanager
def bar(total: float | None = None, what: str = "simulating", at_the_end: str = "") -> Iterator[Callable[..., object]]:
    """A progress bar with the time left on stderr if it is a terminal; nothing elsewhere.

    It gives a function of the part of the total that is done, and of the name of what is being done.

    Args:
        total: All that is to be done; None if that is not known: the bar then has the time spent.
        what: What is being done, unless that function is told.
        at_the_end: What is still being done once the total is reached.
    """
    from rich.console import Console
    from rich.progress import BarColumn, Progress, ProgressColumn, Task, TextColumn
    from rich.text import Text

    from robot_dyn.queries.units import format_duration

    class Time(ProgressColumn):
        def render(self, task: Task) -> Text:
            left = None if task.finished else task.time_remaining
            return Text(f"{int(task.elapsed or 0)} s" if left is None else f"{format_duration(left)} left")

    columns = (TextColumn("{task.description}", markup=False), BarColumn(), Time())
    with Progress(*columns, console=Console(stderr=True), transient=True, disable=not sys.stderr.isatty()) as shown:
        task = shown.add_task(what, total=total)

        def advance(done: float, now: str = what) -> None:
            ended = total is not None and done >= total
            if done < shown.tasks[0].completed:  # it is done again, as pilot runs are
                shown.reset(task)
            shown.update(task, completed=done, description=at_the_end if ended and at_the_end else now)

        yield advance
