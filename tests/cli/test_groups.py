"""`robot-dyn --help` lists each command once, in its group, with a line that fits a terminal of 80 columns."""

from __future__ import annotations

import json
import re
from importlib.metadata import entry_points

import pytest

from robot_dyn.cli import GROUPS, program
from robot_dyn.cli.application import app
from tests.command import said, spawn

TOOLS = sorted(command.name for command in entry_points(group="robot_dyn.commands"))


def commands() -> dict[str, tuple[str, str]]:
    """Group and line of each command, in the order of the help."""
    return {
        name: (command.rich_help_panel, (command.short_help or command.help).partition("\n")[0])
        for name, command in program().commands.items()
    }


def test_every_command_is_in_one_group() -> None:
    """Groups follow each other; commands of tools come after those of the core."""
    groups = [group for group, _ in commands().values()]
    assert groups == sorted(groups, key=GROUPS.index)
    for group in GROUPS:
        of_tools = [name in TOOLS for name, (its, _) in commands().items() if its == group]
        assert of_tools == sorted(of_tools) and not all(of_tools)
    assert {*TOOLS} < {*commands()}


def test_help_has_the_groups_and_a_line_for_each_command() -> None:
    shown = [line.strip("│ \n") for line in said("--help").splitlines()]
    titles = [re.sub(r"[^\w ]", "", line).strip() for line in shown if line.startswith("╭")]
    assert titles == ["Options", *GROUPS]
    width = max(map(len, commands()))
    for name, (_, line) in commands().items():
        assert f"{name:<{width}}  {line}" in shown, name


@pytest.mark.parametrize("name", commands())
def test_what_takes_no_value_has_no_type_in_help(name: str) -> None:
    text = said(name, "--help")
    assert re.search(r"--help\s+-h\s+Show this", text) and "bool" not in text


@pytest.mark.parametrize("name", commands())
def test_every_argument_and_option_is_described(name: str) -> None:
    """By its docstring, which names no other."""
    command = program().commands[name]
    assert [option.name for option in command.params if not option.help] == []
    assert "Options:" not in command.help


NAMES = """import json
from robot_dyn.cli import program
commands = program().commands.items()
print(json.dumps({name: [[each.opts, each.secondary_opts] for each in command.params] for name, command in commands}))
"""


def test_options_have_their_names_without_docstrings() -> None:
    """Python -OO drops them."""
    assert json.loads(spawn(code=NAMES, PYTHONOPTIMIZE="2").stdout) == json.loads(spawn(code=NAMES).stdout)


def test_a_command_keeps_its_own_help() -> None:
    assert "exit code is 1 if it diverges" in re.sub(r"\s+", " ", said("simulate", "--help"))


def test_commands_without_a_known_group_come_last(monkeypatch: pytest.MonkeyPatch) -> None:
    """A plug-in may name a group of its own, or none."""
    monkeypatch.setattr(app, "registered_commands", [*app.registered_commands])
    app.command("of-no-group")(lambda: None)
    app.command("of-another", rich_help_panel="Others")(lambda: None)
    assert [*program().commands][-2:] == ["of-no-group", "of-another"]


def test_the_help_of_check_names_what_needs_fix() -> None:
    assert re.search(r"--allow-overlap and --units need --fix", re.sub(r"[\s│]+", " ", said("check", "--help")))
