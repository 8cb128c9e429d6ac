"""Arrows: the external wrenches of runs, F = (f, τ), each length a part of the largest force or torque of all runs."""

from __future__ import annotations

import numpy as np

from robot_dyn.simulation.results.trajectory import Trajectory
from robot_dyn.view import commands
from robot_dyn.view.geometry.shapes import arrow
from robot_dyn.view.keyframes import corners
from robot_dyn.view.overlays import PART, Overlays, Rgba, along, of_link
from robot_dyn.view.stage import Stage

_LONGEST = 0.4  # of the radius of what is seen
_KINDS: tuple[tuple[str, str, slice, str, Rgba], ...] = (
    ("force", "orange", slice(1, 4), "N", (0.84, 0.37, 0.0, 1.0)),
    ("torque", "pink", slice(4, 7), "N m", (0.8, 0.47, 0.65, 1.0)),
)


def arrows(shown: list[tuple[Stage, Trajectory, Overlays]], reach: float) -> list[str]:
    """Add the arrows of all runs, on one scale; what the scale is, in words.

    Args:
        shown: Stage, samples and overlays of each run.
        reach: Radius of what is seen, in [m].
    """
    notes = []
    for kind, colour, which, unit, rgba in _KINDS:
        sizes = [np.linalg.norm(F[:, which], axis=1).max() for _, run, _ in shown for F in run.wrenches.values()]
        if not (largest := float(max(sizes, default=0.0))) > 0:
            continue
        notes.append(f"{colour} arrows: {kind}s, {_LONGEST * reach:.2g} m long for the largest, {largest:.4g} {unit}")
        for stage, run, found in shown:
            for link, F in run.wrenches.items():
                _arrow(found, stage, run, reach, f"{kind} on {link}", link, F[:, 0], F[:, which] / largest, rgba)
    return notes


def _arrow(
    found: Overlays, stage: Stage, run: Trajectory, reach: float, name: str, link: str,
    t: np.ndarray, F: np.ndarray, rgba: Rgba,
) -> None:  # fmt: skip
    """One arrow on a link: F (k, 3) at times t (k,), in parts of the largest."""
    q = np.stack([np.interp(t, run.t, column) for column in run.q.T], axis=1)
    points = of_link(stage, q, link)
    kept = np.flatnonzero(corners(t, np.hstack([points / reach, F]), PART))
    t, F, points = t[kept], F[kept], points[kept]
    lengths = np.linalg.norm(F, axis=1)
    found.add(
        f"{stage.root}/{name.replace('/', '∕')}",
        arrow(_LONGEST * reach),
        rgba,
        commands.track("position", "vector", t, points),
        commands.track("quaternion", "quaternion", t, along(F)),
        commands.track("scale", "vector", t, np.maximum(lengths, 1e-6)[:, None] * np.ones(3)),
        commands.track("visible", "bool", t, lengths > 0),
    )
