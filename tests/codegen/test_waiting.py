"""Long waits are logged, to "robot_dyn" at INFO; the command line prints them, and a script does not."""

from __future__ import annotations

import logging
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, ClassVar

import pytest

import robot_dyn as rd
from robot_dyn.codegen import INSTEAD, MachineFunction
from robot_dyn.foundations import waiting
from robot_dyn.foundations.waiting import log_if_slow
from robot_dyn.simulation import choose
from tests.command import MAIN, spawn


class Clock:
    """A timer that ends when a test says so: the clocks that were started, and whether each was cancelled."""

    started: ClassVar[list[Clock]] = []

    def __init__(self, after: float, function: Callable[..., object], args: tuple[Any, ...]) -> None:
        self.after, self.ring, self.cancelled = after, lambda: function(*args), False

    def start(self) -> None:
        Clock.started.append(self)

    def cancel(self) -> None:
        self.cancelled = True


@pytest.fixture
def clocks(monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture) -> list[Clock]:
    Clock.started = []
    caplog.set_level(logging.INFO, "robot_dyn")
    monkeypatch.setattr(waiting, "Timer", Clock)
    return Clock.started


def ring(clocks: list[Clock], caplog: pytest.LogCaptureFixture) -> list[str]:
    """What is logged once all clocks have rung."""
    for clock in clocks:
        assert 0.0 < clock.after <= 2.0
        clock.ring()
    assert {(each.name, each.levelno) for each in caplog.records} == {("robot_dyn", logging.INFO)}
    return [each.getMessage() for each in caplog.records]


def test_a_wait_is_logged_while_it_lasts(monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO, "robot_dyn")
    monkeypatch.setattr(waiting, "PATIENCE_S", 1e-3)
    with log_if_slow("thinking 100 %"):
        for _ in range(1000):
            if caplog.records:
                break
            time.sleep(0.01)
    assert [each.getMessage() for each in caplog.records] == ["thinking 100 %"]


def test_nothing_is_logged_after_the_end_of_a_wait(clocks: list[Clock]) -> None:
    with log_if_slow("thinking"):
        assert not clocks[0].cancelled
    with pytest.raises(ZeroDivisionError), log_if_slow("thinking"):
        print(1 / 0)
    assert [each.cancelled for each in clocks] == [True, True]


def test_no_timer_runs_where_the_log_is_off(clocks: list[Clock], caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.WARNING, "robot_dyn")
    with log_if_slow("thinking"):
        assert not clocks


SLOW = """import time
from robot_dyn.foundations import waiting
from robot_dyn.codegen.loops.call import MachineFunction
waiting.PATIENCE_S, compiled = 0.01, MachineFunction._compiled
MachineFunction._compiled = lambda *args: (time.sleep(0.5), compiled(*args))[1]
"""
RUN = "import robot_dyn as rd; rd.simulate(rd.load('planar_2r'), [0.4, -0.7], duration_s=0.1, engine='compiled')"
SCENE = 'robot = "planar_2r"\nduration_s = 0.1\nengine = "compiled"\n[start]\nq = 0.3\n'


def test_a_script_that_does_not_configure_logging_prints_nothing() -> None:
    done = subprocess.run([sys.executable, "-c", SLOW + RUN], capture_output=True, text=True, timeout=60, check=True)
    assert (done.stdout, done.stderr) == ("", "")
    configured = "import logging\nlogging.basicConfig(level=logging.INFO)\n" + SLOW + RUN
    done = subprocess.run([sys.executable, "-c", configured], capture_output=True, text=True, timeout=60, check=True)
    assert "INFO:robot_dyn:compiling the time loop of" in done.stderr


def test_the_command_line_prints_waits_to_stderr(tmp_path: Path) -> None:
    (tmp_path / "scene.toml").write_text(SCENE)
    done = spawn("simulate", tmp_path / "scene.toml", code=SLOW + MAIN)
    lines = done.stderr.decode().splitlines()
    assert done.returncode == 0, lines
    assert [line for line in lines if line.startswith("robot-dyn: compiling the time loop of")]


def doubled(x: float) -> float:
    return x + x


def test_machine_code_of_a_run_and_of_a_loop_is_logged_and_what_is_there_is_not(
    clocks: list[Clock], caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A run that is worth compiling, asked for twice; and any function."""
    monkeypatch.setenv("ROBOT_DYN_CACHE", "off")
    setup = rd.Setup(rd.Plant(rd.load("planar_2r").with_(mass_scale=1.013)), [0.4, -0.7], duration_s=3600.0)
    for _ in range(2):
        assert choose(setup).label == "compiled"
    loop = MachineFunction(doubled, INSTEAD, lambda: None, "a function")
    for _ in range(2):
        assert loop.calls()(2.0) == 4.0
    assert ring(clocks, caplog) == [
        "compiling the equations of this run (cached for runs of the same structure)",
        "compiling a function (cached for this version)",
    ]


def test_machine_code_of_a_robot_and_of_a_batch_is_logged(
    clocks: list[Clock], caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("ROBOT_DYN_CACHE", "off")
    robot = rd.load("planar_2r").with_(mass_scale=1.017)
    rd.compiled(robot).M([0.4, -0.7])
    assert ring(clocks, caplog) == [
        "tracing M of planar_2r",
        "compiling M of planar_2r, once for these equations",
    ]
    clocks.clear()
    rd.rollouts(robot, [[0.4, -0.7], [0.1, 0.2]], duration_s=0.01, method="RK4", step_s=1e-3)
    assert "compiling the equations of this run (cached for runs of the same structure)" in ring(clocks, caplog)
