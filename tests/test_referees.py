"""M, C v + N and forward dynamics of the whole catalog against MuJoCo, which shares no line with either road.

Its reader, its kinematics and its algorithms are its own. What it refuses or drops, the doctor of files names.
"""

from __future__ import annotations

from importlib import import_module
from typing import Any

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn.accuracy.peers.free_motion import PeerError
from robot_dyn.accuracy.peers.mujoco import mujoco_model
from robot_dyn.errors import RobotDynError
from robot_dyn.lagrange.magnitude import magnitudes
from robot_dyn.lagrange.scale import diagonal_scale, floored, mass_norm, scaled, solved_tolerance

mujoco: Any = import_module("mujoco")
TOLERANCE = 1e-12  # of the terms added; its own minimum of diagonals and Pinocchio's rounding leave 1e-13
NAMES = rd.list_robots()


def loaded(name: str) -> rd.Robot:
    try:
        robot = rd.load(name)
    except RobotDynError as error:
        pytest.skip(f"is refused: {error}")
    return robot


@pytest.mark.filterwarnings("ignore::robot_dyn.ModelWarning")
@pytest.mark.parametrize("name", NAMES)
def test_another_engine_has_the_same_equations(name: str) -> None:
    robot = loaded(name)
    if not robot.couplings.trivial:
        pytest.skip("has joints that follow others, which MuJoCo keeps as constraints")
    found = {each.kind for each in rd.check(name).findings}
    try:
        model = mujoco_model(mujoco, robot, bare=True, ordered=False)
    except PeerError as error:
        assert found & {"inertia_impossible", "mass_missing", "inertia_missing", "inertia_zero"}, error
        return
    if "inertia_without_mass" in found:  # which it drops
        return
    at = [model.joint(each).dofadr[0] for each in robot.joint_names]
    own, data, rng, n = rd.Lagrangian(robot), mujoco.MjData(model), np.random.default_rng(11), robot.n
    for _ in range(3):
        q, (v, tau) = robot.random_configuration(rng), rng.normal(size=(2, n))
        data.qpos[at], data.qvel[at], data.qfrc_applied[at] = q, v, tau
        mujoco.mj_forward(model, data)
        M, bias = np.zeros((n, n)), data.qfrc_bias[at]
        mujoco.mj_fullM(model, data, M)
        M = M[np.ix_(at, at)]
        terms = magnitudes(own.linkage, q).inverse_dynamics(np.abs(v), np.zeros(n))
        ours = robot.M(q)
        assert scaled(ours - M, floored(diagonal_scale(ours))).max() <= TOLERANCE
        assert scaled(robot.inverse_dynamics(q, v, np.zeros(n)) - bias, floored(terms)).max() <= TOLERANCE
        if robot.joint_without_inertia is None and np.linalg.eigvalsh(ours)[0] > 0:
            a = robot.forward_dynamics(q, v, tau)
            allowed = solved_tolerance(TOLERANCE, ours) * float(
                np.linalg.norm((np.abs(tau) + terms) / np.sqrt(np.diag(ours)))
            )
            assert mass_norm(ours, a - data.qacc[at]) <= allowed
