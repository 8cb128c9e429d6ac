"""The regressor: torques are linear in the inertial parameters of the bodies, τ = Y(q, v, a) θ + armature · a."""

from __future__ import annotations

from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import robot_dyn as rd
from robot_dyn.description import parameter_names, parameters, unit_inertias
from robot_dyn.lagrange import floored, magnitudes
from robot_dyn.lagrange.recursions.regressor import regressor
from tests.queries import general

ROBOTS = ("pendulum", "ur5", "mimic_chain", "skew_tree", "cart_pole")
ENGINES = {
    "Robot": lambda robot: robot,
    "Lagrangian": rd.Lagrangian,
    "longdouble": lambda robot: rd.Lagrangian(robot, np.longdouble),
    "compiled": lambda robot: rd.compiled(robot, cache=False),
}


def arm(name: str) -> rd.Robot:
    robot = rd.load(name)
    payload = rd.Payload(robot.frame_names[-1], 0.8, (0.05, -0.02, 0.1), np.diag([0.01, 0.02, 0.025]).tolist())
    return robot.with_(gravity=(1.0, -2.0, -9.0), payload=payload, armature=0.3)


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize("name", ROBOTS)
def test_torques_are_the_regressor_times_the_parameters(name: str, engine: str) -> None:
    """Y θ + armature · a = ID of Pinocchio; 1e-13 of the terms, those of Y θ, which the sums over links hide in ID."""
    robot = arm(name)
    asked: Any = ENGINES[engine](robot)
    q, v, a = general(robot, 5)
    Y, theta = asked.regressor(q, v, a), asked.inertial_parameters
    terms = np.abs(Y) @ np.abs(theta) + 0.3 * np.abs(a)
    expected = getattr(asked, "robot", robot).inverse_dynamics(q, v, a)  # of a compiled robot with its right angles
    assert np.all(np.abs(Y @ theta + 0.3 * a - expected) <= 1e-13 * terms)


@pytest.mark.parametrize("name", ROBOTS)
def test_all_implementations_give_one_regressor(name: str) -> None:
    """Christoffel symbols of unit inertias, the recursion and machine code against Pinocchio: 1e-13 of the terms."""
    robot = arm(name)
    own, (q, v, a) = rd.Lagrangian(robot), general(robot, 6)
    allowed = 1e-13 * floored(magnitudes(own.linkage, q).regressor(v, a))
    expected = robot.regressor(q, v, a)
    assert own.body_names == robot.body_names == rd.compiled(robot).body_names
    for Y in (own.regressor(q, v, a), regressor(own.linkage, q, v, a)):
        assert np.all(np.abs(Y - expected) <= allowed)
    fast = rd.compiled(robot, cache=False)
    assert np.all(np.abs(fast.regressor(q, v, a) - fast.robot.regressor(q, v, a)) <= allowed)
    size = 1e-14 * np.abs(robot.inertial_parameters).max()
    assert np.allclose(own.inertial_parameters, robot.inertial_parameters, rtol=0, atol=size)


def test_it_is_pinocchios_where_no_joints_are_coupled() -> None:
    """Column by column, in the order of its joints."""
    robot = arm("ur5")
    q, v, a = general(robot, 7)
    expected = pin.computeJointTorqueRegressor(robot.model, robot.model.createData(), q, v, a)
    assert np.array_equal(robot.regressor(q, v, a), expected)
    assert robot.body_names == robot.joint_names


def test_coupled_joints_carry_bodies_of_their_own() -> None:
    """Y = Sᵀ Y_full(S q + s₀, S v, S a): two coordinates, four bodies, the coupled ones last and by name."""
    robot = arm("mimic_chain")
    assert robot.body_names == (*robot.joint_names, "flex_1", "flex_2")
    q, v, a = general(robot, 8)
    S, s0 = robot.couplings.S, robot.couplings.s0
    full = pin.computeJointTorqueRegressor(robot.model, robot.model.createData(), S @ q + s0, S @ v, S @ a)
    columns = {name: full[:, 10 * i : 10 * i + 10] for i, name in enumerate(robot.model.names[1:])}
    expected = S.T @ np.hstack([columns[name] for name in robot.body_names])
    np.testing.assert_allclose(robot.regressor(q, v, a), expected, rtol=0, atol=1e-14 * np.abs(expected).max())


@pytest.mark.parametrize("name", ROBOTS)
def test_columns_do_not_depend_on_masses(name: str) -> None:
    """Y of twice the masses is the same to the last bit, and θ is twice as large: τ is linear in it."""
    robot = rd.load(name)
    state = general(robot, 9)
    heavy = robot.with_(mass_scale=2.0)
    assert np.array_equal(heavy.regressor(*state), robot.regressor(*state))
    assert np.array_equal(rd.Lagrangian(heavy).regressor(*state), rd.Lagrangian(robot).regressor(*state))
    np.testing.assert_allclose(heavy.inertial_parameters, 2 * robot.inertial_parameters, rtol=1e-14)


def test_a_column_is_the_torque_of_a_unit_of_its_parameter() -> None:
    """A payload of 1 kg at the frame of a body adds 1 to its mass: ID grows by that column."""
    robot = rd.load("ur5")
    q, v, a = general(robot, 10)
    loaded = robot.with_(payload=rd.Payload("forearm_link", 1.0))
    grown = loaded.inverse_dynamics(q, v, a) - robot.inverse_dynamics(q, v, a)
    column = parameter_names(robot.body_names).index("elbow_joint m")
    np.testing.assert_allclose(robot.regressor(q, v, a)[:, column], grown, rtol=0, atol=1e-13 * np.abs(grown).max())


def test_balls_hold_the_regressor() -> None:
    robot = rd.load("mimic_chain")
    state = general(robot, 11)
    proven = rd.Lagrangian(robot, rd.accuracy.Ball(200)).regressor(*state)
    assert rd.accuracy.radius(proven).max() < 1e-50
    np.testing.assert_allclose(rd.accuracy.midpoint(proven), robot.regressor(*state), rtol=0, atol=1e-14)


def test_unit_inertias_span_the_inertia_of_a_body() -> None:
    """𝓜 = Σ θ_k E_k, and the parameters of E_k are the k-th unit vector."""
    E = unit_inertias(np.dtype(float))
    assert np.array_equal([parameters(each) for each in E], np.eye(10))
    for inertia in rd.Lagrangian(rd.load("skew_tree")).linkage.inertias:
        np.testing.assert_allclose(np.tensordot(parameters(inertia), E, axes=1), inertia, rtol=1e-15, atol=1e-17)
