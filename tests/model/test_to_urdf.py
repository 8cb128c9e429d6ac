"""A robot written as a URDF with its edits: other programs read the robot that was edited."""

from __future__ import annotations

import os
import warnings
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
import yourdfpy
from lxml import etree

import robot_dyn as rd
from robot_dyn import ModelWarning
from robot_dyn.foundations import DescriptionError
from robot_dyn.view import drawing
from tests.hostile.kinds import ARM, AXIS, LIMIT

LOAD = ((0.004, 0.0003, 0.0), (0.0003, 0.003, 0.0001), (0.0, 0.0001, 0.0025))
LIMITS = ("lower", "upper", "effort_limit", "velocity_limit", "damping", "friction")
ROUNDING = 1e-14  # of √(M_ii M_jj): another order of sums, and angles of locked joints as roll, pitch and yaw
ARMS = ["ur5", "xarm7", "skew_tree", "panda", "mimic_chain", "cart_pole"]  # the last but one with followers


def edited(name: str) -> rd.Robot:
    """A joint in the midst locked, a payload, a mass and an inertia replaced, all masses scaled."""
    with warnings.catch_warnings(action="ignore", category=ModelWarning):
        robot = rd.load(name)
    heavy = [link.get("name") for link in robot.description.element.iterfind("link[inertial]")]
    payload = rd.Payload(heavy[-1], 0.8, (0.01, 0.02, 0.05), LOAD)
    robot = robot.with_(payload=payload, masses={heavy[-2]: 1.3}, inertias={heavy[-1]: LOAD}, mass_scale=1.07)
    return robot.with_(lock={robot.joint_names[1]: 0.37}) if robot.n > 2 else robot


def difference(a: np.ndarray, b: np.ndarray, M: np.ndarray) -> float:
    d = np.sqrt(np.diag(M))
    return float(np.abs((a - b) / (d[:, None] * d)).max())


@pytest.mark.parametrize("name", ARMS)
def test_what_is_written_is_read_as_the_edited_robot(name: str, tmp_path: Path) -> None:
    robot, rng = edited(name), np.random.default_rng(4)
    with warnings.catch_warnings(action="ignore", category=ModelWarning):
        again = rd.load(robot.to_urdf(tmp_path / "arm"))
    assert again.joint_names == robot.joint_names
    assert again.edits == rd.load("pendulum").edits
    assert all(np.array_equal(getattr(again, each), getattr(robot, each)) for each in LIMITS)
    for _ in range(3):
        q, v, a = (robot.random_configuration(rng) for _ in range(3))
        assert difference(again.M(q), robot.M(q), robot.M(q)) < ROUNDING
        here, there = robot.inverse_dynamics(q, v, a), again.inverse_dynamics(q, v, a)
        assert np.abs(here - there).max() < 1e-13 * np.abs(here).max()


@pytest.mark.parametrize("name", ["ur5", "xarm7", "z1"])
def test_other_programs_read_the_same_robot(name: str, tmp_path: Path) -> None:
    """M by Pinocchio and MuJoCo, whose parsers read the file themselves; frames by yourdfpy."""
    mujoco = pytest.importorskip("mujoco")
    robot = edited(name)
    path = robot.to_urdf(tmp_path / "arm.urdf")
    q = robot.random_configuration(np.random.default_rng(6))
    model = pin.buildModelFromUrdf(str(path))
    assert tuple(model.names[1:]) == robot.joint_names
    assert difference(pin.crba(model, model.createData(), q), robot.M(q), robot.M(q)) < ROUNDING
    tree = etree.parse(str(path))
    for link in tree.getroot().iterfind("link"):
        for shape in [*link.iterfind("visual"), *link.iterfind("collision")]:
            link.remove(shape)
    spec = etree.SubElement(tree.getroot(), "mujoco")
    etree.SubElement(spec, "compiler", fusestatic="false", boundmass="0", boundinertia="0")
    other = mujoco.MjModel.from_xml_string(etree.tostring(tree, encoding="unicode"))
    assert tuple(other.joint(k).name for k in range(other.njnt)) == robot.joint_names
    data, M = mujoco.MjData(other), np.zeros((robot.n, robot.n))
    data.qpos[:] = q
    mujoco.mj_forward(other, data)
    mujoco.mj_fullM(other, data, M)
    assert difference(M, robot.M(q), robot.M(q)) < 1e-12  # MuJoCo turns inertias to their principal axes
    drawn = yourdfpy.URDF.load(str(path), load_meshes=False)
    drawn.update_cfg(dict(zip(robot.joint_names, q, strict=True)))
    for frame in robot.frame_names[-3:]:
        assert np.abs(drawn.get_transform(frame, robot.frame_names[0]) - robot.placement(q, frame)).max() < 1e-12


def test_the_shapes_are_those_of_the_file_from_the_new_place_too(tmp_path: Path) -> None:
    """A package:// address stays; one relative to the file is written as from the new folder."""
    (tmp_path / "arm" / "meshes").mkdir(parents=True)
    (tmp_path / "arm" / "meshes" / "box.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", encoding="utf-8")
    visual = '<link name="base"><visual><geometry><mesh filename="meshes/box.obj"/></geometry></visual></link>'
    (tmp_path / "arm" / "arm.urdf").write_text(ARM.replace('<link name="base"/>', visual), encoding="utf-8")
    (tmp_path / "out").mkdir()
    robot = rd.load(tmp_path / "arm" / "arm.urdf")
    path = robot.to_urdf(tmp_path / "out" / "arm.urdf")
    assert os.path.join("..", "arm", "meshes") in path.read_text(encoding="utf-8").replace("/", os.sep)
    here, there = drawing(robot), drawing(rd.load(path))
    assert not there.notes
    assert [each.link for each in there.pieces] == [each.link for each in here.pieces] == ["base"]
    assert "package://" in rd.load("panda").to_urdf(tmp_path / "panda").read_text(encoding="utf-8")


def test_limits_that_the_file_does_not_state_are_left_out_where_a_urdf_may(tmp_path: Path) -> None:
    continuous = ARM.replace(f"{AXIS}\n    {LIMIT}", AXIS).replace(
        '"shoulder" type="revolute"', '"shoulder" type="continuous"'
    )
    path = rd.Robot.from_text(continuous).to_urdf(tmp_path / "arm.urdf")
    shoulder, elbow = etree.parse(str(path)).getroot().iterfind("joint")
    assert shoulder.find("limit") is None
    assert dict(elbow.find("limit").attrib) == {"lower": "-2", "upper": "2", "effort": "8", "velocity": "3"}


def test_what_a_urdf_cannot_state_is_told_and_stands_in_a_comment(tmp_path: Path) -> None:
    robot = rd.load("ur5").with_(armature=0.1, gravity=(0.0, 0.0, -1.62))
    with pytest.warns(ModelWarning, match="armature is not in the URDF.*gravity is not in the URDF"):
        path = robot.to_urdf(tmp_path / "arm.urdf")
    assert path.read_text(encoding="utf-8").count("which cannot express it") == 2


def test_the_file_that_was_read_is_not_replaced(tmp_path: Path) -> None:
    (tmp_path / "arm.urdf").write_text(ARM, encoding="utf-8")
    robot = rd.load(tmp_path / "arm.urdf")
    with pytest.raises(DescriptionError, match=r"arm\.urdf"):
        robot.to_urdf(tmp_path / "arm.urdf")
    with pytest.raises(DescriptionError, match=r"\.stl"):
        robot.to_urdf(tmp_path / "arm.stl")
    assert (tmp_path / "arm.urdf").read_text(encoding="utf-8") == ARM
