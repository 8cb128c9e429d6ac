"""Nothing is compiled for long without a word to who watches."""

from __future__ import annotations

import io
import sys
from collections.abc import Callable
from threading import Event
from typing import ClassVar

import pytest

import robot_dyn as rd
from robot_dyn.codegen import INSTEAD, MachineFunction, waiting
from robot_dyn.codegen.waiting import announced
from robot_dyn.simulation.engine.choice import choose


class Screen(io.StringIO):
    """A terminal, or a file."""

    def __init__(self, watched: bool) -> None:
        super().__init__()
        self.watched, self.said = watched, Event()

    def isatty(self) -> bool:
        return self.watched

    def flush(self) -> None:
        self.said.set()


@pytest.mark.parametrize("watched", [True, False])
def test_a_wait_is_told_where_a_person_watches(watched: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    screen = Screen(watched)
    monkeypatch.setattr(sys, "stderr", screen)
    monkeypatch.setattr(waiting, "_IN_TERMINAL_S", 0.0)
    with announced("thinking"):
        assert screen.said.wait(30.0 if watched else 0.05) is watched
    assert screen.getvalue() == "robot_dyn: thinking\n" * watched


class Clock:
    """In place of a timer: what is started, and whether it was cancelled."""

    started: ClassVar[list[Clock]] = []

    def __init__(self, after: float, say: Callable[[], object]) -> None:
        self.say, self.cancelled = say, False

    def start(self) -> None:
        Clock.started.append(self)

    def cancel(self) -> None:
        self.cancelled = True


@pytest.fixture
def clocks(monkeypatch: pytest.MonkeyPatch) -> list[Clock]:
    Clock.started = []
    monkeypatch.setattr(waiting, "Timer", Clock)
    monkeypatch.setattr(waiting, "_patience_s", lambda: 1.0)
    return Clock.started


def test_nothing_is_told_after_the_end_of_what_is_done(clocks: list[Clock]) -> None:
    with announced("thinking"):
        assert not clocks[0].cancelled
    with pytest.raises(ZeroDivisionError), announced("thinking"):
        print(1 / 0)
    assert [each.cancelled for each in clocks] == [True, True]


def doubled(x: float) -> float:
    return x + x


def test_machine_code_of_a_run_and_of_a_loop_is_told_and_what_is_there_is_not(
    clocks: list[Clock], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    """A run that is worth compiling, asked for twice; and any function."""
    monkeypatch.setenv("ROBOT_DYN_CACHE", "off")
    setup = rd.Setup(rd.Plant(rd.load("planar_2r").with_(mass_scale=1.013)), [0.4, -0.7], duration_s=3600.0)
    for _ in range(2):
        assert choose(setup).label == "compiled"
    loop = MachineFunction(doubled, INSTEAD, lambda: None, "a function")
    for _ in range(2):
        assert loop.calls()(2.0) == 4.0
    for clock in clocks:
        clock.say()
    assert capsys.readouterr().err.splitlines() == [
        "robot_dyn: compiling the equations of this run, once for its structure",
        "robot_dyn: compiling a function, once for this version",
    ]


def test_machine_code_of_a_robot_and_of_a_batch_is_told(
    clocks: list[Clock], capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("ROBOT_DYN_CACHE", "off")
    robot = rd.load("planar_2r").with_(mass_scale=1.017)
    rd.Compiled(robot).M([0.4, -0.7])
    for clock in clocks:
        clock.say()
    assert capsys.readouterr().err.splitlines() == [
        "robot_dyn: tracing M of planar_2r",
        "robot_dyn: compiling M of planar_2r, once for these equations",
    ]
    clocks.clear()
    rd.rollouts(robot, [[0.4, -0.7], [0.1, 0.2]], duration_s=0.01, integrator="rk4", step_s=1e-3)
    for clock in clocks:
        clock.say()
    assert "robot_dyn: compiling the equations of this run, once for its structure" in capsys.readouterr().err


def test_a_notebook_waits_longer_for_a_line_than_a_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is printed in a notebook is kept with it; a pipe and a missing stderr get nothing."""
    for screen, ipython, after in ((True, False, 1.0), (False, True, 2.0), (False, False, None), (None, True, None)):
        monkeypatch.setattr(sys, "stderr", None if screen is None else Screen(screen))
        with monkeypatch.context() as modules:
            modules.delitem(sys.modules, "ipykernel", raising=False)
            if ipython:
                modules.setitem(sys.modules, "ipykernel", sys)
            assert waiting._patience_s() == after
