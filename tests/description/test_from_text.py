"""Robots from a text, or from a model of Pinocchio that was built elsewhere: one way in, the hardened read."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from numpy.testing import assert_allclose

import robot_dyn as rd
from robot_dyn import ModelWarning
from robot_dyn.foundations import CatalogError, DescriptionError
from tests.hostile.kinds import ARM

# --- text


@pytest.mark.parametrize("text", [ARM, ARM.encode(), f'<?xml version="1.0" encoding="latin-1"?>{ARM}', "\ufeff" + ARM])
def test_text_is_read_as_a_file_with_that_content(text: str | bytes, tmp_path) -> None:
    (tmp_path / "arm.urdf").write_text(ARM)
    assert rd.Robot.from_text(text).description.xml == rd.load(tmp_path / "arm.urdf").description.xml


def test_text_with_a_declared_encoding_keeps_its_letters() -> None:
    """The encoding that a text declares is that of the file it was read from."""
    for encoding in ("latin-1", "utf-16", "utf-8"):
        text = f'<?xml version="1.0" encoding="{encoding}"?>{ARM}'.replace('"elbow"', '"coudé"')
        assert rd.Robot.from_text(text).joint_names == ("shoulder", "coudé")


def test_text_warns_as_a_file_does() -> None:
    with pytest.warns(ModelWarning, match="arm: joint 'shoulder': its velocity limit -2 is negative") as caught:
        rd.Robot.from_text(ARM.replace('velocity="2"', 'velocity="-2"'))
    assert caught[0].filename == __file__


@pytest.mark.parametrize("text", [ARM, ARM.encode(), f"\n<?xml version='1.0'?>\n{ARM}", "\ufeff<robot/>", "  <robot"])
def test_text_given_in_place_of_a_path_is_recognised(text: str) -> None:
    with pytest.raises(CatalogError, match=r"the text of a URDF, .* Robot\.from_text"):
        rd.load(text)


@pytest.mark.parametrize("wrong", ["", "arm.urdf", "\udcff<robot/>", None, 3, ["<robot/>"]])
def test_what_is_no_urdf_is_refused(wrong: object) -> None:
    with pytest.raises(DescriptionError, match="the text of the URDF"):
        rd.Robot.from_text(wrong)  # pyright: ignore[reportArgumentType]


# --- models of Pinocchio


def model_with_all_joints() -> pin.Model:
    """A tree of every kind of joint that has one degree of freedom, with armature, friction and a frame at its tip."""
    rng = np.random.default_rng(3)
    pin.seed(5)
    model = pin.Model()
    model.name, parent = "all joints", 0
    axis = np.array([0.48, -0.6, 0.64])
    kinds = [getattr(pin, f"JointModel{kind}{axis}")() for kind in ("R", "P", "RUB") for axis in "XYZ"]
    kinds += [pin.JointModelRevoluteUnaligned(axis), pin.JointModelPrismaticUnaligned(axis)]
    for i, kind in enumerate(kinds):
        parent = model.addJoint(parent if i != 5 else 2, kind, pin.SE3.Random(), f"joint {i}")
        parts = [pin.Inertia.FromBox(rng.uniform(0.5, 2), *rng.uniform(0.1, 0.5, 3)) for _ in range(2)]
        model.appendBodyToJoint(parent, parts[0], pin.SE3.Random())
        model.appendBodyToJoint(parent, parts[1], pin.SE3.Random())
    model.addFrame(pin.Frame("tip", parent, 0, pin.SE3.Random(), pin.FrameType.OP_FRAME))
    n = model.nv
    model.armature, model.damping = rng.uniform(0.1, 0.2, n), rng.uniform(0, 1, n)
    model.gravity = pin.Motion(np.array([0.3, -0.2, -9.7]), np.zeros(3))
    limits = np.where([name.shortname()[10:13] == "RUB" for name in model.joints.tolist()[1:]], np.inf, 1.5)
    model.effortLimit = limits
    return model


def configuration(model: pin.Model, q: np.ndarray) -> np.ndarray:
    """The q of Pinocchio: cosine and sine of the angles without bounds."""
    whole = [(np.cos(x), np.sin(x)) if nq == 2 else (x,) for x, nq in zip(q, model.nqs.tolist()[1:], strict=True)]
    return np.concatenate(whole)


def test_robot_of_a_model_has_its_dynamics() -> None:
    """The same engine on numbers that went through roll, pitch and yaw: 1e-13 of the largest entry, 2 m levers."""
    model = model_with_all_joints()
    with warnings.catch_warnings(action="ignore", category=ModelWarning):  # of the order of its two branches
        robot = rd.Robot.from_pinocchio(model)
    names = model.names.tolist()[1:]
    assert sorted(robot.joint_names) == sorted(names)
    order = [names.index(name) for name in robot.joint_names]
    q, v, a = np.random.default_rng(8).uniform(-2, 2, (3, model.nv))
    data, whole = model.createData(), configuration(model, q)
    M, tau = pin.crba(model, data, whole), pin.rnea(model, data, whole, v, a)
    for dynamics in (robot, rd.Lagrangian(robot)):
        assert_allclose(dynamics.M(q[order]), M[np.ix_(order, order)], rtol=0, atol=1e-13 * np.abs(M).max())
        ours = dynamics.inverse_dynamics(q[order], v[order], a[order])
        assert_allclose(ours, tau[order], rtol=0, atol=1e-13 * np.abs(tau).max())
    pin.framesForwardKinematics(model, data, whole)
    tip = data.oMf[model.getFrameId("tip")].homogeneous
    assert_allclose(robot.placement(q[order], "tip"), tip, rtol=0, atol=1e-13 * np.abs(tip).max())
    assert np.array_equal(robot.damping, model.damping[order])
    assert np.array_equal(robot.armature, model.armature[order])
    assert np.array_equal(robot.effort_limit, model.effortLimit[order])


@pytest.mark.parametrize("name", ["ur5", "kinova", "panda", "skew_tree"])
def test_robot_of_the_model_of_a_robot_keeps_all_digits(name: str) -> None:
    """4 units in the last place: rotations pass through roll, pitch and yaw, and Pinocchio divides m c by m again."""
    few = 4 * np.finfo(float).eps
    robot = rd.load(name)
    again = rd.Robot.from_pinocchio(robot.model)
    assert set(robot.frame_names) <= set(again.frame_names)
    theirs, ours = robot.model, again.model
    assert ours.names.tolist() == theirs.names.tolist()
    for mine, stated in zip(ours.inertias.tolist(), theirs.inertias.tolist(), strict=True):
        assert mine.mass == stated.mass
        assert_allclose(mine.lever, stated.lever, rtol=few, atol=0)
        assert_allclose(mine.inertia, stated.inertia, rtol=0, atol=few * np.abs(stated.inertia).max())
    for mine, stated in zip(ours.jointPlacements.tolist(), theirs.jointPlacements.tolist(), strict=True):
        assert np.array_equal(mine.translation, stated.translation)
        assert_allclose(mine.rotation, stated.rotation, rtol=0, atol=few)
    for bounds in ("lowerPositionLimit", "upperPositionLimit", "effortLimit", "velocityLimit", "damping", "friction"):
        assert np.array_equal(getattr(ours, bounds), getattr(theirs, bounds)), bounds


def test_another_order_of_joints_is_said() -> None:
    model = pin.Model()
    for name in ("b", "a"):
        joint = model.addJoint(0, pin.JointModelRX(), pin.SE3.Identity(), name)
        model.appendBodyToJoint(joint, pin.Inertia.FromSphere(1.0, 0.1), pin.SE3.Identity())
    with pytest.warns(ModelWarning, match="the joint order differs from the model's: a, b; arrange"):
        robot = rd.Robot.from_pinocchio(model)
    assert robot.joint_names == ("a", "b")


def refused(kind: object = None, name: str = "j", more=lambda model: None) -> pin.Model:
    model = pin.Model()
    joint = model.addJoint(0, kind or pin.JointModelRX(), pin.SE3.Identity(), name)
    model.appendBodyToJoint(joint, pin.Inertia.FromSphere(1.0, 0.1), pin.SE3.Identity())
    more(model)
    return model


def bent_gravity(model: pin.Model) -> None:
    model.gravity = pin.Motion(np.ones(6))


WRONG = {
    "joint 'j': is a FreeFlyer joint; only revolute": lambda: refused(pin.JointModelFreeFlyer()),
    "joint 'j': is a Spherical joint": lambda: refused(pin.JointModelSpherical()),
    "joint 'j': is a HX joint": lambda: refused(pin.JointModelHX(0.1)),
    "its axis .* is not of length 1": lambda: refused(pin.JointModelRevoluteUnaligned(np.array([0.0, 2.0, 0.0]))),
    "has control characters": lambda: refused(name="a\x1b[2J"),
    "gravity: has an angular part": lambda: refused(more=bent_gravity),
    "no joint moves|holds no": pin.Model,
    "needs a pinocchio.Model, got Robot": lambda: rd.load("pendulum"),
    "needs a pinocchio.Model, got NoneType": lambda: None,
    "needs a pinocchio.Model, got Data": lambda: pin.Model().createData(),
}


@pytest.mark.parametrize("why", WRONG)
def test_what_a_urdf_cannot_state_is_refused_by_name(why: str) -> None:
    with pytest.raises(DescriptionError, match=why):
        rd.Robot.from_pinocchio(WRONG[why]())


@pytest.mark.parametrize("wrong", [pin.Model(), "ur5", None, b"<robot/>"])
def test_what_is_no_description_makes_no_robot(wrong: object) -> None:
    with pytest.raises(DescriptionError, match=r"must be a Description, got .*; use rd\.load, Robot\.from_text"):
        rd.Robot(wrong)  # pyright: ignore[reportArgumentType]


def test_a_path_that_begins_with_an_angle_bracket_is_a_path(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("<arm.urdf", "<arm>.urdf"):
        Path(name).write_text(ARM, encoding="utf-8")
        assert rd.load(name).joint_names == rd.Robot.from_text(ARM).joint_names
    with pytest.raises(CatalogError, match="no file"):
        rd.load("<absent.urdf")
