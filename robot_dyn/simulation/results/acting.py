"""Effects on a plant: by name, as wrenches on links, F = (f, τ), and as stops in contact."""

from __future__ import annotations

import json
from collections.abc import Iterator

import numpy as np

from robot_dyn.effects.geared_motor import GearedMotor
from robot_dyn.effects.joint_limit import JointStopSpring
from robot_dyn.effects.plant import Plant
from robot_dyn.effects.rigid_stops import RigidStops
from robot_dyn.effects.wrench import ExternalWrench
from robot_dyn.model.robot import Robot
from robot_dyn.queries.dynamics import Dynamics
from robot_dyn.simulation.setup.setup import Setup

_FAR = 1e9  # [rad] or [m]: limit on positions of a run that diverged
_BEFORE = 2.0**-22  # relative time before a switch, distinct in single precision too, which viewers use


def acting(setup: Setup) -> tuple[str, ...]:
    """Return the edits, effects and control of a run, by the names of scenes, with units."""
    dynamics = setup.plant.dynamics
    robot = getattr(dynamics, "robot", dynamics)
    edits = _edits(robot) if isinstance(robot, Robot) else ()
    control = () if setup.controller is None else ("control",)
    return (*edits, *dict.fromkeys(effect.name for effect in setup.plant.effects), *control)


def _edits(robot: Robot) -> Iterator[str]:
    edits = robot.edits
    if any(edits.gravity):
        yield f"gravity {np.linalg.norm(edits.gravity):.4g} m/s²"
    if estimated := len(robot.estimated):
        yield f"inertia of {estimated} link{'s' * (estimated > 1)} estimated from shapes"
    yield from (f"payload {payload.mass:g} kg on {payload.frame}" for payload in edits.payloads)
    if edits.mass_scale != 1:
        yield f"mass_scale {edits.mass_scale:g}"
    yield from (f"mass_scale {factor:g} of {link}" for link, factor in edits.mass_scales)
    yield from (f"mass {mass:g} kg of {link}" for link, mass in edits.masses)
    yield from (f"inertia of {link}" for link, _ in edits.inertias)
    if any(value for _, value in edits.armature):
        yield "armature"
    yield from (f"lock {joint}" for joint, _ in edits.lock)


def wrenches(plant: Plant, t: np.ndarray, q: np.ndarray) -> dict[str, np.ndarray]:
    """Return the external wrench on each link that has one, in base axes at the link's frame.

    Args:
        plant: The plant.
        t: Times of the samples, (m,), in [s].
        q: Positions, (m, n).

    Returns:
        Rows (t, force, torque) by link, (k, 7), in [s], [N], [N m]: at the samples, and at both sides of each switch.
    """
    effects = [effect for effect in plant.effects if isinstance(effect, ExternalWrench)]
    total: dict[str, np.ndarray] = {}
    links = {effect.frame: link_of(plant.dynamics, effect.frame) for effect in effects}
    for link in dict.fromkeys(links.values()):
        on_link = [effect for effect in effects if links[effect.frame] == link]
        switches = np.array([s for effect in on_link for s in effect.switches if t[0] < s <= t[-1]])
        times = np.unique(np.concatenate([t, switches, switches * (1 - _BEFORE)]))
        at = np.stack([np.interp(times, t, np.clip(np.nan_to_num(column), -_FAR, _FAR)) for column in q.T], axis=1)
        placement = plant.dynamics.placement(at, link)
        F = sum(np.where(effect.acts(times)[:, None], effect.at(placement), 0.0) for effect in on_link)
        total[link] = np.column_stack([times, F])
    return total


def link_of(dynamics: Dynamics, frame: str) -> str:
    """Return the link of a frame, which may have the name of its joint."""
    robot = getattr(dynamics, "robot", dynamics)
    return robot.description.joint_frames.get(frame, frame) if isinstance(robot, Robot) else frame


def at_stop(plant: Plant, q: np.ndarray) -> np.ndarray | None:
    """Return True where a joint is beyond a soft stop or touches a rigid one, (m, n); None without stops."""
    soft = [(q < x.lower) | (q > x.upper) for x in plant.effects if isinstance(x, JointStopSpring)]
    rigid = [x.touched(q) != 0 for x in plant.effects if isinstance(x, RigidStops)]
    return np.any(soft + rigid, axis=0) if soft or rigid else None


def frame_of(setup: Setup) -> dict[str, str]:
    """Return the link whose motion is controlled, as a text of the run; empty for control of the joints."""
    if setup.controller is None or setup.controller.task_frame is None:
        return {}
    return {"frame": link_of(setup.plant.dynamics, setup.controller.task_frame)}


def rotors_of(setup: Setup) -> dict[str, str]:
    """Return the inertia of each rotor that a drive of the plant simulates, n² J at its joint, as a text of the run."""
    equation, names = setup.plant.equation_of_motion, setup.plant.dynamics.joint_names
    geared = [drive for drive in equation.drives.values() if isinstance(drive, GearedMotor)]
    rotors = {
        names[i]: float(inertia)
        for drive in geared
        for i, inertia in zip(drive.driven(len(names)), drive.reflected(len(names)), strict=True)
    }
    return {"rotors": json.dumps(rotors, ensure_ascii=False)} if rotors else {}
