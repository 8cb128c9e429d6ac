"""Functions that a specification names by import path, as "my_figures:settling", with the digest of their module."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable
from hashlib import sha256
from importlib import import_module
from pathlib import Path
from typing import Any

from robot_dyn.foundations.errors import SweepError, shown

_PATH = re.compile(r"[^\W\d]\w*(\.[^\W\d]\w*)*:[^\W\d]\w*")


def path_of(function: Any) -> str:
    """The import path of a function, or of a text that is one.

    Raises:
        SweepError: If it has none: it is neither, or is defined in a script, a notebook or another function.
    """
    if isinstance(function, str):
        if not _PATH.fullmatch(function):
            raise SweepError(f"an import path is such as 'my_figures:settling', got {shown(function)}")
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


def imported(path: str) -> Callable[..., Any]:
    """The function of an import path; modules are also looked for in the working directory.

    Raises:
        SweepError: If there is none.
    """
    module, _, name = path_of(path).partition(":")
    try:
        found = getattr(_module(module), name)
    except (ImportError, AttributeError) as error:
        raise SweepError(
            f"{path} cannot be imported ({error}): name a function of a module in the working directory or on"
            " PYTHONPATH"
        ) from None
    if not callable(found) or isinstance(found, type):
        raise SweepError(f"{path} is not a function, but {shown(found)}")
    return found


def digest_of(path: str) -> str:
    """The SHA-256 of the file of the module of an import path."""
    module = _module(path.partition(":")[0])
    file = getattr(module, "__file__", None)
    if file is None or not Path(file).is_file():
        raise SweepError(f"{path}: its module has no file, so that a change of it would not be seen; write it to one")
    return sha256(Path(file).read_bytes()).hexdigest()


def _module(name: str) -> Any:
    here = str(Path.cwd())
    if here in sys.path or "" in sys.path:
        return import_module(name)
    sys.path.append(here)
    try:
        return import_module(name)
    finally:
        sys.path.remove(here)
