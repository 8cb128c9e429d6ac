"""Long work says what it does and how long it will take where a person watches; elsewhere nothing."""

from __future__ import annotations

import os
import pty
import re
import sys
from pathlib import Path
from typing import Any

import pytest

from robot_dyn.cli import bar, progress
from robot_dyn.cli.application import program
from tests.command import MAIN, run, said

SCENE = """
robot = "pendulum"
duration_s = 40.0
engine = "interpreted"
method = "rk4"
step_s = 0.05
[start]
q = 0.4
[[effect]]
kind = "gravity"
"""


def watched(*args: str | Path) -> tuple[int, str]:
    """Exit code of a command in a terminal, and all that appeared there, without control sequences."""
    process, terminal = pty.fork()
    if process == 0:
        os.environ.update(TERM="xterm", COLUMNS="120", PYTHONUTF8="1")
        os.execv(sys.executable, [sys.executable, "-c", MAIN, *map(str, args)])
    seen = b""
    try:
        while part := os.read(terminal, 65536):
            seen += part
    except OSError:  # its end
        pass
    os.close(terminal)
    return os.waitstatus_to_exitcode(os.waitpid(process, 0)[1]), re.sub(r"\x1b\[[0-9;?]*[a-zA-Z]", "", seen.decode())


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    path = tmp_path / "scene.toml"
    path.write_text(SCENE, encoding="utf-8")
    return path


def test_a_run_shows_the_time_left_in_a_terminal(scene: Path) -> None:
    code, seen = watched("simulate", scene)
    assert code == 0
    assert re.search(r"simulating .* left", seen) and "estimating the error" in seen
    assert "finished at t = 40 s" in seen


def test_no_bar_says_that_it_simulates_where_nothing_is_simulated() -> None:
    for command in ("check", "compare"):
        code, seen = watched(command, "pendulum")
        assert code == 0 and "pendulum" in seen and "simulating" not in seen


def test_a_sweep_that_is_complete_has_no_pace(scene: Path, tmp_path: Path) -> None:
    folder, vary = tmp_path / "out", "mass_scale=uniform(low=0.9, high=1.1)"
    assert run("sweep", scene, "-o", folder, "--runs", "4", "--vary", vary).returncode == 0
    code, seen = watched("sweep", "run", folder)
    assert code == 0 and "4 of 4 runs" in seen and not re.search(r"[\d.]+ a second", seen)


def test_paragraphs_of_help_are_broken_by_the_terminal_alone() -> None:
    """A line of a docstring that ends where the terminal has room would be broken twice."""
    commands: Any = program()
    for name, command in commands.commands.items():
        assert not any("\n" in each for each in command.help.split("\n\n")), name


def test_a_pipe_gets_the_answer_alone(scene: Path) -> None:
    assert said("simulate", scene).startswith("finished at t = 40 s")
    assert said("compare", "pendulum", "planar_2r", "--json").startswith("{\n")


def test_work_that_begins_again_is_shown_again(capsys: pytest.CaptureFixture[str]) -> None:
    """Pilot runs: the part that is done falls; nothing is written where stderr is no terminal."""
    with bar(2.0, at_the_end="ending") as advance:
        for done in (0.5, 2.0, 0.1, 2.0):
            advance(done)
    assert list(progress(["a", "b"], "looking at")) == ["a", "b"]
    assert capsys.readouterr() == ("", "")
