"""Way points of a file in a scene: a spline from rest at the start, as of the same points in the scene."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn.foundations import ControlError, SceneError
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


@pytest.mark.parametrize(
    ("text", "table", "message"),
    [
        ('file = "way.csv"\n', None, "way.csv: there is no such file; give a CSV file in UTF-8"),
        (
            'file = "way.csv"\n',
            HEAD + "0.5,0.4,x\n",
            "line 2: column 'q slide .m.' holds 'x', not a number; correct it",
        ),
        ('file = "way.csv"\n', HEAD + "\n0.5,0.4\n", "line 3 has 2 entries for 3 columns; correct it"),
        ('file = "way.csv"\n', HEAD + "0.5,0.4,nan\n", "column .q slide .m..: sample 1 is nan; fill it in"),
        ('file = "way.csv"\n', HEAD + ROWS + "0.2,1,1\n", r"times must increase: sample 4 is at 0\.2 s"),
        ('file = "way.csv"\n', HEAD + "-1,0.4,1\n", "the first time is -1 s; start at 0 s or later"),
        ('file = "way.csv"\n', HEAD, "has no samples below its first line"),
        ('file = "way.csv"\n', "t,q hinge\n0.5,1\n0.6,1\n", "there is no column of slide; known: q hinge"),
        (
            'file = "way.csv"\n',
            "t,q hinge,q slide,v hinge,v slide\n1,1,1,1,1\n2,2,2,1,1\n",
            "columns of v are for kind = 'samples'; leave them out",
        ),
        (
            'file = "way.csv"\n',
            HEAD + "".join(f"{k},0,0\n" for k in range(1, 3001)),
            "points must be 2000 at most, got 3001; rd.control.Samples takes more",
        ),
        ('file = "way.csv"\ntimes_s = [1.0]\n', HEAD + ROWS, "give times_s and points, or a file of both"),
        ("v_end = 1.0\n", None, "give times_s and points, or a file of both"),
        ("times_s = [1.0]\n", None, "1 times_s for 0 points; give one for each"),
    ],
)
def test_what_is_no_table_of_points_is_told_by_file_and_line(tmp_path, text: str, table: str | None, message) -> None:
    if table is not None:
        (tmp_path / "way.csv").write_text(table)
    with pytest.raises(SceneError, match=rf"scene\.toml: .*{message}"):
        reference(tmp_path, text)


def test_more_points_than_their_equations_can_be_solved_for_are_refused() -> None:
    """1e6 points would ask for 5e13 numbers."""
    t = np.arange(1e6)
    with pytest.raises(
        ControlError, match=r"points must be 2000 at most, got 1000000; rd\.control\.Samples takes more"
    ):
        rd.control.via_points(t, np.zeros((len(t), 1)))
