"""MJCF through MuJoCo's compiler: the robot that is read has M, N, C v, frames and limits of MuJoCo itself."""

from __future__ import annotations

import sys
import warnings
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn import ModelWarning
from robot_dyn.foundations import DescriptionError, MissingExtraError
from robot_dyn.simulation import robot_of
from tests.hostile.kinds import ARM as URDF

mujoco: Any = import_module("mujoco")  # which has no types
# joints beside the origins of their bodies, several of one body, references, moments of shapes, defaults, a follower
ARM = """<mujoco model="arm">
  <compiler angle="radian" autolimits="true"/>
  <option gravity="0.3 -0.2 -9.7"/>
  <default><joint damping="0.3"/><default class="small"><joint armature="0.013" frictionloss="0.2"/></default></default>
  <worldbody>
    <body name="base" pos="0.1 0 0.2" euler="0.1 0.2 -0.3">
      <geom type="box" size="0.1 0.1 0.05"/>
      <body name="upper" pos="0 0.05 0.1" quat="0.9 0.1 -0.3 0.2">
        <joint name="shoulder" pos="0.02 -0.01 0.03" axis="0.2 1 0.4" range="-1.5 2" ref="0.3" armature="0.05"/>
        <joint name="twist" pos="0 0.02 0" axis="1 0 0.1" class="small"/>
        <geom type="capsule" fromto="0 0 0 0.3 0.02 0.1" size="0.03" density="700"/>
        <body name="slider" pos="0.3 0.02 0.1" euler="0.4 0 0.2">
          <joint name="slide" type="slide" pos="0.1 0 0" axis="0.1 0.2 1" range="-0.1 0.3" ref="0.05" class="small"/>
          <inertial pos="0.01 0.02 0.05" mass="0.7" fullinertia="0.003 0.004 0.002 0.0002 -0.0003 0.0001"/>
          <body name="tool" pos="0 0 0.1">
            <geom type="ellipsoid" size="0.03 0.02 0.05"/>
            <body name="left" pos="0 0.02 0.05">
              <joint name="left" axis="1 0 0" pos="0 0 -0.01" armature="0.02"/>
              <geom type="cylinder" size="0.01 0.04"/>
            </body>
            <body name="right" pos="0 -0.02 0.05">
              <joint name="right" axis="1 0.1 0" ref="0.1" armature="0.03"/>
              <geom type="cylinder" size="0.012 0.03"/>
            </body>
          </body>
        </body>
      </body>
    </body>
  </worldbody>
  <equality><joint name="couple" joint1="right" joint2="left" polycoef="0.05 -0.8 0 0 0"/></equality>
  <actuator>
    <motor joint="shoulder" gear="50" ctrlrange="-2 2" armature="1e-5" damping="2e-5"/>
    <position joint="twist" kp="20" forcerange="-7 7"/>
    <motor joint="slide" ctrlrange="-1 3"/>
  </actuator>
</mujoco>
"""
STATES = 20
ROUNDING = 1e-12


def written(folder: Path, text: str) -> Path:
    path = folder / "arm.xml"
    path.write_text(text, encoding="utf-8")
    return path


def loaded(path: Path, **options) -> rd.Robot:
    with warnings.catch_warnings(action="ignore", category=ModelWarning):
        return rd.load(path, **options)


class Theirs:
    """MuJoCo at a state of the robot: all joints where the couplings put them."""

    def __init__(self, path: Path, robot: rd.Robot, q: np.ndarray, v: np.ndarray) -> None:
        self.model = mujoco.MjModel.from_xml_path(str(path))
        self.data = mujoco.MjData(self.model)
        names = tuple(robot.model.names)[1:]
        joints = [self.model.joint(name) for name in names]
        self.dofs = [joint.dofadr[0] for joint in joints]
        self.S = np.asarray(robot.couplings.S)
        self.data.qpos[[joint.qposadr[0] for joint in joints]] = robot.couplings.position(q)
        self.data.qvel[self.dofs] = self.S @ v
        mujoco.mj_forward(self.model, self.data)

    @property
    def M(self) -> np.ndarray:
        full = np.zeros((self.model.nv, self.model.nv))
        mujoco.mj_fullM(self.model, self.data, full)
        return self.S.T @ full[np.ix_(self.dofs, self.dofs)] @ self.S

    @property
    def bias(self) -> np.ndarray:
        return self.S.T @ self.data.qfrc_bias[self.dofs]


def test_M_with_armature_and_the_torques_are_those_of_mujoco(tmp_path: Path) -> None:
    """Also of a follower, q_right − 0.1 = 0.05 − 0.8 q_left, whose armature is felt at the joint that it follows."""
    path, rng = written(tmp_path, ARM), np.random.default_rng(2)
    robot = loaded(path)
    assert robot.joint_names == ("shoulder", "twist", "slide", "left")
    for _ in range(STATES):
        q, v = robot.random_configuration(rng), rng.standard_normal(robot.n)
        theirs = Theirs(path, robot, q, v)
        d = np.sqrt(np.diag(theirs.M))
        assert np.abs((robot.M(q) - theirs.M) / np.outer(d, d)).max() <= ROUNDING
        ours = robot.inverse_dynamics(q, v, np.zeros(robot.n))
        assert np.abs((ours - theirs.bias) / d).max() <= ROUNDING * np.abs(theirs.bias / d).max()


def test_the_frames_of_bodies_are_those_of_mujoco(tmp_path: Path) -> None:
    path, rng = written(tmp_path, ARM), np.random.default_rng(3)
    robot = loaded(path)
    q = robot.random_configuration(rng)
    theirs = Theirs(path, robot, q, np.zeros(robot.n))
    for name in ("base", "upper", "slider", "tool", "left", "right"):
        body, g = theirs.data.body(name), robot.placement(q, name)
        assert np.abs(g[:3, 3] - body.xpos).max() < ROUNDING
        assert np.abs(g[:3, :3].ravel() - body.xmat).max() < ROUNDING


def test_ranges_friction_and_limits_of_actuators_are_those_of_the_file(tmp_path: Path) -> None:
    """A motor by its control range and gear, a servo by its force range; one that is not symmetric has none."""
    with pytest.warns(ModelWarning, match="'slide'.* -1 to 3, different in the two directions; no effort limit"):
        robot = rd.load(written(tmp_path, ARM))
    assert np.array_equal(robot.lower, [-1.5, -np.inf, -0.1, -np.inf])
    assert np.array_equal(robot.upper, [2, np.inf, 0.3, np.inf])
    assert np.array_equal(robot.effort_limit, [100, 7, np.inf, np.inf])
    assert np.allclose(robot.damping, [0.3 + 50**2 * 2e-5, 0.3, 0.3, 0.3 * (1 + 0.8**2)], rtol=1e-15)
    assert np.array_equal(robot.friction, [0, 0.2, 0.2, 0])
    assert np.allclose(robot.armature, [0.05 + 50**2 * 1e-5, 0.013, 0.013, 0.02 + 0.8**2 * 0.03], rtol=1e-15)
    assert robot.edits.gravity == (0.3, -0.2, -9.7)


FLAGS = '<flag gravity="disable" equality="disable" damper="disable" frictionloss="disable"/>'


def test_flags_of_a_file_switch_off_what_they_name(tmp_path: Path) -> None:
    """As in MuJoCo: no gravity, no coupling of joints, no damping of joints and no dry friction."""
    text = ARM.replace('-9.7"/>', f'-9.7">{FLAGS}</option>').replace('damping="2e-5"', "")
    path, rng = written(tmp_path, text), np.random.default_rng(4)
    robot = loaded(path)
    assert robot.joint_names == ("shoulder", "twist", "slide", "left", "right")
    assert robot.edits.gravity == (0.0, 0.0, 0.0)
    q, v = robot.random_configuration(rng), rng.standard_normal(robot.n)
    theirs = Theirs(path, robot, q, v)
    ours = robot.inverse_dynamics(q, v, np.zeros(robot.n))
    assert np.abs(ours - theirs.bias).max() <= ROUNDING * np.abs(theirs.bias).max()
    passive = theirs.data.qfrc_passive[theirs.dofs]
    assert not robot.damping.any() and not passive.any()
    assert not robot.friction.any() and not theirs.data.nefc


FREE = '<body name="ball" pos="1 0 0"><{} name="loose"/><geom size="0.1"/></body></worldbody>'
TENDON = '<tendon><fixed name="cable"><joint joint="left" coef="1"/><joint joint="twist" coef="1"/></fixed></tendon>'
LEFT_OUT = {
    "tendon": (("</mujoco>", TENDON + "</mujoco>"), "tendon 'cable'"),
    "free": (("</worldbody>", FREE.format("freejoint")), "joint 'loose': is a free joint"),
    "ball": (("</worldbody>", FREE.format('joint type="ball"')), "joint 'loose': is a ball joint"),
}
EQUALITIES = {
    "quadratic": ('polycoef="0.05 -0.8 0 0 0"', 'polycoef="0.05 -0.8 0.1 0 0"', "equality 'couple'"),
    "of one joint": ('joint2="left" polycoef="0.05 -0.8 0 0 0"', 'polycoef="0.05 0 0 0 0"', "equality 'couple'"),
    "weld": ("</equality>", '<weld name="w" body1="left" body2="right"/></equality>', "equality 'w'"),
    "connect": ("</equality>", '<connect name="c" body1="left" body2="right" anchor="0 0 0"/></equality>', "'c'"),
    "two of a joint": ("</equality>", '<joint name="e" joint1="right" joint2="twist"/></equality>', "follows another"),
}
OTHERS = LEFT_OUT | {name: ((old, new), said) for name, (old, new, said) in EQUALITIES.items()}


@pytest.mark.parametrize("name", OTHERS)
def test_what_is_not_a_tree_of_hinges_and_slides_is_refused_by_name_or_left_out_and_told(
    name: str, tmp_path: Path
) -> None:
    (old, new), said = OTHERS[name]
    path, what = written(tmp_path, ARM.replace(old, new)), name if name in LEFT_OUT else "equality"
    with pytest.raises(DescriptionError, match=rf"{said}.*without=\{{'{what}'\}}"):
        rd.load(path)
    robot = loaded(path, without={what})
    (told,) = [each for each in robot.findings if "left out" in each]
    assert said in told
    q = robot.random_configuration(np.random.default_rng(5))
    theirs = Theirs(path, robot, q, np.zeros(robot.n))
    d = np.sqrt(np.diag(theirs.M))
    assert np.abs((robot.M(q) - theirs.M) / np.outer(d, d)).max() <= ROUNDING


def test_a_run_of_it_is_read_again(tmp_path: Path) -> None:
    """Its description is the URDF that was made, its armature and gravity are edits."""
    robot = loaded(written(tmp_path, ARM))
    plant = rd.Plant(robot, [rd.effects.ViscousFriction(robot.damping)])
    run = rd.simulate(rd.Setup(plant, np.zeros(4), np.zeros(4), duration_s=0.01))
    q = np.array([0.1, 0.2, 0.05, -0.3])
    again = robot_of(rd.read(run.save(tmp_path / "run.npz")))
    assert np.array_equal(again.M(q), robot.M(q))
    assert again.edits.gravity == robot.edits.gravity


def test_errors_name_the_file_and_the_remedy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = written(tmp_path, ARM.replace('type="capsule"', 'type="capsul"'))
    with pytest.raises(DescriptionError, match=r"arm\.xml: MuJoCo rejects it: .*capsul"):
        rd.load(path)
    for wrong in ("tendon", {"tendons"}, 3):
        with pytest.raises(DescriptionError, match="without must be a set of tendon, equality, free, ball"):
            rd.load(written(tmp_path, ARM), without=wrong)  # pyright: ignore[reportArgumentType]
    (tmp_path / "arm.urdf").write_text(URDF, encoding="utf-8")
    with pytest.raises(DescriptionError, match="applies to MJCF files only"):
        rd.load(tmp_path / "arm.urdf", without={"tendon"})
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with pytest.raises(MissingExtraError, match=r"robot-dyn\[mjcf\]"):
        rd.load(path)


def test_warnings_of_mujoco_are_findings_and_leave_no_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """MuJoCo itself would write them to MUJOCO_LOG.TXT in the current directory; a handler of the user's stays."""
    mine: list[str] = []
    mujoco.set_mju_user_warning(mine.append)
    here = tmp_path / "here"
    here.mkdir()
    monkeypatch.chdir(here)
    try:
        with pytest.warns(ModelWarning, match="MuJoCo warns: .*settotalmass"):
            robot = rd.load(written(tmp_path, ARM.replace("<compiler ", '<compiler settotalmass="4" ')))
        assert mujoco.get_mju_user_warning() == mine.append
    finally:
        mujoco.set_mju_user_warning(None)
    assert robot.total_mass == pytest.approx(4, rel=1e-12)  # up to rounding
    assert [*here.iterdir()] == [] == mine


@pytest.mark.parametrize(
    "body",
    [
        '<geom type="sphere" size="0.1" mass="inf"/>',
        '<geom type="sphere" size="0.1" density="inf"/>',
        '<geom type="sphere" size="1e200"/>',
        '<inertial pos="0 0 0" mass="inf" diaginertia="inf inf inf"/>',
        '<inertial pos="0 0 0" quat="1 1 0 0" mass="1" diaginertia="inf inf inf"/>',
    ],
)
def test_an_infinite_mass_is_refused_without_a_warning_of_numpy(tmp_path: Path, body: str) -> None:
    joint = '<joint name="j" type="hinge" axis="0 0 1"/>'
    path = tmp_path / "arm.xml"
    path.write_text(f"<mujoco><worldbody><body>{joint}{body}</body></worldbody></mujoco>")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        with pytest.raises(DescriptionError):
            rd.load(path)
