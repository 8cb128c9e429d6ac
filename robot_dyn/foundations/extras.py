"""Installed packages: their versions, and those that only some answers need, imported on use."""

from __future__ import annotations

import re
from functools import cache
from importlib import import_module
from types import ModuleType

from robot_dyn.foundations.errors import MissingExtraError


def needs(module: str, *, extra: str) -> ModuleType:
    """A module of an optional dependency, imported now.

    Args:
        module: Its name, such as "ruckig".
        extra: The extra of robot-dyn that installs it, such as "plan".

    Raises:
        MissingExtraError: If it is not installed.
    """
    try:
        return import_module(module)
    except ModuleNotFoundError as error:
        if error.name is None or error.name.partition(".")[0] != module.partition(".")[0]:
            raise  # it is there, and lacks a package of its own
        raise MissingExtraError(
            f"{module.partition('.')[0]} is not installed: pip install 'robot-dyn[{extra}]'"
        ) from None


@cache
def version_of(name: str) -> str:
    """The version of an installed distribution, or "unknown"."""
    from importlib.metadata import PackageNotFoundError, distribution  # a query of a robot needs none of it

    try:
        found = distribution(name)
    except PackageNotFoundError:  # run from its folder
        return "unknown"
    head = re.search("^Version: (.*)$", found.read_text("METADATA") or "", re.MULTILINE)
    return head[1] if head else found.version  # which starts a mail parser
