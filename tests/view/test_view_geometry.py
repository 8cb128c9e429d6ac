"""Geometry of real robots: each link fills the box of its files, on the page too, and stands on its collision shape."""

from __future__ import annotations

import numpy as np
import pytest
from lxml import etree  # pyright: ignore[reportAttributeAccessIssue]

import robot_dyn as rd
from robot_dyn import Robot
from robot_dyn.description import description
from robot_dyn.view import drawing
from tests.browser import opened
from tests.drawings import WRITTEN_FOR_GAZEBO, Z_UP, box, boxes, stated_boxes
from tests.long import long, stress, third

pytestmark = pytest.mark.filterwarnings("ignore::robot_dyn.foundations.errors.ModelWarning")

FLOAT32 = 1e-6  # [m]: coordinates of a few metres at most, in float32


# ur5, panda, kinova, romeo: Collada, Z_UP; icub, hextilt: Y_UP; xarm7, talos_left_arm: STL; laikago: OBJ
@pytest.mark.parametrize(
    "name",
    ["ur5", "hextilt_flying_arm_5", *third(["panda", "kinova", "icub", "xarm7", "talos_left_arm", "laikago", "romeo"])],
)
def test_bounding_box_of_each_link_is_that_of_its_files(name: str) -> None:
    """Read independently: raw coordinates times the nodes of the scene, the unit, the scale."""
    here, stated = boxes(drawing(rd.load(name))), stated_boxes(name)
    assert len(stated) >= 2
    for link, expected in stated.items():
        assert np.abs(here[link] - expected).max() < 2e-6 + FLOAT32, link


def collision_boxes(robot: Robot) -> dict[str, np.ndarray]:
    """The collision shapes, drawn by calling them visuals."""
    root = etree.fromstring(robot.description.text)
    for link in root.iterfind("link"):
        for visual in link.findall("visual"):
            link.remove(visual)
        for collision in link.iterfind("collision"):
            collision.tag = "visual"
    return boxes(drawing(Robot(description.check(etree.tostring(root), robot.description.source))))


@pytest.mark.parametrize("name", ["ur5", *long(["panda", "hextilt_flying_arm_5"])])
def test_visual_and_collision_shapes_cover_each_other(name: str) -> None:
    """IoU of boxes > 0.5 for each link: a turn from y-up to z-up would bring its mean to 0.3 or less."""
    robot = rd.load(name)
    visual, collision = boxes(drawing(robot)), collision_boxes(robot)
    common = visual.keys() & collision.keys()
    assert len(common) >= 5
    turned = []
    for link in common:
        a, b = visual[link], collision[link]
        assert overlap(a, b) > 0.5, link
        turned.append(overlap(np.sort(a @ Z_UP.T, axis=0), b))
    assert np.mean(turned) < 0.5  # else this test would pass with the turn, too


@pytest.mark.parametrize("name", ["twodofs", "hextilt_flying_arm_5", *long(["icub", "borinot_flying_arm_2", "go1"])])
def test_up_axis_is_followed_only_where_the_masses_say_so(name: str) -> None:
    """A URDF does not say whether it was written for Gazebo, which turns y-up meshes, or for rviz, which does not."""
    robot = rd.load(name)
    here = drawing(robot)
    assert any("Y_UP" in note for note in here.remarks) == (name in WRITTEN_FOR_GAZEBO)
    if name in WRITTEN_FOR_GAZEBO:
        q = np.clip(np.zeros(robot.n), robot.lower, robot.upper)
        for link in ("l_lower_leg", "r_lower_leg"):  # hangs from the knee to the ankle, instead of across
            g = robot.placement(q, link)
            low, high = box(boxes(here)[link] @ g[:3, :3].T)
            assert high[2] - low[2] > 2 * (high[1] - low[1])


def overlap(a: np.ndarray, b: np.ndarray) -> float:
    """Volume of the intersection over that of the union, of two boxes at least 1 mm thick."""
    thick = np.array([[-5e-4], [5e-4]])
    a, b = a + thick, b + thick
    common = np.prod(np.maximum(np.minimum(a[1], b[1]) - np.maximum(a[0], b[0]), 0))
    return float(common / (np.prod(a[1] - a[0]) + np.prod(b[1] - b[0]) - common))


# all formats, and all robots with meshes that are missing; every robot of the catalog was drawn once by hand
@pytest.mark.parametrize(
    "name",
    ["simple_humanoid", "skew_tree", "iris",
     *third(["alex_nub_hands", "baxter", "hyq_no_sensors", "human", "pr2", "quadruped", "romeo_laas_small", "solo12",
            "talos_full_v2", "tiago_no_hand", "anymal_b"])],
)  # fmt: skip
def test_every_link_with_a_visual_is_drawn(name: str) -> None:
    robot = rd.load(name)
    here = drawing(robot)
    visible = {link.get("name") for link in etree.fromstring(robot.description.text).iterfind("link[visual]")}
    assert here.pieces
    assert visible <= {piece.link for piece in here.pieces}
    replaced = [note for note in here.notes if "drawn in its place" in note]
    assert len(replaced) == (20 if name == "romeo_laas_small" else 0)
    for piece in here.pieces:
        mesh = piece.mesh
        assert np.isfinite(mesh.vertices).all()
        assert mesh.faces.max() < len(mesh.vertices)
        assert np.abs(np.linalg.norm(mesh.normals, axis=1) - 1).max() < 1e-5
        assert np.abs(piece.pose[:3, :3] @ piece.pose[:3, :3].T - np.eye(3)).max() < 1e-12
        assert not mesh.vertices.flags.writeable
        assert len(piece.rgba) == 4
        assert all(0 <= x <= 1 for x in piece.rgba)


@pytest.mark.parametrize("name, least", [("ur5", 7), *long([("panda", 10)]), *stress([("kinova", 9), ("twodofs", 1)])])
def test_each_link_fills_the_box_of_its_pieces(browser, name: str, least: int) -> None:
    """In the browser's scene, placed by Pinocchio; single precision in a scene of about 1 m: 2e-6."""
    arm = rd.load(name)
    q = np.linspace(0.2, 0.7, arm.n)
    points: dict[str, list[np.ndarray]] = {}
    for piece in drawing(arm).pieces:
        place = arm.placement(q, piece.link) @ piece.pose
        points.setdefault(piece.link, []).append(piece.mesh.vertices @ place[:3, :3].T + place[:3, 3])
    assert len(points) >= least
    with opened(browser, rd.show(arm, q)) as view:
        for link, places in points.items():
            np.testing.assert_allclose(view.bounds(view.path(link)), box(np.concatenate(places)), atol=2e-6)
