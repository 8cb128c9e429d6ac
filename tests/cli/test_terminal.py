"""What comes from files and their names reaches the terminal in one line each, its control characters escaped."""

from __future__ import annotations

import os
import pty
import re
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest

import robot_dyn as rd
from robot_dyn.cli import bar, progress
from robot_dyn.cli.application import program
from robot_dyn.simulation import Outcome, Reason, Remark, RemarkKind
from tests.command import MAIN, run, said

HOSTILE = "a\nrobot-dyn: all is well\x1b[2J\r\u202e"
URDF = (Path(rd.__file__).parent.parent / "urdf" / "planar_2r.urdf").read_text(encoding="utf-8")
SCENE = "duration_s = 0.01\n[start]\nq = 0.3\n"


@pytest.fixture(scope="module")
def swing() -> rd.Trajectory:
    return rd.simulate(rd.load("planar_2r"), [0.4, -0.7], duration_s=0.01, estimate_error=False)


def assert_harmless(text: str) -> None:
    """No control character but the ends of lines, and no line that a file wrote."""
    assert all(line.isprintable() for line in text.split("\n")), repr(text)
    assert not any(line.lstrip().startswith("robot-dyn: all is well") for line in text.split("\n")), text


@pytest.mark.parametrize(
    "command",
    [
        ("info", "{urdf}"),
        ("info", "{urdf}.gone"),
        ("query", "{urdf}"),
        ("compare", "{urdf}"),
        ("check-urdf", "{urdf}", "{urdf}.gone", "--fix", "--force"),
        ("show", "{urdf}", "--html", "{urdf}.html"),
        ("simulate", "{toml}", "-o", "{urdf}.npz", "--csv", "{urdf}.csv", "--force"),
        ("simulate", "{urdf}.toml.gone"),
        ("explain", "{toml}"),
        ("replay", "{npz}", "--html", "{npz}.html"),
        ("plot", "{npz}", "--only", "phase"),
        ("plot", "{urdf}"),
    ],
    ids=" ".join,
)
def test_a_name_of_a_file_is_one_line(command: tuple[str, ...], swing: rd.Trajectory, tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    names = {end: f"{HOSTILE}.{end}" for end in ("urdf", "toml", "npz")}
    Path(names["urdf"]).write_text(URDF, encoding="utf-8")
    text = names["urdf"].replace("\n", "\\n").replace("\x1b", "\\u001b").replace("\r", "\\r")
    Path(names["toml"]).write_text(f'robot = "{text}"\n{SCENE}', encoding="utf-8")
    swing.save(names["npz"])
    done = run(*(word.format(**names) for word in command))
    assert "all is well" in done.stdout + done.stderr or command[0] in ("query", "compare", "simulate")
    assert_harmless(done.stdout)
    assert_harmless(done.stderr)


def test_the_summary_of_a_run_file_has_the_lines_of_a_summary(swing: rd.Trajectory, tmp_path) -> None:
    """Whatever texts are in the file."""
    remark = Remark(RemarkKind.CHATTER, HOSTILE, "u", 0.0, 0.1, 0.0, 1.0, None, {"unit": HOSTILE})
    strange = replace(
        swing, outcome=Outcome(Reason.TERMINAL_EVENT, 0.01, HOSTILE, {"event": HOSTILE}),
        metadata=swing.metadata | {"right_angles": HOSTILE},
        acting=(HOSTILE,), remarks=(remark,), statistics=replace(swing.statistics, method=HOSTILE, engine=HOSTILE),
    )  # fmt: skip
    loaded = rd.read(strange.save(tmp_path / "run.npz"))
    assert_harmless(loaded.summary)
    assert len(loaded.summary.split("\n")) == len(swing.summary.split("\n")) + 2  # right angles and a remark


PENDULUM = """
robot = "pendulum"
duration_s = 40.0
engine = "interpreted"
method = "RK4"
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
    path.write_text(PENDULUM, encoding="utf-8")
    return path


def test_a_run_shows_the_time_left_in_a_terminal(scene: Path) -> None:
    code, seen = watched("simulate", scene)
    assert code == 0
    assert re.search(r"simulating .* left", seen) and "estimating the error" in seen
    assert "finished at t = 40 s" in seen


def test_no_bar_says_that_it_simulates_where_nothing_is_simulated() -> None:
    for command in ("check-urdf", "compare"):
        code, seen = watched(command, "pendulum")
        assert code == 0 and "pendulum" in seen and "simulating" not in seen


def test_a_sweep_that_is_complete_has_no_pace(scene: Path, tmp_path: Path) -> None:
    folder, vary = tmp_path / "out", "mass_scale=uniform(low=0.9, high=1.1)"
    scene.write_text(PENDULUM.replace("40.0", "1.0"), encoding="utf-8")
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
