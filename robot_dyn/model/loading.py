"""Loading: a name or path → a Robot in standard gravity."""

from __future__ import annotations

import warnings
from collections.abc import Iterable
from pathlib import Path

from robot_dyn.errors import ModelWarning
from robot_dyn.model import catalog
from robot_dyn.model.description import read
from robot_dyn.model.robot import Robot


def load(name_or_path: str | Path, *, package_dirs: Iterable[str | Path] = ()) -> Robot:
    """A robot in standard gravity, by its name in the catalog, its path, or its package:// address.

    Args:
        name_or_path: One of `list_robots()`, or a URDF file.
        package_dirs: Folders in which packages are searched first; then those above the file and ROS_PACKAGE_PATH.

    Raises:
        CatalogError: If there is no such robot or file.
        DescriptionError: If the file is refused.

    Warns:
        ModelWarning: Once, if there are findings about the description; the robot loads all the same.
    """
    robot = Robot(read(catalog.find(name_or_path, package_dirs)))
    if found := robot.findings:
        more = f" (the first of {len(found)} findings; all of them: Robot.findings, robot-dyn info)"
        warnings.warn(f"{robot.name}: {found[0]}{more if len(found) > 1 else ''}", ModelWarning, stacklevel=2)
    return robot
