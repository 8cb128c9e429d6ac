"""Solids, hulls and shells of triangles against closed forms."""

from __future__ import annotations

from math import pi

import numpy as np
import pytest
import trimesh

from robot_dyn.description import MassProperties, combined
from robot_dyn.description import box as solid_box
from robot_dyn.description import cylinder as solid_cylinder
from robot_dyn.foundations import rotation_rpy
from robot_dyn.shapes import MeshError, primitives, surface
from robot_dyn.shapes.winding import winding

BOX = (0.3, 0.2, 0.5)
EXACT = 1e-12  # relative: sums of some hundred products of float64


def same(a: MassProperties | None, b: MassProperties | None, tolerance: float) -> None:
    assert a is not None and b is not None
    assert a.mass == pytest.approx(b.mass, rel=tolerance)
    np.testing.assert_allclose(a.com, b.com, atol=tolerance)
    np.testing.assert_allclose(a.inertia, b.inertia, atol=tolerance * np.trace(b.inertia))


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
    mesh = trimesh.creation.box(BOX)
    for body in (solid(mesh), surface.hull(mesh.vertices)):
        same(body, solid_box(float(np.prod(BOX)), *BOX), EXACT)


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
        placed = trimesh.Trimesh(vertices, mesh.faces, process=False)
        bodies = {"hull": lambda: surface.hull(vertices), "solid": lambda: solid(placed)}
        found = bodies.get(kind, lambda: surface.shell(vertices, mesh.faces))()
        assert found is not None
        return found

    power, at = (2 if kind == "shell" else 3), body(mesh.vertices)
    scaled = MassProperties(s**power * at.mass, s * at.com, s ** (power + 2) * at.inertia)
    same(body(s * mesh.vertices @ R.T + p), scaled.moved(R, p), 1e-10)  # of volumes that cancel away from the origin


def test_an_open_surface_has_no_solid_and_a_flat_one_no_hull() -> None:
    mesh = trimesh.creation.box(BOX)
    assert surface.solid(mesh.vertices, mesh.faces[1:]) is None
    same(surface.hull(mesh.vertices), solid_box(float(np.prod(BOX)), *BOX), EXACT)
    flat = mesh.vertices * (1, 1, 0)
    assert surface.hull(flat) is None and surface.shell(flat[:1], np.zeros((1, 3), dtype=int)) is None


CUBOID, GLOBE = trimesh.creation.box(BOX), trimesh.creation.icosphere(2, 0.2)
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
    full = solid_box(float(np.prod(BOX)), *BOX)
    mass, inertia = (sum(sign * s**power for sign, s in ((1, 1.0), (-1, 0.6), (1, 0.3))) for power in (3, 5))
    same(solid(hollow), MassProperties(mass * full.mass, full.com, inertia * full.inertia), EXACT)
    found = surface.solid(hollow.vertices, hollow.faces)
    assert found is not None and (found.parts, found.turned) == (3, 3 if flipped else 0)


@pytest.mark.parametrize("faces", [slice(None), slice(2), slice(5)])
def test_faces_that_are_inside_out_are_turned_and_counted(faces: slice) -> None:
    """All of them, two or five: the box is that of the right one."""
    wrong = np.array(CUBOID.faces)
    wrong[faces] = wrong[faces, ::-1]
    mesh = together(trimesh.Trimesh(CUBOID.vertices, wrong, process=False), moved(CUBOID, 1, 0, 0))
    same(solid(mesh), solid(together(CUBOID, moved(CUBOID, 1, 0, 0))), EXACT)
    found = surface.solid(mesh.vertices, mesh.faces)
    assert found is not None and (found.parts, found.turned) == (2, 1)


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
