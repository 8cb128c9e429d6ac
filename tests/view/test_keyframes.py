"""Keyframes and thinned series: what is left out is no more than what is said, and no peak is lost."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import robot_dyn as rd
from robot_dyn.view.keyframes import CHORD, TOLERANCE, keyframes, motion_of
from robot_dyn.view.series import thinned


def wander(seed: int, m: int, joints: int, size: float) -> tuple[np.ndarray, np.ndarray]:
    """Times of uneven steps and a random walk."""
    draw = np.random.default_rng(seed)
    return np.cumsum(draw.uniform(1e-4, 1e-2, m)), np.cumsum(size * draw.normal(size=(m, joints)), axis=0)


@given(seed=st.integers(0, 2**32 - 1), m=st.integers(1, 400), joints=st.integers(1, 8), size=st.floats(1e-6, 3.0))
def test_every_sample_lies_within_the_stated_error(seed: int, m: int, joints: int, size: float) -> None:
    """And that within the tolerance, but for single precision of the times: speed · t · 2⁻²⁴."""
    t, q = wander(seed, m, joints, size)
    keys = keyframes(t, q)
    drawn = np.stack([np.interp(t, keys.t, column) for column in keys.q.T], axis=1)
    off = np.abs(drawn - q).max(axis=0)
    np.testing.assert_array_equal(off, keys.error)
    speed = np.abs(np.diff(q, axis=0) / np.diff(t)[:, None]).max(initial=0.0)
    assert (keys.error <= TOLERANCE + speed * t[-1] * 2.0**-23).all()
    assert keys.samples == m


@given(seed=st.integers(0, 2**32 - 1), size=st.floats(0.5, 5.0))
def test_no_joint_turns_half_a_circle_between_keyframes(seed: int, size: float) -> None:
    """A viewer takes the shorter way: beyond π it would be the wrong one."""
    keys = keyframes(*wander(seed, 50, 3, size))
    assert np.abs(np.diff(keys.q, axis=0)).max() <= np.pi / 2 + 1e-9
    assert (np.diff(keys.t) > 0).all()


@pytest.mark.parametrize(("period", "worse"), [(0.01, 1.5), (0.05, 10.0)])
def test_keyframes_follow_the_motion_between_samples_as_far_as_is_said(period: float, worse: float) -> None:
    """A fast swing, held to the same run with a sample each ms: lines between the samples alone would be far off."""
    arm = rd.load("planar_2r")
    swing = rd.Setup(rd.Plant(arm), [0.4, 0.9], [3.0, -5.0], duration_s=1.0, estimate_error=False)
    dense, run = (rd.simulate(swing, record_every_s=p, method="DP8", step_s=1e-3) for p in (1e-3, period))
    motion = motion_of(run)
    keys = keyframes(motion.t, motion.q)
    drawn = np.stack([np.interp(dense.t, keys.t, column) for column in keys.q.T], axis=1)
    off = np.abs(drawn - dense.q).max(axis=0)
    slack = np.abs(dense.v).max() * 2.0**-23  # of times in single precision
    assert (off <= keys.error + CHORD + motion.open + slack).all()
    lines = np.stack([np.interp(dense.t, run.t, column) for column in run.q.T], axis=1)
    assert np.abs(lines - dense.q).max() > worse * off.max()


def test_samples_of_a_polynomial_of_degree_three_leave_nothing_open() -> None:
    t = np.array([0.0, 0.4, 1.0])
    q, v, a = t**3 - t, 3 * t**2 - 1, 6 * t
    run = SimpleNamespace(t=t, q=q[:, None], v=v[:, None], a=a[:, None])
    motion = motion_of(run)  # pyright: ignore[reportArgumentType]
    np.testing.assert_allclose(motion.q[:, 0], motion.t**3 - motion.t, atol=1e-14)
    assert motion.open.max() < 1e-14 and len(motion.t) > 20


def test_a_straight_run_needs_two_keyframes() -> None:
    t = np.linspace(0, 1, 1001)
    keys = keyframes(t, np.outer(t, [1.0, -0.5]))
    assert len(keys.t) == 2
    assert keys.error.max() < 1e-12


@given(seed=st.integers(0, 2**32 - 1))
def test_thinning_keeps_the_least_and_the_largest_value(seed: int) -> None:
    _, columns = wander(seed, 5000, 3, 1.0)
    kept = thinned(columns, buckets=50)
    assert len(kept) <= 2 + 50 * 6
    assert {0, 4999} <= set(kept.tolist())
    np.testing.assert_array_equal(columns[kept].max(axis=0), columns.max(axis=0))
    np.testing.assert_array_equal(columns[kept].min(axis=0), columns.min(axis=0))


def test_what_has_no_value_hides_no_peak() -> None:
    columns = np.sin(np.linspace(0, 9, 5000))[:, None].copy()
    columns[100::7] = np.nan
    kept = thinned(columns, buckets=50)
    assert np.nanmax(columns[kept]) == np.nanmax(columns)
