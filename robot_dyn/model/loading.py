"""Loading of robots by name or path, in standard gravity."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path

from robot_dyn.model.reading import STATED, read_file
from robot_dyn.model.robot import Robot


def load(
    name_or_path: str | Path,
    *,
    package_dirs: Iterable[str | Path] = (),
    xacro: Mapping[str, str | float | bool] | None = None,
    inertia: str = STATED,
    mass: Mapping[str, float] | None = None,
    total_mass: float | None = None,
    density: float | None = None,
    allow_overlap: bool = False,
    download: bool = False,
    without: Iterable[str] = (),
) -> Robot:
    """Load a robot in standard gravity, by its name in the catalog, its path, or its package:// address.

    Args:
        name_or_path: One of `list_robots()`, or a URDF file; or, if the package robot_descriptions is installed, a name
            such as "robot_descriptions:ur10e_description". For the text of a URDF use `Robot.from_text`.
        package_dirs: Folders in which packages are searched first, before the folders above the file, those next to
            its package, ROS_PACKAGE_PATH and AMENT_PREFIX_PATH.
        xacro: Expand the file by xacro, with these values of its arguments; {} for their defaults. A xacro file is a
            program: only expand files that you would run. Needs `pip install robot-dyn[xacro]`.
        inertia: "stated" to use the file as it is; or "from_shapes" to estimate missing inertias from the shapes of the
            links, which opens mesh files, with masses from the next three arguments. `Robot.estimated` lists these
            links; values stated by the file are not changed.
        mass: With "from_shapes": masses by link, in [kg].
        total_mass: With "from_shapes": mass of the whole robot with its base, in [kg]; links without a mass share the
            rest in proportion to the volume of their convex hulls.
        density: With "from_shapes": density in [kg/m³] of links without a mass, instead of `total_mass`.
        allow_overlap: With "from_shapes": accept meshes whose closed parts overlap, and count the common volume once
            per part; by default they are refused, because their mass is ambiguous.
        download: Allow robot_descriptions to download missing files.
        without: Elements to leave out of an MJCF file, from "tendon", "equality", "free" and "ball"; findings list
            them. MJCF, in a file with suffix .xml or .mjcf, is compiled by MuJoCo, which opens its meshes; needs
            `pip install robot-dyn[mjcf]`.

    Raises:
        CatalogError: If there is no such robot or file, an entry of `package_dirs` is not a folder, or a description
            has not been downloaded.
        MissingExtraError: If robot_descriptions is needed but not installed: pip install 'robot-dyn[robots]'.
        DescriptionError: If the file is refused or cannot be expanded, or a shape needed for an estimate cannot be
            read.
        QueryError: If an estimate lacks a mass, or a given mass is not positive, already stated by the file, or of an
            unknown link.

    Warns:
        ModelWarning: Once, if there are findings about the description; the robot is loaded anyway.
    """
    description, edits = read_file(
        name_or_path, package_dirs=package_dirs, xacro=xacro, inertia=inertia, mass=mass, total_mass=total_mass,
        density=density, allow_overlap=allow_overlap, download=download, without=without,
    )  # fmt: skip
    return Robot(description, edits).announced()
