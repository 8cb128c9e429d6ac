"""Reading: maps a name or path to a checked description, and to the edits that an MJCF file states."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path

from robot_dyn.description import catalog
from robot_dyn.description.description import Description, check, read
from robot_dyn.description.edits import Edits
from robot_dyn.description.packages import searched
from robot_dyn.description.sources import mjcf, robot_descriptions
from robot_dyn.description.sources.mjcf import is_mjcf
from robot_dyn.description.sources.xacro import expand
from robot_dyn.description.structure import structure_of
from robot_dyn.foundations.errors import CatalogError, DescriptionError, QueryError
from robot_dyn.foundations.validate import choice, truth

STATED, FROM_SHAPES = "stated", "from_shapes"


def read_file(
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
) -> tuple[Description, Edits]:
    """Return the description and edits of a file, in which no joint need move; see `load`."""
    choice("inertia", inertia, (STATED, FROM_SHAPES))
    has_masses = any(value is not None for value in (mass, total_mass, density)) or truth(
        "allow_overlap", allow_overlap
    )
    if inertia == STATED and has_masses:
        raise QueryError(
            f"mass, total_mass, density and allow_overlap need inertia={FROM_SHAPES!r}; add it, or remove them"
        )
    package_dirs, without = searched(package_dirs), mjcf.leavable(without)
    if isinstance(name_or_path, str) and name_or_path.startswith(robot_descriptions.PREFIX):
        described = robot_descriptions.find(name_or_path, truth("download", download))
        path, xacro = described.path, described.expansion(xacro)
        package_dirs = (*package_dirs, *described.package_dirs)
    elif truth("download", download):
        raise CatalogError("download=True needs a name such as robot_descriptions:ur10e_description; remove it")
    else:
        path = catalog.find(name_or_path, package_dirs)
    if xacro is None and is_mjcf(path):
        return _compiled(path, without, inertia)
    if without:
        raise DescriptionError(f"{path}: without={set(without)} applies to MJCF files only; remove it")
    description = read(path) if xacro is None else _expanded(path, xacro, package_dirs)
    if inertia == FROM_SHAPES:
        from robot_dyn.shapes.estimate import with_estimates
        from robot_dyn.shapes.masses import Masses

        masses = Masses({} if mass is None else mass, total_mass, density, allow_overlap)
        description = with_estimates(description, masses, package_dirs)
    return description, Edits()


def _expanded(path: Path, xacro: Mapping[str, str | float | bool], package_dirs: tuple[Path, ...]) -> Description:
    """Return the description of an expanded xacro file."""
    text, warnings, _ = expand(path, xacro, package_dirs)
    return check(text, source=str(path), findings=warnings)


def _compiled(path: Path, without: frozenset[str], inertia: str) -> tuple[Description, Edits]:
    """Return the description of an MJCF file, whose compiler derives missing inertias from shapes by its own rules."""
    if inertia != STATED:
        raise QueryError(
            "inertia='from_shapes' applies to URDF only: MuJoCo itself computes inertias missing from MJCF; remove it"
        )
    compiled = mjcf.read(path, without)
    description = check(compiled.urdf, source=str(path), findings=compiled.findings)
    joints = structure_of(description, Edits()).free
    return description, Edits().with_(joints, **compiled.edits(joints))
