"""Replay: runs of arms in a browser, live or as one file; between keyframes each joint turns as q(t) ≈ its chord."""

from __future__ import annotations

import warnings
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from robot_dyn.errors import ModelWarning
from robot_dyn.files import Kind, save, target
from robot_dyn.simulation.trajectory import Trajectory
from robot_dyn.view.document import ReplayError, document
from robot_dyn.view.page import page

if TYPE_CHECKING:
    from robot_dyn.view.server import Server

PAGE = Kind("a page", ".html", b"<!DOCTYPE html>")


def replay(
    run: Trajectory,
    *ghosts: Trajectory,
    package_dirs: Iterable[str | Path] = (),
    frame: str | None = None,
    inertia: bool = False,
    port: int | None = None,
) -> Server:
    """Show runs in the browser, at the `url` of the server that is returned, on this machine alone.

    Args:
        run: What is shown.
        *ghosts: Runs shown with it, clear.
        package_dirs: Folders in which the packages of meshes are searched first.
        frame: Link whose path is traced.
        inertia: Whether each link's equivalent box, of the same mass and inertia, is drawn.
        port: Where to listen; any free one if not given.

    Raises:
        ReplayError: If a run has no samples.
        QueryError: If it carries no robot, or `frame` is no link of it.
        ServerError: If the port is taken.
    """
    from robot_dyn.view.server import Server  # takes meshcat and tornado along

    document = _told((run, *ghosts), package_dirs, frame, inertia)
    drawn = document.pop("commands")
    return Server(page(document | {"live": True}), drawn, port)


def save_replay(
    run: Trajectory,
    path: str | Path,
    *ghosts: Trajectory,
    package_dirs: Iterable[str | Path] = (),
    frame: str | None = None,
    inertia: bool = False,
) -> Path:
    """Write a replay as one HTML file that needs neither server nor network; arguments as of `replay`.

    Another page under that name is replaced; a file of another kind is not.

    Raises:
        ReplayError: If a run has no samples.
        QueryError: If it carries no robot, or `frame` is no link of it.
        ReplayError: If the file cannot be written.
    """
    file = target(path, PAGE, ReplayError)
    text = page(_told((run, *ghosts), package_dirs, frame, inertia) | {"live": False}).encode()
    return save(file, lambda stream: stream.write(text), ReplayError)


def _told(*arguments: Any) -> dict[str, Any]:
    """The document; what is not drawn as described is told once, here too."""
    made = document(*arguments)
    if problems := made["problems"]:
        rest = f"; and {len(problems) - 1} more, listed on the page" if len(problems) > 1 else ""
        warnings.warn(f"not shown as described: {problems[0]}{rest}", ModelWarning, stacklevel=3)
    return made
