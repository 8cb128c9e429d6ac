"""Geometry of the replay page: the box about each link, in the browser's scene, is that of trimesh and Pinocchio."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
import trimesh
from lxml import etree  # pyright: ignore[reportAttributeAccessIssue]

import robot_dyn as rd
from robot_dyn.description import catalog
from tests.browser import opened
from tests.long import long


def box_of_link(arm: rd.Robot, link: str, q: np.ndarray, source: Path) -> np.ndarray | None:
    """Least and largest coordinates (2, 3) of a link's visual meshes, read by trimesh, placed by Pinocchio."""
    element = etree.fromstring(source.read_bytes()).find(f"link[@name='{link}']")
    points = []
    for visual in element.iterfind("visual"):
        origin, mesh = visual.find("origin"), visual.find("geometry/mesh")
        if mesh is None:
            return None
        xyz, rpy = (
            [float(x) for x in (origin.get(key, "0 0 0") if origin is not None else "0 0 0").split()]
            for key in ("xyz", "rpy")
        )
        place = trimesh.transformations.euler_matrix(*rpy, "sxyz")
        place[:3, 3] = xyz
        name = mesh.get("filename")
        path = catalog.resolve(name, source) if name.startswith("package://") else source.parent / name
        vertices = trimesh.load_scene(path, process=False).to_geometry().vertices
        unit = re.search(r'<unit[^>]*meter="([^"]*)"', path.read_text("utf-8", "replace"))
        if path.suffix.lower() == ".dae" and unit:
            vertices = vertices * float(unit[1])
        vertices = vertices * [float(x) for x in mesh.get("scale", "1 1 1").split()]
        points.append(trimesh.transform_points(vertices, arm.placement(q, link) @ place))
    return np.array([np.vstack(points).min(axis=0), np.vstack(points).max(axis=0)]) if points else None


@pytest.mark.parametrize("name, least", [("ur5", 7), *long([("panda", 10), ("kinova", 9), ("twodofs", 1)])])
def test_each_link_fills_the_box_that_trimesh_gives(browser, tmp_path, name: str, least: int) -> None:
    """Single precision of coordinates and placements in a scene of about 1 m: 2e-6."""
    arm, source = rd.load(name), catalog.find(name)
    q = np.linspace(0.2, 0.7, arm.n)
    run = rd.simulate(rd.Plant(arm), q0=q, duration_s=0.002, estimate_error=False)
    checked = 0
    with opened(browser, rd.save_replay(run, tmp_path / "run.html")) as view:
        view.ask("(replay.seek(0), 0)")
        for link in (link.get("name") for link in arm.description.element.iterfind("link")):
            if (expected := box_of_link(arm, link, q, source)) is not None:
                np.testing.assert_allclose(view.bounds(path_of(view, link)), expected, atol=2e-6)
                checked += 1
    assert checked >= least


def path_of(view, link: str) -> str:
    """Path of a link's node, wherever it stands in the tree."""
    return view.ask(
        f"(() => {{ const find = (n, path) => {{ for (const [k, c] of Object.entries(n.children)) {{"
        f" if (k === {'link ' + link!r}) return path + k; const f = find(c, path + k + '/'); if (f) return f; }} }};"
        f" return find(viewer.scene_tree, ''); }})()"
    )
