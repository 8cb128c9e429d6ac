"""Recorded motions and way points of files in a scene; a doubtful recording is a warning."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn.foundations import ControlError, PlanWarning, SceneError
from robot_dyn.scene import of_scene, read_both

SCENE = """robot = "planar_2r"
duration_s = 0.1
[control]
kind = "pd"
bandwidth_rad_s = 5
[reference]
kind = "samples"
"""
ARM, T = rd.load("planar_2r"), np.linspace(0, 1, 21)
Q = 0.2 + np.outer(10 * T**3 - 15 * T**4 + 6 * T**5, [0.7, -0.4])


def reference(folder: Path, text: str, head: str = SCENE) -> rd.control.PiecewisePolynomial:
    """What the controller of a scene follows; the scene is written next to its table."""
    path = folder / "scene.toml"
    path.write_text(head + text, encoding="utf-8")
    return rd.read_scene(path).controller.desired


def write(path: Path, heads: str, *columns: np.ndarray) -> Path:
    np.savetxt(path, np.column_stack(columns), delimiter=",", header=heads, comments="", fmt="%.17g")
    return path


def test_the_motion_of_a_scene_is_that_of_from_samples(tmp_path: Path) -> None:
    """Headings of a logger, in degrees and milliseconds: each option reaches the file."""
    path = write(tmp_path / "log.csv", "clock [ms],J2,J1", 1000 * T + 500, np.degrees(Q[:, 1]), np.degrees(Q[:, 0]))
    joints = 'joints = {joint_1 = "J1", joint_2 = "J2"}\n'
    options = {"time": "clock [ms]", "unit": "deg", "joints": {"joint_1": "J1", "joint_2": "J2"}, "start_s": 0.3}
    text = 'file = "log.csv"\ntime = "clock [ms]"\nunit = "deg"\nstart_s = 0.3\n' + joints
    for ends in ("rest", "measured"):
        found, expected = (
            reference(tmp_path, f'{text}ends = "{ends}"\n'),
            rd.control.from_samples(ARM, path, ends=ends, **options).reference,
        )
        np.testing.assert_array_equal(found.breaks, expected.breaks)
        np.testing.assert_array_equal(found.coefficients, expected.coefficients)
    np.testing.assert_allclose(found.at(T + 0.3)[0], Q, atol=1e-12)


def test_way_points_of_a_logger_are_those_of_the_scene(tmp_path: Path) -> None:
    write(tmp_path / "way.csv", "t [ms],J2,J1", 1000 * T[::5] + 500, np.degrees(Q[::5, 1]), np.degrees(Q[::5, 0]))
    text = 'file = "way.csv"\nunit = "deg"\njoints = {joint_1 = "J1", joint_2 = "J2"}\n'
    desired = reference(tmp_path, text, SCENE.replace('"samples"', '"via_points"'))
    np.testing.assert_allclose(desired.at(T[::5] + 0.5)[0], Q[::5], atol=1e-12)


def test_what_is_doubtful_is_a_warning(tmp_path: Path) -> None:
    """A gap of 3 s between samples 0.05 s apart."""
    write(tmp_path / "log.csv", "t,joint_1,joint_2", T + 3 * (T > 0.5), Q)
    with pytest.warns(PlanWarning, match=r"log\.csv: 1 gap in time, the longest of 3\.05 s"):
        reference(tmp_path, 'file = "log.csv"\n')


@pytest.mark.parametrize(
    ("heads", "columns", "text", "message"),
    [
        ("t,joint_1,joint_2", (T, np.degrees(3 * Q)), "", "angles may be in degrees: joint_1"),
        ("t,joint_1,joint_2", (T, Q), 'joints = {elbow = "joint_2"}\n', "no joint 'elbow'"),
        ("t,joint_1,joint_2", (T, Q), 'unit = "turns"\n', "unit"),
        ("t,joint_1,joint_2", (T, Q), 'topic = "/joint_states"\n', "applies to MCAP logs"),
    ],
)
def test_what_has_no_single_meaning_is_refused(
    tmp_path: Path, heads: str, columns: tuple[np.ndarray, ...], text: str, message: str
) -> None:
    write(tmp_path / "log.csv", heads, *columns)
    with pytest.raises(SceneError, match=rf"scene\.toml: .*{message}"):
        reference(tmp_path, 'file = "log.csv"\n' + text)


OF_POINTS = """robot = "cart_pole"
duration_s = 0.1
[start]
q = {hinge = 0.3}
[control]
kind = "pd"
bandwidth_rad_s = 5
[reference]
kind = "via_points"
"""
HEAD = "t [s],q hinge [rad],q slide [m]\n"
ROWS = "0.5,0.4,0.1\n0.9,-0.2,0.3\n1.6,0.7,0.2\n"
TIMES, POINTS = [0.5, 0.9, 1.6], [[0.1, 0.4], [0.3, -0.2], [0.2, 0.7]]  # in the order of the joints: slide, hinge


def test_points_of_a_file_are_those_of_the_scene(tmp_path) -> None:
    """From rest at the start through the rows, columns by the names of joints; a row at 0 s is the start itself."""
    (tmp_path / "way.csv").write_text(HEAD + ROWS)
    (tmp_path / "whole.csv").write_text(HEAD + "0,0.3,0\n" + ROWS)
    stated = reference(tmp_path, f"times_s = {TIMES}\npoints = {POINTS}\n", OF_POINTS)
    for name in ("way.csv", "whole.csv"):
        read = reference(tmp_path, f'file = "{name}"\n', OF_POINTS)
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
