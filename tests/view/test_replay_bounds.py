"""Geometry of the replay page: the box about each link, in the browser's scene, is that of its pieces."""

from __future__ import annotations

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn.view import drawing
from tests.browser import opened
from tests.drawings import box
from tests.long import long


@pytest.mark.parametrize("name, least", [("ur5", 7), *long([("panda", 10), ("kinova", 9), ("twodofs", 1)])])
def test_each_link_fills_the_box_of_its_pieces(browser, name: str, least: int) -> None:
    """Read right, as test_view_geometry.py checks, and placed by Pinocchio.

    Single precision of coordinates and placements in a scene of about 1 m: 2e-6.
    """
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
