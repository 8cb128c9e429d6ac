"""Solids, hulls and shells of triangles against closed forms."""

from __future__ import annotations

from math import pi

import numpy as np
import pytest
import trimesh

from robot_dyn.description import solids
from robot_dyn.description.inertia import MassProperties
from robot_dyn.foundations.spatial import rotation_rpy
from robot_dyn.shapes import primitives, surface

BOX = (0.3, 0.2, 0.5)
EXACT = 1e-12  # relative: sums of some hundred products of float64


def same(a: MassProperties | None, b: MassProperties | None, tolerance: float) -> None:
    assert a is not None and b is not None
    assert a.mass == pytest.approx(b.mass, rel=tolerance)
    np.testing.assert_allclose(a.com, b.com, atol=tolerance)
    np.testing.assert_allclose(a.inertia, b.inertia, atol=tolerance * np.trace(b.inertia))


def test_the_solid_in_a_closed_box_is_the_box() -> None:
    mesh = trimesh.creation.box(BOX)
    for body in (surface.solid(mesh.vertices, mesh.faces), surface.hull(mesh.vertices)):
        same(body, solids.box(float(np.prod(BOX)), *BOX), EXACT)


def test_cylinders_of_polygons_tend_to_the_cylinder() -> None:
    """The area of a regular polygon of n corners in a circle is less by 2π²/(3 n²): four times less with 2 n."""
    true = solids.cylinder(pi * 0.1**2 * 0.4, 0.1, 0.4)
    errors = []
    for sections in (32, 64):
        mesh = trimesh.creation.cylinder(0.1, 0.4, sections=sections)
        body = surface.solid(mesh.vertices, mesh.faces)
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
        body = getattr(surface, kind)(mesh.vertices, mesh.faces)
        errors.append([1 - body.mass / true.mass, 1 - np.trace(body.inertia) / np.trace(true.inertia)])
    np.testing.assert_allclose(np.divide(*errors), 4, rtol=0.05)
    assert max(errors[1]) < 0.03


def test_the_shell_of_a_box_is_exact() -> None:
    """Its faces are flat, so that the triangles are the surface."""
    mesh = trimesh.creation.box(BOX)
    same(surface.shell(mesh.vertices, mesh.faces), primitives.shell("box", BOX), EXACT)


@pytest.mark.parametrize(("kind", "lengths"), [("box", BOX), ("cylinder", (0.15, 0.4)), ("sphere", (0.2,))])
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
        found = surface.hull(vertices) if kind == "hull" else getattr(surface, kind)(vertices, mesh.faces)
        assert found is not None
        return found

    power, at = (2 if kind == "shell" else 3), body(mesh.vertices)
    scaled = MassProperties(s**power * at.mass, s * at.com, s ** (power + 2) * at.inertia)
    same(body(s * mesh.vertices @ R.T + p), scaled.moved(R, p), 1e-10)  # of volumes that cancel away from the origin


def test_an_open_surface_has_no_solid_and_a_flat_one_no_hull() -> None:
    mesh = trimesh.creation.box(BOX)
    assert surface.solid(mesh.vertices, mesh.faces[1:]) is None
    assert surface.solid(mesh.vertices, mesh.faces[:, ::-1]) is None  # it faces inward
    same(surface.hull(mesh.vertices), solids.box(float(np.prod(BOX)), *BOX), EXACT)
    flat = mesh.vertices * (1, 1, 0)
    assert surface.hull(flat) is None and surface.shell(flat[:1], np.zeros((1, 3), dtype=int)) is None
