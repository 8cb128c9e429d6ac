"""Loading: a name or path → a Robot in standard gravity."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path

from robot_dyn.description import catalog
from robot_dyn.description.description import Description, check, read
from robot_dyn.description.packages import searched
from robot_dyn.description.sources import mjcf, robot_descriptions
from robot_dyn.description.sources.mjcf import is_mjcf
from robot_dyn.description.sources.xacro import expand
from robot_dyn.foundations.errors import CatalogError, DescriptionError, QueryError
from robot_dyn.foundations.validate import choice, truth
from robot_dyn.model.robot import Robot

STATED, FROM_SHAPES = "stated", "from_shapes"


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
    """A robot in standard gravity, by its name in the catalog, its path, or its package:// address.

    Args:
        name_or_path: One of `list_robots()`, or a URDF file; or, where the package robot_descriptions is installed, a
            name such as "robot_descriptions:ur10e_description". `Robot.from_text` takes the text of a URDF.
        package_dirs: Folders in which packages are searched first; then those above the file, those beside its package,
            ROS_PACKAGE_PATH and AMENT_PREFIX_PATH.
        xacro: Expand the file by xacro, with these values of its arguments; {} for their defaults. A xacro file is a
            program: expand none that you would not run. Needs `pip install robot-dyn[xacro]`.
        inertia: "stated", as in the file; or "from_shapes": links without one get that of their shape, which opens mesh
            files, and a mass from the next three. `Robot.estimated` names them; what the file states stays.
        mass: With "from_shapes": masses by link, in [kg].
        total_mass: With "from_shapes": mass of the whole robot with its base, in [kg]; what the known masses leave is
            shared by the volume of convex hulls.
        density: With "from_shapes": in [kg/m³], of links whose mass is not known otherwise, in place of `total_mass`.
        allow_overlap: With "from_shapes": whether the space that several closed parts of a mesh fill counts as often as
            they do; without it such a mesh is refused, since its mass is not known.
        download: Whether robot_descriptions may download what is not on disk.
        without: What is left out of a file of MJCF, of "tendon", "equality", "free" and "ball"; findings name it. MJCF,
            in a file that ends with .xml or .mjcf, is compiled by MuJoCo, which opens its meshes; needs
            `pip install robot-dyn[mjcf]`.

    Raises:
        CatalogError: If there is no such robot or file, an entry of `package_dirs` is not a folder, or a description
            is not on disk.
        MissingExtraError: If robot_descriptions is asked for and not installed: pip install 'robot-dyn[robots]'.
        DescriptionError: If the file is refused, or cannot be expanded, or the shape of a link without inertia cannot
            be read.
        QueryError: If no mass is given for an estimate, or one that is not positive, known already or of no link.

    Warns:
        ModelWarning: Once, if there are findings about the description; the robot loads all the same.
    """
    choice("inertia", inertia, (STATED, FROM_SHAPES))
    given = any(each is not None for each in (mass, total_mass, density)) or truth("allow_overlap", allow_overlap)
    if inertia == STATED and given:
        raise QueryError(
            f"mass, total_mass, density and allow_overlap are for inertia={FROM_SHAPES!r}; add it, or leave them out"
        )
    package_dirs, without = searched(package_dirs), mjcf.leavable(without)
    if isinstance(name_or_path, str) and name_or_path.startswith(robot_descriptions.PREFIX):
        described = robot_descriptions.find(name_or_path, truth("download", download))
        path, xacro = described.path, described.expansion(xacro)
        package_dirs = (*package_dirs, *described.package_dirs)
    elif truth("download", download):
        raise CatalogError("download=True is for names such as robot_descriptions:ur10e_description; leave it out")
    else:
        path = catalog.find(name_or_path, package_dirs)
    if xacro is None and is_mjcf(path):
        return _compiled(path, without, inertia)
    if without:
        raise DescriptionError(f"{path}: without={set(without)} is for files of MJCF; leave it out")
    description = read(path) if xacro is None else _expanded(path, xacro, package_dirs)
    if inertia == FROM_SHAPES:
        from robot_dyn.shapes.estimate import with_estimates
        from robot_dyn.shapes.masses import Masses

        masses = Masses({} if mass is None else mass, total_mass, density, allow_overlap)
        description = with_estimates(description, masses, package_dirs)
    return Robot(description).announced()


def _expanded(path: Path, xacro: Mapping[str, str | float | bool], package_dirs: tuple[Path, ...]) -> Description:
    text, warnings = expand(path, xacro, package_dirs)
    return check(text, source=str(path), findings=warnings)


def _compiled(path: Path, without: frozenset[str], inertia: str) -> Robot:
    """The robot of a file of MJCF, whose compiler takes inertias from shapes by its own rules."""
    if inertia != STATED:
        raise QueryError(
            "inertia='from_shapes' is for URDF: MuJoCo takes those that a file of MJCF lacks; leave it out"
        )
    compiled = mjcf.read(path, without)
    robot = Robot(check(compiled.urdf, source=str(path), findings=compiled.findings))
    return robot.with_(**compiled.edits(robot.joint_names)).announced()
