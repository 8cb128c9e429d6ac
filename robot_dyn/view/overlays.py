"""Overlays of a replay: what a run recorded, drawn into it: p_com = Σ mᵢ pᵢ / Σ mᵢ, a trace, stops.

Paths are thinned like joints: a straight line replaces the samples between keyframes, to a part of what is seen.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import final

import numpy as np

from robot_dyn.simulation.results.trajectory import Trajectory
from robot_dyn.spatial import first_moment
from robot_dyn.view import commands
from robot_dyn.view.commands import Command
from robot_dyn.view.geometry.shapes import cylinder, sphere
from robot_dyn.view.geometry.triangles import Mesh
from robot_dyn.view.keyframes import Keyframes, keyframes
from robot_dyn.view.stage import Stage, placement

Rgba = tuple[float, float, float, float]
Placements = Mapping[int, tuple[np.ndarray, np.ndarray]]

_COM: Rgba = (0.94, 0.89, 0.26, 1.0)
_TRACE: Rgba = (0.0, 0.62, 0.45, 1.0)
_STOP: Rgba = (0.9, 0.05, 0.05, 0.75)
GHOST = 0.35  # opacity
PART = 5e-4  # of what is seen: how far a path may be off between keyframes
_CHUNK = 20_000  # samples whose placements are held at a time


@final
@dataclass
class Overlays:
    """Commands, tracks by path, and notes, gathered.

    Attributes:
        ghost: Whether what is added lets light through.
    """

    ghost: bool = False
    commands: list[Command] = field(default_factory=list)
    tracks: dict[str, list[Command]] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)

    def colour(self, rgba: Rgba) -> Rgba:
        """A colour, clear if it is a ghost's."""
        return (*rgba[:3], rgba[3] * GHOST) if self.ghost else rgba

    def add(self, path: str, mesh: Mesh, rgba: Rgba, *tracks: Command) -> None:
        """An object with its tracks."""
        look = commands.material(self.colour(rgba))
        self.commands.append(commands.set_object(path, commands.triangles(mesh), look))
        if tracks:
            self.tracks[path] = list(tracks)


def overlays(stage: Stage, run: Trajectory, reach: float, frame: str | None = None, ghost: bool = False) -> Overlays:
    """What a run recorded: centre of mass, trace of a frame, joints at their stops.

    Args:
        stage: Where the robot stands.
        run: Its samples.
        reach: Radius of what is seen, in [m].
        frame: Link whose path is traced; the one under control, or the tip, if not given.
        ghost: Whether it is drawn clear.
    """
    found = Overlays(ghost)
    com = keyframes(run.t, over(stage, run.q, lambda at: centre_of_mass(stage, at)), PART * reach)
    place = commands.track("position", "vector", com.t, com.q)
    found.add(f"{stage.root}/centre of mass", sphere(0.02 * reach), _COM, place)

    frame = frame or run.about.get("frame") or stage.tip
    path = keyframes(run.t, of_link(stage, run.q, frame), PART * reach)
    line = commands.polyline(path.q), commands.material(found.colour(_TRACE), line=True)
    found.commands.append(commands.set_object(f"{stage.root}/trace", *line, kind="Line"))
    what = f"the line is the path of {frame}, the yellow ball the centre of mass of what moves"
    found.notes.append(f"{what}; they are off by at most {1e3 * _off(com, path):.1g} mm")
    if run.at_stop is not None:
        _stops(found, stage, run, reach)
    return found


def _off(*paths: Keyframes) -> float:
    """Largest distance of a path from a sample, bounded by its coordinates'."""
    return max(float(np.linalg.norm(path.error)) for path in paths)


def over(stage: Stage, q: np.ndarray, ask: Callable[[Placements], np.ndarray]) -> np.ndarray:
    """What is asked of the placements of all bodies, at positions q (m, n)."""
    chunks = [q[i : i + _CHUNK] for i in range(0, len(q), _CHUNK)]
    return np.concatenate([ask(stage.linkage.at(chunk).in_base) for chunk in chunks])


def of_link(stage: Stage, q: np.ndarray, link: str) -> np.ndarray:
    """Positions of a link's frame, (m, 3); QueryError if there is no such link."""
    stage.link_path(link)
    body, pose, _ = stage.linkage.links[link]
    shape = (-1, 3)
    return over(stage, q, lambda at: np.broadcast_to(placement(at, body, pose)[1], (len(at[0][1]), 3)).reshape(shape))


def centre_of_mass(stage: Stage, at: Placements) -> np.ndarray:
    """Centre of mass of the bodies that move, (m, 3), where they are placed at (R, p) each."""
    total, mass = np.zeros_like(at[0][1]), 0.0
    for inertia, (R, p) in zip(stage.linkage.inertias, at.values(), strict=True):
        total, mass = total + inertia[0, 0] * p + R @ first_moment(inertia), mass + inertia[0, 0]
    return total / mass if mass > 0 else total


def _stops(found: Overlays, stage: Stage, run: Trajectory, reach: float) -> None:
    """A red drum on each joint that comes to a stop, seen while it bears on it."""
    assert run.at_stop is not None
    for index, name in enumerate(run.joint_names):
        bears = run.at_stop[:, index]
        if not bears.any():
            continue
        first = np.concatenate([[True], bears[1:] != bears[:-1]])
        body = next(i for i, each in enumerate(stage.linkage.bodies) if each.joint == name)
        path, axis = f"{stage.paths[body]}/at its stop", stage.linkage.bodies[body].axis
        turned = commands.track("quaternion", "quaternion", run.t[:1], along(axis[None]))
        seen = commands.track("visible", "bool", run.t[first], bears[first])
        found.add(path, cylinder(0.06 * reach, 0.15 * reach), _STOP, turned, seen)
        found.notes.append(f"{name} is red while it is at a stop")


def along(vectors: np.ndarray) -> np.ndarray:
    """Quaternions (k, 4) that turn the z axis along vectors (k, 3); none where a vector is 0."""
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    x, y, z = (vectors / np.where(length > 0, length, 1.0)).T
    turns = np.stack([-y, x, 0 * z, 1 + z], axis=1)  # (ẑ × d, 1 + ẑ · d), not yet of unit length
    turns[(length[:, 0] == 0)] = [0, 0, 0, 1]
    turns[(np.abs(turns).max(axis=1) < 1e-9)] = [1, 0, 0, 0]  # straight down
    return turns / np.linalg.norm(turns, axis=1, keepdims=True)
