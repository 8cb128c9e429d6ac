"""Samples that are kept of runs are those of the runs, whatever the chunks; the others are nan and take no room."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from robot_dyn import RobotDynError
from robot_dyn.foundations import SweepError
from robot_dyn.tools import sweeps as sw
from tests.tools.sweeps.swept import VARY, swept

pytest.importorskip("zarr")
pytest.importorskip("xarray")


@pytest.mark.parametrize("chunk", [64, 50])
def test_samples_are_those_of_the_runs(tmp_path: Path, chunk: int) -> None:
    vary = {"q0": VARY["q0"], "kd": sw.choice([4.0, 4000.0])}
    sweep = swept(tmp_path, 150, vary=vary, samples=sw.samples("q", "u", every=3))
    done = sw.run(sweep, tmp_path / "out", chunk=chunk)
    data, table = done.samples(), done.table("outcome")
    assert data.q.dims == ("run", "t", "joint") and dict(data.sizes) == {"run": 150, "t": 51, "joint": 2}
    assert data.joint.values.tolist() == ["joint_1", "joint_2"] and data.run.values.tolist() == list(range(150))
    assert (data.q.attrs["units"], data.u.attrs["units"]) == ("rad", "N m")
    assert np.isnan(data.q.values[np.arange(150) % 3 != 0]).all()
    for i in (0, 63, 147):
        run = done.run(i)
        m = len(run.t)
        np.testing.assert_array_equal(data.t.values[:m], run.t)
        np.testing.assert_array_equal(data.q[i].values[:m], run.q)
        np.testing.assert_array_equal(data.u[i].values[:m], run.u)
        assert m == len(data.t) or (table["outcome"][i] == "diverged" and np.isnan(data.q[i].values[m:]).all())


def test_of_failed_runs_alone_nothing_else_takes_room(tmp_path: Path) -> None:
    vary = {"kd": sw.choice([4.0] * 15 + [4000.0])}
    sweep = swept(tmp_path, 300, vary=vary, samples=sw.samples("q", failed=True))
    done = sw.run(sweep, tmp_path / "out", chunk=60)
    diverged = done.table("outcome")["outcome"] == "diverged"
    kept = np.isfinite(done.samples().q.values[:, 0, 0])
    assert (kept == diverged).all() and 0 < kept.sum() < 60
    size = sum(path.stat().st_size for path in (tmp_path / "out" / "samples" / "q" / "c").rglob("*") if path.is_file())
    assert size < (kept.sum() + 1) * 51 * 2 * 8 + 300 * 32


def test_samples_have_the_same_bits_in_other_chunks_and_are_resumed(tmp_path: Path) -> None:
    sweep = swept(tmp_path, 150, samples="q")
    whole = sw.run(sweep, tmp_path / "a", chunk=128).samples().q.values
    done = sw.run(sweep, tmp_path / "b", chunk=20, threads=2)
    done.folder.file(3).unlink()
    done = sw.run(sw.read_sweep(tmp_path / "b").sweep, tmp_path / "b")
    np.testing.assert_array_equal(done.samples().q.values, whole)


def test_samples_that_are_missing_or_changed_are_found(tmp_path: Path) -> None:
    done = sw.run(swept(tmp_path, 40, samples=sw.samples("q", "v")), tmp_path / "out", chunk=10)
    digest, shard = done.verify(), tmp_path / "out" / "samples" / "v" / "c" / "2" / "0" / "0"
    data = bytearray(shard.read_bytes())
    data[len(data) // 2] ^= 1
    shard.write_bytes(bytes(data))
    with pytest.raises(SweepError, match=r"v/c/2/0/0: was changed after it was written; remove the rows of chunk 2"):
        done.verify()
    shard.unlink()
    with pytest.raises(SweepError, match=r"v/c/2/0/0: there is no such file"):
        done.samples()
    done.folder.file(2).unlink()
    assert sw.run(done.sweep, tmp_path / "out").verify() == digest


def test_what_cannot_be_kept_is_refused(tmp_path: Path) -> None:
    for name in ("x", "w", "samples"):
        with pytest.raises(SweepError, match=r"samples.*q, v, u"):
            swept(tmp_path, samples=name)
    with pytest.raises(SweepError, match="every"):
        sw.samples("q", every=0)
    with pytest.raises(SweepError, match="no samples are kept"):
        sw.run(swept(tmp_path, 10), tmp_path / "out", chunk=10).samples()


def test_a_sweep_refused_for_its_samples_leaves_a_folder_that_takes_the_corrected_one(tmp_path: Path) -> None:
    """All runs of the first diverge at once, so that times of samples are not known."""
    out = tmp_path / "out"
    with pytest.raises(SweepError, match="times are unknown"):
        sw.run(swept(tmp_path, 20, vary={"kd": sw.choice([4e6])}, samples="q"), out, chunk=10)
    sw.run(swept(tmp_path, 20, vary={"kd": sw.choice([4.0])}, samples="q"), out, chunk=10)
    assert np.isfinite(sw.read_sweep(out).samples().q.values).all()


def test_without_the_package_of_samples_no_folder_is_begun(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "zarr", None)
    with pytest.raises(RobotDynError, match="zarr"):
        sw.run(swept(tmp_path, 20, samples="q"), tmp_path / "out", chunk=10)
    assert not (tmp_path / "out").exists()
