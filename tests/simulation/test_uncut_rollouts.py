"""Uncut rollouts against the same runs with steps that end at thresholds."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn.simulation.rollouts.comparison import Comparison, differences, drawn

ARM = rd.load("planar_2r")
PLANT = rd.Plant(ARM, [rd.effects.ViscousFriction(0.5), rd.effects.EffortLimit(12.0)])
SETUP = rd.Setup(
    PLANT, [0.4, 0.9], duration_s=0.3, method="RK4", step_s=1e-3, record_every_s=0.01, estimate_error=False,
    controller=rd.control.PD(rd.control.hold([1.0, 0.5]), kp=40.0, kd=4.0),
)  # fmt: skip
STARTS = np.array([0.4, 0.9]) + 0.3 * np.random.default_rng(4).normal(size=(100, 2))


@pytest.fixture(scope="module")
def uncut() -> rd.Rollouts:
    return rd.rollouts(SETUP, STARTS, record=("q", "u", "energy"), uncut=True)


def test_the_differences_are_those_of_the_runs_that_were_drawn(uncut: rd.Rollouts) -> None:
    cut = rd.rollouts(SETUP, STARTS, record=("q", "u", "energy"))
    places, comparison = drawn(100), uncut.comparison
    assert comparison is not None and uncut.uncut and cut.comparison is None
    assert (comparison.compared, comparison.runs, comparison.other_outcome) == (64, 100, 0)
    for difference in comparison.differences:
        x, y = (getattr(runs, difference.name)[places].reshape(64, -1) for runs in (uncut, cut))
        assert difference.largest == np.abs(x - y).max() > 0
        assert difference.median == np.median(np.abs(x - y).max(axis=1))
    assert {x.name: x.unit for x in comparison.differences} == {
        "q": "rad", "u": "N m", "kinetic": "J", "potential": "J",
    }  # fmt: skip


def test_a_file_keeps_the_comparison(uncut: rd.Rollouts, tmp_path: Path) -> None:
    back = rd.read(uncut.save(tmp_path / "uncut.npz"))
    assert isinstance(back, rd.Rollouts) and back.comparison == uncut.comparison and back.uncut == uncut.uncut
    assert back.summary.splitlines()[:2] == uncut.summary.splitlines()[:2]


def test_some_runs_of_a_batch_do_not_claim_the_count_of_all() -> None:
    """Runs made one by one are counted over the whole batch, so that a slice has no count."""
    runs = rd.rollouts(SETUP, STARTS)
    assert runs.statistics.one_by_one > 2 and runs[:2].statistics.one_by_one == 0


def test_runs_without_thresholds_have_nothing_to_compare() -> None:
    free = rd.rollouts(rd.Plant(ARM), STARTS[:3], duration_s=0.1, method="RK4", step_s=1e-3, uncut=True)
    assert free.uncut == () and free.comparison is None


@pytest.mark.parametrize(
    ("uncut", "cut", "expected"),
    [
        ([1.0, 2.0, np.nan], [1.0, 2.5, np.nan], 0.5),  # nan in both: the same
        ([1.0, np.nan], [1.0, 0.0], np.inf),  # a value in one way only
        ([np.inf, -np.inf], [np.inf, -np.inf], 0.0),
        ([np.inf, 1.0], [-np.inf, 1.0], np.inf),
    ],
)
def test_a_value_in_one_way_only_differs_infinitely(uncut: list[float], cut: list[float], expected: float) -> None:
    (difference,) = differences({"x": np.array(uncut)}, {"x": np.array(cut)}, {})
    assert difference.largest == expected


def test_runs_are_drawn_once_each_and_alike_for_a_seed() -> None:
    for runs in (1, 63, 64, 65, 10_000):
        places = drawn(runs, seed=5)
        assert len(set(places.tolist())) == len(places) == min(runs, 64) and places.max() < runs
        np.testing.assert_array_equal(places, drawn(runs, seed=5))
    assert (drawn(10_000, 1) != drawn(10_000, 2)).any()


def test_of_all_runs_nothing_is_left_to_doubt() -> None:
    assert Comparison(20, 20, 0, ()).beyond == 0.0
    assert Comparison(64, 65, 0, ()).beyond == pytest.approx(1 - 0.05 ** (1 / 64), rel=1e-12)
