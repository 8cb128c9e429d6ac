"""Every block of the README and of the how-to pages, and every script, runs as a newcomer would run it."""

from __future__ import annotations

import ast
import io
import os
import re
import runpy
import shlex
import subprocess
import sys
from collections.abc import Callable
from contextlib import redirect_stdout
from itertools import pairwise, takewhile
from pathlib import Path
from unittest import mock

import pytest

from tests import command as here
from tests.browser import chromium
from tests.long import long, stress

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text()
ENVIRONMENT = os.environ | {"PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"}


def commands_of(page: Path) -> list[str]:
    """The commands of the library in a page."""
    return re.findall(r"^\$ (robot-dyn .*)$", page.read_text(encoding="utf-8"), flags=re.MULTILINE)


def run(*command: str, folder: Path = ROOT) -> str:
    done = subprocess.run(
        command, cwd=folder, env=ENVIRONMENT, capture_output=True, text=True, timeout=300, check=False
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_no_block_of_the_readme_says_no_more_than_true() -> None:
    """A comparison that prints True is seen by nobody when its bound is too wide: a number is shown instead."""
    assert not re.findall(r"# → .*\b(?:True|False)\b", README)


def in_a_process(*command: str) -> str:
    return run(*command, folder=Path.cwd())


def with_few_samples_here(*command: str) -> str:
    """In this process."""
    done = here.run(*("100" if before == "--samples" else word for before, word in pairwise(command)))
    assert done.returncode == 0, done.stderr
    return done.stdout


def untimed(commands: list[str]) -> list[str]:
    """Without those that measure for seconds, which have tests of their own."""
    return [each for each in commands if "--budget" not in each]


def run_commands(commands: list[str], start: Callable[..., str], folder: Path) -> None:
    """One after the other in one folder, as they are read; `> file` keeps what is printed."""
    for command in commands:
        line, file = re.match(r"(.*?)(?: > ([\w.]+))?$", command).groups()
        printed = start(*shlex.split(line))
        assert printed
        if file:
            (folder / file).write_text(printed, encoding="utf-8")


@pytest.mark.stress  # the gate runs them in this process below, and some with the wheel
def test_commands_of_the_readme_run_in_processes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    commands = commands_of(ROOT / "README.md")
    assert len(commands) >= 3
    run_commands(commands, in_a_process, tmp_path)


IN_CHECK = {"words.py"}  # `make check` runs it
SCRIPTS = [
    [path.name] for path in sorted((ROOT / "scripts").glob("*.py")) if path.name not in {"benchmark.py", *IN_CHECK}
]


SLOW = [["architecture.py"], ["before.py"], ["replay_pictures.py"]]
IN_A_PROCESS = [["compare_dynamics.py"], ["benchmark.py"], ["benchmark.py", "sweeps"], ["benchmark.py", "plans"], *SLOW]


@pytest.mark.parametrize(
    "command",
    [
        ["benchmark.py", "energy"],
        *(command for command in SCRIPTS if command not in SLOW),
        *long([["benchmark.py", "sweeps"], ["benchmark.py", "plans"], *SLOW]),
        *stress([["benchmark.py"]]),
    ],
    ids=" ".join,
)
def test_script_runs_quickly(command: list[str]) -> None:
    script = ROOT / "scripts" / command[0]
    if "chromium" in script.read_text(encoding="utf-8"):
        chromium()
    words = [str(script), *command[1:], "--quick"]
    assert run(sys.executable, *words) if command in IN_A_PROCESS else printed(words)


def printed(words: list[str]) -> str:
    """Return what a script prints in this process, which saves its imports."""
    out = io.StringIO()
    with mock.patch.object(sys, "argv", words), redirect_stdout(out):
        try:
            runpy.run_path(words[0], run_name="__main__")
        except SystemExit as end:
            assert not end.code
    return out.getvalue()


def test_make_targets_of_the_readme_exist() -> None:
    targets = set(re.findall(r"^([\w-]+):", (ROOT / "Makefile").read_text(), flags=re.MULTILINE))
    assert set(re.findall(r"\bmake ([\w-]+)", README)) <= targets


def check_prints(document: Path, capsys: pytest.CaptureFixture[str]) -> int:
    """Run the Python blocks one after the other in one session, and count the lines that were held to what is printed.

    Comments `# → text` state the first lines that the statement above prints.
    """
    blocks = re.findall(r"^```python\n(.*?)^```$", document.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)
    names: dict[str, object] = {}
    held = 0
    for block in blocks:
        lines = block.splitlines()
        for statement in ast.parse(block).body:
            exec(compile(ast.Module([statement], []), document.name, "exec"), names)
            printed = capsys.readouterr().out.splitlines()
            after = takewhile(lambda line: line.startswith("# → "), lines[statement.end_lineno :])
            expected = [line.removeprefix("# → ") for line in after]
            assert printed[: len(expected)] == expected
            held += len(expected)
    assert held == sum(block.count("# →") for block in blocks)  # none stands where it is not looked for
    return held


INDEX = ROOT / "docs" / "how_to" / "README.md"
PAGES = sorted(set(INDEX.parent.glob("*.md")) - {INDEX})
EXTRAS = {
    "are_the_motors_big_enough.md": ("toppra",),
    "data_for_other_tools.md": ("pandas", "xarray", "pyarrow", "mcap_ros2"),
    "follow_a_recorded_motion.md": ("mcap_ros2",),
    "how_fast_can_it_go.md": ("ruckig", "toppra"),
    "identify_an_arm.md": ("cvxpy", "clarabel"),
    "observers_and_lqg.md": ("control",),
    "print_the_equations.md": ("sympy",),
    "step_many_arms.md": ("gymnasium",),
    "sweep.md": ("pyarrow",),
}


IN_SHORT = {"query_an_arm", "mjcf", "follow_a_recorded_motion", "data_for_other_tools", "a_real_control_loop"}
SHORT = [page for page in PAGES if page.stem in IN_SHORT]
SOME = [*SHORT, *long(page for page in PAGES if page not in SHORT)]
OF_MANY_LINES = [ROOT / "README.md", ROOT / "docs" / "developers" / "extending.md"]


@pytest.mark.parametrize("page", [*OF_MANY_LINES, *SOME], ids=lambda page: page.stem)
def test_blocks_run_and_print_what_the_page_says(page: Path, tmp_path: Path, monkeypatch, capsys) -> None:
    """The Python first, whose files the commands take."""
    for module in EXTRAS.get(page.name, ()):
        pytest.importorskip(module)
    monkeypatch.chdir(tmp_path)
    assert check_prints(page, capsys) > (8 if page in OF_MANY_LINES else 0)
    run_commands(untimed(commands_of(page)), with_few_samples_here, tmp_path)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_a_page_begins_with_its_question(page: Path) -> None:
    lines = page.read_text(encoding="utf-8").splitlines()
    assert re.fullmatch(r"\*.+[.?]\*", lines[2])


def test_the_index_names_each_page_by_its_question() -> None:
    rows = re.findall(r"^\| (.+) \| \[(.+)\]\((\w+\.md)\) \|$", INDEX.read_text(encoding="utf-8"), re.MULTILINE)
    heads = {page.name: page.read_text(encoding="utf-8").splitlines() for page in PAGES}
    assert sorted(rows) == sorted(
        (head[2].strip("*"), head[0].removeprefix("# "), name) for name, head in heads.items()
    )


def test_versions_that_pages_name_are_those_of_the_lock() -> None:
    """What a page says was tried, was; rerun-sdk is tried where it is installed, and is not locked."""
    lock = (ROOT / "requirements-dev.lock").read_text(encoding="utf-8")
    text = "".join(page.read_text(encoding="utf-8") for page in PAGES)
    named = re.findall(r"\b([A-Za-z][\w-]*) (\d+\.\d+\.\d+)\b(?!\.\d)", text)
    assert len(named) >= 5
    stale = [f"{name} {version}" for name, version in named if f"\n{name.lower()}=={version} " not in lock]
    assert [each for each in stale if not each.startswith("rerun-sdk ")] == []
