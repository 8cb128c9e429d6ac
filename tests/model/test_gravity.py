"""Gravity at first sight: the textbook robots feel it as they come, and where it has no torque that is said."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pytest

import robot_dyn as rd
from tests.command import document, said

G = -rd.STANDARD_GRAVITY[2]
OWN = sorted(path.stem for path in (Path(__file__).parents[2] / "urdf").glob("*.urdf"))


def test_the_lectures_arm_has_the_lectures_gravity_vector_as_it_is_loaded() -> None:
    """N₁ = g ((m₁ r₁ + m₂ l₁) cos q₁ + m₂ r₂ cos(q₁ + q₂)), N₂ = g m₂ r₂ cos(q₁ + q₂); few operations: 1e-14 of N."""
    q = np.random.default_rng(1).uniform(-3, 3, (20, 2))
    far = G * 1.5 * 0.4 * np.cos(q.sum(axis=1))
    N = np.stack([G * (2.0 * 0.5 + 1.5 * 1.0) * np.cos(q[:, 0]) + far, far], axis=1)
    robot = rd.load("planar_2r")
    for engine in (robot, rd.Lagrangian(robot)):
        np.testing.assert_allclose(engine.N(q), N, rtol=0, atol=1e-14 * np.abs(N).max())


def test_its_tip_goes_where_the_lecture_says() -> None:
    """The lecture has x = l₁ cos q₁ + l₂ cos(q₁ + q₂), y = l₁ sin q₁ + l₂ sin(q₁ + q₂), and y is z of the base."""
    q = np.array([0.6, -1.1])
    place = rd.load("planar_2r").placement(q, "tip")
    expected = [np.cos(0.6) + 0.8 * np.cos(-0.5), 0.0, np.sin(0.6) + 0.8 * np.sin(-0.5)]
    np.testing.assert_allclose(place[:3, 3], expected, atol=1e-15)


@pytest.mark.filterwarnings("ignore::robot_dyn.foundations.errors.ModelWarning")  # of the massless tip
@pytest.mark.parametrize("name", OWN)
def test_gravity_acts_on_every_robot_of_the_library(name: str) -> None:
    assert rd.load(name).gravity_acts


def test_gravity_along_all_axes_of_an_arm_has_no_torque_and_that_is_said() -> None:
    arm = rd.load("planar_2r")
    with pytest.warns(rd.ModelWarning, match=r"planar_2r: gravity \(0.0, -9.8, 0.0\) .* no torque .* N\(q\) = 0"):
        level = arm.with_(gravity=(0.0, -9.8, 0.0))
    assert not level.gravity_acts
    assert level.with_(gravity=(1e-6, -9.8, 0.0)).gravity_acts  # the least of a slope


def test_no_gravity_and_unchanged_gravity_are_silent() -> None:
    """The arm twodofs moves in a horizontal plane: as it is loaded nothing is wrong with it."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert not rd.load("planar_2r").with_(gravity=(0.0, 0.0, 0.0)).gravity_acts
        assert not rd.load("twodofs").with_(armature=0.1, gravity=rd.STANDARD_GRAVITY).gravity_acts


def test_the_commands_say_why_N_is_zero() -> None:
    assert "no torque on any joint at any position, so N(q) = 0" in said("query", "twodofs")
    assert "no torque" in said("info", "twodofs")
    assert document("info", "twodofs")["gravity_acts"] is False
    assert document("query", "planar_2r")["gravity_acts"] is True
    assert "no torque" not in said("query", "planar_2r") + said("info", "planar_2r")
