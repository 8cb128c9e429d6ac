"""What is observed of runs in lock step is what NumPy finds in the arrays of all their steps."""

from __future__ import annotations

import numpy as np
import pytest

from robot_dyn.simulation import RemarkKind, observation_of
from robot_dyn.simulation.observation.guard_levels import GuardLevels, Level
from robot_dyn.simulation.observation.observation import observe, observed

N, W, STEPS, H = 2, 3, 400, 1e-3


@pytest.fixture(scope="module")
def motion() -> np.ndarray:
    """q, v, u at the start and at each step, (1 + STEPS, 3n, W); run 2 ends after 250 steps."""
    x = np.cumsum(np.random.default_rng(11).normal(size=(1 + STEPS, 3 * N, W)), axis=0)
    x[251:, :, 2] = np.nan
    return x


def seen(motion: np.ndarray, levels: GuardLevels, every: int = 1):
    """What is observed of the motion, the controller acting at the start of each so many steps."""
    of = observation_of(motion[0], levels)
    for k, x in enumerate(motion[1:]):
        observe(of, k * H, (k + 1) * H, *x.reshape(3, N, W), k % every == 0)
    return observed([of], levels)


def test_extremes_and_visits_are_those_of_all_steps(motion: np.ndarray) -> None:
    """Bounds differ from run to run, one run has none; durations add steps of 1 ms, to rounding of 400 sums."""
    rng = np.random.default_rng(12)
    levels = [Level(RemarkKind.BEYOND, row, side, 0.0) for row in range(3 * N) for side in (1, -1)]
    bounds = np.array([[each.side * size for size in rng.uniform(3, 12, W)] for each in levels])
    bounds[3, 1] = np.nan
    of = seen(motion, GuardLevels(tuple(levels), bounds, bounds))
    low, high = np.nanmin(motion, axis=0), np.nanmax(motion, axis=0)
    np.testing.assert_array_equal(of.extremes, np.stack([low, high]).reshape(2, 3, N, W).transpose(3, 1, 0, 2))
    visited = 0
    for (k, level), b in ((each, b) for each in enumerate(levels) for b in range(W)):
        x = level.side * motion[:, level.row, b]
        past = x > level.side * bounds[k, b]
        if not past.any():
            assert np.isnan(of.visits[b, k]).all()
            continue
        first, most, visited = int(past.argmax()), int(np.nanargmax(x)), visited + 1
        at = most - 1 if level.row >= 2 * N and most else most
        expected = [max(first - 1, 0) * H, past[1:].sum() * H, at * H, level.side * x[most]]
        np.testing.assert_allclose(of.visits[b, k], expected, rtol=1e-12, atol=1e-15)
    assert 0 < visited < len(levels) * W


@pytest.mark.parametrize("every", [1, 3])
def test_chatter_is_ten_reversals_in_a_row(every: int) -> None:
    """Found in the array of all ticks by its definition; changes below a fiftieth of the largest so far are noise."""
    rng = np.random.default_rng(13)
    ticks = np.arange(STEPS // every)
    u = np.sin(0.02 * ticks)[:, None, None] * rng.uniform(0.1, 1, (N, W))
    swing = (-1.0) ** ticks * (np.abs(ticks - 50) < 15)
    u[:, 1, 0] += 0.7 * swing  # an episode
    u[:, 0, 1] += 3e-3 * swing  # noise
    u[:, 0, 2] += 0.7 * (-1.0) ** ticks * (np.abs(ticks - 50) < 4)  # too short
    motion = np.zeros((1 + STEPS, 3 * N, W))
    motion[1:, 2 * N :] = (
        np.repeat(u, every, axis=0)[:STEPS]
        if every * len(u) >= STEPS
        else np.append(np.repeat(u, every, axis=0), u[-1:].repeat(STEPS - every * len(u), 0), axis=0)
    )
    of = seen(motion, GuardLevels((), np.empty((0, W)), np.empty((0, W))), every)
    change = np.diff(u, axis=0)
    for joint in range(N):
        for b in range(W):
            largest = np.maximum.accumulate(np.abs(u[:, joint, b]))[1:-1]
            turned = change[1:, joint, b] * change[:-1, joint, b] < -((0.02 * largest) ** 2)
            rows = np.split(np.flatnonzero(turned), np.flatnonzero(np.diff(np.flatnonzero(turned)) > 1) + 1)
            long = [row for row in rows if len(row) >= 10]
            assert (len(long) == 1) == ((joint, b) == (1, 0))
            if not long:
                assert (of.episodes[b, joint] == 0).all()
                continue
            (row,) = long
            start, end = (row[0] + 1) * every * H, (row[-1] + 2) * every * H
            amplitude = np.abs(change[row[0] : row[-1] + 2, joint, b]).max() / 2
            np.testing.assert_allclose(of.episodes[b, joint], [start, end - start, amplitude], rtol=1e-12)
