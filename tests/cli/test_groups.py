"""`robot-dyn --help` lists each command once, in its group, with a line that fits a terminal of 80 columns."""

from __future__ import annotations

import re

import pytest

from robot_dyn.cli.app import app
from robot_dyn.cli.groups import GROUPS
from tests.command import said

LINES = {name: line for lines in GROUPS.values() for name, line in lines.items()}


def commands() -> list[str]:
    said("--help")  # loads them
    return [each.name or each.callback.__name__ for each in app.registered_commands]  # pyright: ignore


def test_every_command_is_in_one_group() -> None:
    assert commands() == [*LINES]
    assert sum(map(len, GROUPS.values())) == len(LINES)


def test_help_has_the_groups_and_a_line_for_each_command() -> None:
    shown = [line.strip("│ \n") for line in said("--help").splitlines()]
    titles = [re.sub(r"[^\w ]", "", line).strip() for line in shown if line.startswith("╭")]
    assert titles == ["Options", *GROUPS]
    width = max(map(len, LINES))
    for name, line in LINES.items():
        assert f"{name:<{width}}  {line}" in shown, name


@pytest.mark.parametrize("name", LINES)
def test_what_takes_no_value_has_no_type_in_help(name: str) -> None:
    text = said(name, "--help")
    assert re.search(r"--help\s+-h\s+Show this", text) and "bool" not in text


def test_a_command_keeps_its_own_help() -> None:
    assert "exit code 1 if it diverges" in re.sub(r"\s+", " ", said("simulate", "--help"))
