"""Loading: a name or path → a Robot in standard gravity."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path

from robot_dyn.description import catalog
from robot_dyn.description.description import check, read
from robot_dyn.description.packages import searched
from robot_dyn.model.robot import Robot


def load(
    name_or_path: str | Path,
    *,
    package_dirs: Iterable[str | Path] = (),
    xacro: Mapping[str, str | float | bool] | None = None,
) -> Robot:
    """A robot in standard gravity, by its name in the catalog, its path, or its package:// address.

    Args:
        name_or_path: One of `list_robots()`, or a URDF file. `Robot.from_text` takes the text of one.
        package_dirs: Folders in which packages are searched first; then those above the file, those beside its package,
            ROS_PACKAGE_PATH and AMENT_PREFIX_PATH.
        xacro: Expand the file by xacro, with these values of its arguments; {} for their defaults. A xacro file is a
            program: expand none that you would not run. Needs `pip install robot-dyn[xacro]`.

    Raises:
        CatalogError: If there is no such robot or file, or an entry of `package_dirs` is not a folder.
        DescriptionError: If the file is refused, or cannot be expanded.

    Warns:
        ModelWarning: Once, if there are findings about the description; the robot loads all the same.
    """
    package_dirs = searched(package_dirs)
    path = catalog.find(name_or_path, package_dirs)
    if xacro is None:
        description = read(path)
    else:
        from robot_dyn.description.xacro import expand

        text, warnings = expand(path, xacro, package_dirs)
        description = check(text, source=str(path), findings=warnings)
    return Robot(description).announced()
