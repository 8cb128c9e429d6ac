"""Drawings of small URDFs, and an independent reading of the mesh files of real ones."""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import pytest
from lxml import etree  # pyright: ignore[reportAttributeAccessIssue]

from robot_dyn import Robot
from robot_dyn.description import catalog, description
from robot_dyn.view import Drawing, drawing

pytestmark = pytest.mark.filterwarnings("ignore::robot_dyn.foundations.errors.ModelWarning")


def urdf(visual: str, more: str = "", collision: str = "") -> bytes:
    """A pendulum whose link has this <visual>."""
    return f"""<robot name="r">{more}<link name="base"/><link name="arm">
        <inertial><origin xyz="0 0 0.2"/><mass value="2"/>
          <inertia ixx="0.03" ixy="0" ixz="0" iyy="0.03" iyz="0" izz="0.01"/></inertial>{visual}{collision}</link>
        <joint name="j" type="continuous"><parent link="base"/><child link="arm"/><axis xyz="0 1 0"/></joint>
        </robot>""".encode()


def drawn(text: bytes, folder: Path, **choices: bool) -> Drawing:
    return drawing(Robot(description.check(text, str(folder / "r.urdf"))), **choices)


def mesh_visual(name: str, attributes: str = "", more: str = "") -> str:
    return f'<visual>{more}<geometry><mesh filename="{name}" {attributes}/></geometry></visual>'


def box(points: np.ndarray) -> np.ndarray:
    return np.array([points.min(axis=0), points.max(axis=0)])


def boxes(drawn: Drawing) -> dict[str, np.ndarray]:
    """The bounding box of each link in its own frame."""
    points: dict[str, list[np.ndarray]] = {}
    for piece in drawn.pieces:
        points.setdefault(piece.link, []).append(piece.mesh.vertices @ piece.pose[:3, :3].T + piece.pose[:3, 3])
    return {link: box(np.concatenate(each)) for link, each in points.items()}


def stl(path: Path, scale: float = 1.0, count: int | None = None) -> np.ndarray:
    """A tetrahedron as binary STL; its corners."""
    corners = scale * np.array([[0, 0, 0], [0.3, 0, 0], [0, 0.2, 0], [0, 0, 0.1]], dtype="f4")
    faces = corners[[[0, 2, 1], [0, 1, 3], [0, 3, 2], [1, 2, 3]]]
    data = b" " * 80 + struct.pack("<I", len(faces) if count is None else count)
    path.write_bytes(data + b"".join(struct.pack("<12fH", 0, 0, 0, *face.ravel(), 0) for face in faces))
    return corners


# --- an independent reading: pycollada with transforms of its own, STL by struct, OBJ by its words


def collada_points(path: Path) -> np.ndarray:
    ns = {"c": "http://www.collada.org/2005/11/COLLADASchema"}
    root = etree.parse(str(path), etree.XMLParser(huge_tree=True)).getroot()
    geometries = {g.get("id"): g for g in root.iterfind(".//c:geometry", ns)}
    unit = root.find("c:asset/c:unit", ns)
    found: list[np.ndarray] = []

    def used(geometry: etree._Element) -> np.ndarray:
        """Positions that some triangle uses."""
        mesh = geometry.find("c:mesh", ns)
        ids = {e.get("id"): e for e in mesh.iterfind("*[@id]")}
        points = []
        for faces in mesh.iterfind("*"):
            if faces.tag.rpartition("}")[2] not in ("triangles", "polylist", "polygons"):
                continue
            inputs = faces.findall("c:input", ns)
            stride = 1 + max(int(e.get("offset")) for e in inputs)
            vertex = next(e for e in inputs if e.get("semantic") == "VERTEX")
            position = next(
                e for e in ids[vertex.get("source")[1:]].iterfind("c:input", ns) if e.get("semantic") == "POSITION"
            )
            source = ids[position.get("source")[1:]].find("c:float_array", ns)
            xyz = np.array((source.text or "").split(), dtype=float).reshape(-1, 3)
            for p in faces.iterfind("c:p", ns):
                index = np.array((p.text or "").split(), dtype=int)[int(vertex.get("offset")) :: stride]
                points.append(xyz[index])
        return np.concatenate(points) if points else np.zeros((0, 3))

    def walk(node: etree._Element, g: np.ndarray) -> None:
        for child in node:
            values = np.array((child.text or "").split() if len(child) == 0 else [], dtype=object)
            match child.tag.rpartition("}")[2]:
                case "matrix":
                    g = g @ values.astype(float).reshape(4, 4)
                case "translate":
                    T = np.eye(4)
                    T[:3, 3] = values.astype(float)
                    g = g @ T
                case "scale":
                    g = g @ np.diag([*values.astype(float), 1.0])
                case "rotate":
                    *axis, degrees = values.astype(float)
                    a = np.array(axis) / max(np.linalg.norm(axis), 1e-300)
                    K = np.cross(np.eye(3), a)  # a × x = K x
                    R = np.eye(4)
                    angle = np.deg2rad(degrees)
                    R[:3, :3] += np.sin(angle) * K + (1 - np.cos(angle)) * K @ K
                    g = g @ R
                case "instance_geometry":
                    found.append(used(geometries[child.get("url")[1:]]) @ g[:3, :3].T + g[:3, 3])
                case "node":
                    walk(child, g)

    for scene in root.iterfind(".//c:visual_scene", ns):
        walk(scene, np.eye(4))
    return np.concatenate(found) * (1.0 if unit is None else float(unit.get("meter", "1")))


def stl_points(path: Path) -> np.ndarray:
    data = path.read_bytes()
    (count,) = struct.unpack_from("<I", data, 80)
    if len(data) == 84 + 50 * count:
        return np.array([struct.unpack_from("<9f", data, 96 + 50 * i) for i in range(count)]).reshape(-1, 3)
    words = [line.split()[1:] for line in data.decode().splitlines() if line.split()[:1] == ["vertex"]]
    return np.array(words, dtype=float)


def obj_points(path: Path) -> np.ndarray:
    lines = [line.split() for line in path.read_text(errors="replace").splitlines()]
    vertices = np.array([words[1:4] for words in lines if words[:1] == ["v"]], dtype=float)
    index = {int(corner.split("/")[0]) for words in lines if words[:1] == ["f"] for corner in words[1:]}
    return vertices[[i - 1 if i > 0 else len(vertices) + i for i in index]]


READERS = {".dae": collada_points, ".stl": stl_points, ".obj": obj_points}


WRITTEN_FOR_GAZEBO = ("icub",)  # which turns a Collada file with <up_axis> Y_UP; raw, its limbs float in the air
Z_UP = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]])


def stated_boxes(name: str) -> dict[str, np.ndarray]:
    """The bounding box of each link from its <visual> meshes, by the readers above."""
    path = catalog.find(name)
    points: dict[str, list[np.ndarray]] = {}
    for link in etree.parse(str(path)).getroot().iterfind("link"):
        for visual in link.iterfind("visual"):
            mesh, origin = visual.find("geometry/mesh"), visual.find("origin")
            if mesh is None:
                points.pop(link.get("name"), None)
                break
            file = catalog.resolve(mesh.get("filename"), path)
            xyz = READERS[file.suffix.lower()](file) * np.array(mesh.get("scale", "1 1 1").split(), dtype=float)
            if name in WRITTEN_FOR_GAZEBO:
                xyz = xyz @ Z_UP.T
            if origin is not None:
                r, p, y = map(float, origin.get("rpy", "0 0 0").split())
                cr, sr, cp, sp, cy, sy = np.cos(r), np.sin(r), np.cos(p), np.sin(p), np.cos(y), np.sin(y)
                R = np.array(  # written out, Craig 2005, eq. 2.64
                    [
                        [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
                        [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
                        [-sp, cp * sr, cp * cr],
                    ]
                )
                xyz = xyz @ R.T + np.array(origin.get("xyz", "0 0 0").split(), dtype=float)
            points.setdefault(link.get("name"), []).append(xyz)
    return {link: box(np.concatenate(each)) for link, each in points.items()}
