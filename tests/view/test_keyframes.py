"""Keyframes and thinned series: what is left out is no more than what is said, and no peak is lost."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from robot_dyn.view.keyframes import TOLERANCE, keyframes
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
