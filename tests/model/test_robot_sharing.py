"""A robot may be shared: it is frozen, it is pickled as a value, threads get the serial answers."""

from __future__ import annotations

import pickle
from concurrent.futures import ThreadPoolExecutor
from dataclasses import FrozenInstanceError
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_array_equal

import robot_dyn as rd
from tests.queries import ARGUMENTS, arguments_of, ask, general


def test_immutable_with_read_only_arrays():
    robot = rd.load("ur5")
    for name in ("description", "edits", "name", "n", "lower", "anything"):
        with pytest.raises((FrozenInstanceError, AttributeError)):
            setattr(robot, name, None)
    for name in ("lower", "upper", "effort_limit", "velocity_limit", "armature", "damping", "friction"):
        with pytest.raises(ValueError, match="read-only"):
            getattr(robot, name)[0] = 1.0


@pytest.mark.parametrize("name", ["ur5", "panda", "skew_tree"])
def test_pickled_robot_is_the_same_robot(name: str):
    robot = rd.load(name)
    robot = robot.with_(
        lock={robot.joint_names[1]: 0.3}, armature=0.1, payload=rd.Payload(robot.frame_names[-1], 0.5, (0.1, 0.2, 0.3))
    )
    robot.M(general(robot, 0)[0])  # so that there is something cached
    copy = pickle.loads(pickle.dumps(robot))
    q, v, a = general(robot, 4)
    assert copy == robot and hash(copy) == hash(robot)
    assert_array_equal(copy.inverse_dynamics(q, v, a), robot.inverse_dynamics(q, v, a))
    assert robot != robot.with_(armature=0.2) and robot != rd.load(name)


@pytest.mark.parametrize("name", ["ur5", "panda"])
def test_threads_that_share_a_robot_get_the_serial_answers(name: str):
    robot = rd.load(name)
    jobs = [(method, arguments_of(method, robot.n, seed)) for seed in range(60) for method in ARGUMENTS]

    def answer(job: tuple[str, list[np.ndarray]]) -> Any:
        return ask(robot, job[0], *job[1])

    fresh = rd.load(name)  # so that nothing of `robot` is cached yet
    serial = [ask(fresh, method, *arguments) for method, arguments in jobs]
    with ThreadPoolExecutor(8) as pool:
        parallel = list(pool.map(answer, jobs * 3))
    for actual, expected in zip(parallel, serial * 3, strict=True):
        assert_array_equal(actual, expected)
