"""Each broken or hostile file, loaded in a process of its own, is refused by name or loads with what is wrong said."""

from __future__ import annotations

import json
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from robot_dyn.foundations import escaped, shorten
from tests.hostile import entities, limits, mimics, names, numbers, oddities, paths, structure, xml
from tests.hostile.kinds import SECRET, Kind

TOPICS = (paths, xml, entities, limits, structure, names, numbers, mimics, oddities)
TABLE = [kind for topic in TOPICS for kind in topic.KINDS]
LONGEST_MESSAGE = 1500  # characters besides the path: what still fits a terminal
REMEDY = re.compile(
    r"\b(give|needs|write|correct|remove|rename|keep|add|make|join|expand|exchange|check|split"
    r"|known|nearest|only)\b"
)


@pytest.fixture(scope="module")
def server() -> Iterator[subprocess.Popen[str]]:
    """The process whose forks load files."""
    command = [sys.executable, "-m", "tests.hostile.loading"]
    with subprocess.Popen(
        command, cwd=Path(__file__).parents[2], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        yield process
        process.stdin.close()  # pyright: ignore[reportOptionalMemberAccess]


def load_in_child(server: Any, path: Path) -> dict[str, Any]:
    """What became of a file, loaded in a process of its own under limits of memory and time."""
    server.stdin.write(json.dumps(str(path)) + "\n")
    server.stdin.flush()
    child = json.loads(server.stdout.readline())
    assert (child["returncode"], child["stderr"]) == (0, ""), f"exit {child['returncode']}: {child['stderr'][-2000:]}"
    assert SECRET not in child["stdout"]
    assert child["stdout"].count("\n") == 1, child["stdout"][:2000]
    return json.loads(child["stdout"])


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


LARGE = {
    "250 joints that move, in a chain", "250 joints, each following the one before",
    "250 joints that move, on one link", "400 000 links", "500 000 elements",
}  # fmt: skip
CASES = [pytest.param(kind, id=kind.id, marks=[pytest.mark.long] if kind.id in LARGE else []) for kind in TABLE]


@pytest.mark.parametrize("kind", CASES)
def test_hostile_file_is_refused_by_name_in_bounded_time(kind: Kind, server: Any, tmp_path: Path) -> None:
    path = kind.make(tmp_path / "robot.urdf")
    report = load_in_child(server, path)
    if kind.refused:
        check_refusal(kind, path, report)
    else:
        check_loading(kind, report)
