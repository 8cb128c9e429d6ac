"""Pages of docs/how_to: each is short and begins with its question, and its blocks run in one folder, in turn."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.long import long
from tests.test_readme_and_scripts import ROOT, check_prints, commands_of, run_commands, untimed, with_few_samples_here

INDEX = ROOT / "docs" / "how_to" / "README.md"
PAGES = sorted(set(INDEX.parent.glob("*.md")) - {INDEX})
EXTRAS = {
    "are_the_motors_big_enough.md": ("toppra",),
    "data_for_other_tools.md": ("pandas", "xarray", "pyarrow", "mcap_ros2"),
    "follow_a_recorded_motion.md": ("mcap_ros2",),
    "how_fast_can_it_go.md": ("ruckig", "toppra"),
    "sweep.md": ("pyarrow",),
}


IN_SHORT = {"query_an_arm", "mjcf", "follow_a_recorded_motion", "data_for_other_tools", "a_real_control_loop"}
SHORT = [page for page in PAGES if page.stem in IN_SHORT]
SOME = [*SHORT, *long(page for page in PAGES if page not in SHORT)]


@pytest.mark.parametrize("page", SOME, ids=lambda page: page.stem)
def test_blocks_run_and_print_what_the_page_says(page: Path, tmp_path: Path, monkeypatch, capsys) -> None:
    """The Python first, whose files the commands take."""
    for module in EXTRAS.get(page.name, ()):
        pytest.importorskip(module)
    monkeypatch.chdir(tmp_path)
    assert check_prints(page, capsys) > 0
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
