"""Mesh addresses in a URDF, resolved to files: package://, file://, or a path relative to the URDF's folder."""

from __future__ import annotations

import re
from collections.abc import Iterator
from contextlib import suppress
from itertools import islice
from pathlib import Path
from urllib.parse import unquote

from robot_dyn.description import catalog
from robot_dyn.foundations.errors import CatalogError, shorten
from robot_dyn.shapes.mesh_files import MeshError

_LEVELS = 4  # of folders above a URDF that may be its package, as in package/robots/arm/urdf


def shown(address: str | None) -> str:
    """Return an address for display, without the folders of this machine, which are private."""
    address = (address or "").strip()
    rooted = address.startswith(("file:", "/", "\\", "~")) or address[1:2] == ":"
    return shorten(re.split(r"[/\\]", address)[-1] if rooted else address)


def find_file(
    address: str | None, source: Path, package_dirs: tuple[str | Path, ...], remarks: list[str] | None = None
) -> Path:
    """Return the file of an address in the URDF `source`; it need not exist.

    If a package is not found, its file is taken from a folder above the URDF that contains the same relative path, and
    a remark is added.

    Raises:
        MeshError: If the address does not name a file.
    """
    address = (address or "").strip()
    kind = address.partition("://")[0] if "://" in address else ""
    if not address or kind not in ("", "file", "package"):
        raise MeshError(
            f"the address {shown(address)!r} is not that of a local file; write a path, file:// or package://"
        )
    if kind != "package":
        return source.absolute().parent / (unquote(address.removeprefix("file://")) if kind else address)
    for folders in (package_dirs, _installed()):
        with suppress(CatalogError, OSError, ValueError):
            return catalog.resolve(address, source, folders).resolve()
    with suppress(OSError, ValueError):
        name, _, inside = address.removeprefix("package://").lstrip("/").partition("/")
        if folder := _above(inside, source):
            remark = f"package {shorten(name)!r} is not found; its files are taken from {folder.name!r} above the URDF"
            if remarks is not None and remark not in remarks:
                remarks.append(remark)
            return (folder / inside).resolve()
    raise MeshError(
        f"no file for {shown(address)}; add its package's folder to package_dirs, --package-dir or ROS_PACKAGE_PATH"
    )


def _above(inside: str, source: Path) -> Path | None:
    """Return the folder above the URDF that contains this file, for packages that were renamed or are missing."""
    folders = source.absolute().parents[:_LEVELS] if inside and ".." not in Path(inside).parts else ()
    return next((folder for folder in folders if (folder / inside).is_file()), None)


def _installed() -> Iterator[Path]:
    """Return the folder of the installed package example-robot-data, for runs from a machine with another one."""
    parents = (folder for name in catalog.list_robots() for folder in catalog.find(name).parents)
    return islice((folder.parent for folder in parents if folder.name == "example-robot-data"), 1)
