"""The catalog: maps a name, a path or a package:// address to a URDF file.

Names are those of the files of `urdf/` and of every URDF of the installed example-robot-data.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from functools import cache
from importlib import metadata
from pathlib import Path

from robot_dyn.description.packages import environment_folders, package_folders
from robot_dyn.foundations.errors import CatalogError, nearest, shorten, shown

# Files whose stem is not unique or not descriptive.
_RENAMED = {
    "anymal_b_simple_description/robots/anymal.urdf": "anymal_b",
    "anymal_b_simple_description/robots/anymal-kinova.urdf": "anymal_b_kinova",
    "anymal_c_simple_description/urdf/anymal.urdf": "anymal_c",
    "alexander_description/urdf/alexander_v1.lowerBodyOnly.urdf": "alexander",
    "hector_description/robots/quadrotor_base.urdf": "hector",
    "ur_description/urdf/ur3.urdf": "ur3_empty",
}


def list_robots() -> tuple[str, ...]:
    """Return the names that `load` accepts, sorted."""
    return tuple(sorted(_files()))


def files() -> frozenset[Path]:
    """Return the URDF files of all robots in the catalog."""
    return frozenset(_files().values())


def find(name_or_path: str | Path, package_dirs: Iterable[str | Path] = ()) -> Path:
    """Return the URDF file for a name, a path or a package:// address.

    Raises:
        CatalogError: If there is no such robot; the message lists similar names or the searched folders.
    """
    start = name_or_path.decode(errors="replace") if isinstance(name_or_path, bytes) else name_or_path
    if isinstance(start, str) and start.lstrip("\ufeff \t\r\n").startswith("<") and not _is_path(start):
        raise CatalogError("this is the text of a URDF, not its name or path; give it to Robot.from_text")
    if not isinstance(name_or_path, str | Path) or not str(name_or_path).strip():
        raise CatalogError(f"give the name of a robot or the path of a URDF file, got {shown(name_or_path)}")
    text = str(name_or_path)
    if text in _files():
        return _files()[text]
    try:
        if text.startswith("package://"):
            return resolve(text, Path.cwd() / "x", package_dirs)
        path = Path(name_or_path).expanduser()
        if path.exists():
            return path
        if path.suffix or len(path.parts) > 1:
            raise CatalogError(f"no file {shorten(text, 200)}; check the path {shorten(path.absolute(), 300)}")
    except (OSError, RuntimeError, ValueError) as error:  # too long, not readable, no such user, or a NUL
        why = getattr(error, "strerror", error)
        raise CatalogError(f"no file {shorten(text)!r}: {why}; give the path of a URDF file") from None
    raise CatalogError(
        f"no robot {shorten(text)!r}; {nearest(text, list_robots())}; or give the path of a URDF file{_without_data()}"
    )


def _is_path(text: str) -> bool:
    """Return True for an existing path, and for text without ">" that ends in a file suffix."""
    try:
        return Path(text).exists() or (">" not in text and bool(Path(text).suffix))
    except (OSError, ValueError):  # too long for a path, or a NUL
        return False


def abbreviated(path: str | Path) -> str:
    """Return a path in the form that messages print.

    A file of example-robot-data is shown without its installation folder, a file below the working directory relative
    to it.
    """
    text = Path(path).as_posix()
    _, package, inside = text.partition("/example-robot-data/robots/")
    if package:
        return package[1:] + inside
    try:
        return Path(path).absolute().relative_to(Path.cwd()).as_posix()
    except (OSError, ValueError):
        return text


def resolve(address: str, urdf: Path, package_dirs: Iterable[str | Path] = ()) -> Path:
    """Return the file that a package://package/path address in `urdf` refers to.

    Raises:
        CatalogError: If no package of that name contains it, see `packages`; the message lists the searched folders.
    """
    name, _, inside = address.removeprefix("package://").lstrip("/").partition("/")  # many files write a third slash
    package_dirs = tuple(package_dirs)
    for candidate in package_folders(name, urdf, package_dirs) if name and inside else ():
        if (candidate / inside).is_file():
            return candidate / inside
    raise CatalogError(f"no file for {shorten(address, 200)}; {_remedy(name, urdf, package_dirs)}")


def package(name: str, urdf: Path, package_dirs: Iterable[str | Path] = ()) -> Path:
    """Return the folder of a package that `urdf` refers to.

    Raises:
        CatalogError: If there is no such folder; the message lists the searched folders.
    """
    package_dirs = tuple(package_dirs)
    for candidate in package_folders(name, urdf, package_dirs):
        if candidate.is_dir():
            return candidate
    raise CatalogError(f"no package {name!r}; {_remedy(name, urdf, package_dirs)}")


def _remedy(name: str, urdf: Path, package_dirs: Iterable[str | Path]) -> str:
    """Return the searched folders and how to add another, for an error message."""
    added = (Path(folder).expanduser() for folder in package_dirs)
    tried = dict.fromkeys(map(str, (*added, *urdf.absolute().parents, *environment_folders())))
    return (
        f"searched {', '.join(tried)}; add the folder that contains {name or 'the package'!r} to package_dirs"
        " or ROS_PACKAGE_PATH"
    )


@cache
def _files() -> dict[str, Path]:
    """Return the URDF file of each robot by name."""
    bundled = {path.stem: path for path in sorted(_own_folder().glob("*.urdf"))}
    files = dict(_example_robot_data())
    clash = bundled.keys() & files.keys()
    assert not clash, f"names taken twice: {clash}"
    return files | bundled


def _own_folder() -> Path:
    """Return `urdf/`, which is part of an installed package and next to the package in a checkout."""
    package = Path(__file__).parents[1]
    inside = package / "urdf"
    return inside if inside.is_dir() else package.parent / "urdf"


def _without_data() -> str:
    """Return what to install for robots of other makers; empty if it is installed."""
    return "" if any(_example_robot_data()) else "; more robots: pip install example-robot-data"


def _example_robot_data() -> Iterator[tuple[str, Path]]:
    try:
        distribution = metadata.distribution("example-robot-data")
    except metadata.PackageNotFoundError:
        return
    for file in distribution.files or ():
        if file.suffix == ".urdf":
            inside = str(file).partition("/example-robot-data/robots/")[2]
            name = _RENAMED.get(inside, file.stem.removesuffix("_robot").lower().replace("-", "_"))
            yield name, Path(str(distribution.locate_file(file))).resolve()
