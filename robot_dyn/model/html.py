"""A robot in a notebook: its joints, what its file states of them, and its findings."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from robot_dyn.model.robot import Robot

_COLUMNS = ("lower", "upper", "effort_limit", "velocity_limit", "damping", "friction", "armature")


def robot_html(robot: Robot) -> str:
    """HTML for notebooks: a table of the joints in SI units, then mass, gravity, edits and findings."""
    from robot_dyn.display import page, table, text

    heading = ["joint", "type", *(name.replace("_", " ") for name in _COLUMNS)]
    values = [getattr(robot, name).tolist() for name in _COLUMNS]
    rows = zip(robot.joint_names, robot.joint_types, *values, strict=True)
    gravity = ", ".join(f"{x:g}" for x in robot.edits.gravity)
    lines = [f"{robot.n} joints, {robot.total_mass:.4g} kg, gravity ({gravity}) m/s²"]
    lines += [f"{name} is locked at {value:g}" for name, value in robot.edits.lock]
    lines += [f"{each.mass:g} kg on {each.frame}" for each in robot.edits.payloads]
    return page(f"Robot {robot.name}", table(heading, rows), text([*lines, *robot.findings]))
