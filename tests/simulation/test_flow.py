"""The flow of one call: the rooms of a run are entered in one order, and none calls back into a room above it."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from types import FrameType
from typing import Any, NamedTuple

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn import simulation

FOLDER = f"{Path(simulation.__file__).parent}/"
COLUMN = ("rollouts", "simulate.py", "derived.py", "estimate", "diagnostics", "results", "columns.py")
COLUMN += ("compiled", "run", "engine", "events", "observation", "setup", "dynamics")
"""Rooms of a run, from above to below; see the contract in pyproject.toml."""


class Entry(NamedTuple):
    """A call of a function of one room by another: the functions between, of other folders, are left out."""

    caller: str
    room: str
    function: str

    @property
    def climbs(self) -> bool:
        """True if the room is above its caller."""
        return self.caller in COLUMN and COLUMN.index(self.room) < COLUMN.index(self.caller)


def entries(call: Callable[[], object]) -> list[Entry]:
    """The entries of rooms during a call, in order."""
    stack: list[tuple[str, FrameType]] = []
    result: list[Entry] = []

    def profile(frame: FrameType, event: str, _: Any) -> None:
        path = frame.f_code.co_filename
        if not path.startswith(FOLDER):
            return
        if event == "call":
            room, caller = path[len(FOLDER) :].split("/")[0], stack[-1][0] if stack else ""
            if room != caller:
                result.append(Entry(caller, room, frame.f_code.co_qualname))
            stack.append((room, frame))
        elif event == "return" and stack and stack[-1][1] is frame:
            stack.pop()

    sys.setprofile(profile)
    try:
        call()
    finally:
        sys.setprofile(None)
    return result


ARM, Q = rd.load("ur5"), np.array([0.3, -1.1, 0.9, -0.6, 1.2, 0.4])
CONTROLLER = rd.control.PD(rd.control.quintic(Q, Q + 0.4, 1.0), kp=100.0, kd=10.0)
STAGES = ("setup", "engine", "observation", "run", "diagnostics", "estimate")


def plant() -> rd.Plant:
    """A new plant, with which nothing is cached."""
    return rd.Plant(ARM, [rd.effects.ViscousFriction(2.0), rd.effects.EffortLimit("urdf")])


@pytest.mark.parametrize("engine", ["interpreted", "compiled"])
@pytest.mark.parametrize("method", ["auto", "RK4"])
def test_simulate_enters_its_stages_in_one_order(engine: str, method: str) -> None:
    """A setup, its engine, its observer, the run, a verdict on its speeds, the error estimate; then values are read."""
    options: dict[str, Any] = {"duration_s": 0.02, "controller": CONTROLLER, "engine": engine, "method": method}
    rd.simulate(plant(), Q, **options)
    seen = entries(lambda: rd.simulate(plant(), Q, **options))
    called = [each for each in seen if each.caller == "simulate.py" and each.room in STAGES]
    assert tuple(dict.fromkeys(each.room for each in called)) == STAGES
    values = {"Outcome.ending", "Observer.end", "Observer.fastest", "Interpreted.label", "Interpreted.compiling_s"}
    stages = [STAGES.index(each.room) for each in called if each.function not in values]
    assert stages == sorted(stages)


PROTOCOL = ("MachineCode.", "Interpreted.", "choose", "interpreted.<locals>.", "in_modes.<locals>.", "Watch.")


@pytest.mark.parametrize("engine", ["interpreted", "compiled"])
@pytest.mark.parametrize("method", ["auto", "RK4"])
def test_no_room_of_a_run_calls_back_into_one_above_it(engine: str, method: str) -> None:
    """Except an engine, which is called by its protocol, and the monitor to which its functions report."""
    options: dict[str, Any] = {"duration_s": 0.02, "controller": CONTROLLER, "engine": engine, "method": method}
    climbing = [each for each in entries(lambda: rd.simulate(plant(), Q, **options)) if each.climbs]
    assert [each for each in climbing if not each.function.startswith(PROTOCOL)] == []
    assert {each.room for each in climbing} <= {"compiled", "engine", "run"}


def test_only_the_error_estimate_enters_the_room_of_runs_again() -> None:
    """Each companion is one call of its maker."""
    run: list[rd.Trajectory] = []
    seen = entries(lambda: run.append(rd.simulate(plant(), Q, duration_s=0.02, controller=CONTROLLER)))
    again = [each.function for each in seen if each.room == "run" and each.caller not in ("simulate.py", "engine")]
    assert again == ["Runner.run"] * run[0].statistics.companion_runs != []


def test_rollouts_in_lock_step_call_back_into_no_room_above() -> None:
    options: dict[str, Any] = {"duration_s": 0.02, "controller": CONTROLLER, "method": "RK4"}
    rd.rollouts(plant(), [Q, Q + 0.1], **options)
    seen = entries(lambda: rd.rollouts(plant(), [Q, Q + 0.1], **options))
    assert [each for each in seen if each.climbs] == []
    first = dict.fromkeys(each.room for each in seen if each.caller == "rollouts")
    stages = ("setup", "compiled", "observation", "run", "results")
    assert tuple(room for room in first if room in stages) == stages
