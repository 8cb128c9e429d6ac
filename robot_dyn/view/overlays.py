"""Overlays of a replay: p_com = Σ mᵢ pᵢ / Σ mᵢ, the paths of frames, stops, and arrows of external wrenches (f, τ).

Paths are thinned like joints: a straight line replaces the samples between keyframes, to a part of what is seen.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import final

import numpy as np

from robot_dyn.foundations.spatial import first_moment
from robot_dyn.lagrange.linkage import BASE, Pose
from robot_dyn.shapes.triangles import Mesh
from robot_dyn.simulation.results.run_data import TrajectoryData
from robot_dyn.view import commands
from robot_dyn.view.commands import Command
from robot_dyn.view.geometry.shapes import arrow, cylinder, sphere
from robot_dyn.view.keyframes import Keyframes, Motion, corners, keyframes
from robot_dyn.view.stage import Stage, placement, plain

Rgba = tuple[float, float, float, float]
Placements = Mapping[int, tuple[np.ndarray, np.ndarray]]

_COM: Rgba = (0.94, 0.89, 0.26, 1.0)
_TRACE: Rgba = (0.0, 0.62, 0.45, 1.0)
_STOP: Rgba = (0.9, 0.05, 0.05, 0.75)
GHOST = 0.35  # opacity
_PART = 5e-4  # of what is seen: how far a path may be off between keyframes
_LONGEST = 0.4  # of the radius of what is seen: the arrow of the largest force or torque of all runs
_WRENCH: tuple[tuple[str, str, slice, str, Rgba], ...] = (
    ("force", "orange", slice(1, 4), "N", (0.84, 0.37, 0.0, 1.0)),
    ("torque", "pink", slice(4, 7), "N m", (0.8, 0.47, 0.65, 1.0)),
)
_MOST_PATHS = 60  # of frames, of a run
_CHUNK = 20_000  # samples whose placements are held at a time


@final
@dataclass
class Overlays:
    """Commands, tracks by path, and notes.

    Attributes:
        ghost: Whether the overlays are transparent.
        frames: Links whose paths are drawn, the one to be shown first.
    """

    ghost: bool = False
    commands: list[Command] = field(default_factory=list)
    tracks: dict[str, list[Command]] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    frames: tuple[str, ...] = ()

    def colour(self, rgba: Rgba) -> Rgba:
        """A colour, transparent if it is a ghost's."""
        return (*rgba[:3], rgba[3] * GHOST) if self.ghost else rgba

    def add(self, path: str, mesh: Mesh, rgba: Rgba, *tracks: Command) -> None:
        """An object with its tracks."""
        look = commands.material(self.colour(rgba))
        self.commands.append(commands.set_object(path, commands.triangles(mesh), look))
        if tracks:
            self.tracks[path] = list(tracks)


def overlays(
    stage: Stage, run: TrajectoryData, motion: Motion, reach: float, frame: str | None = None, ghost: bool = False
) -> Overlays:
    """What a run recorded: centre of mass, paths of frames, joints at their stops.

    Args:
        stage: Where the robot stands.
        run: Its samples.
        motion: What lies between them.
        reach: Radius of what is seen, in [m].
        frame: Link whose path is shown at first; the one under control, or the tip, if not given.
        ghost: Whether it is drawn transparent.
    """
    found = Overlays(ghost)
    com = keyframes(motion.t, _over(stage, motion.q, lambda at: centre_of_mass(stage, at)), _PART * reach)
    place = commands.track("position", "vector", com.t, com.q)
    found.add(f"{stage.root}/centre of mass", sphere(0.02 * reach), _COM, place)

    frame = frame or run.about.get("frame") or stage.tip
    stage.link_path(frame)  # raises if there is none
    paths = _paths(found, stage, motion, reach, frame)
    what = "the line is the path of a frame, the yellow ball the centre of mass of what moves"
    found.notes.append(f"{what}; they are off by at most {1e3 * _off(com, *paths):.1g} mm")
    if run.at_stop is not None:
        _stops(found, stage, run, reach)
    return found


def _paths(found: Overlays, stage: Stage, motion: Motion, reach: float, first: str) -> list[Keyframes]:
    """Add the paths of a frame and of the other links that move, those next to the tip first."""
    links, moving = stage.linkage.links, [name for name, (body, _, _) in stage.linkage.links.items() if body != BASE]
    found.frames = tuple(dict.fromkeys([first, *reversed(moving)]))[:_MOST_PATHS]
    poses = [links[name][:2] for name in found.frames]
    points = _over(stage, motion.q, lambda at: np.stack([_origin(at, body, pose) for body, pose in poses], axis=1))
    paths = [keyframes(motion.t, points[:, i], _PART * reach) for i in range(len(poses))]
    look = commands.material(found.colour(_TRACE), line=True)
    for name, drawn in zip(found.frames, paths, strict=True):
        place = f"{stage.root}/paths/{plain(name)}"
        found.commands.append(commands.set_object(place, commands.polyline(drawn.q), look, kind="Line"))
        if name != first:
            found.commands.append(commands.set_property(place, "visible", False))
    return paths


def _origin(at: Placements, body: int, pose: Pose) -> np.ndarray:
    """Positions of the origin of a frame of a body, (m, 3)."""
    p = placement(at, body, pose)[1]
    return np.broadcast_to(p, (len(at[0][1]), 3))


def _off(*paths: Keyframes) -> float:
    """Largest distance of a path from a sample, bounded by its coordinates'."""
    return max(float(np.linalg.norm(path.error)) for path in paths)


def _over(stage: Stage, q: np.ndarray, function: Callable[[Placements], np.ndarray]) -> np.ndarray:
    """Evaluate a function of the placements of all bodies at positions q (m, n)."""
    chunks = [q[i : i + _CHUNK] for i in range(0, len(q), _CHUNK)]
    return np.concatenate([function(stage.linkage.at(chunk).in_base) for chunk in chunks])


def _of_link(stage: Stage, q: np.ndarray, link: str) -> np.ndarray:
    """Positions of a link's frame, (m, 3); QueryError if there is no such link."""
    stage.link_path(link)
    body, pose, _ = stage.linkage.links[link]
    return _over(stage, q, lambda at: _origin(at, body, pose))


def centre_of_mass(stage: Stage, at: Placements) -> np.ndarray:
    """Centre of mass of the bodies that move, (m, 3), where they are placed at (R, p) each."""
    total, mass = np.zeros_like(at[0][1]), 0.0
    for inertia, (R, p) in zip(stage.linkage.inertias, at.values(), strict=True):
        total, mass = total + inertia[0, 0] * p + R @ first_moment(inertia), mass + inertia[0, 0]
    return total / mass if mass > 0 else total


def _stops(found: Overlays, stage: Stage, run: TrajectoryData, reach: float) -> None:
    """A red drum on each joint that comes to a stop, visible while it is there."""
    assert run.at_stop is not None
    for index, name in enumerate(run.joint_names):
        bears = run.at_stop[:, index]
        if not bears.any():
            continue
        first = np.concatenate([[True], bears[1:] != bears[:-1]])
        body = next(i for i, each in enumerate(stage.linkage.bodies) if each.joint == name)
        path, axis = f"{stage.paths[body]}/at its stop", stage.linkage.bodies[body].axis
        turned = commands.track("quaternion", "quaternion", run.t[:1], _along(axis[None]))
        seen = commands.track("visible", "bool", run.t[first], bears[first])
        found.add(path, cylinder(0.06 * reach, 0.15 * reach), _STOP, turned, seen)
        found.notes.append(f"{name} is red while it is at a stop")


def arrows(shown: list[tuple[Stage, TrajectoryData, Overlays]], reach: float) -> list[str]:
    """Add the arrows of all runs, on one scale; return notes on the scale.

    Args:
        shown: Stage, samples and overlays of each run.
        reach: Radius of what is seen, in [m].
    """
    notes = []
    for kind, colour, which, unit, rgba in _WRENCH:
        sizes = [np.linalg.norm(F[:, which], axis=1).max() for _, run, _ in shown for F in run.wrenches.values()]
        if not (largest := float(max(sizes, default=0.0))) > 0:
            continue
        notes.append(f"{colour} arrows: {kind}s, {_LONGEST * reach:.2g} m long for the largest, {largest:.4g} {unit}")
        for stage, run, found in shown:
            for link, F in run.wrenches.items():
                _arrow(found, stage, run, reach, f"{kind} on {link}", link, F[:, 0], F[:, which] / largest, rgba)
    return notes


def _arrow(
    found: Overlays, stage: Stage, run: TrajectoryData, reach: float, name: str, link: str,
    t: np.ndarray, F: np.ndarray, rgba: Rgba,
) -> None:  # fmt: skip
    """One arrow on a link: F (k, 3) at times t (k,), in parts of the largest."""
    q = np.stack([np.interp(t, run.t, column) for column in run.q.T], axis=1)
    points = _of_link(stage, q, link)
    keys = np.flatnonzero(corners(t, np.hstack([points / reach, F]), _PART))
    t, F, points = t[keys], F[keys], points[keys]
    lengths = np.linalg.norm(F, axis=1)
    found.add(
        f"{stage.root}/{plain(name)}",
        arrow(_LONGEST * reach),
        rgba,
        commands.track("position", "vector", t, points),
        commands.track("quaternion", "quaternion", t, _along(F)),
        commands.track("scale", "vector", t, np.maximum(lengths, 1e-6)[:, None] * np.ones(3)),
        commands.track("visible", "bool", t, lengths > 0),
    )


def _along(vectors: np.ndarray) -> np.ndarray:
    """Quaternions (k, 4) that turn the z axis along vectors (k, 3); none where a vector is 0."""
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    x, y, z = (vectors / np.where(length > 0, length, 1.0)).T
    turns = np.stack([-y, x, 0 * z, 1 + z], axis=1)  # (ẑ × d, 1 + ẑ · d), not yet of unit length
    turns[(length[:, 0] == 0)] = [0, 0, 0, 1]
    turns[(np.abs(turns).max(axis=1) < 1e-9)] = [1, 0, 0, 0]  # straight down
    return turns / np.linalg.norm(turns, axis=1, keepdims=True)
