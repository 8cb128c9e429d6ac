"""A robot has the answers of Pinocchio, for one state and a batch, and what its file states; it may be shared."""

from __future__ import annotations

import json
import pickle
import warnings
from concurrent.futures import ThreadPoolExecutor
from dataclasses import FrozenInstanceError
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import robot_dyn as rd
from robot_dyn.foundations import QueryError
from tests.command import document, said
from tests.long import long
from tests.queries import ARGUMENTS, FRAMED, SEVERAL, arguments_of, ask, assert_close, general

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
ENGINES += [("skew_tree", make(rd.load("skew_tree")), 1e-12) for make in (rd.Robot.with_, rd.Lagrangian, rd.compiled)]


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


@pytest.mark.parametrize("name", ["panda", "mimic_chain", "pendulum"])
def test_the_value_is_what_the_command_prints(name: str) -> None:
    answer = rd.info(rd.load(name))
    assert said("info", name) == f"{answer}\n"
    assert document("info", name) == json.loads(answer.to_json())


def test_it_has_the_numbers_of_the_robot_and_does_not_change() -> None:
    arm = rd.load("ur5").with_(payload=rd.Payload("tool0", 2.5), lock={"elbow_joint": 0.25})
    answer = rd.info(arm)
    assert (answer.n, answer.total_mass, answer.locked) == (5, arm.total_mass, {"elbow_joint": 0.25})
    assert answer.links == arm.frame_names
    for name in ("lower", "upper", "effort_limit", "velocity_limit", "damping", "friction", "armature"):
        assert [getattr(joint, name) for joint in answer.joints] == getattr(arm, name).tolist()
    assert "payload: 2.5 kg on tool0" in repr(answer)
    with pytest.raises(FrozenInstanceError):
        answer.n = 3  # pyright: ignore[reportAttributeAccessIssue]


G = -rd.STANDARD_GRAVITY[2]
OWN = sorted(path.stem for path in (Path(__file__).parents[2] / "urdf").glob("*.urdf"))


def test_the_lectures_arm_has_the_lectures_gravity_vector_as_it_is_loaded() -> None:
    """N₁ = g ((m₁ r₁ + m₂ l₁) cos q₁ + m₂ r₂ cos(q₁ + q₂)), N₂ = g m₂ r₂ cos(q₁ + q₂); few operations: 1e-14 of N."""
    q = np.random.default_rng(1).uniform(-3, 3, (20, 2))
    far = G * 1.5 * 0.4 * np.cos(q.sum(axis=1))
    N = np.stack([G * (2.0 * 0.5 + 1.5 * 1.0) * np.cos(q[:, 0]) + far, far], axis=1)
    robot = rd.load("planar_2r")
    for engine in (robot, rd.Lagrangian(robot)):
        np.testing.assert_allclose(engine.N(q), N, rtol=0, atol=1e-14 * np.abs(N).max())


def test_its_tip_goes_where_the_lecture_says() -> None:
    """The lecture has x = l₁ cos q₁ + l₂ cos(q₁ + q₂), y = l₁ sin q₁ + l₂ sin(q₁ + q₂), and y is z of the base."""
    q = np.array([0.6, -1.1])
    place = rd.load("planar_2r").placement(q, "tip")
    expected = [np.cos(0.6) + 0.8 * np.cos(-0.5), 0.0, np.sin(0.6) + 0.8 * np.sin(-0.5)]
    np.testing.assert_allclose(place[:3, 3], expected, atol=1e-15)


@pytest.mark.filterwarnings("ignore::robot_dyn.foundations.errors.ModelWarning")  # of the massless tip
@pytest.mark.parametrize("name", OWN)
def test_gravity_acts_on_every_robot_of_the_library(name: str) -> None:
    assert rd.load(name).gravity_acts


def test_gravity_along_all_axes_of_an_arm_has_no_torque_and_that_is_said() -> None:
    arm = rd.load("planar_2r")
    with pytest.warns(rd.ModelWarning, match=r"planar_2r: gravity \(0.0, -9.8, 0.0\) .* no torque .* N\(q\) = 0"):
        level = arm.with_(gravity=(0.0, -9.8, 0.0))
    assert not level.gravity_acts
    assert level.with_(gravity=(1e-6, -9.8, 0.0)).gravity_acts  # the least of a slope


def test_no_gravity_and_unchanged_gravity_are_silent() -> None:
    """The arm twodofs moves in a horizontal plane: as it is loaded nothing is wrong with it."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert not rd.load("planar_2r").with_(gravity=(0.0, 0.0, 0.0)).gravity_acts
        assert not rd.load("twodofs").with_(armature=0.1, gravity=rd.STANDARD_GRAVITY).gravity_acts


def test_the_commands_say_why_N_is_zero() -> None:
    assert "no torque on any joint at any position, so N(q) = 0" in said("query", "twodofs")
    assert "no torque" in said("info", "twodofs")
    assert document("info", "twodofs")["gravity_acts"] is False
    assert document("query", "planar_2r")["gravity_acts"] is True
    assert "no torque" not in said("query", "planar_2r") + said("info", "planar_2r")


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
