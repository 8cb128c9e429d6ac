"""Uncut sweeps: steps pass thresholds, and the result says how far that may be from runs whose steps end there."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from robot_dyn.foundations import SweepError
from robot_dyn.tools import sweeps as sw
from robot_dyn.tools.sweeps import Work
from tests.tools.sweeps.swept import SCENE, scene

WEAK = SCENE.replace("duration_s = 0.05", "duration_s = 0.3").replace(
    '[control]\nkind = "pd"', '[[effect]]\nkind = "effort_limit"\nlimit_N_m = 12.0\n\n[control]\nkind = "pd"'
)
VARY = {"q0": sw.normal(mean=[0.4, 0.9], sd=0.3), "mass_scale": sw.uniform(low=0.3, high=1.5)}
FIGURES = {"error": sw.rms_tracking_error(), "speed": sw.peak("v"), "end": sw.final("q", "joint_2")}


def plan(folder: Path, runs: int, uncut: bool, text: str = WEAK) -> sw.Sweep:
    return sw.Sweep(str(scene(folder, text)), runs, VARY, FIGURES, seed=2, uncut=uncut)


@pytest.fixture(scope="module")
def done(tmp_path_factory: pytest.TempPathFactory) -> sw.SweepResult:
    folder = tmp_path_factory.mktemp("uncut")
    return sw.run(plan(folder, 300, True), folder / "out", chunk=64)


def test_the_differences_are_those_of_the_compared_runs_made_both_ways(done: sw.SweepResult) -> None:
    """Half of the compared runs differ by at most the median, all by at most the largest, one by just that."""
    comparison = done.comparison
    assert comparison is not None and (comparison.compared, comparison.runs) == (64, 300)
    uncut = done.table()
    cut = Work(plan(done.path.parent, 300, False)).rows(0, 300)
    for difference in comparison.differences:
        gaps = np.abs(uncut[difference.name] - cut[difference.name])
        assert (gaps <= difference.median).sum() >= 32 and (gaps == difference.largest).any()
        assert difference.largest > 0 and (gaps > difference.largest).mean() <= comparison.beyond
    assert (uncut["outcome"] == cut["outcome"]).all() and comparison.other_outcome == 0
    assert [x.unit for x in comparison.differences] == ["rad", "rad/s", "rad"]


def test_the_fraction_beyond_the_largest_is_the_tolerance_limit_of_wilks(done: sw.SweepResult) -> None:
    """All of n runs are within a quantile p with probability p^n, so n = 64 at 95 % gives 1 − 0.05^(1/64)."""
    comparison = done.comparison
    assert comparison is not None
    assert (1 - comparison.beyond) ** comparison.compared == pytest.approx(0.05, rel=1e-12)
    assert round(comparison.beyond, 4) == 0.0457


def test_all_runs_of_a_small_sweep_are_compared(tmp_path: Path) -> None:
    comparison = sw.run(plan(tmp_path, 20, True), tmp_path / "out").comparison
    assert comparison is not None and (comparison.compared, comparison.beyond) == (20, 0.0)


def test_runs_one_by_one_are_counted_with_their_time(tmp_path: Path, done: sw.SweepResult) -> None:
    cut = sw.run(plan(tmp_path, 100, False), tmp_path / "out", chunk=30)
    others = np.abs(cut.table()["error"] - Work(plan(tmp_path, 100, True)).rows(0, 100)["error"]) > 1e-12
    assert 0 < others.sum() <= cut.one_by_one.runs <= 100  # only such runs have other steps
    assert 0 < cut.one_by_one.runs_s < cut.one_by_one.all_s
    assert cut.comparison is None and done.one_by_one.runs == 0


def test_a_repeated_run_has_the_bits_of_its_uncut_row(done: sw.SweepResult) -> None:
    runs = [int(i) for i in done.worst("error", 3)]
    table = done.table()
    for i in runs:
        assert done.run(i).q[-1, 1] == table["end"][i]


def test_an_uncut_sweep_is_another_sweep(tmp_path: Path) -> None:
    sw.run(plan(tmp_path, 20, True), tmp_path / "out")
    with pytest.raises(SweepError, match="uncut"):
        sw.run(plan(tmp_path, 20, False), tmp_path / "out")


def test_a_comparison_that_is_missing_is_made_again_and_a_damaged_one_refused(tmp_path: Path) -> None:
    done = sw.run(plan(tmp_path, 20, True), tmp_path / "out")
    first, file = done.comparison, tmp_path / "out" / "uncut.json"
    text = file.read_text(encoding="utf-8")
    file.unlink()
    assert sw.read_sweep(done.path).comparison is None
    assert sw.run(done.sweep, done.path).comparison == first
    for damaged in ("{", "[]", text.replace('"compared"', '"compare"'), text.replace('"sweep": "', '"sweep": "0')):
        file.write_text(damaged, encoding="utf-8")
        with pytest.raises(SweepError, match=r"uncut\.json"):
            _ = sw.read_sweep(done.path).comparison


def test_what_is_not_in_lock_step_is_refused(tmp_path: Path) -> None:
    with pytest.raises(SweepError, match="uncut: DOP853 chooses its steps"):
        plan(tmp_path, 20, True, WEAK.replace('method = "RK4"\nstep_s = 0.001\n', 'method = "DOP853"\n'))
