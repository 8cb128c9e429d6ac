"""Each broken or hostile file, loaded in a process of its own, is refused by name or loads with what is wrong said."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from robot_dyn.errors import escaped, shorten
from tests.hostile import entities, limits, mimics, names, numbers, oddities, paths, structure, xml
from tests.hostile.kinds import SECRET, Kind

TOPICS = (paths, xml, entities, limits, structure, names, numbers, mimics, oddities)
TABLE = [kind for topic in TOPICS for kind in topic.KINDS]
SECONDS = 20
LONGEST_MESSAGE = 1500  # characters besides the path: what still fits a terminal
REMEDY = re.compile(
    r"\b(give|needs|write|correct|remove|rename|keep|add|make|join|expand|exchange|check|split"
    r"|known|nearest|looked for|only)\b"
)

CHILD = """
import json, math, resource, sys, warnings
resource.setrlimit(resource.RLIMIT_AS, (4 << 30, 4 << 30))
resource.setrlimit(resource.RLIMIT_CPU, (18, 18))
resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
import robot_dyn

def forward_dynamics(robot):
    still = [0.0] * robot.n
    try:
        a = robot.forward_dynamics([0.5] * robot.n, still, still)
    except robot_dyn.RobotDynError as error:
        return f"{type(error).__name__}: {error}"
    return "ok" if all(map(math.isfinite, a)) else f"not finite: {a}"

with warnings.catch_warnings(record=True) as caught:
    warnings.simplefilter("always")
    try:
        robot = robot_dyn.load(json.loads(sys.argv[1]))
    except robot_dyn.RobotDynError as error:
        report = {"outcome": "refused", "kind": type(error).__name__, "message": str(error)}
    else:
        report = {"outcome": "loaded", "forward_dynamics": forward_dynamics(robot), "upper": list(robot.upper)}
        few = 1 < robot.n < 10
        report["held"] = robot.with_(lock={robot.joint_names[0]: 0.5}).n if few else None
report["warnings"] = [f"{type(w.message).__name__}: {w.message}" for w in caught]
print(json.dumps(report))
"""


def load_in_child(path: Path) -> dict[str, Any]:
    """What became of a file, loaded under limits of memory and time."""
    child = subprocess.run(
        [sys.executable, "-c", CHILD, json.dumps(str(path))],
        cwd=Path(__file__).parents[1],
        capture_output=True,
        text=True,
        timeout=SECONDS,
        check=False,
    )
    assert (child.returncode, child.stderr) == (0, ""), f"exit {child.returncode}: {child.stderr[-2000:]}"
    assert SECRET not in child.stdout
    assert child.stdout.count("\n") == 1, child.stdout[:2000]
    return json.loads(child.stdout)


def check_says(message: str, fragments: tuple[str, ...]) -> None:
    lacking = [fragment for fragment in fragments if fragment not in message]
    assert not lacking, f"lacks {lacking}: {message[:1000]}"


def check_refusal(kind: Kind, path: Path, report: dict[str, Any]) -> None:
    """It names the file, what is wrong with it and a remedy, in one printable line."""
    assert report["outcome"] == "refused", report
    assert report["kind"] in ("DescriptionError", "CatalogError")
    assert report["warnings"] == []
    named = escaped(str(path))  # whole, unless it is too long to be a path
    named = named if named in report["message"] else shorten(named)
    check_says(report["message"], (named, *kind.refused))
    said = report["message"].replace(named, "")
    assert len(said) < LONGEST_MESSAGE, f"{len(said)} characters: {said[:300]} …"
    assert said.isprintable(), repr(said)
    assert REMEDY.search(said), f"no remedy: {said}"


def check_loading(kind: Kind, report: dict[str, Any]) -> None:
    """It warns of what cannot exist, and forward dynamics answers or names the joint."""
    assert report["outcome"] == "loaded", report
    assert len(report["warnings"]) == bool(kind.warned), report["warnings"]
    check_says("".join(report["warnings"]), kind.warned)
    check_says(report["forward_dynamics"], kind.stuck or ("ok",))
    assert report["held"] in (None, len(report["upper"]) - 1)
    if kind.upper is not None:
        assert tuple(report["upper"]) == kind.upper


def test_table_is_wide() -> None:
    assert len(TABLE) >= 40
    assert len({kind.id for kind in TABLE}) == len(TABLE)


@pytest.mark.parametrize("kind", TABLE, ids=[kind.id for kind in TABLE])
def test_hostile_file_is_refused_by_name_in_bounded_time(kind: Kind, tmp_path: Path) -> None:
    path = kind.make(tmp_path / "robot.urdf")
    report = load_in_child(path)
    if kind.refused:
        check_refusal(kind, path, report)
    else:
        check_loading(kind, report)
