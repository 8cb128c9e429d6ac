"""The commands as `robot-dyn --help` lists them: groups by what a user wants, a line each.

Commands of tools state their group and their line themselves, and stand behind those of the core.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import typer

GROUPS: Mapping[str, Mapping[str, str]] = {
    "Look at a robot or a run": {
        "demo": "Load, compare, simulate, replay and plot a real arm.",
        "list": "List the robots that can be named.",
        "info": "Show a robot: joints, limits, friction, mass, findings.",
        "show": "Show a robot in the browser, or as one HTML file.",
        "replay": "Replay runs in the browser, or as one HTML file.",
        "diff": "Compare two runs: when they part, what differs.",
        "plot": "Draw a run: joints, torques, energy, tracking, phase, error.",
    },
    "Ask for its dynamics": {
        "query": "Ask for M, C, N, torques and accelerations at a state.",
        "explain": "Say what a scene integrates, and where numbers came from.",
        "sweepable": "List the parameters that runs of a scene can sweep.",
        "cost": "Count and time what effects, control and terms cost.",
    },
    "Run it": {
        "simulate": "Run a scene.",
        "advise": "Say whether step and control period are short enough.",
    },
    "Trust it": {
        "compare": "Compare Pinocchio with the library's own Lagrangian.",
        "certify": "Count the digits of M, C, N and dynamics that are true.",
        "accuracy": "Show what each digit of a motion costs in time.",
    },
    "Files": {
        "export": "Write a run as CSV, Parquet, netCDF or a log of ROS 2.",
        "scene": "Print a scene file to start from.",
        "cache": "List or remove the compiled kernels that are kept on disk.",
    },
}


def group(app: typer.Typer) -> None:
    """Give each command of the core its group and its line, and sort all commands by their group."""
    listed = [(title, name, line) for title, lines in GROUPS.items() for name, line in lines.items()]
    place = {name: number for number, (_, name, _) in enumerate(listed)}
    for command in app.registered_commands:
        if (at := place.get(_name(command))) is not None:
            command.rich_help_panel, _, command.short_help = listed[at]
    titles = {title: number for number, title in enumerate(GROUPS)}
    app.registered_commands.sort(
        key=lambda command: (titles.get(str(command.rich_help_panel), -1), place.get(_name(command), len(listed)))
    )


def without_types_of_flags(command: Any) -> Any:
    """The program of an application in whose help flags, which take no value, have no type beside their names."""
    whole = command.context_class(command, **command.context_settings)
    options = [*command.get_params(whole)]
    for each in command.commands.values():
        options += each.get_params(each.context_class(each, parent=whole, **each.context_settings))
    for option in (option for option in options if getattr(option, "is_flag", False)):
        option.metavar = ""
    return command


def _name(command: typer.models.CommandInfo) -> str:
    return command.name or command.callback.__name__  # pyright: ignore[reportOptionalMemberAccess]
