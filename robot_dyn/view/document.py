"""The document of a page, from which it is drawn: runs as they were simulated, or a robot at one configuration.

The first run is drawn opaque, the others as ghosts. Problems list what is drawn otherwise than the files describe.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, fields, replace
from pathlib import Path
from typing import Any, final

import numpy as np

from robot_dyn.description.packages import searched
from robot_dyn.foundations.errors import QueryError, shorten
from robot_dyn.foundations.spatial import homogeneous
from robot_dyn.foundations.validate import instance, one_state, truth
from robot_dyn.model.robot import Robot
from robot_dyn.queries.dynamics import Array
from robot_dyn.simulation.comparison.differing_settings import run_names
from robot_dyn.simulation.observation.remarks import remark_lines
from robot_dyn.simulation.results.provenance import robot_of
from robot_dyn.simulation.results.run_data import SAMPLED, TrajectoryData, taken
from robot_dyn.view import commands
from robot_dyn.view.causes import causes, resolution
from robot_dyn.view.geometry.coarse import look_of
from robot_dyn.view.geometry.visuals import Drawing, Piece
from robot_dyn.view.keyframes import Keyframes, Motion, keyframes, motion_of, stated_error
from robot_dyn.view.overlays import GHOST, Overlays, arrows, overlays
from robot_dyn.view.page import ReplayError
from robot_dyn.view.rests import lanes
from robot_dyn.view.scenery import Scenery, gravity_arrow, gravity_label, ground, scenery, turned, upright
from robot_dyn.view.series import plots
from robot_dyn.view.sliders import sliders
from robot_dyn.view.stage import Stage
from robot_dyn.view.tables import cost_table, settings_table

_MOST_EVENTS = 200  # of a run
_FAR = 1e4  # [rad] or [m]; diverged runs are drawn up to here


@final
@dataclass(frozen=True, eq=False)
class Shown:
    """A run on its stage.

    Attributes:
        name: In titles and notes.
        prefix: Before its notes where there are several runs.
        run: The part of it that can be drawn.
        stage: Where its robot stands.
        motion: With what lies between its samples.
        keys: Keyframes of its joints.
        drawing: The look of its robot.
        problems: What is drawn otherwise than the files describe.
        notes: What else a reader should know.
    """

    name: str
    prefix: str
    run: TrajectoryData
    stage: Stage
    motion: Motion
    keys: Keyframes
    drawing: Drawing
    problems: tuple[str, ...]
    notes: tuple[str, ...]


@final
@dataclass(eq=False)
class _Picture:
    """A scene to which robots are added.

    Attributes:
        gravity: Of the first robot, in [m/s²], in axes of the base.
        scenery: What surrounds the robots.
        turn: Rotation (3, 3) that turns gravity down.
        commands: What is drawn, gravity and the floor included.
        tracks: What moves, by path.
    """

    gravity: tuple[float, float, float]
    scenery: Scenery
    turn: np.ndarray
    commands: list[commands.Command]
    tracks: dict[str, list[commands.Command]] = field(default_factory=dict)

    @classmethod
    def about(cls, points: np.ndarray, gravity: tuple[float, float, float]) -> _Picture:
        """A picture of points (k, 3) in the base of the first robot."""
        turn = upright(gravity)
        seen = scenery(points @ turn.T)
        return cls(gravity, seen, turn, [ground(seen), *gravity_arrow(seen, gravity)])

    def add(self, stage: Stage, look: Drawing, keys: Keyframes, inertia: bool, opacity: float = 1.0) -> None:
        """Draw a robot that moves by keyframes; its boxes of inertia are seen or not."""
        self.commands.append(commands.set_transform(stage.root, homogeneous(self.turn, np.zeros(3))))
        self.commands += stage.draw(look.pieces, opacity) + stage.fasten(look.boxes, opacity, "inertia ", inertia)
        self.tracks |= stage.tracks(keys)

    def document(self, notes: list[str], **entries: Any) -> dict[str, Any]:
        """The document, with the notes and the camera of the scenery."""
        floor = f"the squares on the floor are {self.scenery.square:g} m wide"
        return entries | {
            "notes": [*notes, *turned(self.gravity), floor],
            "scene": self.scenery.as_json(),
            "commands": [*self.commands, commands.set_animation(self.tracks)],
        }


@np.errstate(all="ignore")  # what is far out is drawn as far as it can be
def document_of(
    runs: tuple[TrajectoryData, ...], package_dirs: Iterable[str | Path], frame: str | None, inertia: bool,
    meshes: str = "full",
) -> dict[str, Any]:  # fmt: skip
    """Return the document of runs; arguments as of `replay`.

    Raises:
        ReplayError: If a run has no samples.
        QueryError: If it carries no robot, or no robot has the frame.
    """
    for run in runs:
        instance("run", run, TrajectoryData, "give the trajectory of rd.simulate, or a run of rollouts, as runs[0]")
    package_dirs, inertia = searched(package_dirs), truth("inertia", inertia)
    instance("frame", frame, str | None, "give the name of a link, or None")
    names = run_names(*runs)
    look = look_of(meshes)
    shown = [_shown(number, run, names, look, package_dirs, inertia) for number, run in enumerate(runs)]
    if frame is not None and all(frame not in each.stage.linkage.links for each in shown):
        shown[0].stage.link_path(frame)  # raises, with the nearest names
    corners = np.concatenate([_corners(each, inertia) for each in shown])
    picture = _Picture.about(corners, shown[0].stage.robot.edits.gravity)
    radius = picture.scenery.radius
    layers = [_overlays(each, radius, frame, number > 0) for number, each in enumerate(shown)]
    scale = arrows([(each.stage, each.run, layer) for each, layer in zip(shown, layers, strict=True)], radius)
    notes, problems, remarks = [], [], []
    for number, (each, layer) in enumerate(zip(shown, layers, strict=True)):
        picture.add(each.stage, each.drawing, each.keys, inertia, GHOST if number else 1.0)
        picture.commands += layer.commands
        picture.tracks |= layer.tracks
        notes += [each.prefix + note for note in (*each.notes, *each.drawing.remarks, *layer.notes)]
        problems += [each.prefix + note for note in (*each.problems, *each.drawing.notes)]
        remarks += [each.prefix + line for line in remark_lines(each.run.remarks)]
    split = _causes(shown)
    return picture.document(
        [*notes, *scale, *([resolution(split)] if split else [])],
        title=_title(shown),
        outcome="; ".join(_outcome(each) for each in shown),
        layers={"inertia": inertia, "paths": _paths(shown, layers)},
        duration=max(float(each.run.t[-1]) for each in shown),
        remarks=remarks,
        problems=problems,
        gravity=_labels(shown),
        events=_events(shown),
        rests=[lane for each in shown for lane in lanes(each.run, each.prefix, _MOST_EVENTS)],
        plots=plots([each.run for each in shown], [each.stage for each in shown], [each.name for each in shown]),
        differs=settings_table([(each.name, each.run) for each in shown]),
        causes=split,
        price=cost_table([(each.name, each.run) for each in shown]),
    )


def still(
    robot: Robot, q: Array | None, package_dirs: Iterable[str | Path], inertia: bool, meshes: str
) -> dict[str, Any]:
    """Return the document of a robot at one configuration; arguments as of `show`.

    Raises:
        QueryError: If q is not one configuration of the robot.
    """
    instance("robot", robot, Robot, "give one of rd.load")
    package_dirs, inertia = searched(package_dirs), truth("inertia", inertia)
    at: Array = np.zeros(robot.n) if q is None else one_state("q", q, robot.joint_names)
    if np.abs(at).max() > _FAR:
        raise QueryError(f"q must be within ±{_FAR:g}, got {shorten(at)}")
    stage, look = Stage("run", robot), look_of(meshes)(robot, package_dirs, inertia=inertia)
    picture = _Picture.about(stage.corners(_seen(look, inertia), at[None]), robot.edits.gravity)
    picture.add(stage, look, keyframes(np.zeros(1), stage.linkage.couplings.position(at[None])), inertia)
    return picture.document(
        [*look.remarks],
        title=robot.name,
        outcome=f"{robot.n} joint{'s' if robot.n > 1 else ''}, {robot.total_mass:.4g} kg",
        layers={"inertia": inertia, "paths": {}},
        duration=0.0,
        remarks=[],
        problems=list(look.notes),
        gravity=gravity_label(robot),
        events=[],
        rests=[],
        plots=[],
        differs={"runs": [], "rows": []},
        price={"runs": [], "rows": []},
        sliders=sliders(stage, at),
    )


def _overlays(shown: Shown, radius: float, frame: str | None, ghost: bool) -> Overlays:
    traced = frame if frame in shown.stage.linkage.links else None  # a ghost may be another robot
    return overlays(shown.stage, shown.run, shown.motion, radius, traced, ghost)


def _paths(shown: list[Shown], layers: list[Overlays]) -> dict[str, Any]:
    """The frames whose paths are drawn, and the one that is shown at first, of each run."""
    return {
        each.stage.root: {"frames": layer.frames, "shown": layer.frames[0]}
        for each, layer in zip(shown, layers, strict=True)
    }


def _events(shown: list[Shown]) -> list[dict[str, Any]]:
    """The events of all runs, the first ones of each; they are marked on the plots, and named as they occur."""
    return [
        {"t": event.t, "name": each.prefix + event.name} for each in shown for event in each.run.events[:_MOST_EVENTS]
    ]


def _causes(shown: list[Shown]) -> dict[str, Any] | None:
    """The torque by cause of the first run."""
    split = causes(shown[0].run, shown[0].stage.robot)
    return split and split | {"whose": shown[0].name if len(shown) > 1 else ""}


def _outcome(shown: Shown) -> str:
    end = shown.run.outcome
    return f"{shown.prefix}{end.ending} at t = {end.t:g} s" + (f": {end.advice}" if end.advice else "")


def _title(shown: list[Shown]) -> str:
    """The robot of one run; names of several, with how they are drawn."""
    first, *others = (each.name for each in shown)
    robots = list(dict.fromkeys(each.stage.robot.name for each in shown))
    prefix = f"{robots[0]}: " if len(robots) == 1 else ""
    return f"{prefix}{first} / {', '.join(others)} (transparent, dashed)" if others else first


def _shown(
    number: int, run: TrajectoryData, names: tuple[str, ...], look: Callable[..., Drawing], dirs: tuple[Path, ...],
    inertia: bool,
) -> Shown:  # fmt: skip
    robot = robot_of(run)
    whole, run = len(run.t), _drawable(run)
    stage = Stage("run" if number == 0 else f"ghost {number}", robot)
    if unknown := run.wrenches.keys() - stage.linkage.links.keys():
        raise QueryError(f"the run has a wrench on {min(unknown)!r}, which is not a link of its robot; simulate again")
    motion = motion_of(run)
    keys = keyframes(motion.t, stage.linkage.couplings.position(motion.q))
    problems = []
    if len(run.t) < whole:
        problems.append(f"the last {whole - len(run.t)} samples are not shown: not finite, or beyond {_FAR:g}")
    joints = {joint.joint: "rad" if joint.revolute else "m" for joint in stage.linkage.bodies}
    thinning = stated_error(run, motion, keys, joints)
    some = f"the first {_MOST_EVENTS} of {len(run.events)} events are marked on the plots"
    notes = (thinning, some) if len(run.events) > _MOST_EVENTS else (thinning,)
    name = names[number] if len(names) > 1 else robot.name
    drawn = look(robot, dirs, inertia=inertia)
    return Shown(name, "" if len(names) == 1 else f"{name}: ", run, stage, motion, keys, drawn, tuple(problems), notes)


def _drawable(run: TrajectoryData) -> TrajectoryData:
    """The run up to its first sample that cannot be drawn."""
    u = np.isfinite(run.u) | np.isnan(run.u).all()  # rollouts may not have recorded it
    good = np.all(np.abs(run.q) < _FAR, axis=1) & np.all(np.isfinite(run.v) & u, axis=1)
    end = len(good) if good.all() else int(good.argmin())
    if not end:
        raise ReplayError("the run has no samples that can be shown; simulate it again, with a smaller step")
    cut = {x.name: taken(getattr(run, x.name), slice(end)) for x in fields(run) if x.name in SAMPLED}
    wrenches = {link: F[F[:, 0] <= run.t[end - 1]] for link, F in run.wrenches.items()}
    return replace(run, **cut, wrenches=wrenches)


def _seen(look: Drawing, inertia: bool) -> tuple[Piece, ...]:
    """The pieces that are shown at first."""
    return look.pieces + look.boxes if inertia else look.pieces


def _corners(shown: Shown, inertia: bool) -> np.ndarray:
    """Corners (k, 3) in the base of what is drawn, at a few keyframes."""
    few = np.unique(np.linspace(0, len(shown.keys.t) - 1, 12).round().astype(int))
    at = np.searchsorted(shown.run.t, shown.keys.t[few]).clip(0, len(shown.run.t) - 1)
    return shown.stage.corners(_seen(shown.drawing, inertia), shown.run.q[at])


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
