"""The origin of a run: the texts from which its robot is built again, wherever the file is read.

A run file carries the URDF, the edits, the scene and the versions, so that a replay needs nothing else but meshes.
"""

from __future__ import annotations

import json
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

from robot_dyn.errors import QueryError
from robot_dyn.model.description import check
from robot_dyn.model.edits import Edits
from robot_dyn.model.robot import Robot

if TYPE_CHECKING:
    from robot_dyn.simulation.trajectory import Trajectory


def origin(dynamics: Any) -> dict[str, str]:
    """Where a run comes from, as texts: URDF, its path, edits and versions."""
    robot = getattr(dynamics, "robot", dynamics)
    texts = {"versions": ", ".join(f"{name} {version(name)}" for name in ("robot-dyn", "pin", "numpy", "scipy"))}
    if isinstance(robot, Robot):
        urdf = robot.description.text.decode(errors="replace")
        texts |= {"robot": robot.name, "source": robot.description.source}
        texts |= {"urdf": urdf, "edits": robot.edits.as_json()}
    return texts


def robot_of(run: Trajectory) -> Robot:
    """The robot of a run, from the texts it carries.

    Raises:
        QueryError: If the run does not come from a URDF, or its texts do not fit together.
    """
    about = run.about
    if "urdf" not in about:
        raise QueryError("the run carries no URDF, so there is no robot to show; simulate one that rd.load gives")
    try:
        edits = Edits.from_json(about.get("edits", "{}"))
    except (json.JSONDecodeError, TypeError, KeyError, ValueError):
        raise QueryError("the edits that the run carries cannot be read; simulate again") from None
    robot = Robot(check(about["urdf"].encode(), about.get("source", "the run's URDF")), edits)
    if robot.joint_names != run.joint_names:
        raise QueryError(
            f"the run's joints {', '.join(run.joint_names)} are not those of its URDF, {', '.join(robot.joint_names)};"
            " simulate again"
        )
    return robot
