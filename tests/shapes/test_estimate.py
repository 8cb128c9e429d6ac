"""Inertias from shapes: laws of rigid bodies, marks that stay, and what is refused."""

from __future__ import annotations

import re
from math import pi
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh

import robot_dyn as rd
from robot_dyn.description import MassProperties, combined
from robot_dyn.description import box as solid_box
from robot_dyn.description import cylinder as solid_cylinder
from robot_dyn.description import sphere as solid_sphere
from robot_dyn.foundations import rotation_rpy

pytestmark = pytest.mark.filterwarnings("ignore::robot_dyn.ModelWarning")
MEASURED = '<inertial><origin xyz="0.01 0.02 0.3"/><mass value="3.1"/><inertia ixx="0.2" ixy="0.01" ixz="0" iyy="0.3"'
MEASURED += ' iyz="0.02" izz="0.25"/></inertial>'
BOX = '<collision><origin xyz="0.1 0.2 0.3" rpy="0.3 -0.7 1.1"/><geometry><box size="0.3 0.2 0.5"/></geometry>'
BOX += "</collision>"
BALL = '<visual><geometry><sphere radius="0.2"/></geometry></visual>'
ROD = '<collision><geometry><cylinder radius="0.05" length="0.8"/></geometry></collision>'
MESH = '<collision><geometry><mesh filename="{}" scale="{}"/></geometry></collision>'


def arm(folder: Path, *links: str) -> Path:
    """A URDF of a base and links behind hinges that stand 0.4 m apart, with this content each."""
    text = f'<link name="base">{BALL}</link>'
    for i, content in enumerate(links, start=1):
        text += f'<link name="link{i}">{content}</link><joint name="joint{i}" type="continuous"><axis xyz="0 1 0"/>'
        text += f'<parent link="{"base" if i == 1 else f"link{i - 1}"}"/><child link="link{i}"/>'
        text += '<origin xyz="0.4 0 0.1" rpy="0.1 0.2 0.3"/></joint>'
    path = folder / "arm.urdf"
    path.write_text(f'<robot name="arm">{text}</robot>')
    return path


def estimated(path: Path, **masses: object) -> rd.Robot:
    return rd.load(path, inertia="from_shapes", **masses)  # pyright: ignore[reportArgumentType]


def body(robot: rd.Robot, link: str) -> MassProperties:
    """The mass properties of a link as the checked file states them, in its frame."""
    inertial = robot.description.element.find(f"link[@name='{link}']/inertial")
    assert inertial is not None
    at = {key: float(value) for key, value in inertial.find("inertia").items()}
    inertia = np.array([[at[f"i{min(i, j)}{max(i, j)}"] for j in "xyz"] for i in "xyz"])
    com, rpy = (np.array(inertial.find("origin").get(key).split(), dtype=float) for key in ("xyz", "rpy"))
    R = rotation_rpy(rpy)
    return MassProperties(float(inertial.find("mass").get("value")), com, R @ inertia @ R.T)


def same(a: MassProperties, b: MassProperties, tolerance: float = 1e-12) -> None:
    assert a.mass == pytest.approx(b.mass, rel=tolerance)
    np.testing.assert_allclose(a.com, b.com, atol=tolerance)
    np.testing.assert_allclose(a.inertia, b.inertia, atol=tolerance * np.trace(b.inertia))


def test_primitives_have_their_closed_forms(tmp_path: Path) -> None:
    """Where its <origin> puts the box; of two elements the sum, by parallel axes."""
    robot = estimated(arm(tmp_path, BOX, BALL, ROD + BOX), density=1000)
    box = solid_box(1000 * 0.03, 0.3, 0.2, 0.5).moved(rotation_rpy(np.array([0.3, -0.7, 1.1])), [0.1, 0.2, 0.3])
    same(body(robot, "link1"), box)
    same(body(robot, "link2"), solid_sphere(1000 * 4 / 3 * pi * 0.008, 0.2))
    same(body(robot, "link3"), combined([solid_cylinder(1000 * pi * 0.002, 0.05, 0.8), box]))


@pytest.mark.parametrize("suffix", ["stl", "obj", "ply", "dae"])
@pytest.mark.parametrize(
    ("faces", "basis"),
    [
        (slice(None), "closed collision mesh"),
        (slice(1, None), "open collision mesh, by its convex hull"),
        ((slice(None), slice(None, None, -1)), "closed collision mesh (1 part turned"),  # it is inside out
    ],
)
def test_a_mesh_is_the_solid_within_or_its_hull_and_scales(tmp_path: Path, suffix: str, faces: Any, basis: str) -> None:
    """Of a box, away from the origin: its lengths times `scale`; float32 corners allow 1e-6."""
    box = trimesh.creation.box((0.3, 0.2, 0.5))
    mesh = trimesh.Trimesh(box.vertices + np.array([0.1, 0.05, 0.2]), box.faces[faces], process=False)
    mesh.export(tmp_path / f"box.{suffix}")
    robot = estimated(arm(tmp_path, MESH.format(f"box.{suffix}", "2 1 0.5")), mass={"link1": 40.0}, density=900)
    same(body(robot, "link1"), solid_box(40.0, 0.6, 0.2, 0.25).moved(np.eye(3), [0.2, 0.05, 0.1]), 1e-6)
    assert basis in robot.estimated["link1"]


def test_a_mesh_whose_parts_overlap_is_refused_unless_it_is_allowed(tmp_path: Path) -> None:
    """One box twice, 3 cm apart: with `allow_overlap` it has twice its mass."""
    mesh = trimesh.creation.box((0.3, 0.2, 0.5))
    shifted = mesh.copy()
    shifted.apply_translation([0.03, 0, 0])
    trimesh.util.concatenate([mesh, shifted]).export(tmp_path / "twice.stl")
    path = arm(tmp_path, MESH.format("twice.stl", "1 1 1"))
    for masses in ({"density": 1000}, {"mass": {"link1": 3.0}}):
        with pytest.raises(
            rd.RobotDynError, match=r"link 'link1'.*twice\.stl.*part 1 at .* and part 2 at .*allow_overlap"
        ):
            estimated(path, **masses)
    robot = estimated(path, density=1000, allow_overlap=True)
    box = solid_box(30.0, 0.3, 0.2, 0.5)
    same(body(robot, "link1"), combined([box, box.moved(np.eye(3), [0.03, 0, 0])]), 1e-6)
    repaired = rd.tools.doctor.check(path, density=1000, allow_overlap=True).repaired
    assert repaired is not None
    np.testing.assert_array_equal(rd.Robot.from_text(repaired).M([0.3]), robot.M([0.3]))


@pytest.mark.parametrize("suffix", ["stl", "obj"])
def test_a_mesh_of_text_one_kilometre_from_the_origin_keeps_its_digits(tmp_path: Path, suffix: str) -> None:
    """float32 would leave 0.06 mm of the edges there, 2e-4 of the mass; float64 1e-13 m, 1e-12 of it."""
    mesh = trimesh.creation.box((0.3, 0.2, 0.5))
    mesh.apply_translation([1e3, -1e3, 1e3])
    corners = [" ".join(map(repr, corner)) for corner in mesh.vertices.tolist()]
    facets = "".join(
        f"facet outer loop {' '.join(f'vertex {corners[k]}' for k in face)} endloop" for face in mesh.faces
    )
    lines = [*(f"v {corner}" for corner in corners), *(f"f {a + 1} {b + 1} {c + 1}" for a, b, c in mesh.faces)]
    text = {"stl": f"solid box {facets} endsolid", "obj": "\n".join(lines)}[suffix]
    (tmp_path / f"far.{suffix}").write_text(text, encoding="utf-8")
    robot = estimated(arm(tmp_path, MESH.format(f"far.{suffix}", "1 1 1")), density=1000)
    true = solid_box(30.0, 0.3, 0.2, 0.5)
    assert body(robot, "link1").mass == pytest.approx(true.mass, rel=1e-11)
    np.testing.assert_allclose(body(robot, "link1").inertia, true.inertia, atol=1e-11 * np.trace(true.inertia))


def test_a_flat_mesh_is_refused_with_the_reason_and_takes_no_share_beside_a_body(tmp_path: Path) -> None:
    flat, mesh = trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]), MESH.format("flat.stl", "1 1 1")
    flat.export(tmp_path / "flat.stl")
    for masses in ({"total_mass": 8.0}, {"density": 900.0}, {"mass": {"link1": 3.0, "link2": 2.0}}):
        with pytest.raises(rd.RobotDynError, match=r"link 'link1'.*mesh flat\.stl: is flat"):
            estimated(arm(tmp_path, mesh, ROD), **masses)
    both = estimated(arm(tmp_path, mesh + ROD), density=900)
    same(body(both, "link1"), body(estimated(arm(tmp_path, ROD), density=900), "link1"))


def test_a_light_housing_is_a_shell(tmp_path: Path) -> None:
    """Below 200 kg/m³ of its hull, ⅔ m r² in place of ⅖ m r²."""
    volume = 4 / 3 * pi * 0.2**3
    robot = estimated(arm(tmp_path, BALL, BALL), mass={"link1": 199 * volume, "link2": 201 * volume})
    assert body(robot, "link1").inertia[0, 0] == pytest.approx(2 / 3 * 199 * volume * 0.04, rel=1e-12)
    assert body(robot, "link2").inertia[0, 0] == pytest.approx(2 / 5 * 201 * volume * 0.04, rel=1e-12)
    assert "shell" in robot.estimated["link1"] and "shell" not in robot.estimated["link2"]


def test_masses_add_up_to_the_total_and_follow_the_volume(tmp_path: Path) -> None:
    robot = estimated(arm(tmp_path, BOX, BALL + MEASURED, ROD, BALL), mass={"link4": 1.7}, total_mass=19.0)
    assert robot.total_mass == pytest.approx(19.0, rel=1e-14)
    volumes = {"base": 4 / 3 * pi * 0.008, "link1": 0.03, "link3": pi * 0.002}
    shared = {link: body(robot, link).mass / volume for link, volume in volumes.items()}
    assert min(shared.values()) == pytest.approx(max(shared.values()), rel=1e-12)
    assert body(robot, "link4").mass == 1.7 and robot.estimated.keys() == {*volumes, "link4"}


def test_the_volume_that_shares_a_total_is_that_of_the_hull(tmp_path: Path) -> None:
    """A tube shares as the full cylinder, and at a density weighs what its wall does."""
    trimesh.creation.annulus(0.15, 0.2, 0.3, sections=64).export(tmp_path / "tube.stl")
    trimesh.creation.cylinder(0.2, 0.3, sections=64).export(tmp_path / "full.stl")
    path = arm(tmp_path, MESH.format("tube.stl", "1 1 1"), MESH.format("full.stl", "1 1 1"))
    by_total, by_density = estimated(path, total_mass=50), estimated(path, density=1000)
    assert body(by_total, "link1").mass == pytest.approx(body(by_total, "link2").mass, rel=1e-5)
    ratio = body(by_density, "link1").mass / body(by_density, "link2").mass
    assert ratio == pytest.approx(1 - 0.75**2, rel=1e-5)


def test_what_is_measured_stays_to_the_last_digit(tmp_path: Path) -> None:
    path = arm(tmp_path, BOX + MEASURED, ROD)
    with_shapes, plain = estimated(path, density=800), rd.load(path)
    text = re.compile(rb'<link name="link1">.*?</link>', re.DOTALL)
    assert text.search(with_shapes.description.xml)[0] == text.search(plain.description.xml)[0]  # pyright: ignore
    assert "link1" not in with_shapes.estimated and not plain.estimated
    assert MEASURED in with_shapes.description.text.decode()


def test_moments_alone_are_estimated_where_the_mass_is_stated(tmp_path: Path) -> None:
    """The parallel axes of the file stay: mass and centre of mass are measured."""
    stated = (
        '<inertial><origin xyz="0 0 0.1" rpy="0.4 0 0"/><mass value="2.5"/><inertia ixx="0" ixy="0" ixz="0" iyy="0"'
    )
    robot = estimated(arm(tmp_path, ROD + stated + ' iyz="0" izz="0"/></inertial>'), density=700)
    rod = solid_cylinder(2.5, 0.05, 0.8)
    same(body(robot, "link1"), MassProperties(2.5, np.array([0, 0, 0.1]), rod.inertia))
    assert robot.estimated["link1"].startswith("moments alone")


def test_the_mark_stays_with_the_robot(tmp_path: Path) -> None:
    """In its text and findings, in `info`, in the summary of a run, on the page, and in a file that is read again."""
    path = arm(tmp_path, BOX, ROD)
    with pytest.warns(rd.ModelWarning, match=r"estimated from shapes, not measured"):
        robot = estimated(path, total_mass=12.0)
    again = rd.Robot.from_text(robot.description.text).with_(payload=rd.Payload("link2", 1.0))
    assert again.estimated == robot.estimated and len(again.estimated) == 3
    assert rd.info(again).estimated == dict(robot.estimated)
    assert robot.description.text.count(b"<!-- estimated, not measured: ") == 3
    run = rd.simulate(rd.Plant(again), q0=[0.1, 0.2], duration_s=0.01)
    assert "inertia of 3 links estimated from shapes" in run.summary
    from robot_dyn.view import drawing

    assert any("estimated from shapes" in remark for remark in drawing(again).remarks)


def test_the_corrected_file_of_the_doctor_is_the_robot_that_is_loaded(tmp_path: Path) -> None:
    path = arm(tmp_path, BOX, ROD)
    masses = {"mass": {"link1": 3.0}, "total_mass": 9.0}
    checkup = rd.tools.doctor.check(path, **masses)  # pyright: ignore[reportArgumentType]
    assert checkup.repaired is not None and b"<!-- robot-dyn check: " in checkup.repaired
    repaired, loaded = rd.Robot.from_text(checkup.repaired), estimated(path, **masses)
    assert repaired.estimated == loaded.estimated
    np.testing.assert_array_equal(repaired.M([0.3, -0.4]), loaded.M([0.3, -0.4]))
    found = [each for each in rd.tools.doctor.check(path).findings if each.kind == "inertial_missing"]
    assert len(found) == 3 and not any(each.changes for each in found)
    (tmp_path / "fixed.urdf").write_bytes(checkup.repaired)
    kinds = [each.kind for each in rd.tools.doctor.check(tmp_path / "fixed.urdf").findings]
    assert kinds.count("inertial_estimated") == 3 and "inertial_missing" not in kinds


@pytest.mark.parametrize(
    ("masses", "message"),
    [
        ({}, "need a mass: give mass by link, total_mass or density"),
        ({"mass": {"link3": 1.0}}, "no link 'link3'"),
        ({"mass": {"link1": -2.0}}, "mass of link 'link1' must be positive, got -2"),
        ({"mass": {"link1": float("nan")}}, "mass of link 'link1' must be"),
        ({"mass": {"link2": 2.0}}, "link 'link2' has 3.1 kg in its file"),
        ({"mass": {"base": 2.0}}, "link 'link1' moves with joint 'joint1' and has no mass"),
        ({"mass": 3.0}, "mass must map links to masses"),
        ({"total_mass": 0.0}, "total_mass must be positive"),
        ({"total_mass": 3.0}, "leaves nothing to share: 3.1 kg are stated"),
        ({"density": -1.0}, "density must be positive"),
        ({"total_mass": 9.0, "density": 900.0}, "contradict each other"),
    ],
)  # fmt: skip
def test_masses_that_say_nothing_are_refused(tmp_path: Path, masses: dict[str, object], message: str) -> None:
    path = arm(tmp_path, BOX, ROD + MEASURED)
    with pytest.raises(rd.RobotDynError, match=re.escape(message)):
        estimated(path, **masses)
    if masses:
        with pytest.raises(rd.RobotDynError, match=re.escape(message)):
            rd.tools.doctor.check(path, **masses)  # pyright: ignore[reportArgumentType]


def test_a_shape_that_cannot_be_read_is_refused(tmp_path: Path) -> None:
    """A missing mesh, for which nothing may be guessed; a readable <visual> serves in its place."""
    path = arm(tmp_path, MESH.format("missing.stl", "1 1 1"))
    with pytest.raises(rd.RobotDynError, match=r"link 'link1'.*cannot be estimated.*missing\.stl"):
        estimated(path, density=900)
    robot = estimated(arm(tmp_path, MESH.format("missing.stl", "1 1 1") + BALL), density=900)
    assert robot.estimated["link1"].startswith("visual sphere")
    with pytest.raises(rd.RobotDynError, match=r"link 'link1' has no <collision> or <visual>"):
        estimated(arm(tmp_path, "", ROD), mass={"link1": 1.0})


def test_a_base_whose_shape_cannot_be_read_keeps_no_arm_out(tmp_path: Path) -> None:
    """No equation depends on it, but shares of a total do, unless its mass is given."""
    path = arm(tmp_path, BOX, ROD)
    whole = path.read_text()
    path.write_text(whole.replace(BALL, MESH.format("missing.stl", "1 1 1")))
    light, heavy = estimated(path, total_mass=18.0, mass={"base": 4.0}), estimated(path, total_mass=18.0)
    assert light.total_mass == pytest.approx(14.0)
    assert heavy.total_mass == pytest.approx(18.0)
    (said,) = (each for each in heavy.findings if "'base'" in each)
    assert "and no share of the total mass, so the other links are too heavy" in said
    assert "missing.stl" in said
    assert "mass={'base': …}" in said
    (said,) = (each for each in light.findings if "'base'" in each)
    assert "share" not in said
    q = np.array([0.3, -0.8])
    np.testing.assert_allclose(heavy.M(q), 18 / 14 * light.M(q), rtol=1e-12)
    path.write_text(whole)
    np.testing.assert_allclose(light.M(q), estimated(path, total_mass=18.0, mass={"base": 4.0}).M(q), rtol=1e-12)


def test_a_shape_of_length_0_has_no_volume(tmp_path: Path) -> None:
    """Such boxes and spheres stand for a frame: the body has the shape of its other elements."""
    empty = '<collision><geometry><box size="0 0 0"/></geometry></collision>'
    frame = '<visual><geometry><sphere radius="0"/></geometry></visual>'
    assert np.array_equal(
        estimated(arm(tmp_path, BOX + empty), density=900).M(np.zeros(1)),
        estimated(arm(tmp_path, BOX), density=900).M(np.zeros(1)),
    )
    robot = estimated(arm(tmp_path, BOX, frame), density=900)
    assert any("link 'link2' moves but has no mass" in each for each in robot.findings)


def test_masses_are_refused_where_nothing_is_estimated(tmp_path: Path) -> None:
    path = arm(tmp_path, BOX)
    with pytest.raises(rd.RobotDynError, match=r"need inertia='from_shapes'"):
        rd.load(path, total_mass=3.0)
    with pytest.raises(rd.RobotDynError, match=r"no inertia 'from_shape'; .*from_shapes"):
        rd.load(path, inertia="from_shape", total_mass=3.0)
