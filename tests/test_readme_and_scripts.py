"""Every block of the README and every script runs, as a newcomer would run it."""

from __future__ import annotations

import ast
import os
import re
import shlex
import subprocess
import sys
from itertools import takewhile
from pathlib import Path

import pytest

from tests.browser import chromium

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
    """One after the other in one session; comments `# → text` state the first lines that the statement above prints."""
    names: dict[str, object] = {}
    held = 0
    for block in PYTHON:
        lines = block.splitlines()
        for statement in ast.parse(block).body:
            exec(compile(ast.Module([statement], []), "README.md", "exec"), names)
            printed = capsys.readouterr().out.splitlines()
            after = takewhile(lambda line: line.startswith("# → "), lines[statement.end_lineno :])
            expected = [line.removeprefix("# → ") for line in after]
            assert printed[: len(expected)] == expected
            held += len(expected)
    assert held == sum(block.count("# →") for block in PYTHON) > 8  # none stands where it is not looked for


def test_no_block_of_the_readme_says_no_more_than_true() -> None:
    """A comparison that prints True is seen by nobody when its bound is too wide: a number is shown instead."""
    assert not re.findall(r"# → .*\b(?:True|False)\b", README)


def test_commands_of_the_readme_run(tmp_path) -> None:
    """One after the other in one folder, as they are read; `> file` keeps what is printed."""
    for command in COMMANDS:
        line, _, file = command.partition(" > ")
        said = run(*shlex.split(line), folder=tmp_path)
        assert said
        if file:
            (tmp_path / file).write_text(said, encoding="utf-8")


@pytest.mark.parametrize("script", sorted((ROOT / "scripts").glob("*.py")), ids=lambda path: path.name)
def test_script_runs_quickly(script: Path) -> None:
    if "chromium" in script.read_text(encoding="utf-8"):
        chromium()
    assert run(sys.executable, str(script), "--quick")


def test_make_targets_of_the_readme_exist() -> None:
    targets = set(re.findall(r"^(\w+):", (ROOT / "Makefile").read_text(), flags=re.MULTILINE))
    assert set(re.findall(r"\bmake (\w+)", README)) <= targets
