"""What a robot takes: real numbers in any form; anything else is refused by name."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from numpy.testing import assert_array_equal

import robot_dyn as rd
from robot_dyn.foundations import QueryError
from tests.long import long
from tests.queries import ARGUMENTS, FRAMED, arguments_of, ask, assert_close

every_robot = pytest.mark.parametrize("name", ["pendulum", "panda", *long(["ur5", "skew_tree"])])  # one joint; coupled
every_method = pytest.mark.parametrize("method", ARGUMENTS)


# --- forms of numbers


def forms(x: np.ndarray) -> dict[str, Any]:
    """The same numbers in other clothes; x holds float32 values."""
    strided, frozen = np.repeat(x, 2), x.copy()
    frozen.setflags(write=False)
    unaligned = np.zeros(x.nbytes + 1, np.uint8)[1:].view(np.float64)
    unaligned[:] = x
    return {
        "list": x.tolist(),
        "tuple": tuple(x),
        "float32": x.astype(np.float32),
        "longdouble": x.astype(np.longdouble),
        "big-endian": x.astype(">f8"),
        "strided": strided[::2],
        "reversed": x[::-1].copy()[::-1],
        "column": np.asfortranarray(np.stack([x, x + 1]))[0],
        "read-only": frozen,
        "unaligned": unaligned,
        "subclass": x.view(type("Sub", (np.ndarray,), {})),
    }


@every_method
@every_robot
def test_form_of_the_numbers_does_not_matter(name: str, method: str):
    robot = rd.load(name)
    arguments = [np.float64(np.float32(x)) for x in arguments_of(method, robot.n, 6)]
    expected = ask(robot, method, *arguments)
    for form in forms(arguments[0]):
        answer = ask(robot, method, *(forms(x)[form] for x in arguments))
        assert type(answer) is type(expected) and np.asarray(answer).dtype == np.float64, form
        assert_close(answer, expected, form)
    whole = [np.arange(1, robot.n + 1) + i for i in range(len(arguments))]
    expected = ask(robot, method, *(x.astype(float) for x in whole))
    for kind in ("int64", "int8", "uint16", ">i4"):
        assert_close(ask(robot, method, *(x.astype(kind) for x in whole)), expected, kind)
    assert_close(ask(robot, method, *(x.tolist() for x in whole)), expected)


@every_method
@every_robot
def test_batch_in_another_memory_order(name: str, method: str):
    robot = rd.load(name)
    arguments = arguments_of(method, robot.n, 7, (4,))
    for form in (np.asfortranarray, np.ndarray.tolist, lambda x: x.astype(">f8"), lambda x: x[::-1].copy()[::-1]):
        assert_close(ask(robot, method, *map(form, arguments)), ask(robot, method, *arguments))


@every_method
@every_robot
def test_inputs_are_kept_and_outputs_are_fresh(name: str, method: str):
    robot = rd.load(name)
    for batch in ((), (2,)):
        arguments = arguments_of(method, robot.n, 8, batch)
        copies = [x.copy() for x in arguments]
        answer = np.asarray(ask(robot, method, *arguments))
        expected = answer.copy()
        others = ask(robot, method, *arguments_of(method, robot.n, 9, batch))
        assert_array_equal(answer, expected)  # a later query leaves it alone
        if answer.ndim:
            answer[...] = 7.0
        assert_array_equal(ask(robot, method, *arguments), expected)
        assert_array_equal(ask(robot, method, *arguments_of(method, robot.n, 9, batch)), others)
        for x, copy in zip(arguments, copies, strict=True):
            assert not np.shares_memory(x, answer)
            assert_array_equal(x, copy)


# --- what is refused

NOT_NUMBERS = ("abc", None, 1j, object(), True, "0.1", b"0")


def wrongs(x: np.ndarray) -> list[Any]:
    """What is not an array of n real numbers."""
    entries = [[wrong, *x.tolist()[1:]] for wrong in NOT_NUMBERS[:-3]]
    shapes = [
        0.5,
        np.float64(0.5),
        [],
        x[:-1],
        np.append(x, 0.5),
        x[:, None] if len(x) > 1 else x[:0],
        np.zeros((2, 0)),
    ]
    return [
        *NOT_NUMBERS,
        *entries,
        *shapes,
        x + 0j,
        x > 0,
        x.astype(str),
        x.astype(object),
        {"q": x},
        [[0.1], [0.1, 2]],
    ]


@every_method
@every_robot
def test_what_is_no_array_of_n_numbers_is_refused(name: str, method: str):
    robot = rd.load(name)
    arguments = arguments_of(method, robot.n, 10)
    for i, argument in enumerate(ARGUMENTS[method]):
        for wrong in wrongs(arguments[i]):
            with pytest.raises(QueryError, match=rf"^{argument} must (be|have) .*\b{robot.n}\b"):
                ask(robot, method, *arguments[:i], wrong, *arguments[i + 1 :])


@pytest.mark.parametrize("value", [np.nan, *long([np.inf, -np.inf])])
@every_method
@every_robot
def test_value_that_is_not_finite_is_refused_by_its_joint(name: str, method: str, value: float):
    robot = rd.load(name)
    arguments = arguments_of(method, robot.n, 11)
    for i, argument in enumerate(ARGUMENTS[method]):
        for j, joint in enumerate(robot.joint_names):
            bad = arguments[i].copy()
            bad[j] = value
            for form in (bad, bad.tolist(), np.stack([arguments[i], bad])):
                with pytest.raises(QueryError, match=f"^{argument} must be finite, got {value} for joint '{joint}'"):
                    ask(robot, method, *arguments[:i], form, *arguments[i + 1 :])


def test_number_beyond_float64_is_refused_as_not_finite():
    """A longdouble of 1e400 is finite, but not in float64; where longdouble is float64 it is inf at once."""
    with np.errstate(over="ignore"):
        huge = np.full(6, np.longdouble("1e300")) ** 2
    with pytest.raises(QueryError, match=r"^q must be finite"):
        rd.load("ur5").M(huge)


@pytest.mark.parametrize("frame", ["tol0", "", None, 5, ["tool0"]])
@pytest.mark.parametrize("method", FRAMED)
def test_unknown_frame_is_refused_with_the_nearest(method: str, frame: Any):
    robot = rd.load("ur5")
    with pytest.raises(QueryError, match=r"no frame .*; (nearest: tool0|known: world, base_link)"):
        getattr(robot, method)(*arguments_of(method, robot.n), frame)


@pytest.mark.parametrize("axes", ["wrld", "globe", "Local", "", None, 3, ["world"], pin.BODY])
@pytest.mark.parametrize("method", ["jacobian", "jacobian_rate"])
def test_unknown_axes_are_refused(method: str, axes: Any):
    robot = rd.load("ur5")
    for engine in (robot, rd.Lagrangian(robot)):
        with pytest.raises(QueryError, match=r"no expressed_in .*(world|body)"):
            getattr(engine, method)(*arguments_of(method, robot.n), "tool0", expressed_in=axes)
