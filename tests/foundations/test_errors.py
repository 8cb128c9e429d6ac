"""Errors and results pass between processes: each survives pickle and copy, and none makes a pool of processes wait."""

from __future__ import annotations

import multiprocessing
import pickle
import pkgutil
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor
from copy import copy, deepcopy
from importlib import import_module
from inspect import Parameter, isclass, isfunction, signature
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

import robot_dyn as rd
from robot_dyn.foundations import SingularError, UndecidedError
from robot_dyn.integrate import METHODS
from robot_dyn.simulation import Outcome, Reason
from tests.wrong_arguments import Example

OPTIONAL = ("peers", "video")  # need packages that may be absent
OF_TYPE = {"bool": True, "str": "joint_1", "float": 0.25, "int": 3, "Any": 0.25, "Scalar": 0.25, "tuple": ("effect", 0)}
OF_TYPE["Outcome"] = Outcome(Reason.STATE_OVERFLOWS, 0.25, "joint_1", {"largest": 1e200})
MASSLESS = (
    '<robot name="a"><link name="b"/><link name="l"/><joint name="j" type="continuous"><parent link="b"/>'
    '<child link="l"/></joint></robot>'
)


def modules() -> Iterator[ModuleType]:
    yield rd
    for module in pkgutil.walk_packages(rd.__path__, "robot_dyn."):
        if not module.name.endswith("__main__"):
            try:
                yield import_module(module.name)
            except ImportError:
                assert any(f".{part}" in module.name for part in OPTIONAL), module.name


ERRORS = sorted(
    {
        thing
        for module in modules()
        for thing in vars(module).values()
        if isclass(thing) and issubclass(thing, BaseException) and thing.__module__.startswith("robot_dyn")
    },
    key=lambda kind: (kind.__module__, kind.__name__),
)


def subclasses(kind: type) -> set[type]:
    return {kind, *(below for each in kind.__subclasses__() for below in subclasses(each))}


def example(kind: type[BaseException]) -> BaseException:
    """An error of a class, with a value for each argument by its type."""
    if not isfunction(kind.__init__):  # it is that of Python
        return kind("arm.urdf: \x1b joint 'a'")
    arguments = []
    for each in list(signature(kind).parameters.values()):
        if each.kind in (Parameter.POSITIONAL_OR_KEYWORD, Parameter.KEYWORD_ONLY):
            arguments.append(OF_TYPE[str(each.annotation).strip("'").partition("[")[0]])
    return kind(*arguments)


def test_every_error_of_the_package_is_looked_at() -> None:
    stated = {kind for kind in subclasses(rd.RobotDynError) if kind.__module__.startswith("robot_dyn")}
    assert stated <= set(ERRORS) and {SingularError, UndecidedError} <= stated


@pytest.mark.parametrize("kind", ERRORS, ids=lambda kind: kind.__name__)
def test_every_error_survives_pickle_and_copy(kind: type[BaseException]) -> None:
    error: Any = example(kind)
    error.row, error.own = (2, 1), {"a": [1.0]}
    error.add_note("in a controller")
    for protocol in range(2, pickle.HIGHEST_PROTOCOL + 1):
        same(pickle.loads(pickle.dumps(error, protocol)), error)
    same(copy(error), error)
    same(deepcopy(error), error)


def same(one: Any, other: Any) -> None:
    assert type(one) is type(other) and one is not other
    assert (str(one), one.args, vars(one)) == (str(other), other.args, vars(other))


def forward_dynamics(urdf: str) -> Any:
    return rd.Robot.from_text(urdf).forward_dynamics([0.0], [0.0], [0.0])


@pytest.mark.filterwarnings("ignore::robot_dyn.foundations.errors.ModelWarning")  # the link has no mass
def test_an_error_in_another_process_arrives_as_it_was_raised() -> None:
    with pytest.raises(SingularError) as here:
        forward_dynamics(MASSLESS)
    with (
        ProcessPoolExecutor(1, mp_context=multiprocessing.get_context("spawn")) as pool,
        pytest.raises(SingularError) as there,
    ):
        pool.submit(forward_dynamics, MASSLESS).result(timeout=120)
    assert (str(there.value), there.value.joint) == (str(here.value), here.value.joint)


NOT_COPIED = ("Event", "Adaptive.steps", "plot", "Stepper", "VectorEnv", "Env")


def test_what_public_callables_return_survives_pickle_and_copy(known: dict[str, Example]) -> None:
    """Except functions of the caller, figures of Matplotlib, balls of Arb, and lanes, which live in machine code."""
    for name, (function, arguments) in known.items():
        value = function(**arguments)
        if hasattr(value, "close"):
            value.close()
        if not type(value).__module__.startswith("robot_dyn") or name in NOT_COPIED:
            continue
        for other in (pickle.loads(pickle.dumps(value)), copy(value), deepcopy(value)):
            assert type(other) is type(value), name
            if hasattr(value, "to_json"):
                assert other.to_json() == value.to_json(), name


@pytest.mark.parametrize("name", sorted(METHODS))
def test_methods_of_integration_survive_pickle(name: str) -> None:
    method = rd.integrate.method(name)
    for other in (pickle.loads(pickle.dumps(method)), copy(method), deepcopy(method)):
        assert type(other) is type(method) and other.name == method.name


@pytest.mark.parametrize("make", [rd.replay, rd.show], ids=["replay", "show"])
def test_pages_survive_pickle(make: Any, tmp_path: Path) -> None:
    arm = rd.load("pendulum")
    page = make(rd.simulate(arm, q0=[0.1], duration_s=0.01) if make is rd.replay else arm)
    for other in (pickle.loads(pickle.dumps(page)), copy(page), deepcopy(page)):
        assert other.text == page.text
