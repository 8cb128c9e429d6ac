"""Shell completion: names of robots, starter scenes and joints, without slow imports."""

from __future__ import annotations

import os
import re
from contextlib import suppress

from robot_dyn.description.catalog import find, list_robots
from robot_dyn.foundations.errors import RobotDynError
from robot_dyn.foundations.files import read_start

_READ = 2**22  # bytes of a URDF that are searched for joints
_MOVES = re.compile(
    rb"""<joint\b(?=[^>]*\btype\s*=\s*["'](?:revolute|continuous|prismatic))[^>]*\bname\s*=\s*["']([^"']+)"""
)


def robots(incomplete: str) -> list[str]:
    """Return names of robots in the catalog."""
    return [name for name in list_robots() if name.startswith(incomplete)]


def scenes(incomplete: str) -> list[str]:
    """Return names of starter scenes."""
    from robot_dyn.scene.starters import starter_names

    return [name for name in starter_names() if name.startswith(incomplete)]


def quantities(incomplete: str) -> list[str]:
    """Return names of the queries of a robot."""
    from robot_dyn.queries.dynamics import QUANTITIES

    return [name for name in QUANTITIES if name.startswith(incomplete)]


def joints(incomplete: str) -> list[str]:
    """Return names of the movable joints of the robot on the command line."""
    return [name for name in _joints() if name.startswith(incomplete)]


def locks(incomplete: str) -> list[str]:
    """Return names of the movable joints, each followed by `=`."""
    return [f"{name}=" for name in joints(incomplete)]


def _joints() -> list[str]:
    """Return movable joints of the first robot on the command line, which shells pass in environment variables."""
    line = os.environ.get("COMP_WORDS") or os.environ.get("_TYPER_COMPLETE_ARGS") or ""
    for word in line.split()[2:]:
        with suppress(RobotDynError):
            text = read_start(find(word), _READ, RobotDynError, "")
            names = [found.decode("utf-8", "replace") for found in _MOVES.findall(text)]
            return [name for name in names if name.isprintable()]
    return []
