"""A robot says what Pinocchio says, of one state and of a batch, and what its file states."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import robot_dyn as rd
from robot_dyn.foundations import QueryError
from tests.long import long
from tests.queries import ARGUMENTS, SEVERAL, arguments_of, ask, assert_close, general

ROBOTS = ("pendulum", "cart_pole", "ur5", "kinova", "panda", "mimic_chain", "skew_tree")
every_method = pytest.mark.parametrize("method", ARGUMENTS)
every_robot = pytest.mark.parametrize("name", ["pendulum", "panda", *long(["ur5", "skew_tree"])])  # one joint; coupled


# --- what Pinocchio says


def test_uncoupled_robot_says_what_pinocchio_says():
    robot = rd.load("ur5")
    model = robot.model
    data = model.createData()
    for seed in range(20):
        q, v, x = general(robot, seed)
        M, C = pin.crba(model, data, q), pin.computeCoriolisMatrix(model, data, q, v)
        assert_array_equal(robot.M(q), M)
        assert_allclose(robot.C(q, v), C, rtol=0, atol=1e-14 * np.abs(C).max())  # by another algorithm
        assert_array_equal(robot.N(q), pin.computeGeneralizedGravity(model, data, q))
        assert_array_equal(robot.inverse_dynamics(q, v, x), pin.rnea(model, data, q, v, x))
        assert_array_equal(robot.forward_dynamics(q, v, x), pin.aba(model, data, q, v, x))
        for product, A in (
            (robot.momentum(q, v), M),
            (robot.coriolis_torque(q, v), C),
            (robot.coriolis_transpose(q, v), C.T),
        ):  # of the terms added, by other algorithms
            assert np.all(np.abs(product - A @ v) <= 1e-14 * np.max(np.abs(A) @ np.abs(v)))
        assert_allclose(robot.kinetic_energy(q, v), pin.computeKineticEnergy(model, data, q, v), rtol=1e-15)
        assert_allclose(robot.potential_energy(q), pin.computePotentialEnergy(model, data, q), rtol=1e-15)


AXES = {"world_aligned": pin.LOCAL_WORLD_ALIGNED, "body": pin.LOCAL, "world": pin.WORLD}
AXES |= {"local_world_aligned": pin.LOCAL_WORLD_ALIGNED, "local": pin.LOCAL} | {axes: axes for axes in AXES.values()}


ENGINES = [("ur5", rd.load("ur5"), 1e-15)]
ENGINES += [("skew_tree", make(rd.load("skew_tree")), 1e-12) for make in (rd.Robot.with_, rd.Lagrangian, rd.Compiled)]


@pytest.mark.parametrize(("arm", "asked", "rounding"), ENGINES, ids=lambda x: type(x).__name__)
def test_frames_are_those_of_pinocchio(arm: str, asked, rounding: float):
    """Axes by names of this library and of Pinocchio; turned to the base's axes by the robot itself: 1e-15 of J."""
    robot = rd.load(arm)
    model, data = robot.model, robot.model.createData()
    q, v, _ = general(robot, 1)
    turn = np.abs(v).sum()
    for name in robot.frame_names:
        frame = model.getFrameId(name, pin.FrameType.BODY)
        pin.framesForwardKinematics(model, data, q)
        assert_array_equal(robot.placement(q, name), data.oMf[frame].homogeneous)
        for axes, reference in AXES.items():
            J = pin.computeFrameJacobian(model, data, q, frame, reference)
            assert_allclose(asked.jacobian(q, name, expressed_in=axes), J, rtol=0, atol=rounding)
            pin.computeJointJacobiansTimeVariation(model, data, q, v)
            dJ = pin.getFrameJacobianTimeVariation(model, data, frame, reference)
            assert_allclose(asked.jacobian_rate(q, v, name, expressed_in=axes), dJ, rtol=0, atol=rounding * turn)


@pytest.mark.parametrize("name", ROBOTS)
def test_equation_of_motion(name: str):
    """M a + C v + N = τ and FD(ID(a)) = a: 1e-12, and 1e-9 for the solve, since κ(M) is up to 1e4."""
    robot = rd.load(name)
    q, v, a = general(robot, 2)
    tau = robot.inverse_dynamics(q, v, a)
    assert_allclose(robot.M(q) @ a + robot.C(q, v) @ v + robot.N(q), tau, rtol=1e-12, atol=1e-12)
    assert_allclose(robot.forward_dynamics(q, v, tau), a, rtol=1e-9)
    assert_allclose(robot.kinetic_energy(q, v), v @ robot.M(q) @ v / 2, rtol=1e-15)
    assert_array_equal(robot.M(q), robot.M(q).T)


# --- what its file states


def test_continuous_joints_are_one_number_without_limits():
    kinova = rd.load("kinova")
    turning = [i for i, name in enumerate(kinova.joint_names) if name[-1] in "146"]
    assert kinova.model.nq == kinova.model.nv == kinova.n == 6
    assert_array_equal(kinova.lower[turning], -np.inf)
    assert_array_equal(kinova.upper[turning], np.inf)
    assert np.isfinite(np.delete(kinova.lower, turning)).all()


def test_revolute_joints_without_stated_bounds_are_unlimited():
    with pytest.warns(rd.ModelWarning, match="legs, wheels or rotors"):
        robot = rd.load("centauro")
    wheels = [i for i, name in enumerate(robot.joint_names) if name.startswith("j_wheel")]
    assert len(wheels) == 4
    assert_array_equal(robot.lower[wheels], -np.inf)
    assert_array_equal(robot.upper[wheels], np.inf)


def test_stated_limits_are_those_of_the_file():
    robot = rd.load("skew_tree")
    assert_array_equal(robot.lower, [-np.inf, -2.5, -0.3, -2.5, -2.2])
    assert_array_equal(robot.effort_limit, [np.inf, 60, 200, 60, 40])
    assert_array_equal(robot.velocity_limit, [np.inf, 4, 1, 4, 5])


def test_total_mass_counts_the_base_and_every_payload():
    """Sums of decimal masses in another order: 1e-14."""
    assert_allclose(rd.load("mimic_chain").total_mass, 1.0, rtol=1e-14)
    assert_allclose(rd.load("skew_tree").total_mass, 4 + 3 + 1.5 + 0.8 + 0.3 + 1.4 + 0.7, rtol=1e-14)
    panda = rd.load("panda")
    assert_allclose(panda.with_(lock={"panda_finger_joint1": 0.02}).total_mass, panda.total_mass, rtol=1e-14)
    loaded = panda.with_(payload=[rd.Payload("panda_hand", 0.7), rd.Payload("panda_link0", 0.3)])
    assert_allclose(loaded.total_mass, panda.total_mass + 1, rtol=1e-14)


# --- batches


@every_method
@every_robot
def test_batch_is_one_state_at_a_time(name: str, method: str):
    robot = rd.load(name)
    arguments = arguments_of(method, robot.n, 1, (2, 3))
    answer = ask(robot, method, *arguments)
    for i in np.ndindex(2, 3):
        assert_close(answer[i], ask(robot, method, *(x[i] for x in arguments)))


@every_method
@every_robot
def test_empty_batch_has_the_shape_of_its_answer(name: str, method: str):
    robot = rd.load(name)
    shape = np.shape(ask(robot, method, *arguments_of(method, robot.n)))
    for batch in ((0,), (2, 0), (0, 3)):
        answer = ask(robot, method, *arguments_of(method, robot.n, 2, batch))
        assert answer.shape == batch + shape and answer.dtype == np.float64


@pytest.mark.parametrize("method", SEVERAL)
@every_robot
def test_arguments_broadcast(name: str, method: str):
    robot = rd.load(name)
    one, many = arguments_of(method, robot.n, 3), arguments_of(method, robot.n, 4, (5,))
    for single in range(len(one)):  # this one (n,), the others (5, n)
        mixed = [x if i == single else y for i, (x, y) in enumerate(zip(one, many, strict=True))]
        full = [np.broadcast_to(x, (5, robot.n)) for x in mixed]
        assert_close(ask(robot, method, *mixed), ask(robot, method, *full))
    assert ask(robot, method, one[0], *(x[:, None] for x in many[1:])).shape[:2] == (5, 1)


@pytest.mark.parametrize("method", SEVERAL)
@every_robot
def test_batches_that_do_not_match_are_refused(name: str, method: str):
    robot = rd.load(name)
    for odd in range(len(ARGUMENTS[method])):
        arguments = arguments_of(method, robot.n, 5, (2,))
        arguments[odd] = arguments_of(method, robot.n, 5, (3,))[odd]
        with pytest.raises(QueryError, match="batch axes do not match"):
            ask(robot, method, *arguments)


def test_one_state_gives_plain_floats_for_energies():
    robot = rd.load("panda")
    q, v = arguments_of("C", robot.n)
    assert type(robot.kinetic_energy(q, v)) is float and type(robot.potential_energy(q)) is float
