"""Way points of a file in a scene: a spline from rest at the start, as of the same points in the scene."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn.foundations import ControlError
from robot_dyn.scene import of_scene, read_both

SCENE = """robot = "cart_pole"
duration_s = 0.1
[start]
q = {hinge = 0.3}
[control]
kind = "pd"
frequency_rad_per_s = 5
[reference]
kind = "via_points"
"""
HEAD = "t [s],q hinge [rad],q slide [m]\n"
ROWS = "0.5,0.4,0.1\n0.9,-0.2,0.3\n1.6,0.7,0.2\n"
TIMES, POINTS = [0.5, 0.9, 1.6], [[0.1, 0.4], [0.3, -0.2], [0.2, 0.7]]  # in the order of the joints: slide, hinge


def reference(folder: Path, text: str) -> rd.control.PiecewisePolynomial:
    """What the controller of a scene follows; the scene is written beside its table."""
    path = folder / "scene.toml"
    path.write_text(SCENE + text, encoding="utf-8")
    controller = rd.read_scene(path).controller
    assert controller is not None and isinstance(controller.desired, rd.control.PiecewisePolynomial)
    return controller.desired


def test_points_of_a_file_are_those_of_the_scene(tmp_path) -> None:
    """From rest at the start through the rows, columns by the names of joints; a row at 0 s is the start itself."""
    (tmp_path / "way.csv").write_text(HEAD + ROWS)
    (tmp_path / "whole.csv").write_text(HEAD + "0,0.3,0\n" + ROWS)
    stated = reference(tmp_path, f"times_s = {TIMES}\npoints = {POINTS}\n")
    for name in ("way.csv", "whole.csv"):
        read = reference(tmp_path, f'file = "{name}"\n')
        np.testing.assert_array_equal(read.breaks, stated.breaks)
        np.testing.assert_array_equal(read.coefficients, stated.coefficients)
    for t, q in zip([0.0, *TIMES], [[0.0, 0.3], *POINTS], strict=True):
        np.testing.assert_allclose(stated.at(t)[0], q, atol=1e-14)  # units of rounding
    assert np.abs(stated.at(0.0)[1]).max() == 0
    assert "file = " in repr(of_scene(*read_both(tmp_path / "scene.toml")))


def test_more_points_than_their_equations_can_be_solved_for_are_refused() -> None:
    """1e6 points would ask for 5e13 numbers."""
    t = np.arange(1e6)
    with pytest.raises(ControlError, match=r"at most 2000 are allowed, got 1000000; use rd\.control\.Samples"):
        rd.control.via_points(t, np.zeros((len(t), 1)))
