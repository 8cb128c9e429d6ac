"""Arms whose files have no usable inertia, loaded with inertia="from_shapes" and a total mass: how many then move.

An arm is a URDF or xacro file with 3 to 20 joints that move, of which one at least carries no mass in the file. It is
usable if the estimate is made, every joint that moves carries mass, and forward dynamics answers at a random state.
Arms with the same links, joints and masses are counted once. The rest is listed by cause.
"""

from __future__ import annotations

import warnings
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import numpy as np

import robot_dyn as rd
from benchmarks.measure import row, table
from robot_dyn.description.edits import Edits
from robot_dyn.description.structure import structure_of
from robot_dyn.foundations.errors import RobotDynError

SHARED = 20.0  # [kg], by the links without a mass of any arm: whether it moves does not depend on it
_NO_ROBOTS = ("macro", "gazebo", "ros2_control", "transmission", "srdf")


def main() -> None:
    from argparse import ArgumentParser

    parser = ArgumentParser(description=__doc__)
    parser.add_argument("repositories", type=Path, nargs="+", metavar="FOLDER", help="clones of repositories")
    warnings.simplefilter("ignore", rd.ModelWarning)
    table("repository", "arms without inertia", "shapes there", "usable")
    every, left = np.zeros(3, dtype=int), list[str]()
    for folder in parser.parse_args().repositories:
        outcomes = [(path, _outcome(path, folder)) for path in _arms(folder)]
        counts = Counter(what.split(":")[0] for _, what in outcomes)
        numbers = np.array(
            [len(outcomes), len(outcomes) - counts["no shape"] - counts["mesh missing"], counts["usable"]]
        )
        row(folder.name.replace("+", "/"), *map(str, numbers))
        every += numbers
        left += [f"{folder.name}: {path.name}: {what}" for path, what in outcomes if what != "usable"]
    row("all", *map(str, every))
    print("", *left, sep="\n")


def _load(path: Path, folder: Path, **options: object) -> rd.Robot:
    xacro = {"xacro": {}} if path.suffix == ".xacro" else {}
    return rd.load(path, package_dirs=[folder], **xacro, **options)  # pyright: ignore[reportArgumentType]


def _arms(folder: Path) -> Iterator[Path]:
    """Files of arms of which a body that moves has no mass, each robot once."""
    known = set[tuple[object, ...]]()
    for path in sorted((*folder.rglob("*.urdf"), *folder.rglob("*.xacro"))):
        if any(word in path.name for word in _NO_ROBOTS):
            continue
        try:
            robot = _load(path, folder)
        except RobotDynError:
            continue
        stated = structure_of(robot.description, Edits())
        key = (*((name, link.mass) for name, link in stated.links.items()), *map(str, stated.joints.values()))
        if key in known or not 3 <= len(stated.moving) <= 20:
            continue
        known.add(key)
        if any(not any(stated.links[name].mass for name in links) for links in stated.bodies.values()):
            yield path


def _outcome(path: Path, folder: Path) -> str:
    """Return "usable", or the cause why not: "mesh missing: …", "no shape: …", "refused: …"."""
    try:
        total = _load(path, folder).total_mass + SHARED
        robot = _load(path, folder, inertia="from_shapes", total_mass=total)
    except RobotDynError as error:
        told = str(error).rpartition(".urdf: ")[2]
        missing = "no file for" in told or "cannot be read (No such file" in told
        cause = "mesh missing" if missing else "no shape" if "could take a share" in told else "refused"
        return f"{cause}: {told[:160]}"
    rng = np.random.default_rng(0)
    q, v, tau = robot.random_configuration(rng), rng.uniform(-1, 1, robot.n), rng.uniform(-1, 1, robot.n)
    if massless := [each for each in robot.findings if "moves but has no mass" in each or "M is singular" in each]:
        return f"no shape: {massless[0]}"
    return "usable" if np.isfinite(robot.forward_dynamics(q, v, tau)).all() else "refused: forward dynamics"


if __name__ == "__main__":
    main()
