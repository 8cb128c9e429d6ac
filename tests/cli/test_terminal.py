"""What comes from files and their names reaches the terminal in one line each, its control characters escaped."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

import robot_dyn as rd
from robot_dyn.simulation import Outcome, Reason, Remark, RemarkKind
from tests.command import run

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
        ("check", "{urdf}", "{urdf}.gone", "--fix", "--force"),
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
    rd.save_run(swing, names["npz"])
    done = run(*(word.format(**names) for word in command))
    assert "all is well" in done.stdout + done.stderr or command[0] in ("query", "compare", "simulate")
    assert_harmless(done.stdout)
    assert_harmless(done.stderr)


def test_the_summary_of_a_run_file_has_the_lines_of_a_summary(swing: rd.Trajectory, tmp_path) -> None:
    """Whatever texts are in the file."""
    remark = Remark(RemarkKind.CHATTER, HOSTILE, "u", 0.0, 0.1, 0.0, 1.0, None, {"unit": HOSTILE})
    strange = replace(
        swing, outcome=Outcome(Reason.TERMINAL_EVENT, 0.01, HOSTILE, {"event": HOSTILE}),
        about=swing.about | {"right_angles": HOSTILE},
        acting=(HOSTILE,), remarks=(remark,), statistics=replace(swing.statistics, method=HOSTILE, engine=HOSTILE),
    )  # fmt: skip
    loaded = rd.load_run(rd.save_run(strange, tmp_path / "run.npz"))
    assert_harmless(loaded.summary)
    assert len(loaded.summary.split("\n")) == len(swing.summary.split("\n")) + 2  # right angles and a remark
