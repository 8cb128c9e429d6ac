"""The catalog: names, paths, package:// addresses and robot_descriptions → files, or a refusal with its reason."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import warnings
from functools import cache
from pathlib import Path

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn import ModelWarning
from robot_dyn.description import catalog
from robot_dyn.foundations import CatalogError, DescriptionError, MissingExtraError
from tests.hostile.kinds import ARM

URDF = Path(__file__).parents[2] / "urdf"
REFUSED = {
    "alex_psyonic_hands": "mimics 'index_q1', which is not defined",
    "hector": "no joint moves",
    "iris_simple": "no joint moves",
    "ur3_empty": "has no <link>",
}


@pytest.fixture
def package(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder that holds the package `arms`, and a working directory elsewhere."""
    monkeypatch.delenv("ROS_PACKAGE_PATH", raising=False)
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    (tmp_path / "ws" / "arms" / "urdf").mkdir(parents=True)
    shutil.copy(URDF / "pendulum.urdf", tmp_path / "ws" / "arms" / "urdf")
    return tmp_path / "ws"


def test_names_are_sorted_and_hold_the_well_known_and_the_own_robots():
    names = rd.list_robots()
    assert list(names) == sorted(set(names))
    assert {"panda", "ur5", "kinova", "xarm7", "talos_left_arm"} <= set(names)
    assert {path.stem for path in URDF.glob("*.urdf")} <= set(names)
    assert set(REFUSED) <= set(names)


@cache
def of_catalog(name: str) -> rd.Robot:
    """A robot without its warnings, loaded once in a process."""
    with warnings.catch_warnings(action="ignore", category=ModelWarning):
        return rd.load(name)


@pytest.mark.parametrize("name", rd.list_robots())
def test_every_name_loads_or_says_why_not(name: str):
    if name in REFUSED:
        with pytest.raises(DescriptionError, match=REFUSED[name]) as refusal:
            rd.load(name)
        assert str(refusal.value).startswith(str(catalog.find(name)))
    else:
        robot = of_catalog(name)
        assert robot.n == len(robot.joint_names) > 0
        assert robot.description.source == str(catalog.find(name))


@pytest.mark.parametrize("name", ["human", "romeo", "massless_tip"])
def test_a_robot_with_findings_warns_once_and_says_how_many_and_where(name: str):
    with pytest.warns(ModelWarning) as caught:
        robot = rd.load(name)
    first, *others = robot.findings
    more = f" (the first of {1 + len(others)} findings; see Robot.findings or robot-dyn info for all)" if others else ""
    assert [str(w.message) for w in caught] == [f"{robot.name}: {first}{more}"]
    assert {w.filename for w in caught} == {__file__}


@pytest.mark.parametrize(("wrong", "near"), [("ur6", "ur5"), ("Panda", "panda"), ("pendulm", "pendulum")])
def test_unknown_name_is_answered_with_the_nearest(wrong: str, near: str):
    with pytest.raises(CatalogError, match=rf"no robot '{wrong}'; nearest: .*\b{near}\b"):
        rd.load(wrong)


@pytest.mark.parametrize("wrong", ["nowhere/arm.urdf", "arm.urdf", "/nowhere/arm"])
def test_missing_file_is_named_with_the_place_that_was_looked_in(wrong: str, package: Path):
    with pytest.raises(CatalogError, match=rf"no file {wrong}; check the path /.*arm"):
        rd.load(wrong)


def test_path_may_be_text_or_path_absolute_or_relative_or_of_the_home_folder(
    package: Path, monkeypatch: pytest.MonkeyPatch
):
    file = package / "arms" / "urdf" / "pendulum.urdf"
    monkeypatch.setenv("HOME", str(package))
    relative = os.path.relpath(file)
    for name in (
        file,
        str(file),
        relative,
        Path(relative),
        Path("~/arms/urdf/pendulum.urdf"),
        "~/arms/urdf/pendulum.urdf",
    ):
        assert rd.load(name).description.text == file.read_bytes()


def test_folder_is_no_robot(package: Path):
    with pytest.raises(DescriptionError, match="is a folder"):
        rd.load(package)


ADDRESS = "package://arms/urdf/pendulum.urdf"


def test_a_package_is_found_in_named_folders_above_and_in_the_ros_package_path(
    package: Path, monkeypatch: pytest.MonkeyPatch
):
    """Above the working directory, or above the file that names it."""
    file, deep = package / "arms" / "urdf" / "pendulum.urdf", package / "arms" / "urdf" / "deep"
    for folders in ([package], (str(package),), iter([package.parent, package])):
        assert catalog.find(ADDRESS, folders) == file
    assert rd.load(ADDRESS, package_dirs=[package]).name == "pendulum"
    for source in (file, package / "other" / "robot.urdf"):
        assert catalog.resolve(ADDRESS, source) == file
    with monkeypatch.context() as ros:
        ros.setenv("ROS_PACKAGE_PATH", os.pathsep.join(["", "/nowhere", str(package)]))
        assert rd.load(ADDRESS).n == 1
    deep.mkdir()
    for place in (package, package / "arms", deep):
        monkeypatch.chdir(place)
        assert rd.load(ADDRESS).n == 1


def test_named_folder_comes_before_those_above_and_these_before_the_ros_path(
    package: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
):
    first, last = tmp_path / "first", tmp_path / "last"
    for other in (first, last):
        shutil.copytree(package, other)
    monkeypatch.setenv("ROS_PACKAGE_PATH", str(last))
    monkeypatch.chdir(package)
    assert catalog.find(ADDRESS, [first]).is_relative_to(first)
    assert catalog.find(ADDRESS).is_relative_to(package)


def test_missing_package_lists_the_places_tried(package: Path, monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setenv("ROS_PACKAGE_PATH", "/nowhere")
    with pytest.raises(CatalogError) as refusal:
        rd.load("package://legs/urdf/leg.urdf", package_dirs=[package])
    message = str(refusal.value)
    for place in (package, Path.cwd(), package.parent, "/nowhere", "'legs'", "package_dirs", "ROS_PACKAGE_PATH"):
        assert str(place) in message
    with pytest.raises(CatalogError, match=r"no file for package://arms/urdf/leg\.urdf"):
        rd.load("package://arms/urdf/leg.urdf", package_dirs=[package])
    for empty in ("package://", "package:///", "package://arms"):
        with pytest.raises(CatalogError, match="no file for package://"):
            rd.load(empty, package_dirs=[package])


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
