"""Laws of identification at rest: sets contain the truth, intervals contain it at their rate, blind is blind."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn.foundations import QueryError, rotation
from robot_dyn.tools.identify import Poses, static
from robot_dyn.tools.identify.base_parameters import base_parameters
from robot_dyn.tools.identify.rest_poses import Gravity, Kind, _interval, _rows, _set

LOCKED = {f"wrist_{k}_joint": 0.3 * k for k in (2, 3)}
FRICTION = np.array([6.0, 6.0, 5.0, 1.5])
TILT = np.deg2rad([1.5, -2.0, 0.0])
OFFSETS = np.array([0.3, -0.4, 0.2, 0.1])


@cache
def arms() -> tuple[rd.Robot, rd.Robot, Gravity, np.ndarray]:
    """The arm of the file, the true one, the model of the first and the true parameters."""
    stated = rd.load("ur5").with_(lock=LOCKED)
    angle = np.linalg.norm(TILT)
    gravity = rotation(TILT / angle, -angle) @ np.array(stated.gravity)
    true = stated.with_(masses={"forearm_link": 2.9}, gravity=gravity)
    base = base_parameters(stated, at_rest=True)
    x = np.concatenate([base.R @ true.inertial_parameters, OFFSETS, TILT[:2]])
    return stated, true, Gravity(stated, base, True), x


def one_sided(seed: int, poses: int = 15) -> Poses:
    rng, true = np.random.default_rng(seed), arms()[1]
    q = rng.uniform(-2, 2, (poses, 4))
    return Poses(q, true.N(q) + OFFSETS + FRICTION * rng.uniform(-1, 1, q.shape), 0 * q)


def two_sided(seed: int, poses: int = 15, noise: float = 0.05) -> Poses:
    rng, true = np.random.default_rng(seed), arms()[1]
    q = np.repeat(rng.uniform(-2, 2, (poses, 4)), 2, axis=0)
    side = np.tile([[1.0], [-1.0]], (poses, 4))
    friction = side * np.repeat(FRICTION * rng.uniform(0.6, 1, (poses, 4)), 2, axis=0)
    return Poses(q, true.N(q) + OFFSETS + friction + rng.normal(0, noise, q.shape), side)


def test_the_model_at_rest_is_the_gravity_torque() -> None:
    """Of an arm with other masses, and of a tilted one, to rounding; its slope is the central difference."""
    stated, true, model, x = arms()
    q, h, changed = np.random.default_rng(0).uniform(-2, 2, (5, 4)), 1e-5, np.arange(len(x)) < len(x) - 2
    rows = _rows(model, Poses(q, 0 * q), FRICTION)
    upright, tilted = true.with_(gravity=stated.gravity), stated.with_(gravity=true.gravity)
    assert np.allclose(model.torque(rows, np.where(changed, x, 0)), (upright.N(q) + OFFSETS).ravel(), atol=1e-9)
    assert np.allclose(model.torque(rows, np.where(changed, model.stated, x)), tilted.N(q).ravel(), atol=1e-9)
    slope = [(model.torque(rows, x + h * e) - model.torque(rows, x - h * e)) / (2 * h) for e in np.eye(len(x))]
    assert np.allclose(np.transpose(slope), model.slope(rows, x), atol=1e-7)


@pytest.mark.parametrize("seed", range(8))
def test_the_set_of_one_sided_poses_contains_the_truth(seed: int) -> None:
    """Whatever the friction within its bound was; linear programs are exact to 1e-7."""
    _, _, model, x = arms()
    _, lower, upper = _set(model, _rows(model, one_sided(seed), FRICTION), np.zeros(4))
    assert (lower <= x + 1e-6).all()
    assert (x <= upper + 1e-6).all()


def test_intervals_of_two_sided_poses_hold_the_truth_at_their_rate() -> None:
    """Of 60 logs with 12 parameters, 95 %; parameters of a log are dependent: five standard deviations of 60 logs."""
    _, _, model, x = arms()
    inside = []
    for seed in range(60):
        _, lower, upper = _interval(model, _rows(model, two_sided(seed, 10), FRICTION), None)
        inside.append(np.mean((lower <= x) & (x <= upper)))
    assert 0.95 - 5 * np.std(inside) / np.sqrt(60) <= np.mean(inside) <= 0.95 + 5 * np.std(inside) / np.sqrt(60)


def test_two_sides_are_narrower_than_one_and_measure_friction() -> None:
    stated = arms()[0]
    both, one = static(stated, two_sided(1)), static(stated, one_sided(1), friction=FRICTION)
    assert (both.kind, one.kind) == (Kind.INTERVAL, Kind.SET)
    assert ((both.upper - both.lower) < 0.2 * (one.upper - one.lower)).all()
    assert (both.friction > 0.6 * FRICTION).all()
    assert (both.friction < 1.05 * FRICTION).all()
    assert {"tilt about x", "tilt about y", "elbow_joint offset"} <= set(both.differing)


def test_a_tilt_about_parallel_axes_cannot_be_seen() -> None:
    """It turns all first moments of a planar arm, which a shift of the centres of mass does too."""
    arm = rd.load("planar_2r")
    q = np.repeat(np.random.default_rng(2).uniform(-2, 2, (12, 2)), 2, axis=0)
    side = np.tile([[1.0], [-1.0]], (12, 2))
    estimate = static(arm, Poses(q, arm.N(q) + side, side), noise=0.01)
    assert "tilt about y" in estimate.blind
    assert "joint_1 offset" not in estimate.blind
    assert not static(arm, Poses(q, arm.N(q) + side, side), noise=0.01, tilt=False).blind


def test_means_that_disagree_need_the_noise() -> None:
    """Means of the first joint alone do not determine all parameters; without noise, none are on all of them."""
    stated, _, model, x = arms()
    both = two_sided(4, 12)
    mixed = Poses(both.q, both.tau, both.approach * [1, 0, 0, 0])
    with pytest.raises(QueryError):
        static(stated, mixed, friction=FRICTION)
    estimate = static(stated, mixed, friction=FRICTION, noise=0.05)
    assert estimate.kind is Kind.SET
    assert (estimate.lower <= x + 1e-6).all()
    assert (x <= estimate.upper + 1e-6).all()
    assert estimate.parameters == model.parameters


def test_impossible_requests_raise_errors() -> None:
    stated, poses = arms()[0], one_sided(3)
    for arguments in ({}, {"friction": 0.01}, {"friction": -1.0}, {"friction": [1.0, 2.0]}):
        with pytest.raises(QueryError):
            static(stated, poses, **arguments)
    with pytest.raises(QueryError):
        static(rd.load("planar_2r"), poses)
    with pytest.raises(QueryError):
        Poses(poses.q, poses.tau, 0.5 * np.ones_like(poses.q))
