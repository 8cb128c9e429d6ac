"""Robots of the package robot_descriptions, with names such as robot_descriptions:ur10e_description.

The package caches its files in ~/.cache/robot_descriptions and downloads missing ones as soon as a description is
imported. Here a description is imported only if its files exist, or on request.
"""

from __future__ import annotations

import ast
import os
from collections.abc import Mapping
from dataclasses import dataclass
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any, final

from robot_dyn.foundations.errors import CatalogError, nearest, shorten
from robot_dyn.foundations.extras import needs

PREFIX = "robot_descriptions:"


@final
@dataclass(frozen=True)
class Described:
    """A description on disk.

    Attributes:
        path: URDF or xacro file.
        package_dirs: Folders that contain its packages.
        arguments: Arguments of the xacro file; None for a URDF.
    """

    path: Path
    package_dirs: tuple[Path, ...]
    arguments: Mapping[str, str | float | bool] | None

    def expansion(self, arguments: Mapping[str, str | float | bool] | None) -> Mapping[str, str | float | bool] | None:
        """Return the xacro arguments, those of the user over the description's own; None for a URDF without any."""
        return arguments if self.arguments is None else {**self.arguments, **(arguments or {})}


def find(name: str, download: bool) -> Described:
    """Return the files of a description.

    Raises:
        MissingExtraError: If the package is not installed.
        CatalogError: If there is no such description, it is MJCF only, it is not on disk and `download` is False, or
            the download fails.
    """
    description = name.removeprefix(PREFIX)
    descriptions = needs("robot_descriptions", extra="robots").DESCRIPTIONS
    if description not in descriptions:
        raise CatalogError(f"robot_descriptions has no {shorten(description)!r}; {nearest(description, descriptions)}")
    if not download and not _on_disk(description):
        raise CatalogError(
            f"{name}: is not on disk; run python -m robot_descriptions pull {description}, or load it with"
            " download=True"
        )
    try:
        module: Any = import_module(f"robot_descriptions.{description}")
    except Exception as error:  # git, the network and the package raise their own
        raise CatalogError(f"{name}: cannot be downloaded ({shorten(error, 200)}); try again") from None
    path = getattr(module, "URDF_PATH", None) or getattr(module, "XACRO_PATH", None)
    if path is None:
        raise CatalogError(f"{name}: is MJCF, not URDF; choose a description that is a URDF")
    folders = dict.fromkeys(Path(folder) for folder in (module.PACKAGE_PATH, module.REPOSITORY_PATH))
    around = dict.fromkeys((*folders, *(folder.parent for folder in folders)))
    arguments = getattr(module, "XACRO_ARGS", {}) if getattr(module, "URDF_PATH", None) is None else None
    return Described(Path(path), tuple(around), arguments)


def _on_disk(description: str) -> bool:
    """Return True if the required commit is checked out in the package's cache: then no import downloads anything."""
    git = needs("git", extra="robots")
    repositories = needs("robot_descriptions._repositories", extra="robots").REPOSITORIES
    commit = os.environ.get("ROBOT_DESCRIPTION_COMMIT")
    cache = Path(os.environ.get("ROBOT_DESCRIPTIONS_CACHE", "~/.cache/robot_descriptions")).expanduser()
    for repository in map(repositories.get, _repositories(description)):
        if repository is None:
            return False
        inside = (
            repository.cache_path if commit is None else f"{repository.cache_path}-{commit}/{repository.cache_path}"
        )
        try:
            clone = git.Repo(cache / inside)
            if clone.git.rev_parse(f"{commit or repository.commit}^{{commit}}") != clone.head.commit.hexsha:
                return False
        except (git.GitCommandError, git.InvalidGitRepositoryError, git.NoSuchPathError, ValueError):
            return False
    return True


def _repositories(description: str) -> list[str]:
    """Return the repositories that a description requires, read from its source: an import would download them."""
    spec = find_spec(f"robot_descriptions.{description}")
    if spec is None or spec.origin is None:
        return [""]  # another version of the package: treated as not on disk
    nodes = ast.walk(ast.parse(Path(spec.origin).read_text("utf-8")))
    calls = (node for node in nodes if isinstance(node, ast.Call))
    names = [
        call.args[0].value
        for call in calls
        if isinstance(call.func, ast.Name) and "clone_to_cache" in call.func.id and call.args
        if isinstance(call.args[0], ast.Constant)
    ]
    return [str(name) for name in names] or [""]
