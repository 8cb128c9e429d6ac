"""MuJoCo, Drake and PyBullet behind the queries of a robot, each with its own reader, where it is installed."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator
from importlib import import_module
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np
from lxml import etree  # pyright: ignore[reportAttributeAccessIssue]

import robot_dyn as rd
from robot_dyn.accuracy import PeerError, bare_urdf, mujoco_model


class MuJoCo:
    """Its M, bias and accelerations, with the constraint solver off."""

    def __init__(self, robot: rd.Robot) -> None:
        self.module: Any = import_module("mujoco")
        self.model = mujoco_model(self.module, robot, bare=True)
        self.data = self.module.MjData(self.model)
        self.at = [self.model.joint(name).dofadr[0] for name in robot.joint_names]

    def _forward(self, q: np.ndarray, v: np.ndarray, tau: np.ndarray) -> None:
        self.module.set_mju_user_warning(lambda _: None)
        self.module.mj_resetData(self.model, self.data)
        self.data.qpos[self.at], self.data.qvel[self.at], self.data.qfrc_applied[self.at] = q, v, tau
        self.module.mj_forward(self.model, self.data)
        self.module.set_mju_user_warning(None)

    def M(self, q: np.ndarray) -> np.ndarray:
        self._forward(q, 0 * q, 0 * q)
        M = np.zeros((len(q), len(q)))
        self.module.mj_fullM(self.model, self.data, M)
        return M[np.ix_(self.at, self.at)]

    def inverse_dynamics(self, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
        self._forward(q, v, 0 * q)
        self.data.qacc[self.at] = a
        tau = np.zeros(self.model.nv)
        self.module.mj_rne(self.model, self.data, 1, tau)
        return tau[self.at]

    def forward_dynamics(self, q: np.ndarray, v: np.ndarray, tau: np.ndarray) -> np.ndarray:
        self._forward(q, v, tau)
        return self.data.qacc[self.at].copy()


class Drake:
    """Its continuous multibody plant."""

    def __init__(self, robot: rd.Robot, damping: float = 0.0) -> None:
        tree, parsing, math = (import_module(f"pydrake.{x}") for x in ("multibody.plant", "multibody.parsing", "math"))
        self.spatial: Any = import_module("pydrake.multibody.tree")
        self.plant: Any = tree.MultibodyPlant(time_step=0.0)
        try:
            parsing.Parser(self.plant).AddModelsFromString(etree.tostring(bare_urdf(robot), encoding="unicode"), "urdf")
            root = self.plant.GetFrameByName(next(iter(robot.frame_names)))
            if root.name() != "world":
                self.plant.WeldFrames(self.plant.world_frame(), root, math.RigidTransform())
            self.plant.mutable_gravity_field().set_gravity_vector(np.array(robot.edits.gravity))
            for name in robot.joint_names:
                self.plant.GetJointByName(name).set_default_damping_vector([damping])
            self.plant.Finalize()
        except (RuntimeError, ValueError) as error:
            raise PeerError(" ".join(str(error).split())[:200]) from None
        self.context = self.plant.CreateDefaultContext()
        self.at = [self.plant.GetJointByName(name).position_start() for name in robot.joint_names]

    def _at(self, q: np.ndarray, v: np.ndarray) -> None:
        x = np.empty((2, len(q)))
        x[0, self.at], x[1, self.at] = q, v
        self.plant.SetPositionsAndVelocities(self.context, x.ravel())

    def M(self, q: np.ndarray) -> np.ndarray:
        self._at(q, 0 * q)
        return self.plant.CalcMassMatrix(self.context)[np.ix_(self.at, self.at)]

    def inverse_dynamics(self, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
        self._at(q, v)
        full, forces = np.empty(len(q)), self.spatial.MultibodyForces(self.plant)
        full[self.at] = a
        self.plant.CalcForceElementsContribution(self.context, forces)
        return self.plant.CalcInverseDynamics(self.context, full, forces)[self.at]

    def forward_dynamics(self, q: np.ndarray, v: np.ndarray, tau: np.ndarray) -> np.ndarray:
        self._at(q, v)
        full = np.empty(len(q))
        full[self.at] = tau
        self.plant.get_applied_generalized_force_input_port().FixValue(self.context, full)
        return self.plant.EvalTimeDerivatives(self.context).get_generalized_velocity().CopyToVector()[self.at]


class PyBullet:
    """Its mass matrix and inverse dynamics; it gives no accelerations."""

    def __init__(self, robot: rd.Robot) -> None:
        self.module: Any = import_module("pybullet")
        self.client = self.module.connect(self.module.DIRECT)
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "arm.urdf"
            path.write_bytes(etree.tostring(_filled_in(bare_urdf(robot))))
            try:
                flags = self.module.URDF_USE_INERTIA_FROM_FILE
                self.body = self.module.loadURDF(str(path), useFixedBase=True, flags=flags, physicsClientId=self.client)
            except self.module.error as error:
                raise PeerError(str(error)) from None
        self.module.setGravity(*robot.edits.gravity, physicsClientId=self.client)
        moving = [
            info[1].decode()
            for i in range(self.module.getNumJoints(self.body, physicsClientId=self.client))
            if (info := self.module.getJointInfo(self.body, i, physicsClientId=self.client))[2]
            != self.module.JOINT_FIXED
        ]
        self.at = [moving.index(name) for name in robot.joint_names]
        self.back = np.argsort(self.at)

    def M(self, q: np.ndarray) -> np.ndarray:
        M = np.array(self.module.calculateMassMatrix(self.body, list(q[self.back]), physicsClientId=self.client))
        return M[np.ix_(self.at, self.at)]

    def inverse_dynamics(self, q: np.ndarray, v: np.ndarray, a: np.ndarray) -> np.ndarray:
        asked = [list(x[self.back]) for x in (q, v, a)]
        tau = self.module.calculateInverseDynamics(self.body, *asked, physicsClientId=self.client)
        return np.array(tau)[self.at]


def _filled_in(urdf: Any) -> Any:
    """The file with zeros written out, since a link without inertial would be taken as 1 kg, and with limits."""
    for joint in urdf.iter("joint"):
        if joint.get("type") == "prismatic":
            etree.SubElement(joint, "limit", lower="-1e9", upper="1e9", effort="1e9", velocity="1e9")
    for link in urdf.iter("link"):
        if link.find("inertial") is None:
            inertial = etree.SubElement(link, "inertial")
            etree.SubElement(inertial, "mass", value="0")
            etree.SubElement(inertial, "inertia", **dict.fromkeys(("ixx", "ixy", "ixz", "iyy", "iyz", "izz"), "0"))
    return urdf


ENGINES: dict[str, Callable[[rd.Robot], Any]] = {"mujoco": MuJoCo, "drake": Drake, "pybullet": PyBullet}
_NAMES = {"mujoco": "MuJoCo", "drake": "Drake", "pybullet": "PyBullet"}


def installed() -> Iterator[tuple[str, Callable[[rd.Robot], Any]]]:
    """Name with version, and how it is given a robot."""
    for package, engine in ENGINES.items():
        try:
            yield f"{_NAMES[package]} {version(package)}", engine
        except PackageNotFoundError:
            continue
