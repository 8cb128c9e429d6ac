"""The typer application: commands by group, and progress bars."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from importlib import import_module
from importlib.metadata import entry_points
from typing import Annotated, Any

import typer
from typer.main import get_command

from robot_dyn.cli.options import with_options
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

GROUPS = "Inspection", "Dynamics", "Simulation", "Verification", "Files"
"""Groups of commands, in the order of --help."""
INSPECTION, DYNAMICS, SIMULATION, VERIFICATION, FILES = GROUPS
_TOPICS = "demo", "query", "show", "diff_runs", "simulate", "cost", "export", "cache"


def command(group: str, name: str | None = None) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Register a function as a command of a group; --help lists it with the first paragraph of its docstring."""

    def register(function: Callable[..., Any]) -> Callable[..., Any]:
        return app.command(name, rich_help_panel=group)(with_options(function))

    return register


def program() -> Any:
    """Return the program with all commands sorted by group.

    In a group, commands of plug-ins follow those of the package; unknown groups come last.
    """
    for topic in _TOPICS:
        import_module(f"robot_dyn.cli.commands.{topic}")
    for entry in entry_points(group="robot_dyn.commands"):  # commands of plug-ins
        entry.load()
    order = {group: k for k, group in enumerate(GROUPS)}
    app.registered_commands.sort(key=lambda subcommand: order.get(str(subcommand.rich_help_panel), len(order)))
    whole = get_command(app)
    context = whole.context_class(whole, **whole.context_settings)
    options = [*whole.get_params(context)]
    for subcommand in whole.commands.values():  # pyright: ignore[reportAttributeAccessIssue]
        options += subcommand.get_params(
            subcommand.context_class(subcommand, parent=context, **subcommand.context_settings)
        )
    for option in options:
        if getattr(option, "is_flag", False):  # a flag takes no value, so --help shows no type
            option.metavar = ""  # pyright: ignore[reportAttributeAccessIssue]
    return whole


def _version(requested: bool) -> None:
    if requested:
        import robot_dyn

        put(f"robot-dyn {robot_dyn.__version__}\n")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", callback=_version, is_eager=True, help="Show the version and exit.")
    ] = False,
) -> None:
    """Dynamics of robot arms from a URDF: M(q) a + C(q, v) v + N(t, q, v) = τ."""


def progress(items: Iterable[str], description: str) -> Iterator[str]:
    """Yield the items; if stderr is a terminal, show a progress bar there with the name of the current item."""
    items = list(items)
    with bar(len(items), description) as advance:
        for done, item in enumerate(items):
            advance(done, f"{description} {escaped(item)}")
            yield item


@contextmanager
def bar(
    total: float | None = None, description: str = "simulating", at_the_end: str = ""
) -> Iterator[Callable[..., object]]:
    """Show a progress bar with the remaining time if stderr is a terminal; otherwise show nothing.

    Yield a function of the amount done so far and, optionally, a description of the current work.

    Args:
        total: Total amount of work; None if unknown: the bar then shows the elapsed time.
        description: Description of the work, unless the function receives another.
        at_the_end: Description of the work that remains after the total is reached.
    """
    from rich.console import Console
    from rich.progress import BarColumn, Progress, ProgressColumn, Task, TextColumn
    from rich.table import Column
    from rich.text import Text

    from robot_dyn.queries.units import format_duration

    class Time(ProgressColumn):
        def render(self, task: Task) -> Text:
            left = None if task.finished else task.time_remaining
            return Text(f"{int(task.elapsed or 0)} s" if left is None else f"{format_duration(left)} left")

    columns = (TextColumn("{task.description}", markup=False), BarColumn(), Time(Column(no_wrap=True)))
    with Progress(*columns, console=Console(stderr=True), transient=True, disable=not sys.stderr.isatty()) as display:
        task = display.add_task(description, total=total)

        def advance(done: float, current: str = description) -> None:
            ended = total is not None and done >= total
            if done < display.tasks[0].completed:  # the work restarts, for example after pilot runs
                display.reset(task)
            display.update(task, completed=done, description=at_the_end if ended and at_the_end else current)

        yield advance
