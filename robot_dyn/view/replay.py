"""Pages that show runs of arms, or an arm at rest, in a notebook or a browser; q(t) is linear between keyframes."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, Literal

from robot_dyn.foundations.errors import ModelWarning
from robot_dyn.model.robot import Robot
from robot_dyn.queries.dynamics import Array
from robot_dyn.simulation.results.run_data import TrajectoryData
from robot_dyn.view.document import document_of, still
from robot_dyn.view.page import Page


def replay(
    run: TrajectoryData,
    *ghosts: TrajectoryData,
    package_dirs: Iterable[str | Path] = (),
    frame: str | None = None,
    inertia: bool = False,
    meshes: Literal["full", "coarse"] = "full",
    names: Sequence[str] | None = None,
) -> Page:
    """Return a page that shows runs: in a notebook as the last value of a cell, elsewhere in a browser (`address`).

    The page is one text that needs neither server nor network; its method `serve` serves it live.

    Args:
        run: The run to show.
        *ghosts: Runs drawn transparent, for comparison.
        package_dirs: Folders searched first for the packages of meshes.
        frame: Link whose path is drawn.
        inertia: True to draw each link's equivalent box, of the same mass and inertia.
        meshes: "full", the triangles of their files; or "coarse", fewer, for a smaller page.
        names: Names of the runs in titles and legends; by default robots, files or settings that differ.

    Raises:
        ReplayError: If a run has no samples.
        QueryError: If a run lacks its robot, `frame` is not one of its links, or `names` are not different texts, one
            per run.
    """
    return _page(document_of((run, *ghosts), package_dirs, frame, inertia, meshes, names))


def show(
    robot: Robot,
    q: Array | None = None,
    *,
    package_dirs: Iterable[str | Path] = (),
    inertia: bool = False,
    meshes: Literal["full", "coarse"] = "full",
) -> Page:
    """Return a page that shows a robot: in a notebook as the last value of a cell, elsewhere at its `address`.

    The page is one text that needs neither server nor network; its method `serve` serves it live.

    Args:
        robot: The robot to show.
        q: Configuration of the robot, (n,), in [rad] or [m]; 0 by default.
        package_dirs: Folders searched first for the packages of meshes.
        inertia: True to draw each link's equivalent box, of the same mass and inertia.
        meshes: "full", the triangles of their files; or "coarse", fewer, for a smaller page.

    Raises:
        QueryError: If q is not one configuration of the robot.
    """
    return _page(still(robot, q, package_dirs, inertia, meshes))


def _page(document: dict[str, Any]) -> Page:
    """Return the page of a document; warn once if a part is not drawn as its files state."""
    if problems := document["problems"]:
        rest = f"; and {len(problems) - 1} more, listed on the page" if len(problems) > 1 else ""
        warnings.warn(f"not drawn as its files state: {problems[0]}{rest}", ModelWarning, stacklevel=3)
    return Page(document)
