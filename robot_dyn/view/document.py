"""The document of a replay: what its page is made of, from runs, their robots and their meshes.

The first run is drawn as it is, the others as ghosts. What is not drawn as described is said.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, final

import numpy as np

from robot_dyn.description.packages import searched
from robot_dyn.errors import QueryError, RobotDynError
from robot_dyn.simulation.observation.remarks import lines
from robot_dyn.simulation.results.provenance import robot_of
from robot_dyn.simulation.results.trajectory import Trajectory
from robot_dyn.spatial import homogeneous
from robot_dyn.validate import instance, truth
from robot_dyn.view import commands
from robot_dyn.view.arrows import arrows
from robot_dyn.view.geometry.visuals import Drawing, drawing
from robot_dyn.view.keyframes import Keyframes, keyframes
from robot_dyn.view.overlays import GHOST, Overlays, overlays
from robot_dyn.view.plots.price import price
from robot_dyn.view.plots.series import plots
from robot_dyn.view.rests import rests
from robot_dyn.view.scenery import gravity_arrow, gravity_label, ground, scenery, turned, upright
from robot_dyn.view.stage import Stage

_MOST_EVENTS = 200  # of a run
_FAR = 1e4  # [rad] or [m]; what diverged is not drawn beyond


class ReplayError(RobotDynError):
    """A replay that cannot be made or written."""


@final
@dataclass(frozen=True, eq=False)
class Shown:
    """A run on its stage.

    Attributes:
        name: In titles and notes.
        run: What of it can be drawn.
        stage: Where its robot stands.
        keys: Keyframes of its joints.
        drawing: The look of its robot.
        problems: What is drawn otherwise than the files describe, in words.
        notes: What else a reader should know.
    """

    name: str
    run: Trajectory
    stage: Stage
    keys: Keyframes
    drawing: Drawing
    problems: tuple[str, ...]
    notes: tuple[str, ...]


@np.errstate(all="ignore")  # what is far out is drawn as far as it can be
def document(
    runs: tuple[Trajectory, ...], package_dirs: Iterable[str | Path], frame: str | None, inertia: bool
) -> dict[str, Any]:
    """All that the page is made of; arguments as of `replay`.

    Raises:
        ReplayError: If a run has no samples.
        QueryError: If it carries no robot, or no robot has the frame.
    """
    for run in runs:
        instance("run", run, Trajectory, "give the trajectory of rd.simulate, or a run of rollouts, as runs[0]")
    package_dirs, inertia = searched(package_dirs), truth("inertia", inertia)
    instance("frame", frame, str | None, "give the name of a link, or None")
    shown = [_shown(number, run, len(runs), package_dirs, inertia) for number, run in enumerate(runs)]
    if frame is not None and all(frame not in each.stage.linkage.links for each in shown):
        shown[0].stage.link_path(frame)  # says so, with the nearest names
    gravity = shown[0].stage.robot.edits.gravity
    turn = upright(gravity)
    seen = scenery(np.concatenate([_corners(each) for each in shown]) @ turn.T)
    radius = seen.radius
    layers = [_overlays(each, radius, frame, number > 0) for number, each in enumerate(shown)]
    scale = arrows([(each.stage, each.run, layer) for each, layer in zip(shown, layers, strict=True)], radius)
    found, tracks, notes, problems, remarks = [ground(seen), *gravity_arrow(seen, gravity)], {}, [], [], []
    for number, (each, layer) in enumerate(zip(shown, layers, strict=True)):
        clear = GHOST if number else 1.0
        found.append(commands.set_transform(each.stage.root, homogeneous(turn, np.zeros(3))))
        found += each.stage.draw(each.drawing.pieces, clear) + layer.commands
        tracks |= each.stage.tracks(each.keys) | layer.tracks
        who = "" if len(shown) == 1 else f"{each.name}: "
        notes += [who + note for note in (*each.notes, *each.drawing.remarks, *layer.notes)]
        problems += [who + note for note in (*each.problems, *each.drawing.notes)]
        remarks += [who + line for line in lines(each.run.remarks)]
    return {
        "title": " and ".join(each.name for each in shown),
        "outcome": "; ".join(_outcome(each, len(shown)) for each in shown),
        "duration": max(float(each.run.t[-1]) for each in shown),
        "remarks": remarks,
        "problems": problems,
        "gravity": _labels(shown),
        "events": _events(shown),
        "rests": _rests(shown),
        "notes": [*notes, *scale, *turned(gravity), f"the squares on the floor are {seen.square:g} m wide"],
        "scene": seen.as_json(),
        "plots": plots([each.run for each in shown], [each.stage for each in shown]),
        "price": price([(each.name, each.run) for each in shown]),
        "commands": [*found, commands.set_animation(tracks)],
    }


def _overlays(shown: Shown, radius: float, frame: str | None, ghost: bool) -> Overlays:
    own = frame if frame in shown.stage.linkage.links else None  # a ghost may be another robot
    return overlays(shown.stage, shown.run, radius, own, ghost)


def _events(shown: list[Shown]) -> list[dict[str, Any]]:
    """The events of all runs, the first ones of each; they are marked on the plots, and named as they occur."""
    return [
        {"t": event.t, "name": event.name if len(shown) == 1 else f"{each.name}: {event.name}"}
        for each in shown
        for event in each.run.events[:_MOST_EVENTS]
    ]


def _rests(shown: list[Shown]) -> list[dict[str, Any]]:
    """A line for each joint that is held for a time, or meets a rigid stop: its rests, and its events."""
    made = []
    for each in shown:
        for name, spans in zip(each.run.joint_names, rests(each.run), strict=True):
            if spans:
                who = name if len(shown) == 1 else f"{each.name}: {name}"
                met = [(event.t, event.name) for event in each.run.events if event.joint == name]
                made.append({"joint": who, "spans": [list(span) for span in spans], "events": met[:_MOST_EVENTS]})
    return made


def _outcome(shown: Shown, count: int) -> str:
    end = shown.run.outcome
    who = "" if count == 1 else f"{shown.name}: "
    return f"{who}{end.ending} at t = {end.t:g} s" + (f": {end.advice}" if end.advice else "")


def _shown(number: int, run: Trajectory, count: int, package_dirs: tuple[Path, ...], inertia: bool) -> Shown:
    robot = robot_of(run)
    whole, run = len(run.t), _drawable(run)
    stage = Stage("run" if number == 0 else f"ghost {number}", robot)
    if unknown := run.wrenches.keys() - stage.linkage.links.keys():
        raise QueryError(f"the run has a wrench on {min(unknown)!r}, which is not a link of its robot; simulate again")
    keys = keyframes(run.t, stage.linkage.couplings.position(run.q))
    problems = []
    if len(run.t) < whole:
        problems.append(f"the last {whole - len(run.t)} samples are not shown: not finite, or beyond {_FAR:g}")
    worst = int(keys.error.argmax())
    joint = stage.linkage.bodies[worst]
    thinning = (
        f"drawn at {len(keys.t)} of the {keys.samples} samples; between these, joint positions are interpolated, with"
        f" an error of at most {keys.error[worst]:.1e} {'rad' if joint.revolute else 'm'} ({joint.joint})"
    )
    mark = "" if not number else " (ghost)" if count == 2 else f" (ghost {number})"
    look = drawing(robot, package_dirs, inertia=inertia)
    some = f"the first {_MOST_EVENTS} of {len(run.events)} events are marked on the plots"
    notes = (thinning, some) if len(run.events) > _MOST_EVENTS else (thinning,)
    return Shown(robot.name + mark, run, stage, keys, look, tuple(problems), notes)


def _drawable(run: Trajectory) -> Trajectory:
    """The run up to its first sample that cannot be drawn."""
    u = np.isfinite(run.u) | np.isnan(run.u).all()  # rollouts may not have recorded it
    good = np.all(np.abs(run.q) < _FAR, axis=1) & np.all(np.isfinite(run.v) & u, axis=1)
    end = len(good) if good.all() else int(good.argmin())
    if not end:
        raise ReplayError("the run has no samples that can be shown; simulate it again, with a smaller step")
    cut = {name: getattr(run, name)[:end] for name in ("t", "q", "v", "a", "u")}
    wrenches = {link: F[F[:, 0] <= run.t[end - 1]] for link, F in run.wrenches.items()}
    return replace(run, **cut, wrenches=wrenches, at_stop=None if run.at_stop is None else run.at_stop[:end])


def _corners(shown: Shown) -> np.ndarray:
    """Corners (k, 3) in the base of what is drawn, at a few keyframes."""
    few = np.unique(np.linspace(0, len(shown.keys.t) - 1, 12).round().astype(int))
    at = np.searchsorted(shown.run.t, shown.keys.t[few]).clip(0, len(shown.run.t) - 1)
    return shown.stage.corners(shown.drawing.pieces, shown.run.q[at])


def _labels(shown: list[Shown]) -> str:
    """Gravity of the first run, and of others where it differs."""
    first = shown[0].stage.robot
    labels = [gravity_label(first)]
    labels += [
        f"{each.name}: {each.stage.robot.edits.gravity} m/s²"
        for each in shown[1:]
        if each.stage.robot.edits.gravity != first.edits.gravity
    ]
    return "; ".join(labels)
