"""The document from which a page is drawn: runs, or a robot at one configuration.

The first run is drawn opaque, the others as ghosts. Its problems are parts that are not drawn as their files state.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, final

import numpy as np

from robot_dyn.description.packages import searched
from robot_dyn.foundations.errors import QueryError, shorten, shown
from robot_dyn.foundations.spatial import homogeneous
from robot_dyn.foundations.validate import instance, one_state, truth
from robot_dyn.model.robot import Robot
from robot_dyn.queries.dynamics import Array
from robot_dyn.simulation.comparison.differing_settings import run_names
from robot_dyn.simulation.observation.remarks import remark_lines
from robot_dyn.simulation.results.provenance import robot_of
from robot_dyn.simulation.results.run_data import SAMPLED, TrajectoryData, taken
from robot_dyn.view.causes import causes, resolution
from robot_dyn.view.commands import Canvas
from robot_dyn.view.geometry.coarse import look_of
from robot_dyn.view.geometry.visuals import Drawing
from robot_dyn.view.keyframes import Keyframes, Motion, keyframes, motion_of, stated_error
from robot_dyn.view.overlays import draw_arrows, draw_paths, draw_stops
from robot_dyn.view.page import ReplayError
from robot_dyn.view.rests import lanes
from robot_dyn.view.scenery import gravity_label, scenery, surround, turned, upright
from robot_dyn.view.series import plots
from robot_dyn.view.sliders import sliders
from robot_dyn.view.stage import Stage
from robot_dyn.view.tables import cost_table, settings_table

_MAX_EVENTS = 200  # listed events of a run
_FAR = 1e4  # [rad] or [m]; diverged runs are drawn up to here


_GHOST = 0.35  # opacity


@final
@dataclass(frozen=True, eq=False)
class Shown:
    """A run on its stage.

    Attributes:
        name: Name in titles and notes.
        prefix: Prefix of its notes if there are several runs; otherwise empty.
        run: The part of the run that can be drawn.
        stage: Stage of its robot.
        motion: Samples of the run, and points between them.
        keys: Keyframes of its joints.
        drawing: Appearance of its robot.
        hidden: Number of samples after this part.
    """

    name: str
    prefix: str
    run: TrajectoryData
    stage: Stage
    motion: Motion
    keys: Keyframes
    drawing: Drawing
    hidden: int


@np.errstate(all="ignore")  # huge positions are drawn as far as possible
def document_of(
    runs: tuple[TrajectoryData, ...], package_dirs: Iterable[str | Path], frame: str | None, inertia: bool,
    meshes: str = "full", names: Sequence[str] | None = None,
) -> dict[str, Any]:  # fmt: skip
    """Return the document of runs; for arguments, see `replay`.

    Raises:
        ReplayError: If a run has no samples.
        QueryError: If a run lacks its robot, no robot has the frame, or there is not one name per run.
    """
    for run in runs:
        instance("run", run, TrajectoryData, "give a trajectory of rd.simulate, or a run of rollouts, such as runs[0]")
    package_dirs, inertia = searched(package_dirs), truth("inertia", inertia)
    instance("frame", frame, str | None, "give the name of a link, or None")
    names = run_names(*runs) if names is None else _checked_names(names, len(runs))
    shown = [_shown(number, run, names, package_dirs, inertia, meshes) for number, run in enumerate(runs)]
    if frame is not None and all(frame not in item.stage.linkage.links for item in shown):
        shown[0].stage.link_path(frame)  # raises, with the nearest names
    first = shown[0]
    page = _Document(np.concatenate([_corners(item, inertia) for item in shown]), first.stage.robot, inertia)
    radius = page.scenery.radius
    remarks, problems = [], []
    for item in shown:
        run, stage, start = item.run, item.stage, len(page.notes)
        page.draw(stage, item.drawing, item.keys)
        traced = (
            frame if frame in stage.linkage.links else run.metadata.get("frame") or stage.tip
        )  # a frame of another robot is not drawn
        stage.link_path(traced)  # raises if there is none
        frames, note = draw_paths(page.canvas, stage, item.motion, radius, traced)
        page.paths[stage.root] = {"frames": frames, "shown": traced}
        joints = {joint.joint: "rad" if joint.revolute else "m" for joint in stage.linkage.bodies}
        page.notes.append(stated_error(run, item.motion, item.keys, joints))
        if len(run.events) > _MAX_EVENTS:
            page.notes.append(f"the first {_MAX_EVENTS} of {len(run.events)} events are marked on the plots")
        page.notes += [*item.drawing.remarks, note, *draw_stops(page.canvas, stage, run, radius)]
        page.notes[start:] = [item.prefix + text for text in page.notes[start:]]
        if item.hidden:
            hidden = f"the last {item.hidden} samples are not shown, because they are not finite or beyond {_FAR:g}"
            problems.append(item.prefix + hidden)
        problems += [item.prefix + text for text in item.drawing.notes]
        remarks += [item.prefix + line for line in remark_lines(run.remarks)]
    page.notes += draw_arrows(page.canvas, [(item.stage, item.run) for item in shown], radius)
    if split := causes(first.run, first.stage.robot):
        split["whose"] = first.name if len(shown) > 1 else ""
        page.notes.append(resolution(split))
    named = [(item.name, item.run) for item in shown]
    return page.entries(
        title=_title(shown),
        outcome="; ".join(_outcome(item) for item in shown),
        duration=max(float(item.run.t[-1]) for item in shown),
        remarks=remarks,
        problems=problems,
        gravity=_labels(shown),
        events=[
            {"t": event.t, "name": item.prefix + event.name}
            for item in shown
            for event in item.run.events[:_MAX_EVENTS]
        ],
        rests=[lane for item in shown for lane in lanes(item.run, item.prefix, _MAX_EVENTS)],
        plots=plots([item.run for item in shown], [item.stage for item in shown], [item.name for item in shown]),
        differs=settings_table(named),
        causes=split,
        price=cost_table(named),
    )


def still(
    robot: Robot, q: Array | None, package_dirs: Iterable[str | Path], inertia: bool, meshes: str
) -> dict[str, Any]:
    """Return the document of a robot at one configuration; for arguments, see `show`.

    Raises:
        QueryError: If q is not one configuration of the robot.
    """
    instance("robot", robot, Robot, "give a robot, for example rd.load('ur5')")
    package_dirs, inertia = searched(package_dirs), truth("inertia", inertia)
    at: Array = np.zeros(robot.n) if q is None else one_state("q", q, robot.joint_names)
    if np.abs(at).max() > _FAR:
        raise QueryError(f"q must be within ±{_FAR:g}, got {shorten(at)}")
    stage, look = Stage("run", robot), look_of(robot, package_dirs, inertia, meshes)
    page = _Document(stage.corners(look.seen(inertia), at[None]), robot, inertia)
    page.draw(stage, look, keyframes(np.zeros(1), stage.linkage.couplings.position(at[None])))
    page.notes += look.remarks
    return page.entries(
        title=robot.name,
        outcome=f"{robot.n} joint{'s' if robot.n > 1 else ''}, {robot.total_mass:.4g} kg",
        duration=0.0,
        remarks=[],
        problems=list(look.notes),
        gravity=gravity_label(robot),
        events=[],
        rests=[],
        plots=[],
        differs={"rows": []},
        price={"rows": []},
        sliders=sliders(stage, at),
    )


class _Document:
    """The common part of documents of runs and of robots: a scene to which robots are added, and notes."""

    def __init__(self, points: np.ndarray, robot: Robot, inertia: bool) -> None:
        """Start the scene of points (k, 3) in the base of the first robot, whose gravity points down."""
        self._gravity, self._shows_boxes = robot.edits.gravity, inertia
        self._turn = upright(self._gravity)
        self.scenery = scenery(points @ self._turn.T)
        self.canvas, self.notes, self.paths = Canvas(), list[str](), dict[str, Any]()
        surround(self.canvas, self.scenery, self._gravity)

    def draw(self, stage: Stage, look: Drawing, keys: Keyframes) -> None:
        """Draw a robot that moves by keyframes."""
        self.canvas.place(stage.root, homogeneous(self._turn, np.zeros(3)))
        stage.draw(self.canvas, look, keys, self._shows_boxes)

    def entries(self, **entries: Any) -> dict[str, Any]:
        """Return the document with these entries."""
        floor = f"squares on the floor are {self.scenery.square:g} m wide"
        return entries | {
            "layers": {"inertia": self._shows_boxes, "paths": self.paths},
            "notes": [*self.notes, *turned(self._gravity), floor],
            "scene": self.scenery.as_json(),
            "commands": self.canvas.commands,
        }


def _checked_names(names: object, count: int) -> tuple[str, ...]:
    """Return the names of runs; raise a QueryError if they are not distinct texts, one for each run."""
    if isinstance(names, list | tuple):
        texts = tuple(dict.fromkeys(name for name in names if isinstance(name, str) and name.strip()))
        if len(texts) == len(names) == count:
            return texts
    raise QueryError(f"names must be {count} different texts, one per run, got {shown(names)}")


def _outcome(shown: Shown) -> str:
    end = shown.run.outcome
    return f"{shown.prefix}{end.ending} at t = {end.t:g} s" + (f": {end.text}" if end.text else "")


def _title(shown: list[Shown]) -> str:
    """Return the title: the robot of one run; for several runs, their names and how they are drawn."""
    first, *others = (item.name for item in shown)
    robots = list(dict.fromkeys(item.stage.robot.name for item in shown))
    prefix = f"{robots[0]}: " if len(robots) == 1 else ""
    return f"{prefix}{first} / {', '.join(others)} (transparent, dashed)" if others else first


def _shown(
    number: int, run: TrajectoryData, names: tuple[str, ...], dirs: tuple[Path, ...], inertia: bool, meshes: str
) -> Shown:
    robot = robot_of(run)
    whole, run = len(run.t), _drawable(run)
    stage = Stage(f"ghost {number}", robot, _GHOST) if number else Stage("run", robot)
    if unknown := run.wrenches.keys() - stage.linkage.links.keys():
        raise QueryError(f"the run has a wrench on {min(unknown)!r}, which is not a link of its robot; simulate again")
    motion = motion_of(run)
    keys = keyframes(motion.t, stage.linkage.couplings.position(motion.q))
    name = names[number]
    prefix = f"{name}: " if len(names) > 1 else ""
    return Shown(name, prefix, run, stage, motion, keys, look_of(robot, dirs, inertia, meshes), whole - len(run.t))


def _drawable(run: TrajectoryData) -> TrajectoryData:
    """Return the run up to its first sample that cannot be drawn; raise a ReplayError if no sample can."""
    u = np.isfinite(run.u) | np.isnan(run.u).all()  # rollouts may not have recorded it
    good = np.all(np.abs(run.q) < _FAR, axis=1) & np.all(np.isfinite(run.v) & u, axis=1)
    end = len(good) if good.all() else int(good.argmin())
    if not end:
        raise ReplayError("the run has no samples that can be drawn; simulate it again with a smaller step")
    cut = {x.name: taken(getattr(run, x.name), slice(end)) for x in fields(run) if x.name in SAMPLED}
    wrenches = {link: F[F[:, 0] <= run.t[end - 1]] for link, F in run.wrenches.items()}
    return replace(run, **cut, wrenches=wrenches)


def _corners(shown: Shown, inertia: bool) -> np.ndarray:
    """Return the corners of the drawing in the base frame at a few keyframes, (k, 3)."""
    few = np.unique(np.linspace(0, len(shown.keys.t) - 1, 12).round().astype(int))
    at = np.searchsorted(shown.run.t, shown.keys.t[few]).clip(0, len(shown.run.t) - 1)
    return shown.stage.corners(shown.drawing.seen(inertia), shown.run.q[at])


def _labels(shown: list[Shown]) -> str:
    """Return the label of gravity in the first run, and in other runs with another gravity."""
    first = shown[0].stage.robot
    others = [
        f"{item.name}: {item.stage.robot.edits.gravity} m/s²"
        for item in shown[1:]
        if item.stage.robot.edits.gravity != first.edits.gravity
    ]
    return "; ".join([gravity_label(first), *others])
