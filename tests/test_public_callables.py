"""Every public callable refuses every wrong kind of argument with an error of the library, soon, without a warning."""

from __future__ import annotations

import warnings
from inspect import signature
from typing import Any

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn import RobotDynError
from robot_dyn.foundations import RobotDynWarning, shown
from tests.campaigns.fuzz.campaign import HangError, limited
from tests.long import stress
from tests.wrong_arguments import EXTREME, LAX, LONG, NOT_TEXT, Example, public, wrong

LIMIT_S = 20  # of one call; the machine may be busy
MEASURE = {
    "advise",
    "budget",
    "certify",
    "check_urdf",
    "compare",
    "cost",
    "excite",
    "fastest",
    "from_scene",
    "max_payload",
    "path",
    "prove",
    "work_precision",
}  # seconds


@pytest.mark.parametrize("name", sorted(public()))
def test_wrong_arguments_are_refused(known: dict[str, Example], name: str) -> None:
    assert name in known, f"give a valid call of {name} in tests/wrong_arguments.py"
    function, arguments = known[name]
    answer = function(**arguments)
    if hasattr(answer, "close"):
        answer.close()
    bad = []
    for argument, value in arguments.items():
        for each in wrong(name, function, argument, value):
            result = _outcome(function, arguments | {argument: each})
            allowed = argument in LAX.get(name, ()) and (
                each.__class__ in (float, np.ndarray, dict) or shown(each) == "-1" or "nan" in shown(each)
            )
            if result and not (result == "accepted" and allowed):
                bad.append(f"{argument}={shown(each)}: {result}")
    assert not bad, "\n".join(bad)


@pytest.mark.parametrize("name", [*sorted({*public()} - MEASURE), *stress(sorted(MEASURE))])
def test_extreme_arguments_are_answered_or_refused(known: dict[str, Example], name: str) -> None:
    """Arrays without axes, scalars of NumPy, None, denormal and huge numbers, NUL in paths."""
    function, arguments = known[name]
    bad = []
    for argument in arguments.keys() - LONG.get(name, set()):
        for each in EXTREME:
            result = _outcome(function, arguments | {argument: each})
            if result not in ("", "accepted"):
                bad.append(f"{argument}={shown(each)}: {result}")
    assert not bad, "\n".join(bad)


def _outcome(function: Any, arguments: dict[str, Any]) -> str:
    """What is wrong with an answer; empty for a refusal in one line."""
    try:
        with limited(LIMIT_S), warnings.catch_warnings():
            warnings.simplefilter("error")
            warnings.simplefilter("ignore", RobotDynWarning)
            answer = function(**arguments)
    except RobotDynError as error:
        return "" if str(error).isprintable() and len(str(error)) < 1000 else f"an unreadable message: {error}"
    except HangError:
        return "took too long"
    except Exception as error:
        return f"foreign: {type(error).__name__}: {error}"
    if hasattr(answer, "close"):
        answer.close()
    return "accepted"


@pytest.mark.parametrize("name", [name for name in sorted(public()) if name.startswith(("Robot.", "Lagrangian."))])
def test_what_to_do_with_states_without_an_answer_is_one_of_two(known: dict[str, Example], name: str) -> None:
    function, arguments = known[name]
    if "errors" not in signature(function).parameters:
        return
    batch = {key: np.tile(x, (2, 1)) if isinstance(x, np.ndarray) else x for key, x in arguments.items()}
    for each in NOT_TEXT:
        assert not _outcome(function, batch | {"errors": each}), shown(each)


def test_every_example_is_of_a_public_callable(known: dict[str, Example]) -> None:
    """Else it would be of a name that was removed."""
    assert known.keys() == set(public())


def test_values_compare_and_hash(known: dict[str, Example]) -> None:
    for name, (function, arguments) in known.items():
        for value in (function(**arguments) if name[0].isupper() and "." not in name else None, *arguments.values()):
            if type(value).__module__.startswith("robot_dyn"):
                hash(value)
                assert value == value and (value == object()) is False, name


def test_equal_runs_and_setups_do_not_raise() -> None:
    robot = rd.load("cart_pole")
    setups = [rd.Setup(rd.Plant(robot), [0.1, 0.2], duration_s=0.01, method="RK4") for _ in range(2)]
    runs = [rd.simulate(setup) for setup in setups]
    assert setups[0] != setups[1] and runs[0] != runs[1] and runs[0] == runs[0]
    assert len({*setups, *runs, runs[0].ledger, runs[0].error}) == 6


@pytest.mark.parametrize(
    "call",
    [
        lambda robot, run: rd.simulate(robot, duration=1),
        lambda robot, run: rd.simulate(robot, duration_s=1.0),
        lambda robot, run: rd.simulate("ur5"),
        lambda robot, run: rd.linearise("ur5", [0.0]),
        lambda robot, run: run.save("run.xlsx"),
        lambda robot, run: rd.plot(run, run),
        lambda robot, run: rd.Robot(robot.model),
        lambda robot, run: rd.Setup(rd.Plant(robot), [0.1, 0.2], record_every_s=1e-320),
        lambda robot, run: rd.compare(robot, seed=-1),
        lambda robot, run: rd.accuracy.Ball(0),
        lambda robot, run: rd.effects.JointStopSpring([0.0, 0.0], [1.0, 1.0, 1.0], 1.0),
        lambda robot, run: rd.control.circle([0, 0, 0], 1.0, [0, 0, 1], 1.0, turns=1e300),
    ],
)
def test_mistakes_of_a_first_hour_are_told(call: Any) -> None:
    robot = rd.load("cart_pole")
    with pytest.raises(RobotDynError):
        call(robot, rd.simulate(robot, q0=[0.1, 0.2], duration_s=0.01))
