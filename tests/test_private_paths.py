"""What is handed on tells nothing of the machine it was made on; one's own runs find their meshes all the same."""

from __future__ import annotations

import os
import re
import warnings
import zipfile
from pathlib import Path

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn.simulation import robot_of
from robot_dyn.simulation.results.provenance import packed
from robot_dyn.view import document_of
from tests.drawings import mesh_visual, stl, urdf


@pytest.fixture
def arm(tmp_path) -> Path:
    """A URDF with a mesh beside it, in a folder whose name is nobody's business."""
    folder = tmp_path / "secret" / "robots" / "meshes"
    folder.mkdir(parents=True)
    stl(folder / "arm.stl")
    path = folder.parent / "arm.urdf"
    path.write_bytes(urdf(mesh_visual("meshes/arm.stl")))
    return path


def run_of(path: Path | str) -> rd.Trajectory:
    robot = rd.load(path)
    return rd.simulate(robot, q0=np.full(robot.n, 0.3), duration_s=0.01, estimate_error=False)


def inside(file: Path) -> str:
    """All bytes of a run file, inflated."""
    with zipfile.ZipFile(file) as members:
        return b"".join(members.read(name) for name in members.namelist()).decode("utf-8", "replace").replace("\0", "")


@pytest.mark.parametrize("runs", [".", "runs", "../runs"])
def test_a_run_finds_its_meshes_from_its_own_folder(arm, tmp_path, runs: str) -> None:
    """Beside the URDF, below it, in a sibling; and after all of it has moved."""
    folder = arm.parent / runs
    folder.mkdir(exist_ok=True)
    file = run_of(arm).save(folder / "run.npz")
    assert str(tmp_path) not in inside(file) and "secret" not in inside(file)
    assert document_of((rd.read(file),), (), None, False)["problems"] == []
    moved = tmp_path / "elsewhere"
    os.rename(tmp_path / "secret", moved)
    here = (
        moved / file.resolve().relative_to(tmp_path / "secret")
        if file.exists()
        else moved / "robots" / runs / file.name
    )
    assert document_of((rd.read(here),), (), None, False)["problems"] == []


def test_a_run_far_from_the_urdf_finds_it_in_the_home_folder(arm, tmp_path, monkeypatch) -> None:
    """With only the root in common, the path starts at the home folder, whose name is not told."""
    monkeypatch.setenv("HOME", str(tmp_path / "secret"))
    metadata = packed(run_of(arm).metadata, Path("/"))
    assert metadata["source"] == "~/robots/arm.urdf"
    assert packed(run_of(arm).metadata, tmp_path)["source"] == "~/robots/arm.urdf"  # what lies above is other people's
    monkeypatch.setenv("HOME", "/nowhere/else")
    assert packed(run_of(arm).metadata, Path("/"))["source"] == "arm.urdf"


def test_a_robot_of_the_catalog_is_known_by_its_file_name(tmp_path) -> None:
    """Its meshes are found in the package, wherever that is installed."""
    file = run_of("ur5").save(tmp_path / "run.npz")
    assert "site-packages" not in inside(file)
    again = rd.read(file)
    assert Path(again.metadata["source"]).name == "ur5_robot.urdf"
    assert document_of((again,), (), None, False)["problems"] == []


def test_a_run_read_again_is_the_same_robot(arm, tmp_path) -> None:
    run = run_of(arm)
    again = rd.read(run.save(tmp_path / "run.npz"))
    assert again.metadata == run.metadata | {"file": "run.npz"}
    assert robot_of(again).description == robot_of(run).description


ADDRESSES = [
    "meshes/none0.stl",
    "/home/alice/none1.stl",
    "file:///home/alice/none2.stl",
    "~/alice/none3.stl",
    "C:\\Users\\alice\\none4.stl",
    "package://none/none5.stl",
    "http://example/none6.stl",
    "meshes/broken.stl",
]


def test_no_page_and_no_warning_shows_a_path_of_the_machine(arm, tmp_path) -> None:
    """Whatever is wrong with a mesh or texture; the link, and the file's name, are enough to find it."""
    (arm.parent / "meshes" / "broken.stl").write_bytes(b"solid x" * 100)
    dae = '<material name="m"><texture filename="/home/alice/skin.png"/></material>'
    visuals = "".join(mesh_visual(address) for address in ADDRESSES)
    visuals += f'<visual><geometry><box size="1 1 1"/></geometry>{dae}</visual>'
    arm.write_bytes(urdf(visuals))
    with warnings.catch_warnings(record=True) as told:
        warnings.simplefilter("always")
        page = document_of((run_of(arm),), (), None, True)
        rd.replay(run_of(arm)).save(tmp_path / "page.html")
    assert len(page["problems"]) >= len(ADDRESSES)
    texts = [*page["problems"], *page["notes"], page["title"], page["outcome"], *(str(each.message) for each in told)]
    assert not re.search(r"alice/|alice\\|secret|" + re.escape(str(tmp_path)), "\n".join(texts))
    assert all(f"none{i}.stl" in "".join(page["problems"]) for i in range(7))
    assert str(tmp_path).encode() not in (tmp_path / "page.html").read_bytes()
