"""Overlays of a replay: what a run recorded, drawn into it: p_com = Σ mᵢ pᵢ / Σ mᵢ, wrenches, a trace, stops.

Arrows are as long as their force or torque, measured by the largest of the run; the notes give the scale.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import final

import numpy as np

from robot_dyn.simulation.trajectory import Trajectory
from robot_dyn.view import commands
from robot_dyn.view.commands import Command
from robot_dyn.view.shapes import arrow, cylinder, sphere
from robot_dyn.view.stage import Stage, placement
from robot_dyn.view.triangles import Mesh

_GROUND = (0.7, 0.73, 0.77, 1.0)
_COM, _TRACE, _FORCE, _TORQUE, _STOP = (
    (0.94, 0.89, 0.26, 1.0),
    (0.0, 0.62, 0.45, 1.0),
    (0.84, 0.37, 0.0, 1.0),
    (0.8, 0.47, 0.65, 1.0),
    (0.9, 0.05, 0.05, 0.75),
)
_MOST = 2000  # points of a trace, and keyframes of an overlay


@final
@dataclass
class Overlays:
    """Commands, tracks by path, and notes, gathered."""

    commands: list[Command] = field(default_factory=list)
    tracks: dict[str, list[Command]] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)

    def add(self, path: str, mesh: Mesh, rgba: tuple[float, ...], *tracks: Command) -> None:
        """An object with its tracks."""
        self.commands.append(commands.set_object(path, commands.triangles(mesh), commands.material(rgba)))
        if tracks:
            self.tracks[path] = list(tracks)


def overlays(stage: Stage, run: Trajectory, reach: float, frame: str | None = None) -> Overlays:
    """What a run recorded: centre of mass, trace of a frame, external wrenches, joints at their stops.

    Args:
        stage: Where the robot stands.
        run: Its samples.
        reach: Radius of what is seen, in [m].
        frame: Link whose path is traced; the one under control, or the tip, if not given.
    """
    found = Overlays()
    few = np.unique(np.linspace(0, len(run.t) - 1, min(len(run.t), _MOST)).round().astype(int))
    t, at = run.t[few], stage.linkage.at(run.q[few]).in_base
    place = commands.track("position", "vector", t, centre_of_mass(stage, at))
    found.add(f"{stage.root}/centre of mass", sphere(0.02 * reach), _COM, place)

    frame = frame or run.about.get("frame") or stage.tip
    stage.link_path(frame)  # so that a name that is wrong is told
    path = np.broadcast_to(placement(at, *stage.linkage.links[frame][:2])[1], (len(t), 3))
    line = commands.polyline(path), commands.material(_TRACE, line=True)
    found.commands.append(commands.set_object(f"{stage.root}/trace", *line, kind="Line"))
    found.notes.append(f"the line is the path of {frame}; the yellow ball is the centre of mass of what moves")

    for which, rgba, unit in ((slice(0, 3), _FORCE, "N"), (slice(3, 6), _TORQUE, "N m")):
        _arrows(found, stage, run, reach, which, rgba, unit)
    if run.at_stop is not None:
        _stops(found, stage, run, reach)
    return found


def squares(reach: float) -> float:
    """Edge of the ground's squares, in [m]."""
    return 10.0 ** np.round(np.log10(reach)) / 5


def ground(center: np.ndarray, reach: float) -> Command:
    """Squares at z = 0 about what is seen, each edge a line of its own: viewers drop lines that pass behind the eye."""
    edge = squares(reach)
    middle, count = np.round(center[:2] / edge), int(np.ceil(4 * reach / edge))
    ticks = np.arange(-count, count + 1)
    x, y = np.meshgrid(ticks, ticks[:-1], indexing="ij")
    along = np.stack([np.stack([x, y], axis=-1), np.stack([x, y + 1], axis=-1)], axis=-2).reshape(-1, 2)
    flat = (np.vstack([along, along[:, ::-1]]) + middle) * edge
    points = np.column_stack([flat, np.zeros(len(flat))])
    look = commands.material(_GROUND, line=True)
    return commands.set_object("ground", commands.polyline(points), look, kind="LineSegments")


def centre_of_mass(stage: Stage, at: list[tuple[np.ndarray, np.ndarray]]) -> np.ndarray:
    """Centre of mass of the bodies that move, (m, 3), where they are placed at (R, p) each."""
    total, mass = np.zeros_like(at[0][1]), 0.0
    for inertia, (R, p) in zip(stage.linkage.inertias, at, strict=True):
        mc = np.stack([inertia[5, 1], inertia[3, 2], inertia[4, 0]])  # 𝓜 holds m ĉ in its lower left block
        total, mass = total + inertia[0, 0] * p + R @ mc, mass + inertia[0, 0]
    return total / mass if mass > 0 else total


def _arrows(
    found: Overlays, stage: Stage, run: Trajectory, reach: float, which: slice, rgba: tuple[float, ...], unit: str
) -> None:
    """One arrow a link: forces in [N], or torques in [N m]."""
    largest = max((np.linalg.norm(F[:, which], axis=1).max() for F in run.wrenches.values()), default=0.0)
    if not largest > 0:
        return
    found.notes.append(
        f"arrows: {0.4 * reach:.2g} m long for the largest {'force' if unit == 'N' else 'torque'}, {largest:.4g} {unit}"
    )
    for link, F in run.wrenches.items():
        few = _changes(F, len(run.t))
        vectors = F[few, which]
        at = stage.linkage.at(run.q[few]).in_base
        points = np.broadcast_to(placement(at, *stage.linkage.links[link][:2])[1], vectors.shape)
        lengths = np.linalg.norm(vectors, axis=1)
        t = run.t[few]
        found.add(
            f"{stage.root}/{'force' if unit == 'N' else 'torque'} on {link.replace('/', '∕')}",
            arrow(0.4 * reach),
            rgba,
            commands.track("position", "vector", t, points),
            commands.track("quaternion", "quaternion", t, _along(vectors)),
            commands.track("scale", "vector", t, np.maximum(lengths / largest, 1e-6)[:, None] * np.ones(3)),
            commands.track("visible", "bool", t, lengths > 0),
        )


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
        along = commands.track("quaternion", "quaternion", run.t[:1], _along(axis[None]))
        seen = commands.track("visible", "bool", run.t[first], bears[first])
        found.add(path, cylinder(0.06 * reach, 0.15 * reach), _STOP, along, seen)
        found.notes.append(f"{name} turns red while it bears on a stop")


def _changes(F: np.ndarray, m: int) -> np.ndarray:
    """A few samples, and both sides of each jump of a wrench, whose end would else be drawn late."""
    few = np.linspace(0, m - 1, min(m, _MOST)).round().astype(int)
    jump = np.flatnonzero((F[1:] != 0).any(axis=1) != (F[:-1] != 0).any(axis=1))
    return np.unique(np.concatenate([few, jump, jump + 1]))


def _along(vectors: np.ndarray) -> np.ndarray:
    """Quaternions (k, 4) that turn the z axis along vectors (k, 3); none where a vector is 0."""
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    x, y, z = (vectors / np.where(length > 0, length, 1.0)).T
    turns = np.stack([-y, x, 0 * z, 1 + z], axis=1)  # (ẑ × d, 1 + ẑ · d), not yet of unit length
    turns[(length[:, 0] == 0)] = [0, 0, 0, 1]
    turns[(np.abs(turns).max(axis=1) < 1e-9)] = [1, 0, 0, 0]  # straight down
    return turns / np.linalg.norm(turns, axis=1, keepdims=True)
