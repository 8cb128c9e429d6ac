"""ROS packages: the folder of a package by its name.

A package is a folder of that name, or one whose package.xml says so in its <name>.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Iterator
from contextlib import suppress
from itertools import islice
from pathlib import Path

from robot_dyn.foundations.errors import CatalogError, shown

_MAX_BYTES = 2**16  # of a package.xml
_MAX_FOLDERS = 5000  # looked into below one folder
_DEPTH = 3  # of packages below a folder that is searched, as in src/repository/package
_COMMENT = re.compile(rb"<!--.*?(-->|\Z)", re.DOTALL)
_NAME = re.compile(rb"<name[^<>]*>\s*([^<\s]+)\s*</name>")


def searched(package_dirs: Iterable[str | Path]) -> tuple[Path, ...]:
    """The folders that a user gives to search packages in.

    Raises:
        CatalogError: If one is not a folder; a single path counts as several of one letter and is refused, too.
    """
    if isinstance(package_dirs, str | Path):
        raise CatalogError(f"package_dirs must be several folders, such as [{str(package_dirs)!r}], got one path")
    try:
        folders = tuple(Path(folder).expanduser() for folder in package_dirs)
        missing = [folder for folder in folders if not folder.is_dir()]
    except (TypeError, RuntimeError, ValueError, OSError):  # not paths; no such user; a NUL
        raise CatalogError(
            f"package_dirs must be several folders, such as ['/opt/arms'], got {shown(package_dirs)}"
        ) from None
    if missing:
        raise CatalogError(f"package_dirs: there is no folder {missing[0]}; correct it, or leave it out")
    return folders


def package_folders(name: str, file: Path, package_dirs: Iterable[str | Path] = ()) -> Iterator[Path]:
    """Folders that may be the package, nearest first; not all of them need exist.

    Searched are `package_dirs` and what is below them, then the folders above `file`, then what lies beside the package
    of `file`, then ROS_PACKAGE_PATH and AMENT_PREFIX_PATH.
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
    """The folders that the environment names: those of ROS 1, and the share folders of ROS 2."""
    for variable, inside in (("ROS_PACKAGE_PATH", ""), ("AMENT_PREFIX_PATH", "share")):
        yield from (Path(folder) / inside for folder in os.environ.get(variable, "").split(os.pathsep) if folder)


def name_of(folder: Path) -> str | None:
    """The name that the package.xml of a folder states, or None."""
    with suppress(OSError, ValueError):
        file = folder / "package.xml"
        if file.is_file():
            with file.open("rb") as stream:
                found = _NAME.search(_COMMENT.sub(b"", stream.read(_MAX_BYTES)))
            return found[1].decode(errors="replace") if found else None
    return None


def _in(folder: Path, name: str) -> Iterator[Path]:
    """A folder's subfolder of that name, itself, and the packages below it that say so."""
    yield folder / name
    yield from (each for each in islice(_below(folder), _MAX_FOLDERS) if name_of(each) == name)


def _below(folder: Path) -> Iterator[Path]:
    """A folder and those below it, level by level; a package holds no other, and hidden folders hold none."""
    level = [folder]
    for _ in range(_DEPTH + 1):
        yield from level
        inner: list[Path] = []
        for each in level:
            with suppress(OSError, ValueError):
                if not (each / "package.xml").exists():
                    found = (entry for entry in os.scandir(each) if entry.is_dir(follow_symlinks=True))
                    inner += sorted(Path(entry.path) for entry in islice(found, _MAX_FOLDERS) if entry.name[0] != ".")
        level = inner
