"""The origin of a run: the texts from which its robot is built again, wherever the file is read.

A run file carries the URDF, findings on its file, the edits, the scene and the versions, so that a replay needs nothing
else but meshes. These are found from the path of the URDF, which a file holds in a form that reveals nothing about the
machine.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

from robot_dyn.description import catalog
from robot_dyn.description.description import Description, check
from robot_dyn.description.edits import Payload
from robot_dyn.foundations.errors import DescriptionError, QueryError, shorten
from robot_dyn.foundations.extras import version_of
from robot_dyn.model.findings import reservations
from robot_dyn.model.right_angles import written_out
from robot_dyn.model.robot import Robot
from robot_dyn.simulation.results.run_data import RunData
from robot_dyn.simulation.setup.settings import settings_of
from robot_dyn.simulation.setup.setup import Setup

_LISTED = 4  # findings in a summary


def origin(dynamics: Any) -> dict[str, str]:
    """Where a run comes from, as texts: URDF, its path, edits and versions."""
    robot = getattr(dynamics, "robot", dynamics)
    texts = {"versions": versions()}
    if isinstance(robot, Robot):
        urdf = robot.description.text.decode(errors="replace")
        texts |= {"robot": robot.name, "source": robot.description.source}
        texts |= {"urdf": urdf, "edits": robot.edits.as_json()}
        if robot.description.findings:
            texts["findings"] = "\n".join(robot.description.findings)
    return texts


def edits_of_machine_code(setup: Setup) -> dict[str, str]:
    """What machine code changes of a setup, as texts of a run: right angles of plant and controller's models."""
    edited_angles = written_out(setup.plant.dynamics, *(setup.controller.models.values() if setup.controller else ()))
    return {"right_angles": edited_angles} if edited_angles else {}


def settings_text(setup: Setup) -> dict[str, str]:
    """The settings of a run, as a text of it."""
    return {"settings": json.dumps(settings_of(setup), ensure_ascii=False)}


def packed(about: dict[str, str], folder: Path) -> dict[str, str]:
    """The texts of a run as a file in `folder` stores them: without the name of the file that it was read from."""
    about = {name: text for name, text in about.items() if name != "file"}
    return about | {"source": portable(about["source"], folder)} if "source" in about else about


def unpacked(about: dict[str, str], file: Path) -> dict[str, str]:
    """The texts of a run of a file, with the name of that file."""
    about, folder = about | {"file": file.name}, file.parent
    if "source" not in about:
        return about
    path = Path(about["source"])
    with suppress(RuntimeError):  # no such home
        path = path.expanduser()
    beside = folder.absolute() / path
    if len(path.parts) == 1 and not beside.exists():  # the name alone of a file elsewhere
        return about
    return about | {"source": os.path.normpath(beside)}


def portable(source: str, folder: Path) -> str:
    """The path of a URDF from the folder of a run, or from the home folder (~); else its name alone.

    A robot of the catalog needs no more than its name: its meshes are found in the installed package.
    """
    path, folder, home = Path(source).resolve(), folder.resolve(), Path(os.path.expanduser("~")).resolve()
    if path in catalog.files():
        return path.name
    with suppress(ValueError):  # on another drive
        shared = Path(os.path.commonpath([path.parent, folder]))
        if shared.name and shared not in home.parents:
            return Path(os.path.relpath(path, folder)).as_posix()
    if home.name and path.is_relative_to(home):
        return (Path("~") / path.relative_to(home)).as_posix()
    return path.name


def about_the_robot(run: RunData) -> Iterator[str]:
    """What was estimated of a run's robot, and what was assumed or left out of its file: the first, and how many."""
    with suppress(DescriptionError):
        found = reservations(_description(run))
        yield from (f"robot: {shorten(each, 200)}" for each in found[:_LISTED])
        if more := found[_LISTED:]:
            yield f"robot: {len(more)} more findings on its file; rd.info lists them"


def _description(run: RunData) -> Description:
    """The robot's file, as the run carries it; DescriptionError if there is none."""
    description = check(run.about.get("urdf", "").encode(), run.about.get("source", "the run's URDF"))
    of_reading = filter(None, run.about.get("findings", "").split("\n"))  # which the URDF alone does not give again
    return replace(description, findings=tuple(dict.fromkeys((*of_reading, *description.findings))))


def joint_types(run: RunData) -> tuple[str | None, ...]:
    """Types of the joints of a run, as of `Robot.joint_types`; None for each of a run without a URDF."""
    try:
        kinds = _description(run).joint_kinds
    except DescriptionError:
        kinds = {}
    return tuple(kinds.get(name) for name in run.joint_names)


@cache  # reading the metadata of packages takes longer than a short run
def versions() -> str:
    """Versions of this library and of those that its numbers depend on."""
    return ", ".join(f"{name} {version_of(name)}" for name in ("robot-dyn", "pin", "numpy", "scipy"))


def robot_of(run: RunData) -> Robot:
    """The robot of a run, from the texts it carries.

    Raises:
        QueryError: If the run does not come from a URDF, or its texts do not fit together.
    """
    about = run.about
    if "urdf" not in about:
        raise QueryError("the run carries no URDF, so there is no robot to show; simulate one that rd.load gives")
    robot = Robot(_description(run))
    try:
        robot = _edited(robot, json.loads(about["edits"]))
    except (KeyError, TypeError, ValueError):
        raise QueryError("the edits that the run carries cannot be read; simulate again") from None
    if robot.joint_names != run.joint_names:
        raise QueryError(
            f"the run's joints {', '.join(run.joint_names)} are not those of its URDF, {', '.join(robot.joint_names)};"
            " simulate again"
        )
    return robot


def _edited(robot: Robot, edits: Any) -> Robot:
    """The robot with the edits of `Edits.as_json`, checked as a user's are; locks come last, they take joints away."""
    payloads = [Payload(**each) for each in edits["payloads"]]
    armature, lock = dict(edits["armature"]), dict(edits["lock"])
    links = {key: dict(edits[key]) for key in ("masses", "inertias") if edits.get(key)}
    free = robot.with_(
        gravity=edits["gravity"], armature=armature, payload=payloads, mass_scale=edits["mass_scale"], **links
    )
    return free.with_(lock=lock) if lock else free
