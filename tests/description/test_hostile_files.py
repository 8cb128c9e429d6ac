"""Each broken or hostile file, loaded in a process of its own, is refused by name or loads with what is wrong said.

What is said of each is tests/snapshots/hostile.json; a new kind is a row of a table in tests/hostile.
"""

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
from tests.hostile import limits, names, oddities, paths, structure, xml
from tests.hostile.kinds import SECRET
from tests.long import long
from tests.snapshots import assert_text

TOPICS = (paths, xml, limits, structure, names, oddities)
TABLE = {kind: make for topic in TOPICS for kind, make in topic.KINDS.items()}
LONGEST_MESSAGE = 1500  # characters besides the path: what still fits a terminal
REMEDY = re.compile(
    r"\b(give|needs|write|correct|remove|rename|keep|add|make|join|expand|exchange|check|split"
    r"|known|nearest|only)\b"
)
OF_THE_PARSER = re.compile(r"(?<=well-formed XML: line ).*(?=; correct the file)")  # other words in other versions


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


def refusal(path: Path, report: dict[str, Any]) -> str:
    """A refusal without the path that it names: one printable line, with a remedy."""
    named = escaped(str(path))  # whole, unless it is too long to be a path
    named = named if named in report["message"] else shorten(named)
    assert named in report["message"] and report["warnings"] == []
    said = report["message"].replace(named, "FILE")
    assert len(said) < LONGEST_MESSAGE, f"{len(said)} characters: {said[:300]} …"
    assert said.isprintable(), repr(said)
    assert REMEDY.search(said), f"no remedy: {said}"
    return f"{report['kind']}: {OF_THE_PARSER.sub('…', said)}"


def loading(report: dict[str, Any]) -> str:
    """What is said of a robot: one warning at most, the upper limits, and the answer of forward dynamics."""
    assert len(report["warnings"]) <= 1
    assert report["held"] in (None, len(report["upper"]) - 1)
    upper = f"upper {report['upper']}" if len(report["upper"]) < 10 else f"{len(report['upper'])} joints"
    return "; ".join([upper, f"forward dynamics {report['forward_dynamics']}", *report["warnings"]])


def test_table_is_wide() -> None:
    assert len(TABLE) == sum(len(topic.KINDS) for topic in TOPICS) >= 40


LARGE = {
    "250 joints that move, in a chain", "250 joints, each following the one before",
    "250 joints that move, on one link", "400 000 links", "500 000 elements",
}  # fmt: skip


@pytest.mark.parametrize("kind", [*(kind for kind in TABLE if kind not in LARGE), *long(sorted(LARGE))])
def test_hostile_file_is_refused_by_name_in_bounded_time(kind: str, server: Any, tmp_path: Path) -> None:
    path = TABLE[kind](tmp_path / "robot.urdf")
    report = load_in_child(server, path)
    assert_text("hostile", kind, refusal(path, report) if report["outcome"] == "refused" else loading(report))
