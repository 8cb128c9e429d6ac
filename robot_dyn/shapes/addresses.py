"""Mesh addresses in a URDF, resolved to files: package://, file://, or a path relative to the URDF's folder.

For paths from another computer, Linux or Windows, the last parts of the path are searched in the folders above the
URDF, then the file name in meshes/ next to it.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterator
from contextlib import suppress
from itertools import islice
from pathlib import Path
from urllib.parse import unquote

from robot_dyn.description import catalog
from robot_dyn.foundations.errors import CatalogError, shorten
from robot_dyn.shapes.mesh_files import MeshError

_LEVELS = 4  # number of folders above a URDF that may be its package, as in package/robots/arm/urdf
_LONGEST = 8  # largest number of last parts of a path that are searched


def shown(address: str | None) -> str:
    """Return an address for display, without the folders of this machine, which are private."""
    address = (address or "").strip()
    rooted = address.startswith(("file:", "/", "\\", "~")) or address[1:2] == ":"
    return shorten(re.split(r"[/\\]", address)[-1] if rooted else address)


def as_written(address: str | None) -> str:
    """Return an address as the file writes it, for messages that stay on this machine."""
    return shorten((address or "").strip(), 200)


def find_file(
    address: str | None, source: Path, package_dirs: tuple[str | Path, ...], remarks: list[str] | None = None
) -> Path:
    """Return the file of an address in the URDF `source`.

    If it is not there, another file is taken whose path ends like the address: in one of the folders above the URDF, or
    in meshes/ next to it. A remark is then added.

    Raises:
        MeshError: If the address does not name a file, or no file is found; callers put the address before the message.
    """
    address = (address or "").strip()
    kind, path = _kind_and_path(address)
    if not path or kind not in ("", "file", "package"):
        raise MeshError("the address is not that of a local file; write a path, file:// or package://")
    if kind != "package":
        for exact in (path, path.replace("\\", "/")):  # on Linux, backslashes may be part of a name
            if os.path.exists(file := source.absolute().parent / exact):
                return file
        fault = "some mesh files are not at their stated paths"
        remedy = "write its path relative to the URDF"
    else:
        address, path = address.replace("\\", "/"), path.replace("\\", "/")
        for folders in (package_dirs, _installed()):
            with suppress(CatalogError, OSError, ValueError):
                return catalog.resolve(address, source, folders).resolve()
        name, _, path = path.lstrip("/").partition("/")
        path = "" if ".." in Path(path).parts else path
        fault = f"package {shorten(name)!r} is not found"
        remedy = "add the folder of its package to package_dirs, --package-dir or ROS_PACKAGE_PATH"
    parts = [part for part in re.split(r"[/\\]+", path) if part not in ("", ".")]
    for folder, end in _elsewhere(parts, source, whole=kind == "package"):
        if os.path.isfile(file := folder.joinpath(*end)):
            whole = kind == "package" and end == parts
            place = f"its files are read from {folder.name!r} above the URDF"
            remark = f"{fault}; {place if whole else f'files of the same name are read from {file.parent.name!r}'}"
            if remarks is not None and remark not in remarks:
                remarks.append(remark)
            return file.resolve()
    for folder, end in _elsewhere(parts, source, whole=kind == "package"):
        with suppress(OSError, ValueError):
            inside = folder.joinpath(*end[:-1])
            if alike := [name for name in os.listdir(inside) if name.lower() == end[-1].lower()]:
                raise MeshError(
                    f"there is no such file on this computer, but {inside.name!r} has {shorten(alike[0])!r}; correct"
                    " the capital letters of one of them"
                )
    raise MeshError(f"there is no such file on this computer; put it in meshes/ next to the URDF, or {remedy}")


def _kind_and_path(address: str) -> tuple[str, str]:
    """Return the scheme of an address, and its path without the host "localhost"; file:// is decoded."""
    if not address.startswith("file:"):
        kind, separator, path = address.partition("://")
        return (kind, path) if separator else ("", address)
    path = unquote(address.removeprefix("file:").removeprefix("//"))
    path = path.removeprefix("localhost") if path.startswith("localhost/") else path
    return "file", re.sub(r"^/(?=[A-Za-z]:[/\\])", "", path)  # file:///C:/meshes/arm.stl


def _elsewhere(parts: list[str], source: Path, whole: bool) -> Iterator[tuple[Path, list[str]]]:
    """Yield folders and last parts of a path to search: most parts first, and the nearest folder first.

    A name alone is searched only next to the URDF and in meshes/ there, unless it is the `whole` path in a package.
    """
    folders = source.absolute().parents[:_LEVELS]
    for k in range(max(0, len(parts) - _LONGEST), len(parts)):
        end = parts[k:]
        wide = len(end) > 1 or (whole and k == 0)
        yield from ((folder, end) for folder in folders[: None if wide else 1] if ".." not in end)
    if parts and parts[-1] != "..":
        yield folders[0], ["meshes", parts[-1]]


def _installed() -> Iterator[Path]:
    """Yield the folder of the installed package example-robot-data, for runs from a machine with another folder."""
    parents = (folder for name in catalog.list_robots() for folder in catalog.find(name).parents)
    return islice((folder.parent for folder in parents if folder.name == "example-robot-data"), 1)
