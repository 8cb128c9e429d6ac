"""`robot-dyn --help` lists each command once, in its group, with a line that fits a terminal of 80 columns."""

from __future__ import annotations

import re
from importlib.metadata import entry_points

import pytest

from robot_dyn.cli import app
from robot_dyn.cli.groups import GROUPS
from tests.command import said

CORE = [name for lines in GROUPS.values() for name in lines]
TOOLS = sorted(command.name for command in entry_points(group="robot_dyn.commands"))


def commands() -> dict[str, tuple[str, str]]:
    """Group and line of each command, in the order of the help."""
    said("--help")  # loads them
    return {
        command.name or command.callback.__name__: (str(command.rich_help_panel), str(command.short_help))  # pyright: ignore
        for command in app.registered_commands
    }


def test_every_command_is_in_one_group() -> None:
    """Those of the core in the order of GROUPS, those of tools behind them in the group that they state."""
    groups = [group for group, _ in commands().values()]
    assert groups == sorted(groups, key=[*GROUPS].index)
    assert [name for name in commands() if name in CORE] == CORE
    assert sorted({*commands()} - {*CORE}) == TOOLS


def test_help_has_the_groups_and_a_line_for_each_command() -> None:
    shown = [line.strip("│ \n") for line in said("--help").splitlines()]
    titles = [re.sub(r"[^\w ]", "", line).strip() for line in shown if line.startswith("╭")]
    assert titles == ["Options", *GROUPS]
    width = max(map(len, commands()))
    for name, (_, line) in commands().items():
        assert f"{name:<{width}}  {line}" in shown, name


@pytest.mark.parametrize("name", [*CORE, *TOOLS])
def test_what_takes_no_value_has_no_type_in_help(name: str) -> None:
    text = said(name, "--help")
    assert re.search(r"--help\s+-h\s+Show this", text) and "bool" not in text


def test_a_command_keeps_its_own_help() -> None:
    assert "exit code 1 if it diverges" in re.sub(r"\s+", " ", said("simulate", "--help"))
