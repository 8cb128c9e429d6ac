"""ROS packages: maps the name of a package to its folder.

A package is a folder of that name, or a folder whose package.xml has that <name>.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Iterator
from contextlib import suppress
from itertools import islice
from pathlib import Path

from robot_dyn.foundations.errors import CatalogError, shown

_MAX_BYTES = 2**16  # largest size of a package.xml
_MAX_FOLDERS = 5000  # searched below one folder
_DEPTH = 3  # largest depth of packages below a searched folder, as in src/repository/package
_COMMENT = re.compile(rb"<!--.*?(-->|\Z)", re.DOTALL)
_NAME = re.compile(rb"<name[^<>]*>\s*([^<\s]+)\s*</name>")


def searched(package_dirs: Iterable[str | Path]) -> tuple[Path, ...]:
    """Return the folders in which a user wants packages to be searched.

    Raises:
        CatalogError: If one is not a folder, or a single path is given instead of several.
    """
    if isinstance(package_dirs, str | Path):
        raise CatalogError(f"package_dirs must be a list of folders, for example [{str(package_dirs)!r}], got one path")
    try:
        folders = tuple(Path(folder).expanduser() for folder in package_dirs)
        missing = [folder for folder in folders if not folder.is_dir()]
    except (TypeError, RuntimeError, ValueError, OSError):  # not paths; no such user; a NUL
        raise CatalogError(
            f"package_dirs must be a list of folders, for example ['/opt/arms'], got {shown(package_dirs)}"
        ) from None
    if missing:
        raise CatalogError(f"package_dirs: there is no folder {missing[0]}; correct or remove it")
    return folders


def package_folders(name: str, file: Path, package_dirs: Iterable[str | Path] = ()) -> Iterator[Path]:
    """Return candidate folders of a package, nearest first; some may not exist.

    The search covers `package_dirs` with their subfolders, the folders above `file`, the folders next to the package of
    `file`, then ROS_PACKAGE_PATH and AMENT_PREFIX_PATH.
    """
    above = file.absolute().parents
    for folder in map(Path, package_dirs):
        yield from _in(folder.expanduser(), name)
    for folder in above:
        yield folder / name
        if name_of(folder) == name:
            yield folder
    if package := next((folder for folder in above if (folder / "package.xml").is_file()), None):
        yield from _in(package.parent, name)
    for folder in environment_folders():
        yield from _in(folder, name)


def environment_folders() -> Iterator[Path]:
    """Return the package folders named in the environment: those of ROS 1 and the share folders of ROS 2."""
    for variable, inside in (("ROS_PACKAGE_PATH", ""), ("AMENT_PREFIX_PATH", "share")):
        yield from (Path(folder) / inside for folder in os.environ.get(variable, "").split(os.pathsep) if folder)


def name_of(folder: Path) -> str | None:
    """Return the name stated in the package.xml of a folder, or None."""
    with suppress(OSError, ValueError):
        file = folder / "package.xml"
        if file.is_file():
            with file.open("rb") as stream:
                match = _NAME.search(_COMMENT.sub(b"", stream.read(_MAX_BYTES)))
            return match[1].decode(errors="replace") if match else None
    return None


def _in(folder: Path, name: str) -> Iterator[Path]:
    """Return a folder's subfolder of that name, and all packages of that name in and below the folder."""
    yield folder / name
    yield from (inner for inner in islice(_below(folder), _MAX_FOLDERS) if name_of(inner) == name)


def _below(top: Path) -> Iterator[Path]:
    """Return a folder and its subfolders level by level; packages are not nested, hidden folders are skipped."""
    level = [top]
    for _ in range(_DEPTH + 1):
        yield from level
        next_level: list[Path] = []
        for parent in level:
            with suppress(OSError, ValueError):
                if not (parent / "package.xml").exists():
                    entries = (entry for entry in os.scandir(parent) if entry.is_dir(follow_symlinks=True))
                    next_level += sorted(
                        Path(entry.path) for entry in islice(entries, _MAX_FOLDERS) if entry.name[0] != "."
                    )
        level = next_level
