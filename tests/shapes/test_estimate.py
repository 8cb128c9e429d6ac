"""Inertias from shapes: laws of rigid bodies, marks that stay, refusals; solids, hulls and shells of triangles."""

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
from robot_dyn.shapes import MeshError, primitives, surface
from robot_dyn.shapes.winding import winding

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


def same(a: MassProperties | None, b: MassProperties | None, tolerance: float = 1e-12) -> None:
    assert a is not None and b is not None
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
        ((slice(None), slice(None, None, -1)), "closed collision mesh (1 part flipped"),  # it is inside out
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
    repaired = rd.tools.doctor.check_urdf(path, density=1000, allow_overlap=True).repaired
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
    assert robot.estimated["link1"].startswith("moments only")


def test_the_mark_stays_with_the_robot(tmp_path: Path) -> None:
    """In its text and findings, in `info`, in the summary of a run, on the page, and in a file that is read again."""
    path = arm(tmp_path, BOX, ROD)
    with pytest.warns(rd.ModelWarning, match=r"estimated from shapes, so torques are rough"):
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
    checkup = rd.tools.doctor.check_urdf(path, **masses)  # pyright: ignore[reportArgumentType]
    assert checkup.repaired is not None
    repaired, loaded = rd.Robot.from_text(checkup.repaired), estimated(path, **masses)
    assert repaired.estimated == loaded.estimated
    np.testing.assert_array_equal(repaired.M([0.3, -0.4]), loaded.M([0.3, -0.4]))
    found = [each for each in rd.tools.doctor.check_urdf(path).findings if each.kind == "inertial_missing"]
    assert len(found) == 3 and not any(each.changes for each in found)
    (tmp_path / "fixed.urdf").write_bytes(checkup.repaired)
    kinds = [each.kind for each in rd.tools.doctor.check_urdf(tmp_path / "fixed.urdf").findings]
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
        ({"total_mass": 3.0}, "does not exceed the 3.1 kg"),
        ({"density": -1.0}, "density must be positive"),
        ({"total_mass": 9.0, "density": 900.0}, "exclude each other"),
    ],
)  # fmt: skip
def test_masses_that_say_nothing_are_refused(tmp_path: Path, masses: dict[str, object], message: str) -> None:
    path = arm(tmp_path, BOX, ROD + MEASURED)
    with pytest.raises(rd.RobotDynError, match=re.escape(message)):
        estimated(path, **masses)
    if masses == {"mass": {"link2": 2.0}}:  # the doctor compares it with the file
        (compared,) = (
            x for x in rd.tools.doctor.check_urdf(path, mass={"link2": 2.0}).findings if x.kind == "mass_sheet"
        )
        assert "link2" in compared.place
    elif masses:
        with pytest.raises(rd.RobotDynError, match=re.escape(message)):
            rd.tools.doctor.check_urdf(path, **masses)  # pyright: ignore[reportArgumentType]


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


EDGES = (0.3, 0.2, 0.5)
EXACT = 1e-12  # relative: sums of some hundred products of float64


def solid(mesh: trimesh.Trimesh, *, allow_overlap: bool = False) -> MassProperties | None:
    found = surface.solid(mesh.vertices, mesh.faces, allow_overlap=allow_overlap)
    return None if found is None else found.body


def moved(mesh: trimesh.Trimesh, *xyz: float) -> trimesh.Trimesh:
    return trimesh.Trimesh(mesh.vertices + np.array(xyz), mesh.faces, process=False)


def inside_out(mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    return trimesh.Trimesh(mesh.vertices, mesh.faces[:, ::-1], process=False)


def scaled(mesh: trimesh.Trimesh, factor: float) -> trimesh.Trimesh:
    return trimesh.Trimesh(factor * mesh.vertices, mesh.faces, process=False)


def together(*meshes: trimesh.Trimesh) -> trimesh.Trimesh:
    faces, before = [], 0
    for mesh in meshes:
        faces.append(mesh.faces + before)
        before += len(mesh.vertices)
    return trimesh.Trimesh(np.vstack([mesh.vertices for mesh in meshes]), np.vstack(faces), process=False)


def test_the_solid_in_a_closed_box_is_the_box() -> None:
    mesh = trimesh.creation.box(EDGES)
    for body in (solid(mesh), surface.hull(mesh.vertices)):
        same(body, solid_box(float(np.prod(EDGES)), *EDGES), EXACT)


def test_cylinders_of_polygons_tend_to_the_cylinder() -> None:
    """The area of a regular polygon of n corners in a circle is less by 2π²/(3 n²): four times less with 2 n."""
    true = solid_cylinder(pi * 0.1**2 * 0.4, 0.1, 0.4)
    errors = []
    for sections in (32, 64):
        mesh = trimesh.creation.cylinder(0.1, 0.4, sections=sections)
        body = solid(mesh)
        assert body is not None
        errors.append([1 - body.mass / true.mass, 1 - body.inertia[2, 2] / true.inertia[2, 2]])
    np.testing.assert_allclose(np.divide(*errors), 4, rtol=0.01)
    np.testing.assert_allclose(errors[0][0], 2 * pi**2 / 3 / 32**2, rtol=0.01)


@pytest.mark.parametrize("kind", ["solid", "shell"])
def test_spheres_of_triangles_tend_to_the_sphere(kind: str) -> None:
    """⅖ m r² and ⅔ m r²; the edges halve with each subdivision, and the error falls to a quarter."""
    true, errors = getattr(primitives, kind)("sphere", (0.2,)), []
    for subdivisions in (2, 3):
        mesh = trimesh.creation.icosphere(subdivisions, 0.2)
        body = solid(mesh) if kind == "solid" else surface.shell(mesh.vertices, mesh.faces)
        assert body is not None
        errors.append([1 - body.mass / true.mass, 1 - np.trace(body.inertia) / np.trace(true.inertia)])
    np.testing.assert_allclose(np.divide(*errors), 4, rtol=0.05)
    assert max(errors[1]) < 0.03


def test_the_shell_of_a_box_is_exact() -> None:
    """Its faces are flat, so that the triangles are the surface."""
    mesh = trimesh.creation.box(EDGES)
    same(surface.shell(mesh.vertices, mesh.faces), primitives.shell("box", EDGES), EXACT)


@pytest.mark.parametrize(("kind", "lengths"), [("box", EDGES), ("cylinder", (0.15, 0.4)), ("sphere", (0.2,))])
def test_a_shell_is_the_limit_of_a_thin_wall(kind: str, lengths: tuple[float, ...]) -> None:
    """(outer − inner)/t of two solids whose faces are t apart; central, so that the error is of t²: 1e-8."""
    t, true = 1e-5, primitives.shell(kind, lengths)
    grown = {"box": (1, 1, 1), "cylinder": (0.5, 1), "sphere": (0.5,)}[kind]  # a radius grows half as fast
    outer, inner = (primitives.solid(kind, tuple(np.add(lengths, np.multiply(s * t, grown)))) for s in (1, -1))
    assert (outer.mass - inner.mass) / t == pytest.approx(true.mass, rel=1e-8)
    np.testing.assert_allclose((outer.inertia - inner.inertia) / t, true.inertia, atol=1e-8 * np.trace(true.inertia))


@pytest.mark.parametrize("kind", ["solid", "hull", "shell"])
def test_mass_properties_scale_and_turn_with_the_shape(kind: str) -> None:
    """M ~ s³ and I ~ s⁵ of solids, s² and s⁴ of shells; a placement moves them as a rigid body."""
    mesh = trimesh.creation.annulus(0.1, 0.2, 0.3)
    R, p, s = rotation_rpy(np.array([0.3, -0.7, 1.1])), np.array([0.4, -0.2, 0.3]), 1.7

    def body(vertices: np.ndarray) -> MassProperties:
        placed = trimesh.Trimesh(vertices, mesh.faces, process=False)
        bodies = {"hull": lambda: surface.hull(vertices), "solid": lambda: solid(placed)}
        found = bodies.get(kind, lambda: surface.shell(vertices, mesh.faces))()
        assert found is not None
        return found

    power, at = (2 if kind == "shell" else 3), body(mesh.vertices)
    scaled = MassProperties(s**power * at.mass, s * at.com, s ** (power + 2) * at.inertia)
    same(body(s * mesh.vertices @ R.T + p), scaled.moved(R, p), 1e-10)  # of volumes that cancel away from the origin


def test_an_open_surface_has_no_solid_and_a_flat_one_no_hull() -> None:
    mesh = trimesh.creation.box(EDGES)
    assert surface.solid(mesh.vertices, mesh.faces[1:]) is None
    same(surface.hull(mesh.vertices), solid_box(float(np.prod(EDGES)), *EDGES), EXACT)
    flat = mesh.vertices * (1, 1, 0)
    assert surface.hull(flat) is None and surface.shell(flat[:1], np.zeros((1, 3), dtype=int)) is None


CUBOID, GLOBE = trimesh.creation.box(EDGES), trimesh.creation.icosphere(2, 0.2)
BARS = together(trimesh.creation.box((1, 0.02, 0.02)), trimesh.creation.box((0.02, 1, 0.02)))


@pytest.mark.parametrize(
    "mesh",
    [
        together(CUBOID, moved(CUBOID, 0.1, 0.05, 0)),
        together(CUBOID, moved(CUBOID, 0.295, 0, 0)),
        together(GLOBE, moved(GLOBE, 0.3, 0, 0)),
        together(CUBOID, scaled(CUBOID, 0.5)),
        together(CUBOID, inside_out(scaled(CUBOID, 0.6)), scaled(CUBOID, 0.4), scaled(CUBOID, 0.2)),
        together(GLOBE, GLOBE),
        trimesh.Trimesh(BARS.vertices @ rotation_rpy(np.array([0.3, -0.7, 1.1])).T, BARS.faces, process=False),
    ],
    ids=["boxes", "5 mm", "spheres", "one in the other", "in a ball in a cavity", "twice", "crossed bars"],
)
def test_parts_that_overlap_have_no_mass_unless_allowed_and_then_the_sum(mesh: trimesh.Trimesh) -> None:
    """The corners of crossed bars are outside each other; of equal spheres all corners are on the other one."""
    with pytest.raises(MeshError, match="overlap"):
        solid(mesh)
    if mesh.volume > 0 and len(mesh.split()) == 2:
        bodies = [solid(part) for part in mesh.split()]
        same(solid(mesh, allow_overlap=True), combined([body for body in bodies if body is not None]), EXACT)


def test_the_message_names_the_parts_that_overlap() -> None:
    mesh = together(moved(CUBOID, 5, 0, 0), CUBOID, moved(CUBOID, 0, 0, 0.25))
    with pytest.raises(MeshError, match=r"3 closed parts.*\(part 2 at \(0, 0, 0\) m and part 3 at \(0, 0, 0.25\) m\)"):
        solid(mesh)


@pytest.mark.parametrize("x", [0.3, 0.30003, 0.5])
def test_parts_that_touch_or_lie_apart_add_up(x: float) -> None:
    one, other = solid(CUBOID), solid(moved(CUBOID, x, 0.01, 0))
    assert one is not None and other is not None
    same(solid(together(CUBOID, moved(CUBOID, x, 0.01, 0))), combined([one, other]), EXACT)


@pytest.mark.parametrize("flipped", [False, True], ids=["right", "inside out"])
def test_a_cavity_is_subtracted_and_a_body_in_it_is_added(flipped: bool) -> None:
    """Boxes of edges 1, 0.6 and 0.3 times those of the outer one: m ~ s³, I ~ s⁵."""
    hollow = together(CUBOID, inside_out(scaled(CUBOID, 0.6)), scaled(CUBOID, 0.3))
    hollow = inside_out(hollow) if flipped else hollow
    full = solid_box(float(np.prod(EDGES)), *EDGES)
    mass, inertia = (sum(sign * s**power for sign, s in ((1, 1.0), (-1, 0.6), (1, 0.3))) for power in (3, 5))
    same(solid(hollow), MassProperties(mass * full.mass, full.com, inertia * full.inertia), EXACT)
    found = surface.solid(hollow.vertices, hollow.faces)
    assert found is not None and (found.parts, found.flipped_parts) == (3, 3 if flipped else 0)


@pytest.mark.parametrize("faces", [slice(None), slice(2), slice(5)])
def test_faces_that_are_inside_out_are_turned_and_counted(faces: slice) -> None:
    """All of them, two or five: the box is that of the right one."""
    wrong = np.array(CUBOID.faces)
    wrong[faces] = wrong[faces, ::-1]
    mesh = together(trimesh.Trimesh(CUBOID.vertices, wrong, process=False), moved(CUBOID, 1, 0, 0))
    same(solid(mesh), solid(together(CUBOID, moved(CUBOID, 1, 0, 0))), EXACT)
    found = surface.solid(mesh.vertices, mesh.faces)
    assert found is not None and (found.parts, found.flipped_parts) == (2, 1)


@pytest.mark.parametrize("far", [1e3, 1e6])
@pytest.mark.parametrize("kind", ["solid", "hull", "shell"])
def test_nothing_is_lost_far_from_the_origin(kind: str, far: float) -> None:
    """Edges and places are sums of powers of 2, which float64 holds: mass and moments about the own centre."""
    edges = (0.25, 0.5, 1.0)
    mesh = moved(trimesh.creation.box(edges), far, -far, far)
    body = {
        "solid": lambda: solid(mesh),
        "hull": lambda: surface.hull(mesh.vertices),
        "shell": lambda: surface.shell(mesh.vertices, mesh.faces),
    }[kind]()
    true = primitives.shell("box", edges) if kind == "shell" else primitives.solid("box", edges)
    assert body is not None
    assert body.mass == pytest.approx(true.mass, rel=1e-12)
    np.testing.assert_allclose(body.inertia, true.inertia, atol=1e-12 * np.trace(true.inertia))
    np.testing.assert_allclose(body.com, [far, -far, far], rtol=1e-15)


def test_winding_numbers_are_those_of_a_point_and_a_sphere() -> None:
    corners = np.asarray(GLOBE.vertices)[GLOBE.faces]
    points = np.array([[0.0, 0, 0], [0.1, 0.05, -0.1], [0.3, 0, 0], [0, -5, 0]])
    np.testing.assert_allclose(winding(points, corners), [1, 1, 0, 0], atol=1e-12)
    np.testing.assert_allclose(winding(points, corners[:, ::-1]), [-1, -1, 0, 0], atol=1e-12)
