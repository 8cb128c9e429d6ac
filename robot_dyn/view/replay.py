"""Show runs of arms, or an arm at rest, in a browser, live or as one file; q(t) is linear between keyframes."""

from __future__ import annotations

import warnings
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from robot_dyn.errors import ModelWarning
from robot_dyn.files import Kind, save, target
from robot_dyn.model.robot import Robot
from robot_dyn.queries.dynamics import Array
from robot_dyn.simulation.results.trajectory import Trajectory
from robot_dyn.validate import integer
from robot_dyn.view.document import ReplayError, document, still
from robot_dyn.view.page import page

if TYPE_CHECKING:
    from robot_dyn.view.live.server import Server

PAGE = Kind("a page", ".html", b"<!DOCTYPE html>")


def replay(
    run: Trajectory,
    *ghosts: Trajectory,
    package_dirs: Iterable[str | Path] = (),
    frame: str | None = None,
    inertia: bool = False,
    port: int | None = None,
) -> Server:
    """Show runs in the browser, on this machine only, at the `url` of the returned server.

    Args:
        run: The run to show.
        *ghosts: Runs shown with it, transparent.
        package_dirs: Folders searched first for the packages of meshes.
        frame: Link whose path is traced.
        inertia: Whether to draw each link's equivalent box, of the same mass and inertia.
        port: Port to listen on; any free one if not given.

    Raises:
        ReplayError: If a run has no samples.
        QueryError: If a run carries no robot, or `frame` is not one of its links.
        ServerError: If the port is taken.
    """
    port = _free(port)
    return _served(document((run, *ghosts), package_dirs, frame, inertia), port)


def save_replay(
    run: Trajectory,
    path: str | Path,
    *ghosts: Trajectory,
    package_dirs: Iterable[str | Path] = (),
    frame: str | None = None,
    inertia: bool = False,
) -> Path:
    """Write a replay as one HTML file that needs neither server nor network; arguments as in `replay`.

    An existing page of that name is replaced; a file of another kind is not.

    Raises:
        ReplayError: If a run has no samples.
        QueryError: If a run carries no robot, or `frame` is not one of its links.
        ReplayError: If the file cannot be written.
    """
    file = target(path, PAGE, ReplayError)
    return _written(document((run, *ghosts), package_dirs, frame, inertia), file)


def show(
    robot: Robot,
    q: Array | None = None,
    *,
    package_dirs: Iterable[str | Path] = (),
    inertia: bool = False,
    port: int | None = None,
) -> Server:
    """Show a robot in the browser, on this machine only, at the `url` of the returned server.

    Args:
        robot: The robot to show.
        q: Its configuration, (n,), in [rad] or [m]; 0 if not given.
        package_dirs: Folders searched first for the packages of meshes.
        inertia: Whether to draw each link's equivalent box, of the same mass and inertia.
        port: Port to listen on; any free one if not given.

    Raises:
        QueryError: If q is not one configuration of the robot.
        ServerError: If the port is taken.
    """
    port = _free(port)
    return _served(still(robot, q, package_dirs, inertia), port)


def save_show(
    robot: Robot,
    path: str | Path,
    q: Array | None = None,
    *,
    package_dirs: Iterable[str | Path] = (),
    inertia: bool = False,
) -> Path:
    """Write the page of `show` as one HTML file that needs neither server nor network; arguments as in `show`.

    An existing page of that name is replaced; a file of another kind is not.

    Raises:
        QueryError: If q is not one configuration of the robot.
        ReplayError: If the file cannot be written.
    """
    file = target(path, PAGE, ReplayError)
    return _written(still(robot, q, package_dirs, inertia), file)


def _free(port: int | None) -> int | None:
    return None if port is None else integer("port", port, least=1, most=65535)


def _served(document: dict[str, Any], port: int | None) -> Server:
    from robot_dyn.view.live.server import Server  # imports zmq and tornado

    _warn(document)
    drawn = document.pop("commands")
    return Server(page(document | {"live": True}), drawn, port)


def _written(document: dict[str, Any], file: Path) -> Path:
    _warn(document)
    text = page(document | {"live": False}).encode()
    return save(file, lambda stream: stream.write(text), ReplayError)


def _warn(document: dict[str, Any]) -> None:
    """Warn once if anything is drawn differently from what the files describe."""
    if problems := document["problems"]:
        rest = f"; and {len(problems) - 1} more, listed on the page" if len(problems) > 1 else ""
        warnings.warn(f"drawn otherwise than its files describe: {problems[0]}{rest}", ModelWarning, stacklevel=4)
