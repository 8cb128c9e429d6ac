"""Meshes as others keep them: STL of odd writers, glTF with buffers beside it, Collada with remains, lost packages."""

from __future__ import annotations

import base64
import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from robot_dyn.shapes import meshes
from tests.drawings import box, boxes, collada_points, drawn, mesh_visual, stl, urdf

pytestmark = pytest.mark.filterwarnings("ignore::robot_dyn.foundations.errors.ModelWarning")

CORNERS = np.array([[0, 0, 0], [0.3, 0, 0], [0, 0.2, 0], [0, 0, 0.1]], dtype="f4")
FACES = np.array([[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]], dtype="<u2")

# --- STL


def facets(normal: str = "0 0 0", vertex: str = "vertex") -> str:
    lines = ["solid some name"]
    for face in FACES:
        corners = "\n".join(f"      {vertex} {x:.9g}\t{y:.9g} {z:.9e}" for x, y, z in CORNERS[face].tolist())
        lines.append(f"  facet normal {normal}\n    outer loop\n{corners}\n    endloop\n  endfacet")
    return "\n".join([*lines, "endsolid some name", ""])


TEXTS = (facets(), facets("nan nan nan"), facets("-1E-3 +.5 0.7"), facets(vertex="VERTEX").upper(),
         "\n\n" + facets().replace("\n", "\r\n"))  # fmt: skip
ODD = [*(lambda binary, text=text: text.encode() for text in TEXTS), lambda binary: b"solid" + binary[5:]]
ODD.append(lambda binary: b"     " + binary[5:] + b"made by hand")
ODD.append(lambda binary: binary[:80] + bytes(4) + binary[84:])  # written as a stream: the count stays 0


@pytest.mark.parametrize("write", ODD)
def test_stl_of_odd_writers_is_that_of_the_same_corners_in_binary(write: Any, tmp_path: Path) -> None:
    """As text, as a binary file that begins as text, or one that goes on after its end."""
    stl(tmp_path / "binary.stl")
    (tmp_path / "odd.stl").write_bytes(write((tmp_path / "binary.stl").read_bytes()))
    (expected,), _ = meshes.read(tmp_path / "binary.stl")
    (part,), missing = meshes.read(tmp_path / "odd.stl")
    assert missing == ()
    for name in ("vertices", "faces", "normals"):
        assert np.array_equal(getattr(part.mesh, name), getattr(expected.mesh, name)), name


def test_what_the_reader_of_a_format_does_not_take_is_noted_and_does_not_reach_stderr(tmp_path: Path, capfd) -> None:
    (tmp_path / "a.stl").write_text(facets("0 0 zz"))
    here = drawn(urdf(mesh_visual("a.stl")), tmp_path)
    assert here.notes == ("mesh a.stl: a normal is not three numbers; drawn without it",)
    assert np.array_equal(box(here.pieces[0].mesh.vertices), box(CORNERS))
    compressed = {"KHR_draco_mesh_compression": {"bufferView": 0}}
    primitive = {"attributes": {"POSITION": 0}, "indices": 1, "extensions": compressed}
    (tmp_path / "a.gltf").write_text(json.dumps(gltf() | {"meshes": [{"primitives": [primitive]}]}))
    assert "its reader reports: " in drawn(urdf(mesh_visual("a.gltf")), tmp_path).notes[0]
    assert capfd.readouterr() == ("", "")


def test_stl_is_read_in_memory_of_a_few_times_its_size(tmp_path: Path) -> None:
    """Counted by NumPy's own allocations, 20 bytes for each of the file's: the whole is then ten files or less."""
    import tracemalloc

    k = 150
    u, v = np.meshgrid(np.linspace(0, 1, k + 1), np.linspace(0, 1, k + 1))
    grid = np.stack([u, v, np.sin(9 * u) * np.cos(7 * v)], axis=2).astype("f4")
    a, b, c = grid[:-1, :-1], grid[:-1, 1:], grid[1:, 1:]
    record = np.zeros(k * k, dtype=[("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    record["corners"] = np.stack([a, b, c], axis=2).reshape(-1, 3, 3)
    data = b" " * 80 + struct.pack("<I", k * k) + record.tobytes()
    (tmp_path / "a.stl").write_bytes(data)
    meshes.read(tmp_path / "a.stl")  # imports
    tracemalloc.start()
    try:
        meshes.read(tmp_path / "a.stl")
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert peak < 12 * len(data)


# --- glTF


def gltf(uri: str | None = None) -> dict:
    """A red tetrahedron; its buffer in the file itself, or at an address."""
    data = CORNERS.tobytes() + FACES.tobytes()
    inside = "data:application/octet-stream;base64," + base64.b64encode(data).decode()
    return {
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "material": 0}]}],
        "materials": [{"pbrMetallicRoughness": {"baseColorFactor": [1, 0, 0, 1]}}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3"},
            {"bufferView": 1, "componentType": 5123, "count": 12, "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteLength": CORNERS.nbytes},
            {"buffer": 0, "byteOffset": CORNERS.nbytes, "byteLength": FACES.nbytes},
        ],
        "buffers": [{"byteLength": len(data), "uri": uri or inside}],
    }


@pytest.mark.parametrize(
    ("uri", "file"), [(None, None), ("a.bin", "a.bin"), ("parts/my%20arm.bin", "parts/my arm.bin")]
)
def test_gltf_is_read_with_its_buffers(uri: str | None, file: str | None, tmp_path: Path) -> None:
    (tmp_path / "a.gltf").write_text(json.dumps(gltf(uri)))
    if file:
        (tmp_path / file).parent.mkdir(exist_ok=True)
        (tmp_path / file).write_bytes(CORNERS.tobytes() + FACES.tobytes())
    here = drawn(urdf(mesh_visual("a.gltf")), tmp_path)
    assert here.notes == ()
    (piece,) = here.pieces
    assert piece.rgba == (1, 0, 0, 1)
    assert np.array_equal(box(piece.mesh.vertices), box(z_up(CORNERS)))


def z_up(points: np.ndarray) -> np.ndarray:
    """Of coordinates in which y is up, as Drake turns glTF: x ↦ x, y ↦ z, z ↦ −y."""
    x, y, z = points.T
    return np.column_stack([x, -z, y])


def binary(description: dict) -> bytes:
    """A glTF as .glb, its buffer in the second chunk."""
    data = base64.b64decode(description["buffers"][0].pop("uri").partition(",")[2])
    text = json.dumps(description).encode()
    chunks = ((b"JSON", text + b" " * (-len(text) % 4)), (b"BIN\0", data + b"\0" * (-len(data) % 4)))
    body = b"".join(struct.pack("<I", len(part)) + kind + part for kind, part in chunks)
    return b"glTF" + struct.pack("<II", 2, 12 + len(body)) + body


@pytest.mark.parametrize("scale", [(1.0, 1.0, 1.0), (2.0, 0.5, 3.0), (-1.5, 1.0, 2.0)])
@pytest.mark.parametrize("name", ["a.gltf", "a.glb"])
def test_gltf_stands_where_its_specification_and_drake_put_it(name: str, scale: tuple, tmp_path: Path) -> None:
    """Nodes T R S, then y up turned to z up, then the scale of the URDF along the axes of the shape, then its origin.

    Two instances of one mesh, one of them mirrored below a node with a matrix; float32 leaves 1e-6 m. The outside is
    outside: the volume by the divergence theorem is positive, and that of the tetrahedra.
    """
    a = 0.7
    axis = np.array([2.0, -1.0, 2.0]) / 3
    quaternion = [*(np.sin(a / 2) * axis), np.cos(a / 2)]
    K = np.cross(np.eye(3), axis)  # axis × x = K x
    R, S, t = np.eye(3) + np.sin(a) * K + (1 - np.cos(a)) * K @ K, np.diag([1.0, -2.0, 0.5]), np.array([0.1, 0.2, 0.3])
    above = np.array([[0.0, -1, 0, 0.4], [1, 0, 0, -0.5], [0, 0, 1, 0.6], [0, 0, 0, 1]])
    nodes = [
        {"children": [1], "matrix": above.T.ravel().tolist()},
        {"mesh": 0, "translation": t.tolist(), "rotation": quaternion, "scale": np.diag(S).tolist()},
        {"mesh": 0, "translation": [-1.0, 0.0, 2.0]},
    ]
    description = gltf() | {"nodes": nodes, "scenes": [{"nodes": [0, 2]}]}
    (tmp_path / name).write_bytes(binary(description) if name == "a.glb" else json.dumps(description).encode())
    origin, mesh = '<origin xyz="0.3 -0.2 0.1" rpy="0 0 1.5707963267948966"/>', f'scale="{" ".join(map(str, scale))}"'
    here = drawn(urdf(mesh_visual(name, mesh, origin)), tmp_path)
    assert (here.notes, here.remarks) == ((), ())
    (piece,) = here.pieces

    low, high = (CORNERS @ (R @ S).T + t) @ above[:3, :3].T + above[:3, 3], CORNERS - np.array([1.0, 0.0, -2.0])
    x, y, z = (z_up(np.concatenate([low, high])) * scale).T
    expected = np.column_stack([0.3 - y, x - 0.2, z + 0.1])
    found = piece.mesh.vertices @ piece.pose[:3, :3].T + piece.pose[:3, 3]
    distance = np.linalg.norm(found[:, None] - expected[None], axis=2)
    assert distance.min(axis=0).max() < 1e-6
    assert distance.min(axis=1).max() < 1e-6
    volume = np.linalg.det(piece.mesh.vertices[piece.mesh.faces].astype(float)).sum() / 6
    assert volume == pytest.approx(0.3 * 0.2 * 0.1 / 6 * (1 + 1.0) * abs(np.prod(scale)), rel=1e-5)


@pytest.mark.parametrize(("up", "told"), [("y", False), ("z", True)])
def test_gltf_written_with_z_up_is_known_by_the_masses_and_told(up: str, told: bool, tmp_path: Path) -> None:
    """The link's centre of mass is 0.2 m along z, and the shape a needle of 0.4 m that a writer took for upright."""
    corners = np.array([[0.01, 0, 0], [0, 0.01, 0], [0, 0, 0.4], [0, 0, 0]], dtype="f4")
    description, data = gltf(), np.roll(corners, -1, axis=1) if up == "y" else corners
    inside = "data:application/octet-stream;base64," + base64.b64encode(data.tobytes() + FACES.tobytes()).decode()
    description["buffers"][0]["uri"] = inside
    (tmp_path / "a.gltf").write_text(json.dumps(description))
    here = drawn(urdf(mesh_visual("a.gltf")), tmp_path)
    assert [("glTF" in each, "y up" in each) for each in here.remarks] == [(True, True)] * told
    low, high = boxes(here)["arm"]
    assert high[2] - low[2] == pytest.approx(0.4, abs=1e-6)
    assert high[2] == pytest.approx(0.4, abs=1e-6)


UNREAD = {
    "instances by EXT_mesh_gpu_instancing": {"extensionsUsed": ["EXT_mesh_gpu_instancing"]},
    "buffers compressed by EXT_meshopt_compression": {"extensionsUsed": ["EXT_meshopt_compression"]},
    "sparse accessors": {"accessors": [{"count": 1, "sparse": {}}]},
    "skins": {"nodes": [{"mesh": 0, "skin": 0}]},
    "weights of morph targets": {"nodes": [{"mesh": 0, "weights": [0.5]}]},
    "triangle fans": {"meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "mode": 6}]}]},
    "normalized positions": {
        "accessors": [{"bufferView": 0, "componentType": 5122, "count": 4, "type": "VEC3", "normalized": True}]
    },
}


@pytest.mark.parametrize("what", UNREAD)
def test_gltf_that_would_be_drawn_wrong_is_replaced_and_told(what: str, tmp_path: Path) -> None:
    (tmp_path / "a.gltf").write_text(json.dumps(gltf() | UNREAD[what]))
    here = drawn(urdf(mesh_visual("a.gltf")), tmp_path)
    assert f"has {what}, which are not supported; export it without them" in here.notes[0]


@pytest.mark.parametrize(
    "uri", ["../a.bin", "{folder}/a.bin", "file://{folder}/a.bin", "parts/../../a.bin", "%2e%2e/a.bin"]
)
def test_gltf_reads_no_buffer_that_is_not_beside_or_below_it(uri: str, tmp_path: Path) -> None:
    (tmp_path / "a.bin").write_bytes(CORNERS.tobytes() + FACES.tobytes())
    (tmp_path / "meshes" / "parts").mkdir(parents=True)
    (tmp_path / "meshes" / "a.gltf").write_text(json.dumps(gltf(uri.format(folder=tmp_path))))
    here = drawn(urdf(mesh_visual("meshes/a.gltf")), tmp_path)
    assert "is not in the folder of the mesh or below it" in here.notes[0]


def test_gltf_may_not_open_more_than_the_limit_in_all(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from robot_dyn.shapes import mesh_files

    description = gltf("a.bin")
    description["buffers"] += [{"byteLength": 96, "uri": f"{i}.bin"} for i in range(5)]
    (tmp_path / "a.gltf").write_text(json.dumps(description))
    for name in ("a", *range(5)):
        (tmp_path / f"{name}.bin").write_bytes(CORNERS.tobytes() + FACES.tobytes() + b" " * 3000)
    monkeypatch.setattr(mesh_files, "MAX_BYTES", 10_000)
    here = drawn(urdf(mesh_visual("a.gltf")), tmp_path)
    assert "makes the total exceed" in here.notes[0]


# --- Collada

COLLADA = """<?xml version="1.0"?><COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><unit meter="1"/><up_axis>Z_UP</up_axis></asset>{libraries}
<library_effects><effect id="e"><profile_COMMON><technique sid="t"><phong><diffuse><color>{color}</color></diffuse>
  </phong></technique></profile_COMMON></effect></library_effects>
<library_materials><material id="m"><instance_effect url="#e"/></material></library_materials>
<library_geometries><geometry id="g"><mesh><source id="p"><float_array id="pa" count="12">{floats}</float_array>
  <technique_common><accessor source="#pa" count="4" stride="3"><param name="X" type="float"/>
  <param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common></source>
  <vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
  <triangles count="4" material="s"><input semantic="VERTEX" source="#v" offset="0"/><p>{faces}</p></triangles>
</mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s">{nodes}<node><instance_geometry url="#g"><bind_material><technique_common>
  <instance_material symbol="s" target="#m"/></technique_common></bind_material></instance_geometry></node>
</visual_scene></library_visual_scenes><scene><instance_visual_scene url="#s"/></scene></COLLADA>"""
SOUND = {
    "libraries": "",
    "color": "1 0 0 1",
    "nodes": "",
    "floats": " ".join(f"{x:.9g}" for x in CORNERS.ravel()),
    "faces": " ".join(map(str, FACES.ravel())),
}
REMAINS = {
    "nothing": {},
    "a light that is not defined": {"nodes": '<node><instance_light url="#Lamp"/></node>'},
    "a camera that is not defined": {"nodes": '<node><instance_camera url="#Camera"/></node>'},
    "a light without technique": {"libraries": '<library_lights><light id="l"/></library_lights>'},
    "an animation of nothing": {
        "libraries": '<library_animations><animation id="a"><channel source="#x" target="y"/></animation>'
        "</library_animations>"
    },
    "a comment between numbers": {"floats": SOUND["floats"].replace(" ", " <!-- x --> ", 3)},
    "a comment in a colour": {"color": "1 0 <!-- green -->0 1"},
    "a comment between faces": {"faces": SOUND["faces"].replace(" ", "<!-- 1 --> ", 2)},
    "comments between elements": {"libraries": "<!-- a -->", "nodes": "<!-- b --><?pi?>"},
}


@pytest.mark.parametrize("remains", REMAINS)
def test_collada_keeps_its_shape_and_colour_beside_what_is_not_drawn(remains: str, tmp_path: Path) -> None:
    (tmp_path / "a.dae").write_text(COLLADA.format(**SOUND | REMAINS[remains]))
    here = drawn(urdf(mesh_visual("a.dae")), tmp_path)
    assert here.notes == ()
    (piece,) = here.pieces
    assert piece.rgba == (1, 0, 0, 1)
    assert len(piece.mesh.faces) == 4
    assert np.array_equal(box(piece.mesh.vertices), box(CORNERS))


def test_nodes_of_collada_turn_by_the_right_hand(tmp_path: Path) -> None:
    """The point x at t + R S x, with a quarter turn about z: (x, y, z) ↦ (1 − 2 y, x, z)."""
    nodes = "<node><translate>1 0 0</translate><rotate>0 0 1 90</rotate><scale>1 2 1</scale>"
    (tmp_path / "a.dae").write_text(COLLADA.format(**SOUND).replace("<node>", nodes))
    x, y, z = CORNERS.T
    expected = box(np.column_stack([1 - 2 * y, x, z]))
    for found in (boxes(drawn(urdf(mesh_visual("a.dae")), tmp_path))["arm"], box(collada_points(tmp_path / "a.dae"))):
        assert np.abs(found - expected).max() < 1e-6


# --- packages


def named(folder: Path, name: str) -> Path:
    folder.mkdir(parents=True)
    (folder / "package.xml").write_text(f'<?xml version="1.0"?><package format="2">\n <name>{name}</name></package>')
    return folder


@pytest.mark.parametrize("place", ["src/own", "src/other", "src/stack/other", "src/stack/deep/other"])
def test_package_is_found_by_the_name_in_its_package_xml(place: str, tmp_path: Path) -> None:
    """Above the file, beside its package, and one folder below that: what a checkout of several repositories has."""
    robot = named(tmp_path / "src" / "own", "arm_description" if place == "src/own" else "arm_robots") / "urdf"
    robot.mkdir()
    holder = robot.parent if place == "src/own" else named(tmp_path / place, "arm_description")
    (holder / "meshes").mkdir()
    stl(holder / "meshes" / "a.stl")
    here = drawn(urdf(mesh_visual("package://arm_description/meshes/a.stl")), robot)
    assert here.notes == ()
    assert np.array_equal(boxes(here)["arm"], box(CORNERS))


def test_package_dirs_are_searched_below_and_come_first(tmp_path: Path) -> None:
    from robot_dyn.shapes.addresses import find_file

    for place in ("first/repository/x", "above/y"):
        stl(named(tmp_path / place, "arm") / "a.stl")
    (tmp_path / "first" / "repository" / "x" / "inner").mkdir()  # a package holds no other one
    source = tmp_path / "above" / "y" / "arm.urdf"
    assert find_file("package://arm/a.stl", source, (tmp_path / "first",)) == tmp_path / "first/repository/x/a.stl"
    assert find_file("package://arm/a.stl", source, ()) == tmp_path / "above/y/a.stl"


def test_file_of_a_lost_package_is_found_above_the_urdf(tmp_path: Path) -> None:
    """A folder that was renamed, or taken out of its package."""
    (tmp_path / "meshes").mkdir()
    (tmp_path / "urdf" / "arms").mkdir(parents=True)
    stl(tmp_path / "meshes" / "a.stl")
    here = drawn(urdf(2 * mesh_visual("package://lost/meshes/a.stl")), tmp_path / "urdf" / "arms")
    assert (here.notes, len(here.pieces)) == ((), 2)
    assert here.remarks == (f"package 'lost' is not found; its files are read from {tmp_path.name!r} above the URDF",)
    here = drawn(urdf(mesh_visual("package://lost/../meshes/a.stl")), tmp_path / "urdf")
    assert "package_dirs" in here.notes[0]


def test_package_in_the_share_folder_of_ros_2(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "install/arm/share/arm").mkdir(parents=True)
    (tmp_path / "elsewhere").mkdir()
    stl(tmp_path / "install/arm/share/arm/a.stl")
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path / "install/arm"))
    assert drawn(urdf(mesh_visual("package://arm/a.stl")), tmp_path / "elsewhere").notes == ()
