"""Samples that are kept of runs are those of the runs, whatever the chunks; the others take no room."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pyarrow.parquet as parquet
import pytest

from robot_dyn.foundations import SweepError
from robot_dyn.tools import sweeps as sw
from robot_dyn.tools.sweeps.kept_samples import longest
from tests.tools.sweeps.swept import VARY, swept

pytest.importorskip("xarray")


@pytest.mark.parametrize("chunk", [64, 50])
def test_samples_are_those_of_the_runs(tmp_path: Path, chunk: int) -> None:
    vary = {"q0": VARY["q0"], "kd": sw.choice([4.0, 4000.0])}
    sweep = swept(tmp_path, 150, vary=vary, samples=sw.samples("q", "u", every=3))
    done = sw.run(sweep, tmp_path / "out", chunk=chunk)
    data, table = done.samples(), done.table("outcome")
    assert data.q.dims == ("run", "t", "joint") and dict(data.sizes) == {"run": 50, "t": 51, "joint": 2}
    assert data.joint.values.tolist() == ["joint_1", "joint_2"] and data.run.values.tolist() == list(range(0, 150, 3))
    assert (data.q.attrs["units"], data.u.attrs["units"]) == ("rad", "N m")
    assert set(done.samples("u").data_vars) == {"u"}
    for i in (0, 63, 147):
        run, kept = done.run(i), data.sel(run=i)
        m = len(run.t)
        np.testing.assert_array_equal(data.t.values[:m], run.t)
        np.testing.assert_array_equal(kept.q.values[:m], run.q)
        np.testing.assert_array_equal(kept.u.values[:m], run.u)
        assert m == len(data.t) or (table["outcome"][i] == "diverged" and np.isnan(kept.q.values[m:]).all())


def test_of_failed_runs_alone_nothing_else_takes_room(tmp_path: Path) -> None:
    vary = {"q0": VARY["q0"], "kd": sw.choice([4.0] * 15 + [4000.0])}
    sweep = swept(tmp_path, 300, vary=vary, samples=sw.samples("q", failed=True))
    done = sw.run(sweep, tmp_path / "out", chunk=60)
    diverged = done.table("outcome")["outcome"] == "diverged"
    assert done.samples().run.values.tolist() == np.flatnonzero(diverged).tolist() and 0 < diverged.sum() < 60
    sw.run(swept(tmp_path, 300, vary=vary, samples="q"), tmp_path / "whole", chunk=60)

    def size(folder: str) -> int:
        return sum(path.stat().st_size for path in (tmp_path / folder / "rows").iterdir())

    assert size("out") < size("whole") / 3


def test_samples_have_the_same_bits_in_other_chunks_and_are_resumed(tmp_path: Path) -> None:
    sweep = swept(tmp_path, 150, samples="q")
    whole = sw.run(sweep, tmp_path / "a", chunk=128).samples().q.values
    done = sw.run(sweep, tmp_path / "b", chunk=20, threads=2)
    done.folder.file(3).unlink()
    done = sw.run(sw.read_sweep(tmp_path / "b").sweep, tmp_path / "b")
    np.testing.assert_array_equal(done.samples().q.values, whole)


def test_samples_that_are_missing_or_changed_are_found(tmp_path: Path) -> None:
    done = sw.run(swept(tmp_path, 40, samples=sw.samples("q", "v")), tmp_path / "out", chunk=10)
    digest, file = done.verify(), done.folder.file(2)
    table = parquet.read_table(file)
    place = table.column_names.index("samples v")
    lists = table["samples v"].to_pylist()
    lists[3][7] = 0.5
    parquet.write_table(table.set_column(place, table.field(place), [lists]), file)
    with pytest.raises(SweepError, match=r"000002.parquet: was changed after it was written"):
        done.verify()
    file.unlink()
    with pytest.raises(SweepError, match="1 of 4 chunks are missing"):
        done.samples()
    assert sw.run(done.sweep, tmp_path / "out").verify() == digest


def test_what_cannot_be_kept_is_refused(tmp_path: Path) -> None:
    for name in ("x", "w", "samples"):
        with pytest.raises(SweepError, match=r"samples.*q, v, u"):
            swept(tmp_path, samples=name)
    with pytest.raises(SweepError, match="every"):
        sw.samples("q", every=0)
    with pytest.raises(SweepError, match="no samples are kept"):
        sw.run(swept(tmp_path, 10), tmp_path / "out", chunk=10).samples()
    with pytest.raises(SweepError, match="no samples 'v'"):
        sw.run(swept(tmp_path, 10, samples="q"), tmp_path / "q", chunk=10).samples("v")


def test_times_of_samples_are_one_grid() -> None:
    t = np.linspace(0, 1, 5)
    np.testing.assert_array_equal(longest(t[:3], t), t)
    np.testing.assert_array_equal(longest(t, t[:0]), t)
    with pytest.raises(SweepError, match="not sampled at the same times"):
        longest(t, t[1:])


def test_runs_that_diverge_at_once_have_the_samples_before_it(tmp_path: Path) -> None:
    done = sw.run(swept(tmp_path, 20, vary={"kd": sw.choice([4e6])}, samples="q"), tmp_path / "out", chunk=10)
    data = done.samples()
    assert len(data.run) == 20 and np.isfinite(data.q.values[:, 0]).all() and np.isnan(data.q.values[:, -1]).all()
