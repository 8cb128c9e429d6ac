"""The reference of the command line, read from the commands themselves."""

from __future__ import annotations

import re
from typing import Any

from robot_dyn.cli import GROUPS, program

TAG = re.compile(r"\[/?[a-z][a-z ]*\]")  # of rich
OPTION = re.compile(r"(?<![\w`-])(--?[a-z][a-z-]*)(?![\w`])")


def page(_: str) -> str:
    """A section for each command, in the groups of `robot-dyn --help`."""
    commands: dict[str, Any] = program().commands
    parts = []
    for group in GROUPS:
        parts.append(f"## {group}")
        parts += [_section(name, each) for name, each in commands.items() if each.rich_help_panel == group]
    return "\n\n".join(parts)


def _section(name: str, command: Any) -> str:
    rows = [_row(each) for each in command.params if each.name not in ("help", "json") and not each.hidden]
    table = "\n".join(["| | meaning | default |", "|---|---|---|", *rows]) if rows else ""
    return f"### robot-dyn {name}\n\n{_plain(command.help or '')}\n\n{table}\n"


def _row(parameter: Any) -> str:
    names = parameter.opts + parameter.secondary_opts
    if parameter.param_type_name == "argument":
        names = [parameter.metavar or parameter.name.upper()]
    elif parameter.metavar:
        names = [*names[:-1], f"{names[-1]} {parameter.metavar}"]
    default = parameter.default
    told = "required" if parameter.required else "" if default in (None, False, (), []) else f"`{default}`"
    return f"| {_escaped(', '.join(f'`{each}`' for each in names))} | {_cell(parameter.help or '')} | {told} |"


def _cell(text: str) -> str:
    return _escaped(_plain(" ".join(text.split())))


def _escaped(text: str) -> str:
    """For a cell of a table, where a bar ends it."""
    return text.replace("|", "\\|")


def _plain(text: str) -> str:
    """Help text as Markdown; options, and what is in backticks, are code."""
    parts = OPTION.sub(r"`\1`", TAG.sub("", text)).split("`")
    parts[::2] = [re.sub(r"([*_<\[\]])", r"\\\1", part) for part in parts[::2]]
    return "`".join(parts)
