"""Meshes and shapes: read right, or noted and replaced; never silently missing."""

from __future__ import annotations

import re
import struct
from pathlib import Path

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn import Robot
from robot_dyn.description import box as solid_box
from robot_dyn.description import description
from robot_dyn.shapes.mesh_files import MAX_BYTES
from robot_dyn.view import drawing
from robot_dyn.view.geometry.inertia_boxes import inertia_boxes
from tests.drawings import box, boxes, drawn, mesh_visual, stl, urdf
from tests.hostile.kinds import ARM, MOMENTS

pytestmark = pytest.mark.filterwarnings("ignore::robot_dyn.foundations.errors.ModelWarning")

FLOAT32 = 1e-6  # [m]: coordinates of a few metres at most, in float32


def volume(piece: object) -> float:
    """∫ dx by the divergence theorem: positive if the triangles face outwards."""
    a, b, c = np.moveaxis(piece.mesh.vertices[piece.mesh.faces].astype(float), 1, 0)  # pyright: ignore[reportAttributeAccessIssue]
    return float(np.einsum("ni,ni->", a, np.cross(b, c)) / 6)


@pytest.mark.parametrize("scale", ["1 1 1", "1 -1 1", "-1 -1 1", "-1 -2 -3"])
def test_a_mirror_image_keeps_its_outside_outside(scale: str, tmp_path: Path) -> None:
    corners = stl(tmp_path / "a.STL")
    (piece,) = drawn(urdf(mesh_visual("a.STL", f'scale="{scale}"')), tmp_path).pieces
    factors = np.array(scale.split(), dtype=float)
    assert np.array_equal(box(piece.mesh.vertices), box(corners * factors.astype("f4")))
    assert volume(piece) == pytest.approx(0.3 * 0.2 * 0.1 / 6 * abs(np.prod(factors)), rel=1e-6)
    a, b, c = np.moveaxis(piece.mesh.vertices[piece.mesh.faces], 1, 0)
    faced = np.einsum("ni,nci->nc", np.cross(b - a, c - a), piece.mesh.normals[piece.mesh.faces])
    assert faced.min() > 0


@pytest.mark.parametrize(
    ("shape", "size"),
    [
        ('<box size="0.1 0.2 0.3"/>', (0.1, 0.2, 0.3)),
        ('<cylinder radius="0.1" length="0.5"/>', (0.2, 0.2, 0.5)),
        ('<sphere radius="0.2"/>', (0.4, 0.4, 0.4)),
    ],
)
def test_primitives_have_their_size_and_face_outwards(shape: str, size: tuple[float, ...], tmp_path: Path) -> None:
    origin = '<origin xyz="1 2 3" rpy="0 0 0"/>'
    here = drawn(urdf(f"<visual>{origin}<geometry>{shape}</geometry></visual>"), tmp_path)
    (piece,) = here.pieces
    assert not here.notes
    assert np.allclose(np.ptp(boxes(here)["arm"], axis=0), size, atol=FLOAT32)
    assert np.allclose(boxes(here)["arm"].mean(axis=0), (1, 2, 3), atol=FLOAT32)
    full = {"box": 1.0, "cylinder": np.pi / 4, "sphere": np.pi / 6}[shape[1:].split()[0]] * np.prod(size)
    assert 0.98 * full < volume(piece) <= full * (1 + 1e-6)  # 48 sides lie inside the circle, 0.6 % in a slice
    assert piece.mesh.uv is not None


BROKEN = {
    "missing.stl": None,
    "empty.stl": b"",
    "short.stl": b" " * 80 + struct.pack("<I", 1000) + b"\0" * 60,
    "no_triangles.stl": b" " * 80 + struct.pack("<I", 0),
    "not_finite.obj": b"v 0 0 0\nv 1 0 0\nv nan 1 0\nf 1 2 3\n",
    "index.obj": b"v 0 0 0\nv 1 0 0\nf 1 2 99\n",
    "flat.obj": b"v 0 0 0\nv 1 0 0\nv 2 0 0\nf 1 2 3\n",
    "short.dae": b"<COLLADA xmlns='http://www.collada.org/2005/11/COLLADASchema'><library_geometries>",
    "other.dae": b"<html/>",
    "dtd.dae": b'<?xml version="1.0"?><!DOCTYPE a [<!ENTITY x SYSTEM "file:///etc/passwd">]><COLLADA>&x;</COLLADA>',
    "late.dae": b"<!--" + b" " * 10000 + b'--><!DOCTYPE a [<!ENTITY x "y">]><COLLADA a="&x;"/>',
    "utf16.dae": '<?xml version="1.0" encoding="utf-16"?><!DOCTYPE a [<!ENTITY x "y">]><COLLADA/>'.encode("utf-16"),
    "bad.glb": b"glTF\2\0\0\0",
    "cut.stl": b"solid x\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nendloop\nendfacet\nendsolid x\n",
    "words.stl": b"solid x\nfacet normal 0 0 1\nouter loop\nvertex 0 0 z\nvertex 1 0 0\nvertex 0 1 0\nendloop",
    "no_buffer.gltf": b'{"asset":{"version":"2.0"},"buffers":[{"uri":"none.bin","byteLength":9}],"accessors":[]}',
    "claims.gltf": b'{"asset":{"version":"2.0"},"accessors":[{"count":9999999999,"type":"SCALAR"}]}',
    "crowd.gltf": b'{"asset":{"version":"2.0"},"nodes":[' + b"{}," * 20_000 + b"{}]}",
    "deep.gltf": b"[" * 100_000,
    "claims.glb": b"glTF\2\0\0\0\xff\0\0\0" + struct.pack("<I", 35) + b'JSON{"accessors":[{"count":9999999999}]}',
    "odd.mesh": b"[MeshSerializer_v1.8]",
}


@pytest.mark.parametrize("name", BROKEN)
def test_a_mesh_that_cannot_be_read_is_noted_and_replaced(name: str, tmp_path: Path) -> None:
    if (data := BROKEN[name]) is not None:
        (tmp_path / name).write_bytes(data)
    here = drawn(urdf(mesh_visual(name)), tmp_path)
    (note,) = here.notes
    assert "link 'arm'" in note
    assert name in note
    assert note.endswith("the ellipsoid of its inertia is drawn in its place")
    assert len(here.pieces) == 1
    assert np.allclose(boxes(here)["arm"].mean(axis=0), (0, 0, 0.2), atol=FLOAT32)
    if name in ("dtd.dae", "late.dae", "utf16.dae"):
        assert "DOCTYPE" in note
    collision = '<collision><geometry><box size="0.1 0.2 0.3"/></geometry></collision>'
    here = drawn(urdf(mesh_visual(name), collision=collision), tmp_path)
    assert here.notes[0].endswith("the collision shape is drawn in its place")
    assert np.allclose(np.ptp(boxes(here)["arm"], axis=0), (0.1, 0.2, 0.3), atol=FLOAT32)


def test_a_huge_mesh_a_folder_and_a_device_are_not_read(tmp_path: Path) -> None:
    with (tmp_path / "huge.stl").open("wb") as stream:
        stream.truncate(MAX_BYTES + 1)
    (tmp_path / "folder.stl").mkdir()
    (tmp_path / "device.stl").symlink_to("/dev/zero")
    for name, why in (("huge", "the limit is 64"), ("folder", "not a regular file"), ("device", "not a regular file")):
        here = drawn(urdf(mesh_visual(f"{name}.stl")), tmp_path)
        assert why in here.notes[0]
        assert len(here.pieces) == 1


def test_instances_of_instances_are_counted_before_they_are_drawn(tmp_path: Path) -> None:
    nodes = "".join(f'<node id="n{i}"><instance_node url="#n{i + 1}"/><instance_node url="#n{i + 1}"/></node>'
                    for i in range(40))  # fmt: skip
    for last, why in (("<node id='n40'/>", "20000 nodes"), ("<node id='n40'><instance_node url='#n0'/></node>", "")):
        (tmp_path / "a.dae").write_text(
            f'<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema"><library_nodes>{nodes}{last}'
            '</library_nodes><library_visual_scenes><visual_scene id="s"><node><instance_node url="#n0"/></node>'
            "</visual_scene></library_visual_scenes></COLLADA>"
        )
        assert why in drawn(urdf(mesh_visual("a.dae")), tmp_path).notes[0]


@pytest.mark.parametrize(
    ("visual", "said"),
    [
        ('<visual><origin xyz="0 nan 0"/><geometry><sphere radius="1"/></geometry></visual>', "at the origin"),
        ('<visual><origin rpy="1 2"/><geometry><sphere radius="1"/></geometry></visual>', "at the origin"),
        ('<visual><geometry><sphere radius="-1"/></geometry></visual>', "below 1e-09 m"),
        ('<visual><geometry><sphere radius="1e-30"/></geometry></visual>', "below 1e-09 m"),
        ('<visual><geometry><box size="1 2"/></geometry></visual>', "3 finite numbers"),
        ('<visual><geometry><torus radius="1"/></geometry></visual>', "not a shape of URDF"),
        ("<visual><geometry/></visual>", "<geometry> is empty"),
        ("<visual/>", "<geometry> is empty"),
        (mesh_visual(""), "is not that of a local file"),
        (mesh_visual("http://[example/a.stl"), "is not that of a local file"),
        (mesh_visual("package://nowhere/b.stl"), "package_dirs"),
        (mesh_visual("a.stl", 'scale="1 1 x"'), "scale must be 3"),
        (mesh_visual("a.stl", 'scale="0 0 1"'), "no triangles"),
    ],
)
def test_a_visual_that_has_no_meaning_is_noted(visual: str, said: str, tmp_path: Path) -> None:
    stl(tmp_path / "a.stl")
    here = drawn(urdf(visual), tmp_path)
    assert said in here.notes[0]
    assert len(here.pieces) == 1


def test_the_same_file_with_the_same_scale_is_one_mesh(tmp_path: Path) -> None:
    stl(tmp_path / "a.stl")
    visuals = mesh_visual("a.stl") + mesh_visual("./a.stl") + mesh_visual("a.stl", 'scale="1 1 1"')
    ball = '<visual><geometry><sphere radius="1"/></geometry></visual>'
    pieces = drawn(urdf(visuals + mesh_visual("a.stl", 'scale="2 1 1"') + 2 * ball), tmp_path).pieces
    assert pieces[0].mesh is pieces[1].mesh is pieces[2].mesh
    assert pieces[3].mesh is not pieces[0].mesh
    assert pieces[4].mesh is pieces[5].mesh


def test_a_flat_normal_where_faces_meet_at_an_edge_and_a_smooth_one_on_a_round(tmp_path: Path) -> None:
    """A cube keeps 4 corners a side; normals of a sphere point from its centre, within half a side of 48: 3.8°."""
    pieces = drawn(
        urdf('<visual><geometry><box size="1 1 1"/></geometry></visual>'
             '<visual><geometry><sphere radius="1"/></geometry></visual>'), tmp_path
    ).pieces  # fmt: skip
    assert len({tuple(row) for row in pieces[0].mesh.normals.round(6).tolist()}) == 6
    ball = pieces[1].mesh
    assert np.einsum("ni,ni->n", ball.normals, ball.vertices).min() > np.cos(np.deg2rad(3.8))


def test_a_material_of_the_mesh_wins_over_that_of_the_urdf(tmp_path: Path) -> None:
    """As in rviz: URDF materials colour what has none, such as every STL."""
    stl(tmp_path / "a.stl")
    triangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\n"
    (tmp_path / "a.mtl").write_text("newmtl red\nKd 1 0 0\nnewmtl blue\nKd 0 0 1\n")
    (tmp_path / "a.obj").write_text(f"mtllib a.mtl\n{triangle}usemtl red\nf 1 2 3\nusemtl blue\nf 3 2 1\n")
    (tmp_path / "plain.obj").write_text(triangle + "f 1 2 3\n")
    (tmp_path / "uv.obj").write_text(triangle + "vt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n")
    (tmp_path / "lost.obj").write_text(f"mtllib lost.mtl\n{triangle}f 1 2 3\n")
    green, named = '<material name="g"><color rgba="0 1 0 0.5"/></material>', '<material name="g"/>'
    visuals = "".join(mesh_visual(name, more=named) for name in ("a.stl", "a.obj", "plain.obj", "uv.obj", "lost.obj"))
    here = drawn(urdf(visuals + mesh_visual("a.stl"), more=green), tmp_path)
    colors = [piece.rgba for piece in here.pieces]
    assert colors[0] == (0, 1, 0, 0.5)
    assert set(colors[1:3]) == {(1, 0, 0, 1), (0, 0, 1, 1)}
    assert colors[3:6] == [(0, 1, 0, 0.5)] * 3
    assert colors[6] == (0.7, 0.7, 0.7, 1)
    assert len(here.notes) == 1
    assert "lost.mtl" in here.notes[0]


def test_a_texture_is_reduced_and_a_damaged_one_is_noted(tmp_path: Path) -> None:
    from io import BytesIO

    from PIL import Image

    Image.new("RGB", (3000, 1500), (255, 0, 0)).save(tmp_path / "t.jpg")
    (tmp_path / "bad.png").write_bytes((tmp_path / "t.jpg").read_bytes()[:300])

    def visual(name: str) -> str:
        material = f'<material name=""><texture filename="{name}"/></material>'
        return f'<visual><geometry><box size="1 1 1"/></geometry>{material}</visual>'

    here = drawn(urdf(visual("t.jpg") + visual("bad.png") + visual("none.png")), tmp_path)
    image = Image.open(BytesIO(here.pieces[0].image or b""))
    assert (image.format, image.size) == ("PNG", (1024, 512))
    assert [piece.image for piece in here.pieces[1:]] == [None, None]
    assert len(here.notes) == 2


def test_a_robot_without_visuals_is_drawn_by_its_inertia_and_says_so() -> None:
    text = re.sub(rb"<visual>.*?</visual>", b"", rd.load("planar_2r").description.text, flags=re.DOTALL)
    here = drawing(Robot(description.check(text, "bare")))
    assert len(here.pieces) == 2
    assert "no link has a <visual>" in here.remarks[0]


@pytest.mark.parametrize("name", ["ur5", "panda", "kinova", "skew_tree"])
def test_inertia_boxes_have_the_mass_and_moments_of_their_bodies(name: str) -> None:
    """The uniform box of their edges, turned into the link's frame; float32 edges allow 1e-6 of the largest moment."""
    robot = rd.load(name).with_(payload=rd.Payload(rd.load(name).frame_names[-1], 1.5, (0.1, 0.0, 0.0)))
    found = list(inertia_boxes(robot))
    assert len(found) == robot.model.njoints - 1
    for (link, pose, mesh, bent), body in zip(found, robot.model.inertias.tolist()[1:], strict=True):
        if bent is not None:
            continue
        edges = np.ptp(mesh.vertices, axis=0).astype(float)
        uniform = solid_box(body.mass, *edges).moved(pose[:3, :3], pose[:3, 3])
        assert np.allclose(uniform.com, body.lever, atol=1e-12), link
        assert np.abs(uniform.inertia - body.inertia).max() <= 2e-6 * np.abs(body.inertia).max(), link


def test_moments_that_no_body_has_are_noted_and_drawn_thin(tmp_path: Path) -> None:
    text = urdf("").replace(b'izz="0.01"', b'izz="0.9"')
    here = drawn(text, tmp_path, inertia=True)
    assert any("inertia box of link 'arm'" in note and "triangle inequality" in note for note in here.notes)
    assert np.ptp(here.boxes[-1].mesh.vertices, axis=0).min() > 0
    assert here.boxes[-1].rgba[3] < 1


def test_an_inertia_far_beyond_the_robot_is_drawn_in_red_at_most_as_long_as_its_longest_link(tmp_path: Path) -> None:
    """In kg mm² in place of kg m²: a box of hundreds of metres would hide the arm."""
    sound = drawn(ARM.encode(), tmp_path, inertia=True)
    here = drawn(
        ARM.replace(MOMENTS, MOMENTS.replace("0.02", "2e4").replace("0.01", "1e4")).encode(), tmp_path, inertia=True
    )
    (note,) = [note for note in here.notes if "inertia box" in note]
    assert "link 'upper'" in note and "in red" in note
    (upper,) = [each for each in here.boxes if each.link == "upper"]
    assert np.ptp(upper.mesh.vertices, axis=0).max() == pytest.approx(0.7)
    assert upper.rgba[0] > upper.rgba[2] and all(each.rgba[0] < each.rgba[2] for each in sound.boxes)


def test_a_link_that_no_joint_connects_is_not_drawn(tmp_path: Path) -> None:
    box = '<{0} name="{1}"><visual><geometry><box size="1 1 1"/></geometry></visual></{0}>'
    text = ARM.replace('<link name="base"/>', box.format("link", "base") + box.format("link", "table"))
    assert {each.link for each in drawn(text.encode(), tmp_path).pieces} == {"base"}


@pytest.mark.parametrize(("mass", "moment", "edge"), [("1e-320", "0.03", 1e6), ("2", "1e-300", 0.01)])
def test_inertias_beyond_what_can_be_drawn_are_drawn_at_the_ends(mass: str, moment: str, edge: float) -> None:
    """An edge of √(6 I / m) is drawn with 1000 km at most, and one below a micrometre as of a point: 1 cm."""
    text = re.sub(r'i(xx|yy|zz)="[^"]*"', rf'i\1="{moment}"', urdf("").decode().replace('value="2"', f'value="{mass}"'))
    ((_, _, mesh, _),) = inertia_boxes(Robot(description.check(text, "r.urdf")))
    assert np.ptp(mesh.vertices, axis=0) == pytest.approx([edge] * 3, rel=1e-6)


def test_a_run_made_on_another_machine_finds_the_installed_meshes() -> None:
    robot = rd.load("ur5")
    moved = Robot(description.check(robot.description.text, "/home/someone/else/ur5.urdf"))
    here = drawing(moved)
    assert not here.notes
    assert len(here.pieces) == len(drawing(robot).pieces)
