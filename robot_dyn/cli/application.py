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
LOOK, ASK, RUN, TRUST, FILES = GROUPS
_TOPICS = "demo", "query", "show", "diff_runs", "simulate", "cost", "export", "cache"


def command(group: str, name: str | None = None) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Register a function as a command of a group; --help lists it with the first paragraph of its docstring."""

    def register(function: Callable[..., Any]) -> Callable[..., Any]:
        return app.command(name, rich_help_panel=group)(with_options(function))

    return register


def program() -> Any:
    """Return the program: all commands by group, those of tools after those of the core, unknown groups last."""
    for topic in _TOPICS:
        import_module(f"robot_dyn.cli.commands.{topic}")
    for entry in entry_points(group="robot_dyn.commands"):  # of tools
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
        if getattr(option, "is_flag", False):  # takes no value: --help has no type for it
            option.metavar = ""  # pyright: ignore[reportAttributeAccessIssue]
    return whole


def _version(asked: bool) -> None:
    if asked:
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
    """Yield the items, with a progress bar on stderr if it is a terminal, that names the item being worked on."""
    items = list(items)
    with bar(len(items), description) as advance:
        for done, item in enumerate(items):
            advance(done, f"{description} {escaped(item)}")
            yield item


@contextmanager
def bar(total: float | None = None, what: str = "simulating", at_the_end: str = "") -> Iterator[Callable[..., object]]:
    """A progress bar with the time left on stderr if it is a terminal; nothing elsewhere.

    It yields a function that takes the finished part of the total and the name of the current work.

    Args:
        total: All that is to be done; None if that is not known: the bar then has the time spent.
        what: Name of the work, unless that function receives another.
        at_the_end: Name of the work that remains once the total is reached.
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
    with Progress(*columns, console=Console(stderr=True), transient=True, disable=not sys.stderr.isatty()) as shown:
        task = shown.add_task(what, total=total)

        def advance(done: float, now: str = what) -> None:
            ended = total is not None and done >= total
            if done < shown.tasks[0].completed:  # it is done again, as pilot runs are
                shown.reset(task)
            shown.update(task, completed=done, description=at_the_end if ended and at_the_end else now)

        yield advance
