"""The origin of a run: texts from which its robot is rebuilt on any machine.

A run file contains the URDF, findings on its file, the edits, the scene and the versions, so that a replay needs only
the meshes in addition. Their place follows from the path of the URDF. A file stores it in a form that reveals nothing
about the machine.
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
from robot_dyn.foundations.portable_bits import has_portable_bits
from robot_dyn.model.findings import reading_findings
from robot_dyn.model.right_angles import right_angle_note
from robot_dyn.model.robot import Robot
from robot_dyn.simulation.results.acting import frame_of, rotors_of
from robot_dyn.simulation.results.run_data import RunData
from robot_dyn.simulation.setup.settings import settings_of
from robot_dyn.simulation.setup.setup import Setup

_LISTED = 4  # findings in a summary


def origin(setup: Setup, compiled: bool) -> dict[str, str]:
    """Return the origin of a run as texts: URDF, path, edits, controlled frame, rotors, machine code and versions."""
    robot = getattr(setup.plant.dynamics, "robot", setup.plant.dynamics)
    texts = frame_of(setup) | rotors_of(setup) | {"versions": versions()}
    if compiled:
        texts |= edits_of_machine_code(setup) | ({"bits": "portable"} if has_portable_bits() else {})
    if isinstance(robot, Robot):
        urdf = robot.description.text.decode(errors="replace")
        texts |= {"robot": robot.name, "source": robot.description.source}
        texts |= {"urdf": urdf, "edits": robot.edits.as_json()}
        if robot.description.findings:
            texts["findings"] = "\n".join(robot.description.findings)
    return texts


def edits_of_machine_code(setup: Setup) -> dict[str, str]:
    """Return the changes of machine code to a setup as texts of a run: right angles of plant and models."""
    edited_angles = right_angle_note(
        setup.plant.dynamics, *(setup.controller.models.values() if setup.controller else ())
    )
    return {"right_angles": edited_angles} if edited_angles else {}


def settings_text(setup: Setup) -> dict[str, str]:
    """Return the settings of a run as a text of it."""
    return {"settings": json.dumps(settings_of(setup), ensure_ascii=False)}


def packed(metadata: dict[str, str], folder: Path) -> dict[str, str]:
    """Return the texts of a run for a file in `folder`: without the name of the file it was read from."""
    metadata = {name: text for name, text in metadata.items() if name != "file"}
    return metadata | {"source": portable(metadata["source"], folder)} if "source" in metadata else metadata


def unpacked(metadata: dict[str, str], file: Path) -> dict[str, str]:
    """Return the texts of a run that was read from a file, with the name of that file."""
    metadata, folder = metadata | {"file": file.name}, file.parent
    if "source" not in metadata:
        return metadata
    path = Path(metadata["source"])
    with suppress(RuntimeError):  # no such home
        path = path.expanduser()
    in_folder = folder.absolute() / path
    if len(path.parts) == 1 and not in_folder.exists():  # only the name of a file elsewhere
        return metadata
    return metadata | {"source": os.path.normpath(in_folder)}


def portable(source: str, folder: Path) -> str:
    """Return the path of a URDF from the folder of a run, or from the home folder (~); otherwise its name.

    The name is enough for a robot of the catalog, whose meshes are in the installed package.
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
    """Yield the first estimates, assumptions and omissions of the robot's file as lines, and the number of the rest."""
    with suppress(DescriptionError):
        findings = reading_findings(_description(run))
        yield from (f"robot: {shorten(finding, 200)}" for finding in findings[:_LISTED])
        if more := findings[_LISTED:]:
            yield f"robot: {len(more)} more findings on its file; rd.info lists them"


def _description(run: RunData) -> Description:
    """Return the robot's file from the texts of the run; DescriptionError if there is none."""
    description = check(run.metadata.get("urdf", "").encode(), run.metadata.get("source", "the run's URDF"))
    of_reading = filter(None, run.metadata.get("findings", "").split("\n"))  # they cannot be found from the URDF alone
    return replace(description, findings=tuple(dict.fromkeys((*of_reading, *description.findings))))


def joint_types(run: RunData) -> tuple[str | None, ...]:
    """Return the types of the joints of a run, see `Robot.joint_types`; None for each joint without a URDF."""
    try:
        kinds = _description(run).joint_kinds
    except DescriptionError:
        kinds = {}
    return tuple(kinds.get(name) for name in run.joint_names)


@cache  # reading the metadata of packages takes longer than a short run
def versions() -> str:
    """Return the versions of this library and of the libraries that its numbers depend on."""
    return ", ".join(f"{name} {version_of(name)}" for name in ("robot-dyn", "pin", "numpy", "scipy"))


def robot_of(run: RunData) -> Robot:
    """Return the robot of a run, built from its texts.

    Raises:
        QueryError: If the run does not come from a URDF, or its texts do not fit together.
    """
    metadata = run.metadata
    if "urdf" not in metadata:
        raise QueryError("the run contains no URDF, so there is no robot to show; simulate one that rd.load returns")
    robot = Robot(_description(run))
    try:
        robot = _edited(robot, json.loads(metadata["edits"]))
    except (KeyError, TypeError, ValueError):
        raise QueryError("the edits in the run cannot be read; simulate again") from None
    if robot.joint_names != run.joint_names:
        raise QueryError(
            f"the run's joints {', '.join(run.joint_names)} are not those of its URDF, {', '.join(robot.joint_names)};"
            " simulate again"
        )
    return robot


def _edited(robot: Robot, edits: Any) -> Robot:
    """Return the robot with the edits of `Edits.as_json`, checked as usual; locks come last, they remove joints."""
    payloads = [Payload(**fields) for fields in edits["payloads"]]
    armature, lock = dict(edits["armature"]), dict(edits["lock"])
    links = {key: dict(edits[key]) for key in ("mass_scales", "masses", "inertias") if edits.get(key)}
    free = robot.with_(
        gravity=edits["gravity"], armature=armature, payload=payloads, mass_scale=edits["mass_scale"], **links
    )
    return free.with_(lock=lock) if lock else free
