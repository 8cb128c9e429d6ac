"""Coarse meshes: the same shape to a cell of a grid, with fewer triangles, by name alone."""

from __future__ import annotations

import numpy as np
import pytest
import trimesh

import robot_dyn as rd
from robot_dyn.shapes import Mesh
from robot_dyn.shapes.triangles import welded
from robot_dyn.view.geometry.coarse import CELLS, coarse


def mesh_of(shape: trimesh.Trimesh) -> Mesh:
    mesh = welded(np.asarray(shape.triangles))
    assert mesh is not None
    return mesh


def solid(mesh: Mesh) -> trimesh.Trimesh:
    return trimesh.Trimesh(mesh.vertices, mesh.faces, process=True)


@pytest.fixture(scope="module")
def sphere() -> Mesh:
    """Of radius 0.3 m, away from the origin, turned: corners in no plane of the grid."""
    shape = trimesh.creation.icosphere(subdivisions=5, radius=0.3)
    shape.apply_transform(trimesh.transformations.rotation_matrix(0.7, [1, 2, 3], [0.2, 0.1, -0.3]))
    return mesh_of(shape)


def test_no_corner_is_farther_from_the_mesh_than_the_diagonal_of_a_cell(sphere: Mesh) -> None:
    """Each is the mean of corners in one cell. Single precision adds less than 1e-6 m."""
    less = coarse(sphere)
    most = np.sqrt(3) / CELLS * np.ptp(sphere.vertices, axis=0).max() + 1e-6
    away = np.linalg.norm(less.vertices[:, None] - sphere.vertices[None, ::7], axis=2).min(axis=1)
    assert away.max() < most + 0.02  # 0.02 m: spacing of every seventh corner of the sphere
    back = np.linalg.norm(sphere.vertices[::7, None] - less.vertices[None], axis=2).min(axis=1)
    assert back.max() < most
    assert len(less.faces) < len(sphere.faces) / 2


def test_a_closed_surface_stays_closed_and_keeps_its_volume(sphere: Mesh) -> None:
    """Each edge is passed as often one way as the other. Means of a cell lie inside the sphere: 1 % of its volume."""
    whole, less = solid(sphere), solid(coarse(sphere))
    edges = np.concatenate([less.faces[:, [0, 1]], less.faces[:, [1, 2]], less.faces[:, [2, 0]]])
    there = np.unique(edges, axis=0, return_counts=True)
    back = np.unique(edges[:, ::-1], axis=0, return_counts=True)
    np.testing.assert_array_equal(there[0], back[0])
    np.testing.assert_array_equal(there[1], back[1])
    assert less.volume == pytest.approx(whole.volume, rel=0.01)


def test_a_mesh_without_two_corners_in_a_cell_stays_as_it_is() -> None:
    """A box: the corners of each face are far apart."""
    box = mesh_of(trimesh.creation.box((0.3, 0.2, 0.1)))
    np.testing.assert_allclose(solid(coarse(box)).bounds, solid(box).bounds, atol=1e-7)
    assert len(coarse(box).faces) == len(box.faces) == 12


def test_colours_stay_with_their_triangles() -> None:
    corners = np.asarray(trimesh.creation.icosphere(subdivisions=4).triangles)
    red = np.where(corners.mean(axis=1)[:, 2] > 0, 255, 0)
    colors = np.repeat(np.stack([red, 0 * red, 255 - red], axis=1)[:, None], 3, axis=1)
    mesh = welded(corners, colors=colors)
    assert mesh is not None
    less = coarse(mesh)
    assert less.colors is not None and len(less.faces) < len(mesh.faces)
    high = less.vertices[:, 2]
    assert (less.colors[high > 0.1] == (255, 0, 0)).all() and (less.colors[high < -0.1] == (0, 0, 255)).all()


def test_a_page_has_coarse_meshes_where_they_are_named() -> None:
    arm = rd.load("ur5")
    full, less = rd.show(arm), rd.show(arm, meshes="coarse")
    assert len(less.text) < 0.7 * len(full.text)
    assert any("meshes are coarse" in note for note in less.document["notes"])
    assert not any("coarse" in note for note in full.document["notes"])


def test_an_unknown_kind_of_meshes_is_refused() -> None:
    with pytest.raises(rd.RobotDynError, match="no meshes 'corase'; nearest: coarse"):
        rd.show(rd.load("planar_2r"), meshes="corase")  # pyright: ignore[reportArgumentType]
