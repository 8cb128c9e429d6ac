"""Overlays of a replay: centre of mass Σ mᵢ pᵢ / Σ mᵢ, paths of frames, stops, and arrows of external wrenches (f, τ).

Paths are thinned like joint positions: straight lines between keyframes, accurate to a fraction of the scene.
"""

from __future__ import annotations

import numpy as np

from robot_dyn.lagrange.linkage import BASE
from robot_dyn.simulation.results.run_data import TrajectoryData
from robot_dyn.view.commands import Canvas, Rgba, triangles
from robot_dyn.view.geometry.shapes import arrow, cylinder, sphere
from robot_dyn.view.keyframes import Motion, corners, keyframes
from robot_dyn.view.stage import Stage, plain

_COM: Rgba = (0.94, 0.89, 0.26, 1.0)
_TRACE: Rgba = (0.0, 0.62, 0.45, 1.0)
_STOP: Rgba = (0.9, 0.05, 0.05, 0.75)
_PART = 5e-4  # fraction of the scene: largest error of a path between keyframes
_LONGEST = 0.4  # length of the arrow of the largest force or torque of all runs, in radii of the scene
_WRENCH: tuple[tuple[str, str, slice, str, Rgba], ...] = (
    ("force", "orange", slice(1, 4), "N", (0.84, 0.37, 0.0, 1.0)),
    ("torque", "pink", slice(4, 7), "N m", (0.8, 0.47, 0.65, 1.0)),
)
_MAX_PATHS = 60  # drawn paths of frames, per run


def draw_paths(canvas: Canvas, stage: Stage, motion: Motion, reach: float, frame: str) -> tuple[tuple[str, ...], str]:
    """Draw the centre of mass, and the paths of a frame and of other moving links, starting near the tip.

    Args:
        canvas: Canvas to draw on.
        stage: Stage of the robot.
        motion: Samples of the run, and points between them.
        reach: Radius of the scene, in [m].
        frame: Link whose path the page shows when it opens.

    Returns:
        The links whose paths are drawn, the one to be shown first; and a note.
    """
    com = keyframes(motion.t, stage.centre_of_mass(motion.q), _PART * reach)
    ball = f"{stage.root}/centre of mass"
    canvas.mesh(ball, triangles(sphere(0.02 * reach)), stage.tint(_COM))
    canvas.move(ball, position=(com.t, com.q))
    moving = [name for name, (body, _, _) in stage.linkage.links.items() if body != BASE]
    frames = tuple(dict.fromkeys([frame, *reversed(moving)]))[:_MAX_PATHS]
    points = stage.positions(motion.q, frames)
    paths = [keyframes(motion.t, points[:, i], _PART * reach) for i in range(len(frames))]
    for name, drawn in zip(frames, paths, strict=True):
        canvas.line(path := f"{stage.root}/paths/{plain(name)}", drawn.q, stage.tint(_TRACE))
        if name != frame:
            canvas.hide(path)
    off = max(float(np.linalg.norm(path.error)) for path in (com, *paths))  # bounded by that of its coordinates
    meaning = "the line is the path of a frame, the yellow ball the centre of mass of the moving links"
    return frames, f"{meaning}; both are accurate to {1e3 * off:.1g} mm"


def draw_stops(canvas: Canvas, stage: Stage, run: TrajectoryData, reach: float) -> list[str]:
    """Draw a red drum on each joint that reaches a stop, visible while it is at the stop; return notes."""
    if run.at_stop is None:
        return []
    notes, numbers = [], {body.joint: number for number, body in enumerate(stage.linkage.bodies)}
    for name, bears in zip(run.joint_names, run.at_stop.T, strict=True):
        if bears.any():
            number, first = numbers[name], np.concatenate([[True], bears[1:] != bears[:-1]])
            path, axis = f"{stage.paths[number]}/at its stop", stage.linkage.bodies[number].axis
            canvas.mesh(path, triangles(cylinder(0.06 * reach, 0.15 * reach)), stage.tint(_STOP))
            canvas.move(path, quaternion=(run.t[:1], _along(axis[None])), visible=(run.t[first], bears[first]))
            notes.append(f"{name} is red while it is at a stop")
    return notes


def draw_arrows(canvas: Canvas, runs: list[tuple[Stage, TrajectoryData]], reach: float) -> list[str]:
    """Draw the wrenches on links of all runs as arrows, on one scale; return notes on the scale."""
    notes = []
    for kind, colour, which, unit, rgba in _WRENCH:
        sizes = [np.linalg.norm(F[:, which], axis=1).max() for _, run in runs for F in run.wrenches.values()]
        if not (largest := float(max(sizes, default=0.0))) > 0:
            continue
        notes.append(f"{colour} arrows: {kind}s, {_LONGEST * reach:.2g} m long for the largest, {largest:.4g} {unit}")
        for stage, run in runs:
            for link, rows in run.wrenches.items():
                path = f"{stage.root}/{plain(f'{kind} on {link}')}"
                canvas.mesh(path, triangles(arrow(_LONGEST * reach)), stage.tint(rgba))
                canvas.move(path, **_arrow(stage, run, reach, link, rows[:, 0], rows[:, which] / largest))
    return notes


def _arrow(
    stage: Stage, run: TrajectoryData, reach: float, link: str, t: np.ndarray, F: np.ndarray
) -> dict[str, tuple[np.ndarray, np.ndarray]]:
    """Return the tracks of an arrow on a link: F (k, 3) at times t (k,), as fractions of the largest."""
    q = np.stack([np.interp(t, run.t, column) for column in run.q.T], axis=1)
    points = stage.positions(q, [link])[:, 0]
    keys = corners(t, np.hstack([points / reach, F]), _PART)
    t, F, points = t[keys], F[keys], points[keys]
    lengths = np.linalg.norm(F, axis=1)
    scale = np.maximum(lengths, 1e-6)[:, None] * np.ones(3)
    return {"position": (t, points), "quaternion": (t, _along(F)), "scale": (t, scale), "visible": (t, lengths > 0)}


def _along(vectors: np.ndarray) -> np.ndarray:
    """Return quaternions (k, 4) that turn the z axis along vectors (k, 3); the identity where a vector is 0."""
    length = np.linalg.norm(vectors, axis=1, keepdims=True)
    x, y, z = (vectors / np.where(length > 0, length, 1.0)).T
    turns = np.stack([-y, x, 0 * z, 1 + z], axis=1)  # (ẑ × d, 1 + ẑ · d), not yet of unit length
    turns[(length[:, 0] == 0)] = [0, 0, 0, 1]
    turns[(np.abs(turns).max(axis=1) < 1e-9)] = [1, 0, 0, 0]  # straight down
    return turns / np.linalg.norm(turns, axis=1, keepdims=True)
