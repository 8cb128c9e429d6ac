"""Laws of discrimination: causes that one log confounds are told apart after the proposed poses or motion."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn.control import PiecewisePolynomial, Samples
from robot_dyn.tools.identify import DECISIVE, Experiment, FourierSeries, Identification, experiment_of, identify

ARM = rd.load("planar_2r")
VISCOUS, COULOMB = np.array([0.05, 0.03]), np.array([0.05, 0.03])
NOISE = 0.05  # [N m]
FAULTS = {"torque offset": (0.08, 0.0), "gain": (0.0, 0.0136)}  # of joint 2, [N m] and 1: both 0.08 N m at q = 0


@cache
def about_a_pose() -> PiecewisePolynomial:
    """Return a motion of ±0.02 rad about q = 0: the torques of gravity hardly change."""
    series, t = FourierSeries(20.0, 8), np.linspace(0.0, 20.0, 401)
    x = np.random.default_rng(0).normal(size=(series.size, 2))
    x[0] = 0.0
    position, velocity, acceleration = series.basis(t)
    x *= 0.02 / np.abs(position @ x).max(axis=0)
    return Samples(t, position @ x, velocity @ x, acceleration @ x)


def identified(motion: PiecewisePolynomial, fault: str) -> Identification:
    rng, t = np.random.default_rng(5), np.arange(0.0, 20.0, 0.01)
    q, v, a = motion.at(t)
    tau = ARM.inverse_dynamics(q, v, a) + VISCOUS * v + COULOMB * np.sign(v)
    offset, gain = FAULTS[fault]
    tau = (1 + gain * np.array([0, 1])) * tau + offset * np.array([0, 1]) + NOISE * rng.normal(size=q.shape)
    effects = [rd.effects.ViscousFriction(VISCOUS), rd.effects.DryFriction(COULOMB)]
    return identify(ARM, {"t": t, "q": q, "tau": tau, "desired": q}, effects=effects)


def rivals(arm: rd.Robot, state: Any) -> tuple[np.ndarray, list[np.ndarray]]:
    """Return the columns of an offset and of a gain of joint 2, and again of the offset; friction is known."""
    second = np.eye(arm.n)[1]
    offset = np.broadcast_to(second[:, None], (*state[0].shape, 1))
    return offset[..., :0], [offset, (second * arm.inverse_dynamics(*state))[..., None], offset]


@cache
def experiment(arm: rd.Robot = ARM) -> Experiment:
    estimates = {"offset": np.array([0.08]), "gain": np.array([0.0136]), "twin": np.array([0.08])}
    proposed = experiment_of(arm, estimates, lambda state, _: rivals(arm, state), np.full(arm.n, NOISE))
    assert proposed is not None
    return proposed


@pytest.mark.parametrize("fault", FAULTS)
def test_causes_that_a_log_confounds_are_told_apart_after_the_proposed_motion(fault: str) -> None:
    before = identified(about_a_pose(), fault).verdict
    assert {(cause.kind, cause.where) for cause in before.first} == {(kind, "joint_2") for kind in FAULTS}
    assert before.experiment is not None
    after = identified(before.experiment.reference, fault).verdict
    assert [(cause.kind, cause.where) for cause in after.first] == [(fault, "joint_2")]
    assert after.experiment is None


def test_the_poses_tell_apart_by_the_expected_difference() -> None:
    """Of 400 repetitions with white noise; χ² differs by Δ ± 2 √Δ in each: five standard errors are √Δ/2."""
    q, rng = experiment().poses, np.random.default_rng(1)
    _, (offset, gain, _) = rivals(ARM, (q, 0 * q, 0 * q))
    tau = 0.08 * offset.ravel() + NOISE * rng.normal(size=(400, offset.size))
    chi2 = [
        np.sum((tau - np.outer(tau @ C / (C @ C), C)) ** 2, axis=1) / NOISE**2 for C in (offset.ravel(), gain.ravel())
    ]
    expected = experiment().by_poses[0]
    of_gain = 0.0136 * gain.ravel()
    other = of_gain - offset.ravel() * (of_gain @ offset.ravel()) / offset.sum()
    assert expected <= np.mean(chi2[1] - chi2[0]) + np.sqrt(expected) / 2
    assert expected == pytest.approx(min(np.mean(chi2[1] - chi2[0]), other @ other / NOISE**2), rel=0.1)


def test_causes_with_equal_torques_are_never_told_apart() -> None:
    """The offset and its twin have equal columns in all motions; the gain differs from both."""
    assert experiment().undecided == (("offset", "twin"),)
    assert experiment().by_motion[1] == pytest.approx(0.0, abs=1e-9)
    assert experiment().by_motion[0] > DECISIVE


def test_the_proposed_motion_and_poses_are_within_the_limits_of_the_file(tmp_path: Path) -> None:
    """The motion uses 90 % of them at its knots and less than 1e-3 more between them."""
    arm = rd.load("ur5")
    proposed = experiment(arm)
    q, v, a = proposed.reference.at(np.linspace(0.0, 20.0, 4001))
    for at in (q, proposed.poses):
        assert (at >= arm.lower).all()
        assert (at <= arm.upper).all()
        assert (np.abs(arm.N(at)) <= arm.effort_limit).all()
    assert (np.abs(v) <= arm.velocity_limit).all()
    assert (np.abs(arm.inverse_dynamics(q, v, a)) <= arm.effort_limit).all()
    again = rd.control.from_samples(arm, proposed.save(tmp_path / "motion.csv"), ends="measured")
    assert np.allclose(again.reference.at(3.3)[0], proposed.reference.at(3.3)[0], atol=1e-9)
