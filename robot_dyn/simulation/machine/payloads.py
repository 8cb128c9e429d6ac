"""Payloads whose masses differ from run to run: "payload_mass:<link>" is the mass of the payload that a link carries.

The body inertias 𝓜 are then no constants of the kernel but made of its input m, linear in it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, final

import numpy as np

from robot_dyn.model.description import Description
from robot_dyn.model.edits import Edits
from robot_dyn.model.robot import Robot
from robot_dyn.model.tree import Described
from robot_dyn.simulation.machine.parts import with_

_PREFIX = "payload_mass:"


@final
@dataclass(frozen=True)
class Carrying:
    """A robot whose payloads have masses of any arithmetic.

    Attributes:
        description: Its file.
        edits: Its edits, the payloads with these masses among them.
        joint_names: In the order of q.
    """

    description: Description
    edits: Edits
    joint_names: tuple[str, ...]


def masses(dynamics: Any) -> dict[str, np.ndarray]:
    """The masses in [kg], each (1,), by name, of the links that carry one payload."""
    robot = getattr(dynamics, "robot", dynamics)
    payloads = robot.edits.payloads if isinstance(robot, Robot) else ()
    frames = [each.frame for each in payloads]
    return {f"{_PREFIX}{each.frame}": np.array([each.mass]) for each in payloads if frames.count(each.frame) == 1}


def of_links(sweep: Mapping[str, Any]) -> dict[str, Any]:
    """The one number of each of these values that is a payload's mass, by link."""
    return {name.removeprefix(_PREFIX): x[0] for name, x in sweep.items() if name.startswith(_PREFIX)}


def others(sweep: Mapping[str, Any]) -> dict[str, Any]:
    """The values that are not masses of payloads."""
    return {name: x for name, x in sweep.items() if not name.startswith(_PREFIX)}


def carrying(robot: Described, by_link: Mapping[str, Any]) -> Carrying:
    """The robot with other masses of the payloads on these links: symbols, or numbers."""
    payloads = tuple(
        with_(each, {"mass": by_link[each.frame]} if each.frame in by_link else {}) for each in robot.edits.payloads
    )
    return Carrying(robot.description, replace(robot.edits, payloads=payloads), robot.joint_names)
