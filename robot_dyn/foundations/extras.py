"""Installed packages: their versions, and imports of optional packages on use."""

from __future__ import annotations

import re
from functools import cache
from importlib import import_module
from types import ModuleType

from robot_dyn.foundations.errors import MissingExtraError


def needs(module: str, *, extra: str) -> ModuleType:
    """Import and return a module of an optional dependency.

    Args:
        module: Name of the module, such as "ruckig".
        extra: The extra of robot-dyn that installs it, such as "plan".

    Raises:
        MissingExtraError: If it is not installed.
    """
    try:
        return import_module(module)
    except ModuleNotFoundError as error:
        if error.name is None or error.name.partition(".")[0] != module.partition(".")[0]:
            raise  # the module is installed, but one of its dependencies is not
        raise MissingExtraError(
            f"{module.partition('.')[0]} is not installed: pip install 'robot-dyn[{extra}]'"
        ) from None


@cache
def version_of(name: str) -> str:
    """Return the version of an installed distribution, or "unknown"."""
    from importlib.metadata import PackageNotFoundError, distribution  # slow to import, and rarely needed

    try:
        installed = distribution(name)
    except PackageNotFoundError:  # run from a source folder, without being installed
        return "unknown"
    head = re.search("^Version: (.*)$", installed.read_text("METADATA") or "", re.MULTILINE)
    return head[1] if head else installed.version  # slower: it parses the metadata as an e-mail
