"""Replay: runs of arms in a browser, live or as one file; between keyframes each joint turns as q(t) ≈ its chord.

The first run is drawn as it is, the others as ghosts. What cannot be drawn as described is said on the page.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path
from typing import TYPE_CHECKING, Any, final

import numpy as np

from robot_dyn.errors import RobotDynError
from robot_dyn.files import save, target
from robot_dyn.simulation.origin import robot_of
from robot_dyn.simulation.trajectory import Trajectory
from robot_dyn.view import commands
from robot_dyn.view.keyframes import Keyframes, keyframes
from robot_dyn.view.overlays import ground, overlays, squares
from robot_dyn.view.page import page
from robot_dyn.view.series import plots
from robot_dyn.view.stage import Stage, placement
from robot_dyn.view.visuals import Drawing, drawing

if TYPE_CHECKING:
    from robot_dyn.view.server import Server

_FAR = 1e4  # [rad] or [m]; what diverged is not drawn beyond


class ReplayError(RobotDynError):
    """A replay that cannot be made or written."""


def replay(
    run: Trajectory,
    *ghosts: Trajectory,
    package_dirs: Iterable[str | Path] = (),
    frame: str | None = None,
    inertia: bool = False,
    port: int | None = None,
) -> Server:
    """Show runs in the browser, at the `url` of the server that is returned, on this machine alone.

    Args:
        run: What is shown.
        *ghosts: Runs shown with it, clear.
        package_dirs: Folders in which the packages of meshes are searched first.
        frame: Link whose path is traced.
        inertia: Whether each link's equivalent box, of the same mass and inertia, is drawn.
        port: Where to listen; any free one if not given.

    Raises:
        ReplayError: If a run has no samples.
        QueryError: If it carries no robot, or `frame` is no link of it.
        ServerError: If the port is taken.
    """
    from robot_dyn.view.server import Server  # takes meshcat and tornado along

    document = _document((run, *ghosts), package_dirs, frame, inertia)
    drawn = document.pop("commands")
    return Server(page(document | {"live": True}), drawn, port)


def save_replay(
    run: Trajectory,
    path: str | Path,
    *ghosts: Trajectory,
    package_dirs: Iterable[str | Path] = (),
    frame: str | None = None,
    inertia: bool = False,
) -> Path:
    """Write a replay as one HTML file that needs neither server nor network; arguments as of `replay`.

    Raises:
        ReplayError: If a run has no samples.
        QueryError: If it carries no robot, or `frame` is no link of it.
        ReplayError: If the file cannot be written.
    """
    file = target(path, ".html", ReplayError)
    text = page(_document((run, *ghosts), package_dirs, frame, inertia) | {"live": False}).encode()
    return save(file, lambda stream: stream.write(text), ReplayError)


@final
@dataclass(frozen=True, eq=False)
class _Shown:
    """A run on its stage: what of it can be drawn, and how."""

    run: Trajectory
    stage: Stage
    keys: Keyframes
    drawing: Drawing
    notes: tuple[str, ...]


def _document(
    runs: tuple[Trajectory, ...], package_dirs: Iterable[str | Path], frame: str | None, inertia: bool
) -> dict[str, Any]:
    """All that the page is made of."""
    package_dirs = tuple(package_dirs)
    shown = [_shown(number, run, package_dirs, inertia) for number, run in enumerate(runs)]
    center, radius = _sphere(shown)
    found, tracks, notes = [ground(center, radius)], {}, []
    for number, each in enumerate(shown):
        extra = overlays(each.stage, each.run, radius, frame)
        found += each.stage.draw(each.drawing.pieces, ghost=number > 0) + extra.commands
        tracks |= each.stage.tracks(each.keys) | extra.tracks
        who = "" if len(shown) == 1 else f"{_title(number, each)}: "
        notes += [who + note for note in (*each.notes, *each.drawing.notes, *extra.notes)]
    first = runs[0]
    return {
        "title": " and ".join(_title(number, each) for number, each in enumerate(shown)),
        "outcome": f"{first.outcome.ending} at t = {first.outcome.t:g} s",
        "duration": max(float(each.run.t[-1]) for each in shown),
        "notes": [*notes, f"the squares on the ground are {squares(radius):g} m wide"],
        "scene": {"center": center.tolist(), "radius": radius},
        "plots": plots([each.run for each in shown], [each.stage for each in shown]),
        "commands": [*found, commands.set_animation(tracks)],
    }


def _shown(number: int, run: Trajectory, package_dirs: tuple[str | Path, ...], inertia: bool) -> _Shown:
    robot = robot_of(run)
    whole = len(run.t)
    run = _drawable(run)
    stage = Stage("run" if number == 0 else f"ghost {number}", robot)
    keys = keyframes(run.t, stage.linkage.ties.position(run.q))
    notes = []
    if len(run.t) < whole:
        notes.append(f"the last {whole - len(run.t)} samples are not shown: they are not finite, or beyond {_FAR:g}")
    worst = int(keys.error.argmax())
    joint = stage.linkage.bodies[worst]
    notes.append(
        f"{len(keys.t)} keyframes stand for {keys.samples} samples; between them joints are off by at most"
        f" {keys.error[worst]:.1e} {'rad' if joint.revolute else 'm'} ({joint.joint})"
    )
    return _Shown(run, stage, keys, drawing(robot, package_dirs, inertia=inertia), tuple(notes))


def _drawable(run: Trajectory) -> Trajectory:
    """The run up to its first sample that cannot be drawn."""
    good = np.all(np.abs(run.q) < _FAR, axis=1) & np.all(np.isfinite(run.v) & np.isfinite(run.tau), axis=1)
    end = len(good) if good.all() else int(good.argmin())
    if not end:
        raise ReplayError("the run has no samples that can be shown; simulate it again, with a smaller step")
    cut = {name: getattr(run, name)[:end] for name in ("t", "q", "v", "a", "tau")}
    wrenches = {link: F[:end] for link, F in run.wrenches.items()}
    return replace(run, **cut, wrenches=wrenches, at_stop=None if run.at_stop is None else run.at_stop[:end])


def _title(number: int, shown: _Shown) -> str:
    return shown.stage.robot.name + (" (ghost)" if number else "")


def _sphere(shown: list[_Shown]) -> tuple[np.ndarray, float]:
    """Center (3,) and radius in [m] of a sphere about all that is drawn, at a few keyframes."""
    points = []
    for each in shown:
        few = np.unique(np.linspace(0, len(each.keys.t) - 1, 12).round().astype(int))
        points += _corners(each, each.run.q[np.searchsorted(each.run.t, each.keys.t[few]).clip(0, len(each.run.t) - 1)])
    all_ = np.concatenate(points)
    low, high = all_.min(axis=0), all_.max(axis=0)
    return (low + high) / 2, max(float(np.linalg.norm(high - low)) / 2, 1e-3)


def _corners(shown: _Shown, q: np.ndarray) -> list[np.ndarray]:
    """Corners of the boxes about all pieces at positions q (k, n), (8 k, 3) each; and the tip."""
    linkage = shown.stage.linkage
    at = linkage.at(q).in_base
    points = []
    for piece in shown.drawing.pieces:
        R, p = placement(at, *linkage.links[piece.link][:2])
        box = np.array(
            list(product(*zip(piece.mesh.vertices.min(axis=0), piece.mesh.vertices.max(axis=0), strict=True)))
        )
        local = box @ piece.pose[:3, :3].T + piece.pose[:3, 3]
        points.append((np.einsum("...ij,cj->...ci", R, local) + p[..., None, :]).reshape(-1, 3))
    _, tip = placement(at, *linkage.links[shown.stage.tip][:2])
    return [*points, np.zeros((1, 3)), tip.reshape(-1, 3)]
