"""Names of the package robot_descriptions: read from its cache, downloaded on request alone."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn.foundations import CatalogError, MissingExtraError
from tests.hostile.kinds import ARM

UR = "robot_descriptions:ur10e_description"
XACRO = ARM.replace("<robot ", '<robot xmlns:xacro="http://www.ros.org/wiki/xacro" ').replace(
    '<link name="base"/>', '<xacro:arg name="ur_type" default="none"/><xacro:arg name="name" default=""/>'
    '<link name="$(arg ur_type)_base"/>',
).replace('parent link="base"', 'parent link="$(arg ur_type)_base"')  # fmt: skip


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty cache; a module that was imported from another one is imported again."""
    monkeypatch.setenv("ROBOT_DESCRIPTIONS_CACHE", str(tmp_path))
    monkeypatch.delitem(sys.modules, "robot_descriptions.ur10e_description", raising=False)
    return tmp_path


def git(folder: Path, *words: str) -> str:
    who = ("-c", "user.name=a", "-c", "user.email=a@b.c")
    return subprocess.run(["git", "-C", str(folder), *who, *words], check=True, capture_output=True, text=True).stdout


def cloned(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A clone as the package keeps it, of a commit that is asked for by its variable."""
    work = cache / "work"
    (work / "urdf").mkdir(parents=True)
    (work / "urdf" / "ur.urdf.xacro").write_text(XACRO, encoding="utf-8")
    git(work, "init", "-q")
    git(work, "add", ".")
    git(work, "commit", "-q", "-m", "arm")
    commit = git(work, "rev-parse", "HEAD").strip()
    (cache / f"ur_description-{commit}").mkdir()
    work.rename(cache / f"ur_description-{commit}" / "ur_description")
    monkeypatch.setenv("ROBOT_DESCRIPTION_COMMIT", commit)


def test_what_is_not_on_disk_is_refused_with_the_line_to_run(cache: Path) -> None:
    with pytest.raises(CatalogError, match="not on disk; run python -m robot_descriptions pull ur10e_description"):
        rd.load(UR)
    assert not list(cache.iterdir())


def test_what_is_on_disk_is_loaded_with_the_arguments_of_its_xacro_file(
    cache: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    cloned(cache, monkeypatch)
    robot, q = rd.load(UR), np.array([0.4, -0.7])
    assert robot.frame_names[0] == "ur10e_base"
    assert np.array_equal(robot.M(q), rd.Robot.from_text(ARM).M(q))
    assert rd.load(UR, xacro={"ur_type": "ur3"}).frame_names[0] == "ur3_base"


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("robot_descriptions:ur10e_descripton", "nearest: ur10e_description"),
        ("robot_descriptions:", "has no ''"),
        ("robot_descriptions:os", "has no 'os'"),
        ("ur5", "download=True needs a name"),
    ],
)
def test_other_names_are_refused(name: str, said: str, cache: Path) -> None:
    with pytest.raises(CatalogError, match=said):
        rd.load(name, download=True)


def test_without_the_package_the_line_that_installs_it_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "robot_descriptions", None)  # as if it were not there
    with pytest.raises(MissingExtraError, match=r"pip install 'robot-dyn\[robots\]'"):
        rd.load(UR)
