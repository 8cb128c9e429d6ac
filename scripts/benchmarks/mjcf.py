"""M of robots read from MJCF, armature included, against MuJoCo's full matrix, at random states.

Mesh files that are missing are left out with their geoms where every body that has one states its inertia: the meshes
of such bodies do not enter M. A file in which another body has one is refused.
"""

from __future__ import annotations

import warnings
from argparse import ArgumentParser
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

import robot_dyn as rd
from robot_dyn.description.sources.mjcf import LEAVABLE
from robot_dyn.foundations.errors import ModelWarning, RobotDynError

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


def without_missing_meshes(file: Path, folder: Path) -> tuple[Path, int]:
    """The file, or one in `folder` without the meshes whose files are missing, and their number.

    Raises:
        ValueError: If a body with such a mesh does not state its inertia.
    """
    spec = mujoco.MjSpec.from_file(str(file))
    spec.meshdir = str((file.parent / spec.meshdir).absolute())
    spec.texturedir = str((file.parent / spec.texturedir).absolute())
    missing = [mesh for mesh in spec.meshes if mesh.file and not (Path(spec.meshdir) / mesh.file).is_file()]
    for mesh in missing:
        name = mesh.name or Path(mesh.file).stem
        for geom in [geom for geom in spec.geoms if geom.meshname == name]:
            if geom.parent.name != "world" and not geom.parent.explicitinertial:
                raise ValueError(
                    f"body {geom.parent.name!r} takes its inertia from the mesh {mesh.file}, which is missing"
                )
            spec.delete(geom)
        spec.delete(mesh)
    for texture in [each for each in spec.textures if each.file]:  # of colours alone
        if not (Path(spec.texturedir) / texture.file).is_file():
            spec.delete(texture)
    if not missing:
        return file, 0
    spec.compile()
    spec.to_file(str(folder / file.name))
    return folder / file.name, len(missing)


def rows(files: list[Path], without: list[str], folder: Path) -> Iterator[str]:
    yield "| file | joints | followers | largest difference of M | left out |\n|---|--:|--:|--:|---|"
    for given in files:
        try:
            file, missing = without_missing_meshes(given, folder)
            robot = rd.load(file, without=without)
            model = mujoco.MjModel.from_xml_path(str(file))
        except (RobotDynError, ValueError) as error:
            yield f"| {given} | refused: {' '.join(str(error).removeprefix(f'{given}: ').split())[:150]} ||||"
            continue
        rng = np.random.default_rng(1)
        worst = max(difference(robot, model, rng) for _ in range(STATES))
        left = [each.partition(":")[0] for each in robot.findings if each.endswith("left out")]
        left += [f"{missing} mesh files, missing"] if missing else []
        yield f"| {given} | {robot.n} | {len(robot.body_names) - robot.n} | {worst:.1e} | {', '.join(left)} |"


def main() -> None:
    parser = ArgumentParser(description=__doc__)
    parser.add_argument("files", nargs="+", help="MJCF files", type=Path)
    parser.add_argument("--without", nargs="*", default=[], choices=LEAVABLE)
    options = parser.parse_args()
    warnings.simplefilter("ignore", ModelWarning)
    mujoco.set_mju_user_warning(lambda _: None)  # which otherwise go to a file in the current directory
    with TemporaryDirectory() as folder:
        for row in rows(options.files, options.without, Path(folder)):
            print(row, flush=True)


if __name__ == "__main__":
    main()
