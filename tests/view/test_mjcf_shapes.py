"""Geoms of MJCF stand on the page where MuJoCo has them, in their colours."""

from __future__ import annotations

import warnings
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio
import pytest
import trimesh

import robot_dyn as rd
from robot_dyn import ModelWarning
from robot_dyn.view import Piece, drawing

mujoco: Any = import_module("mujoco")  # which has no types
ARM = """<mujoco model="drawn">
  <asset>
    <mesh name="turned" file="wedge.stl" refpos="0.1 0.2 0.3" refquat="0.9 0.1 0.3 0.2" scale="2 2 2"/>
    <mesh name="mirrored" file="wedge.stl" refpos="0.1 0.2 0.3" scale="2 1 -0.5"/>
    <material name="red" rgba="0.8 0.1 0.1 1"/>
  </asset>
  <worldbody>
    <geom type="plane" size="1 1 0.1"/>
    <body name="arm" pos="0.1 0 0.2" euler="20 10 0">
      <joint name="turn" axis="0.1 0.2 1" pos="0.05 0 0"/>
      <geom name="box" type="box" size="0.1 0.05 0.03" pos="0.1 0.2 0.3" euler="10 20 30" material="red"/>
      <geom name="capsule" type="capsule" fromto="0 0 0 0.3 0.02 0.1" size="0.03" rgba="0.1 0.9 0.1 1"/>
      <geom name="cylinder" type="cylinder" size="0.04 0.1" euler="40 0 0"/>
      <geom name="ball" type="sphere" size="0.06" pos="0.3 0.1 0"/>
      <geom name="turned" type="mesh" mesh="turned" pos="0.1 0.2 0.3" quat="0.8 0.2 0.1 0.5"/>
      <geom name="mirrored" type="mesh" mesh="mirrored" quat="0.8 0.2 0.1 0.5" rgba="0.1 0.1 0.9 0.5"/>
      <geom name="hidden" type="box" size="1 1 1" group="3" mass="0"/>
      <geom name="clear" type="box" size="1 1 1" rgba="1 1 1 0" mass="0"/>
    </body>
  </worldbody>
</mujoco>
"""
SINGLE = 1e-6  # [m], of MuJoCo's corners, which have single precision, and of those that are drawn


@pytest.fixture
def path(tmp_path: Path) -> Path:
    wedge = trimesh.creation.box((0.2, 0.1, 0.05))
    wedge.vertices[0] += (0.05, 0.01, 0.02)
    wedge.apply_translation((0.3, 0.02, 0.1))
    wedge.export(tmp_path / "wedge.stl")
    file = tmp_path / "arm.xml"
    file.write_text(ARM, encoding="utf-8")
    return file


def corners(robot: rd.Robot, q: np.ndarray, pieces: tuple[Piece, ...]) -> np.ndarray:
    """Of pieces, in the base, (n, 3)."""
    poses = [robot.placement(q, piece.link) @ piece.pose for piece in pieces]
    return np.vstack([piece.mesh.vertices @ g[:3, :3].T + g[:3, 3] for piece, g in zip(pieces, poses, strict=True)])


def apart(x: np.ndarray, y: np.ndarray) -> float:
    """The largest distance of a point of one set from the other set."""
    distance = np.linalg.norm(x[:, None] - y, axis=2)
    return float(max(distance.min(axis=0).max(), distance.min(axis=1).max()))


def test_shapes_stand_where_mujoco_has_them(path: Path) -> None:
    """Corners of boxes and of meshes, scaled, mirrored and turned; for what is round, the distance from its axis."""
    robot, q = rd.load(path), np.array([0.7])
    pieces = drawing(robot).pieces
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    data.qpos[:] = q
    mujoco.mj_forward(model, data)

    def local(name: str, points: np.ndarray) -> np.ndarray:
        return (points - data.geom(name).xpos) @ data.geom(name).xmat.reshape(3, 3)

    box, wall, end, other, cylinder, ball, *meshes = pieces
    ends = np.stack(np.meshgrid(*[(-1, 1)] * 3), axis=-1).reshape(-1, 3) * model.geom("box").size
    assert apart(local("box", corners(robot, q, (box,))), ends) < SINGLE
    for name, piece in zip(("turned", "mirrored"), meshes, strict=True):
        mesh = model.mesh(name)
        theirs = model.mesh_vert[mesh.vertadr[0] :][: mesh.vertnum[0]]
        assert apart(local(name, corners(robot, q, (piece,))), theirs) < SINGLE
    radius, half, _ = model.geom("capsule").size
    x, y, z = local("capsule", corners(robot, q, (wall, end, other))).T
    beyond = np.maximum(np.abs(z) - half, 0)
    reached = np.sqrt(x**2 + y**2 + beyond**2)[np.hypot(x, y) > SINGLE]  # without the middle of the cylinder's lids
    assert reached.max() == pytest.approx(radius, abs=SINGLE)
    assert z.max() == pytest.approx(half + radius, abs=SINGLE) == -z.min()
    x, y, z = local("cylinder", corners(robot, q, (cylinder,))).T
    assert (np.hypot(x, y).max(), z.max(), z.min()) == pytest.approx((0.04, 0.1, -0.1), abs=SINGLE)
    assert np.linalg.norm(local("ball", corners(robot, q, (ball,))), axis=1) == pytest.approx(0.06, abs=SINGLE)


def test_colours_are_those_of_geoms_or_of_their_materials(path: Path) -> None:
    box, wall, *_, mirrored = drawing(rd.load(path)).pieces
    assert box.rgba == pytest.approx((0.8, 0.1, 0.1, 1))
    assert wall.rgba == pytest.approx((0.1, 0.9, 0.1, 1))
    assert mirrored.rgba == pytest.approx((0.1, 0.1, 0.9, 0.5))


def test_a_body_shows_what_touches_nothing_where_it_has_both(path: Path) -> None:
    """Otherwise shapes for contacts would hide what is there to be seen."""
    path.write_text(ARM.replace('name="ball"', 'name="ball" contype="0" conaffinity="0"'), encoding="utf-8")
    (ball,) = drawing(rd.load(path)).pieces
    assert ball.pose[:3, 3] == pytest.approx((0.3, 0.1, 0))


def test_other_readers_of_urdf_have_the_shapes(path: Path, tmp_path: Path) -> None:
    """urdfdom, by Pinocchio, refuses all shapes of a link if it refuses one."""
    robot = rd.load(path)
    with pytest.warns(ModelWarning, match="gravity is not in the URDF"):
        written = str(robot.to_urdf(tmp_path / "arm.urdf"))
    model, kind = pinocchio.buildModelFromUrdf(written), pinocchio.GeometryType.VISUAL
    shapes = pinocchio.buildGeomFromUrdf(model, written, kind, package_dirs=[str(tmp_path)])
    assert shapes.ngeoms == len(drawing(robot).pieces)


def test_shapes_that_urdf_does_not_have_are_told(path: Path) -> None:
    """An ellipsoid is a sphere if its semi-axes are equal."""
    path.write_text(ARM.replace('type="sphere" size="0.06"', 'type="ellipsoid" size="0.06 0.05 0.06"'), "utf-8")
    with pytest.warns(ModelWarning, match="1 geoms of kind ellipsoid are not drawn"):
        robot = rd.load(path)
    path.write_text(ARM.replace('type="sphere" size="0.06"', 'type="ellipsoid" size="0.06 0.06 0.06"'), "utf-8")
    with warnings.catch_warnings(action="error"):
        assert len(drawing(rd.load(path)).pieces) == len(drawing(robot).pieces) + 1
