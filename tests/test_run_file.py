"""Run files: what is written is read back whole, or refused."""

from __future__ import annotations

import csv
import os
from dataclasses import fields

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn.scene.starters import starter
from robot_dyn.simulation.run_file import RunFileError, export_csv


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    path = tmp_path_factory.mktemp("scene") / "scene.toml"
    path.write_text(starter("cart_pole").replace("4.0", "0.2", 1), encoding="utf-8")
    return rd.simulate(rd.read_scene(path))


def test_a_run_comes_back_as_it_was(run, tmp_path) -> None:
    """Every array to the bit, every text."""
    back = rd.load_run(rd.save_run(run, tmp_path / "run"))
    for field in fields(run):
        before, after = getattr(run, field.name), getattr(back, field.name)
        if isinstance(before, np.ndarray):
            np.testing.assert_array_equal(after, before)
        elif field.name == "power":
            assert all(np.array_equal(after[name], power) for name, power in before.items())
    assert (back.outcome, back.statistics, back.joint_names) == (run.outcome, run.statistics, run.joint_names)
    assert back.summary == run.summary


def test_a_run_file_needs_nothing_else(run, tmp_path) -> None:
    """The URDF, the edits, the scene and the versions travel with the numbers."""
    about = rd.load_run(rd.save_run(run, tmp_path / "run.npz")).about
    assert "<robot" in about["urdf"]
    assert 'kind = "spring"' in about["scene"]
    assert "pin 4" in about["versions"]
    assert "gravity" in about["edits"]


@pytest.mark.parametrize("keep", [0.0, 0.3, 0.99])
def test_a_truncated_file_is_refused(run, tmp_path, keep: float) -> None:
    path = rd.save_run(run, tmp_path / "run.npz")
    whole = path.read_bytes()
    path.write_bytes(whole[: int(keep * len(whole))])
    with pytest.raises(RunFileError, match="no whole run file"):
        rd.load_run(path)


def test_other_files_are_refused(tmp_path) -> None:
    with pytest.raises(RunFileError, match="no such file"):
        rd.load_run(tmp_path / "none.npz")
    np.savez(tmp_path / "other.npz", x=np.ones(3))
    with pytest.raises(RunFileError, match="no whole run file"):
        rd.load_run(tmp_path / "other.npz")
    (tmp_path / "text.npz").write_text("hello")
    with pytest.raises(RunFileError, match="no whole run file"):
        rd.load_run(tmp_path / "text.npz")


def test_a_file_that_cannot_be_written_leaves_the_old_one(run, tmp_path, monkeypatch) -> None:
    """The file is replaced in one move: what fails before it leaves the old file and no litter."""
    path = rd.save_run(run, tmp_path / "run.npz")
    whole = path.read_bytes()

    def fails(*_, **__):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(os, "replace", fails)
    with pytest.raises(RunFileError, match="No space left"):
        rd.save_run(run, path)
    assert path.read_bytes() == whole
    assert [file.name for file in tmp_path.iterdir()] == ["run.npz"]
    monkeypatch.undo()
    with pytest.raises(RunFileError, match="cannot be written"):
        rd.save_run(run, tmp_path / "no folder" / "run.npz")


def test_a_table_has_names_units_and_all_samples(run, tmp_path) -> None:
    rows = list(csv.reader(export_csv(run, tmp_path / "run.csv").read_text(encoding="utf-8").splitlines()))
    assert rows[0][:2] == ["t [s]", "q slide [rad or m]"]
    assert len(rows) == 1 + len(run.t)
    assert [float(row[0]) for row in rows[1:]] == run.t.tolist()
    assert [float(row[2]) for row in rows[1:]] == run.q[:, 1].tolist()


def test_a_damaged_file_is_refused_or_whole(run, tmp_path) -> None:
    """Any byte may be wrong: the file is refused, or what is read is what was written."""
    path = rd.save_run(run, tmp_path / "run.npz")
    whole = path.read_bytes()
    for i in range(0, len(whole), max(1, len(whole) // 300)):
        path.write_bytes(whole[:i] + bytes([whole[i] ^ 0xFF]) + whole[i + 1 :])
        try:
            back = rd.load_run(path)
        except RunFileError:
            continue
        assert np.array_equal(back.q, run.q)


def test_a_folder_is_no_target(run, tmp_path) -> None:
    with pytest.raises(RunFileError, match="is a folder"):
        rd.save_run(run, tmp_path)


@pytest.mark.parametrize(
    ("name", "change", "said"),
    [
        ("t", lambda t: t[:5], "not float64"),
        ("t", lambda t: t[::-1].copy(), "its times"),
        ("t", lambda t: np.where(t > 0.1, np.nan, t), "its times"),
        ("q", lambda q: q[:, :1], "q holds"),
        ("q", lambda q: q.astype(complex), "complex128"),
        ("q", lambda q: q.astype(str), "q holds"),
        ("kinetic", lambda K: K[:5], "kinetic holds"),
        ("wanted", lambda _: np.zeros(3), "wanted holds"),
        ("deviation", lambda _: np.zeros((2, 2)), "deviation holds"),
        ("at_stop", lambda _: np.zeros((10, 2), bool), "at_stop holds"),
        ("wrench/tip", lambda _: np.full((3, 7), np.nan), "its times"),
        ("wrench/tip", lambda _: np.zeros((3, 6)), "wrench on tip holds"),
        ("about", lambda text: np.array(str(text).replace('"urdf": "', '"urdf": 3, "x": "')), "no text"),
        ("about", lambda text: np.array(str(text).replace('"format": 2', '"format": "2"')), "has format '2'"),
    ],
)
def test_arrays_that_do_not_fit_together_are_refused(run, tmp_path, name: str, change, said: str) -> None:
    with np.load(rd.save_run(run, tmp_path / "run.npz")) as file:
        arrays = dict(file)
    np.savez(tmp_path / "bent.npz", **arrays | {name: change(arrays.get(name, np.zeros(0)))})
    with pytest.raises(RunFileError, match=said):
        rd.load_run(tmp_path / "bent.npz")
