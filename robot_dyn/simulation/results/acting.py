"""What acts on a plant, in words: gravity, payloads, the other edits, the effects and the control."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from robot_dyn.model.robot import Robot
from robot_dyn.simulation.setup.setup import Setup


def acting(setup: Setup) -> tuple[str, ...]:
    """What acts in a run, by the names of scenes, with units."""
    dynamics = setup.plant.dynamics
    robot = getattr(dynamics, "robot", dynamics)
    edits = _edits(robot) if isinstance(robot, Robot) else ()
    control = () if setup.controller is None else ("control",)
    return (*edits, *dict.fromkeys(effect.name for effect in setup.plant.effects), *control)


def _edits(robot: Robot) -> Iterator[str]:
    edits = robot.edits
    if any(edits.gravity):
        yield f"gravity {np.linalg.norm(edits.gravity):.4g} m/s²"
    yield from (f"payload {each.mass:g} kg on {each.frame}" for each in edits.payloads)
    if edits.mass_scale != 1:
        yield f"mass_scale {edits.mass_scale:g}"
    yield from (f"mass {mass:g} kg of {link}" for link, mass in edits.masses)
    yield from (f"inertia of {link}" for link, _ in edits.inertias)
    if any(value for _, value in edits.armature):
        yield "armature"
    yield from (f"lock {joint}" for joint, _ in edits.lock)
