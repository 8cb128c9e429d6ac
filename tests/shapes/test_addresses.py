"""Mesh paths of other computers: read by the end of the path near the URDF, or reported as written with a remedy."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn.foundations import DescriptionError
from robot_dyn.shapes.addresses import find_file
from robot_dyn.shapes.mesh_files import MeshError
from tests.drawings import drawn, mesh_visual, stl, urdf

NEAR = "meshes/arm.stl"
ELSEWHERE = {  # address: the file near the URDF that it means
    "file:///home/user/ws/install/arm/share/arm/meshes/arm.stl": NEAR,
    "file:///home/user/my%20robot/meshes/link%201.stl": "meshes/link 1.stl",
    "file://build-server/home/user/meshes/arm.stl": NEAR,
    "file://localhost/home/user/meshes/arm.stl": NEAR,
    "file:/home/user/meshes/arm.stl": NEAR,
    "file:///C:/Users/user/arm/meshes/arm.stl": NEAR,
    "file://C:\\Users\\user\\arm\\meshes\\arm.stl": NEAR,
    "/home/user/ws/src/arm/meshes/visual/arm.stl": "meshes/visual/arm.stl",
    "/home/user/arm.stl": NEAR,
    "~/ws/meshes/arm.stl": NEAR,
    "C:\\Users\\user\\arm\\meshes\\arm.stl": NEAR,
    "D:/arm/parts/arm.stl": "parts/arm.stl",
    "\\\\server\\share\\arm\\arm.stl": "arm.stl",
    "../meshes/arm.stl": NEAR,
    "package://lost/meshes/visual/arm.stl": NEAR,
    "package://lost\\meshes\\arm.stl": NEAR,
}


def near(folder: Path, file: str) -> Path:
    """A URDF in a folder of its own, with a mesh near it."""
    (folder / "robot" / file).parent.mkdir(parents=True)
    stl(folder / "robot" / file)
    return folder / "robot" / "arm.urdf"


@pytest.mark.parametrize("address", ELSEWHERE)
def test_a_path_of_another_computer_is_read_near_the_urdf_and_reported(address: str, tmp_path: Path) -> None:
    source, remarks = near(tmp_path, ELSEWHERE[address]), list[str]()
    assert find_file(address, source, (), remarks) == (source.parent / ELSEWHERE[address]).resolve()
    assert len(remarks) == 1
    here = drawn(urdf(2 * mesh_visual(address)), source.parent)
    assert (here.notes, len(here.pieces), here.remarks) == ((), 2, tuple(remarks))


@pytest.mark.parametrize("address", ["package://lost/meshes/ARM.STL", "/home/user/meshes/Arm.stl"])
def test_a_file_whose_name_differs_in_capital_letters_is_named(address: str, tmp_path: Path) -> None:
    with pytest.raises(MeshError, match=r"'arm\.stl'"):
        find_file(address, near(tmp_path, NEAR), ())


@pytest.mark.parametrize(
    ("address", "file"),
    [
        ("meshes\\arm.stl", NEAR),
        (".\\meshes\\arm.stl", NEAR),
        ("..\\meshes\\arm.stl", "../meshes/arm.stl"),
        ("file://meshes/arm.stl", NEAR),
        ("meshes/back\\slash.stl", "meshes/back\\slash.stl"),
    ],
)
def test_a_relative_path_in_any_notation_is_the_file_itself(address: str, file: str, tmp_path: Path) -> None:
    source, remarks = near(tmp_path, file), list[str]()
    assert find_file(address, source, (), remarks).resolve() == (source.parent / file).resolve()
    assert remarks == []


def test_an_existing_absolute_path_is_read_even_if_a_file_near_the_urdf_has_its_name(tmp_path: Path) -> None:
    source, remarks = near(tmp_path / "here", NEAR), list[str]()
    other = near(tmp_path / "other place", NEAR).parent / NEAR
    for address in (str(other), other.as_uri(), f"file://localhost{other.as_posix().replace(' ', '%20')}"):
        assert find_file(address, source, (), remarks) == other
    assert remarks == []


def test_the_longest_end_of_a_path_decides(tmp_path: Path) -> None:
    """Visual and collision meshes often have the same names."""
    source = near(tmp_path, "meshes/visual/arm.stl")
    for folder in ("meshes/collision", "meshes"):
        (source.parent / folder).mkdir(exist_ok=True)
        stl(source.parent / folder / "arm.stl", 2.0)
    for folder in ("visual", "collision"):
        found = find_file(f"/home/user/meshes/{folder}/arm.stl", source, ())
        assert found == (source.parent / "meshes" / folder / "arm.stl").resolve()


ABSENT = [
    "file:///home/user/meshes/none.stl",
    "/home/user/meshes/none.stl",
    "C:\\Users\\user\\none.stl",
    "\\\\server\\share\\none.stl",
    "meshes/none.stl",
    "package://lost/meshes/none.stl",
    "/",
    "/home/user/meshes/..",
    "package://lost/../meshes/arm.stl",
]


@pytest.mark.parametrize("address", ABSENT)
def test_a_file_that_is_nowhere_is_refused_with_its_address_as_written(address: str, tmp_path: Path) -> None:
    """By `load` in full; the drawing, which is passed on to others, states the file's name only."""
    source = near(tmp_path, NEAR)
    shape = f'<collision><geometry><mesh filename="{address}"/></geometry></collision>'
    without = urdf(shape).decode().split("<inertial>")
    source.write_text(without[0] + without[1].partition("</inertial>")[2])
    if address == "/":  # exists, as a folder
        with pytest.raises(DescriptionError, match="mesh /: "):
            rd.load(source, inertia="from_shapes", density=1000.0)
        return
    with pytest.raises(MeshError, match="meshes/"):
        find_file(address, source, ())
    with pytest.raises(DescriptionError) as raised:
        rd.load(source, inertia="from_shapes", density=1000.0)
    assert f"mesh {address}: " in str(raised.value) and "put it in meshes/" in str(raised.value)


def test_an_inertia_from_another_file_than_the_stated_one_is_marked(tmp_path: Path) -> None:
    source = near(tmp_path, NEAR)
    bases = []
    for address in ("meshes/arm.stl", "/home/user/meshes/arm.stl"):
        shape = f'<collision><geometry><mesh filename="{address}"/></geometry></collision>'
        without = urdf(shape).decode().split("<inertial>")
        source.write_text(without[0] + without[1].partition("</inertial>")[2])
        with pytest.warns(rd.ModelWarning):
            arm = rd.load(source, inertia="from_shapes", mass={"arm": 2.0})
        np.testing.assert_allclose(arm.inertial_parameters[:4] / 2.0, [1, 0.3 / 4, 0.2 / 4, 0.1 / 4], atol=1e-7)
        bases.append(arm.estimated)
    assert bases[0] != bases[1]


def test_a_copy_keeps_addresses_that_are_not_relative(tmp_path: Path) -> None:
    source = near(tmp_path, NEAR)
    addresses = ["C:\\meshes\\arm.stl", "file:/home/user/arm.stl", "/home/user/arm.stl", "meshes/arm.stl"]
    source.write_bytes(urdf("".join(map(mesh_visual, addresses))))
    (tmp_path / "copies").mkdir()
    copy = rd.load(source).to_urdf(tmp_path / "copies" / "arm.urdf").read_text("utf-8")
    for address in (*addresses[:3], "../robot/meshes/arm.stl"):
        assert f'filename="{address}"' in copy
