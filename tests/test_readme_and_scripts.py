"""Every block of the README and every script runs, as a newcomer would run it."""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import pytest

from tests.browser import chromium
from tests.command import said
from tests.long import long
from tests.printed import check_prints

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text()
BLOCKS = re.findall(r"^```(\w+)\n(.*?)^```$", README, flags=re.MULTILINE | re.DOTALL)
PYTHON = [text for language, text in BLOCKS if language == "python"]
COMMANDS = [
    line.removeprefix("$ ")
    for language, text in BLOCKS
    if language == "console"
    for line in text.splitlines()
    if line.startswith("$ robot-dyn")
]
ENVIRONMENT = os.environ | {"PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"}


def run(*command: str, folder: Path = ROOT) -> str:
    done = subprocess.run(
        command, cwd=folder, env=ENVIRONMENT, capture_output=True, text=True, timeout=300, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_readme_has_blocks_to_run() -> None:
    assert len(PYTHON) >= 2
    assert len(COMMANDS) >= 3


def test_python_of_the_readme_prints_what_it_says(capsys) -> None:
    assert check_prints(ROOT / "README.md", capsys) > 8


def test_python_of_the_page_on_extending_prints_what_it_says(capsys) -> None:
    assert check_prints(ROOT / "docs" / "extending.md", capsys) > 8


def test_no_block_of_the_readme_says_no_more_than_true() -> None:
    """A comparison that prints True is seen by nobody when its bound is too wide: a number is shown instead."""
    assert not re.findall(r"# → .*\b(?:True|False)\b", README)


def in_a_process(*command: str) -> str:
    return run(*command, folder=Path.cwd())


def quickly_here(*command: str) -> str:
    """With small sizes, in this process."""
    small = {"--samples": "100", "--budget": "0.2"}
    return said(*(small.get(before, word) for before, word in pairwise(command)))


@pytest.mark.parametrize("start", [quickly_here, *long([in_a_process])])
def test_commands_of_the_readme_run(start: Callable[..., str], tmp_path: Path, monkeypatch) -> None:
    """One after the other in one folder, as they are read; `> file` keeps what is printed."""
    monkeypatch.chdir(tmp_path)
    for command in COMMANDS:
        line, _, file = command.partition(" > ")
        printed = start(*shlex.split(line))
        assert printed
        if file:
            (tmp_path / file).write_text(printed, encoding="utf-8")


SCRIPTS = [[path.name] for path in sorted((ROOT / "scripts").glob("*.py")) if path.name != "benchmark.py"]


@pytest.mark.parametrize(
    "command", [["benchmark.py", "growth", "precision"], *SCRIPTS, *long([["benchmark.py"]])], ids=" ".join
)
def test_script_runs_quickly(command: list[str]) -> None:
    script = ROOT / "scripts" / command[0]
    if "chromium" in script.read_text(encoding="utf-8"):
        chromium()
    assert run(sys.executable, str(script), *command[1:], "--quick")


def test_make_targets_of_the_readme_exist() -> None:
    targets = set(re.findall(r"^(\w+):", (ROOT / "Makefile").read_text(), flags=re.MULTILINE))
    assert set(re.findall(r"\bmake (\w+)", README)) <= targets
