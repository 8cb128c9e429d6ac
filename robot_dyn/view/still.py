"""A robot at one configuration, without a run: the document of its page."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from robot_dyn.description.packages import searched
from robot_dyn.errors import QueryError, shorten
from robot_dyn.model.robot import Robot
from robot_dyn.queries.dynamics import Array
from robot_dyn.spatial import homogeneous
from robot_dyn.validate import instance, one_state, truth
from robot_dyn.view import commands
from robot_dyn.view.geometry.visuals import drawing
from robot_dyn.view.keyframes import keyframes
from robot_dyn.view.scenery import gravity_arrow, gravity_label, ground, scenery, turned, upright
from robot_dyn.view.stage import Stage

_FAR = 1e4  # [rad] or [m]


def still(robot: Robot, q: Array | None, package_dirs: Iterable[str | Path], inertia: bool) -> dict[str, Any]:
    """All that the page is made of; arguments as of `show`.

    Raises:
        QueryError: If q is not one configuration of the robot.
    """
    instance("robot", robot, Robot, "give one of rd.load")
    package_dirs, inertia = searched(package_dirs), truth("inertia", inertia)
    at: Array = np.zeros(robot.n) if q is None else one_state("q", q, robot.joint_names)
    if np.abs(at).max() > _FAR:
        raise QueryError(f"q must be within ±{_FAR:g}, got {shorten(at)}")
    stage, look = Stage("run", robot), drawing(robot, package_dirs, inertia=inertia)
    gravity = robot.edits.gravity
    turn = upright(gravity)
    seen = scenery(stage.corners(look.pieces, at[None]) @ turn.T)
    keys = keyframes(np.zeros(1), stage.linkage.couplings.position(at[None]))
    bodies = {body.joint: body for body in stage.linkage.bodies}
    units = ["rad" if bodies[name].revolute else "m" for name in robot.joint_names]
    values = zip(robot.joint_names, at, units, strict=True)
    return {
        "title": robot.name,
        "outcome": f"{robot.n} joint{'s' if robot.n > 1 else ''}, {robot.total_mass:.4g} kg",
        "duration": 0.0,
        "remarks": [],
        "problems": list(look.notes),
        "gravity": gravity_label(robot),
        "events": [],
        "rests": [],
        "notes": [
            "q: " + ", ".join(f"{name} = {value:.4g} {unit}" for name, value, unit in values),
            *look.remarks,
            *turned(gravity),
            f"the squares on the floor are {seen.square:g} m wide",
        ],
        "scene": seen.as_json(),
        "plots": [],
        "price": {"runs": [], "rows": []},
        "commands": [
            ground(seen),
            *gravity_arrow(seen, gravity),
            commands.set_transform(stage.root, homogeneous(turn, np.zeros(3))),
            *stage.draw(look.pieces),
            commands.set_animation(stage.tracks(keys)),
        ],
    }
