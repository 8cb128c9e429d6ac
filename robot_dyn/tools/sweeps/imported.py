"""Functions by import path, such as "my_figures:settling", with the digest of their module.

A folder may come from somebody else, so a function named in it is imported only if the reader of the folder names it,
too. The digest of the file is compared before the import, and Python must not import from the folder itself.
"""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from hashlib import sha256
from importlib import import_module
from importlib.machinery import PathFinder
from pathlib import Path
from typing import Any, final

from robot_dyn.foundations import SweepError, shown

_PATH = re.compile(r"[^\W\d]\w*(\.[^\W\d]\w*)*:[^\W\d]\w*")


@final
@dataclass(frozen=True)
class Named:
    """Functions that the reader of a folder names, so that they may be imported.

    Attributes:
        scene: Scene file, or import path of a function; None for the scene that the folder names.
        figures: Names of figures, with the import paths of their functions.
    """

    scene: str | None = None
    figures: tuple[tuple[str, str], ...] = ()


NONE_NAMED = Named()


def named(scene: object, figures: object) -> Named:
    """Return the scene and figures that a reader names; for errors, see `source_of` and `path_of`."""
    functions = by_name("figures", {} if figures is None else figures, "settling")
    paths = tuple((name, path_of(function)) for name, function in functions.items())
    return Named(None if scene is None else source_of(scene), paths)


def by_name(label: str, functions: object, example: str) -> dict[str, object]:
    """Return distributions, figures or functions by name; raise a SweepError unless they are a mapping."""
    if not isinstance(functions, Mapping) or not all(isinstance(name, str) and name for name in functions):
        raise SweepError(f"{label}: give them by name, as {{{example!r}: …}}, got {shown(functions)}")
    return dict(functions)


def source_of(scene: object) -> str:
    """Return the absolute path of a scene file, or the import path of a function; raise a SweepError for others."""
    if isinstance(scene, Path) or (isinstance(scene, str) and is_scene(scene)):
        return str(Path(scene).absolute())
    try:
        return path_of(scene)
    except SweepError as error:
        raise SweepError(
            "scene: give a scene file, or a function that returns the setup, by import path such as 'my_arm:setup'"
            f" ({error})"
        ) from None


def is_scene(source: str) -> bool:
    """Return True for the path of a scene file, False for an import path."""
    return source.lower().endswith(".toml")


def is_import_path(text: str) -> bool:
    """Return True for the form of an import path, False for a call such as "peak('u')"."""
    return ":" in text and "(" not in text


def path_of(function: object) -> str:
    """Return the import path of a function, or check a text that is one.

    Raises:
        SweepError: If there is none, because the function is defined in a script, a notebook or another function.
    """
    if isinstance(function, str):
        if not _PATH.fullmatch(function):
            raise SweepError(f"give an import path such as 'my_figures:settling', got {shown(function)}")
        return function
    module, name = getattr(function, "__module__", None), getattr(function, "__qualname__", None)
    if not callable(function) or isinstance(function, type) or not isinstance(module, str) or not isinstance(name, str):
        raise SweepError(f"give a function, or its import path such as 'my_figures:settling', got {shown(function)}")
    if module == "__main__" or not name.isidentifier():
        where = "is of the script or notebook itself" if module == "__main__" else "is defined inside another one"
        raise SweepError(
            f"{name} {where}, which other processes cannot import: write it to my_figures.py, and give"
            f" 'my_figures:{name.rpartition('.')[2].strip('<>')}'"
        )
    return f"{module}:{name}"


def imported(path: str) -> Callable[..., object]:
    """Import the function of an import path; modules may be in the working directory.

    Raises:
        SweepError: If there is no such function.
    """
    module, _, name = path_of(path).partition(":")
    try:
        function = getattr(_module(module), name)
    except (ImportError, AttributeError) as error:
        raise SweepError(
            f"{path} cannot be imported ({error}): name a function of a module in the working directory or on"
            " PYTHONPATH"
        ) from None
    if not callable(function) or isinstance(function, type):
        raise SweepError(f"{path} is not a function, but {shown(function)}")
    return function


def digest_of(path: str) -> str:
    """Return the SHA-256 of the module's file of an import path."""
    module = _module(path.partition(":")[0])
    return _digest(path, getattr(module, "__file__", None))


def check_named(path: str, digest: object, folder: Path) -> None:
    """Compare the file of a function with the digest that a folder states, before the function is imported.

    Raises:
        SweepError: If the file is missing, lies in the folder or has another digest, or Python imports from the folder.
    """
    if not isinstance(digest, str):
        raise SweepError(f"{path}: the folder states no function here; remove it, or name the scene file it states")
    check_places(folder, str(Path.cwd()))
    file = _file_of(path.partition(":")[0])
    if file is None:
        raise SweepError(f"{path} cannot be imported: no such file in the working directory or on PYTHONPATH")
    if _lies_in(file, os.path.realpath(folder)):
        raise SweepError(f"{path}: {file} lies in the folder, from which nothing is imported; move it elsewhere")
    if (found := _digest(path, file)) != digest:
        raise SweepError(
            f"{path}: {file} is not the file of the sweep (SHA-256 {found[:12]}…, not {digest[:12]}…), and is not"
            " imported; restore it, or begin the sweep in a new folder"
        )


def check_places(folder: Path, *more: str) -> None:
    """Raise a SweepError if Python imports from a folder of results, for example as the working directory."""
    real = os.path.realpath(folder)
    for place in (*sys.path, *more):
        if isinstance(place, str) and _lies_in(place or os.curdir, real):
            raise SweepError(
                f"{folder}: Python imports modules from {place or 'the working directory'}, which lies in this folder,"
                " so its files would run as code: change to another working directory, or remove it from PYTHONPATH"
            )


def _lies_in(place: str, folder: str) -> bool:
    return Path(os.path.realpath(place)).is_relative_to(folder)


def _file_of(name: str) -> str | None:
    """Return the file of a module, without importing the module or its packages."""
    if name in sys.modules:
        return getattr(sys.modules[name], "__file__", None)
    places: list[str] | None = [*sys.path, str(Path.cwd())]
    spec = None
    above = ""
    for part in name.split("."):
        above = f"{above}.{part}" if above else part
        spec = None if places is None else PathFinder.find_spec(above, places)
        if spec is None:
            return None
        places = None if spec.submodule_search_locations is None else list(spec.submodule_search_locations)
    return spec.origin if spec is not None and spec.has_location else None


def _digest(path: str, file: str | None) -> str:
    if file is None or not Path(file).is_file():
        raise SweepError(f"{path}: its module has no file, so changes cannot be detected; write it to a file")
    return sha256(Path(file).read_bytes()).hexdigest()


def _module(name: str) -> Any:
    here = str(Path.cwd())
    if here in sys.path or "" in sys.path or name.partition(".")[0] == "robot_dyn":
        return import_module(name)
    sys.path.append(here)
    try:
        return import_module(name)
    finally:
        sys.path.remove(here)
