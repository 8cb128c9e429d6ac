"""M of robots read from MJCF, armature included, against MuJoCo's full matrix, at random states."""

from __future__ import annotations

import warnings
from argparse import ArgumentParser
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

import robot_dyn as rd
from robot_dyn.description.sources.mjcf import LEAVABLE
from robot_dyn.errors import ModelWarning, RobotDynError

STATES = 20
mujoco: Any = import_module("mujoco")  # which has no types


def difference(robot: rd.Robot, model: Any, rng: np.random.Generator) -> float:
    """The largest difference of M at a random state, in units √(M_ii M_jj); followers move as their coupling says."""
    data, full = mujoco.MjData(model), np.zeros((model.nv, model.nv))
    q, names = robot.random_configuration(rng), robot.body_names
    at = [model.joint(name) for name in names]
    data.qpos[:] = model.qpos0
    position, S = by_body(robot, q)
    for joint, value in zip(at, position, strict=True):
        data.qpos[joint.qposadr[0]] = value
    mujoco.mj_forward(model, data)
    mujoco.mj_fullM(model, data, full)
    v = [joint.dofadr[0] for joint in at]
    M, theirs = robot.M(q), S.T @ full[np.ix_(v, v)] @ S
    d = np.sqrt(np.diag(theirs))
    return float(np.abs((M - theirs) / np.outer(d, d)).max())


def by_body(robot: rd.Robot, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Positions of all joints in the order of `body_names`, and ∂ of them by q."""
    order = [tuple(robot.model.names)[1:].index(name) for name in robot.body_names]
    return robot.couplings.position(q)[order], np.asarray(robot.couplings.S)[order]


def main() -> None:
    parser = ArgumentParser(description=__doc__)
    parser.add_argument("files", nargs="+", help="MJCF files")
    parser.add_argument("--without", nargs="*", default=[], choices=LEAVABLE)
    options = parser.parse_args()
    warnings.simplefilter("ignore", ModelWarning)
    print("| file | joints | followers | largest difference of M |\n|---|--:|--:|--:|")
    for file in map(Path, options.files):
        try:
            robot = rd.load(file, without=options.without)
        except RobotDynError as error:
            print(f"| {file.name} | refused: {str(error).partition(': ')[2][:150]} |||", flush=True)
            continue
        rng, model = np.random.default_rng(1), mujoco.MjModel.from_xml_path(str(file))
        worst = max(difference(robot, model, rng) for _ in range(STATES))
        print(f"| {file.name} | {robot.n} | {len(robot.body_names) - robot.n} | {worst:.1e} |", flush=True)


if __name__ == "__main__":
    main()
