"""Run files: what is written is read back whole, or refused."""

from __future__ import annotations

import functools
import io
import json
import tracemalloc
import zipfile
from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn.scene import starter
from robot_dyn.simulation import Outcome, Reason, RunFileError


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    path = tmp_path_factory.mktemp("scene") / "scene.toml"
    path.write_text(starter("cart_pole").replace("4.0", "0.2", 1), encoding="utf-8")
    return rd.simulate(rd.read_scene(path))


def assert_same(after, before) -> None:
    """The same values in every field, mapping and array, to the bit, NaN included."""
    assert type(after) is type(before)
    if is_dataclass(before):
        for field in fields(before):
            assert_same(getattr(after, field.name), getattr(before, field.name))
    elif isinstance(before, dict):
        assert list(after) == list(before)
        for key, value in before.items():
            assert_same(after[key], value)
    elif isinstance(before, np.ndarray):
        assert after.dtype == before.dtype
        np.testing.assert_array_equal(after, before)
    else:
        assert after == before


def test_a_run_comes_back_as_it_was(run, tmp_path) -> None:
    """Every array to the bit, every text; the name of the file is added, and is not stored in another one.

    The URDF, the edits, the scene and the versions travel with the numbers.
    """
    back = rd.read(run.save(tmp_path / "run"))
    again = rd.read(back.save(tmp_path / "again"))
    assert (back.metadata["file"], again.metadata["file"]) == ("run.npz", "again.npz")
    texts = {name: text for name, text in back.metadata.items() if name != "file"}
    assert_same(replace(back, metadata=texts | {"source": run.metadata["source"]}), run)
    assert back.summary == run.summary
    contents = {"urdf": "<robot", "scene": 'kind = "spring"', "versions": "pin 4", "edits": "gravity"}
    assert all(content in back.metadata[name] for name, content in contents.items())


@pytest.mark.parametrize("keep", [0.0, 0.3, 0.99, "hello", None])
def test_files_that_are_cut_short_or_of_another_kind_are_refused(run, tmp_path, keep: Any) -> None:
    path = run.save(tmp_path / "run.npz")
    if keep is None:
        np.savez(path, x=np.ones(3))
    else:
        whole = path.read_bytes()
        path.write_bytes(keep.encode() if isinstance(keep, str) else whole[: int(keep * len(whole))])
    with pytest.raises(RunFileError, match="cannot be read as a run file"):
        rd.read(path)


def test_a_damaged_file_is_refused_or_whole(run, tmp_path) -> None:
    """Any byte may be wrong: the file is refused, or what is read is what was written."""
    path = run.save(tmp_path / "run.npz")
    whole = path.read_bytes()
    for i in range(0, len(whole), max(1, len(whole) // 300)):
        path.write_bytes(whole[:i] + bytes([whole[i] ^ 0xFF]) + whole[i + 1 :])
        try:
            back = rd.read(path)
        except RunFileError:
            continue
        assert np.array_equal(back.q, run.q)


def resaved(run, path, **changes):
    """Write a run file by NumPy, with members changed, or left out if None."""
    with np.load(run.save(path)) as file:
        arrays = dict(file)
    for name, change in changes.items():
        x = change(arrays.get(name, np.zeros(0)))
        arrays = {key: y for key, y in (arrays | {name: x}).items() if y is not None}
    np.savez(path, **arrays)
    return path


def said(text: np.ndarray, **changes) -> np.ndarray:
    """The text of a run file with other fields; paths are separated by two underscores."""
    about = json.loads(str(text))
    for path, value in changes.items():
        *tables, key = path.split("__")
        functools.reduce(dict.__getitem__, tables, about if path == "format" else about["value"])[key] = value
    return np.array(json.dumps(about))


@pytest.mark.parametrize(
    ("name", "change", "message"),
    [
        ("t", lambda t: t[:5], r"'\w+': contains float64 .*m = 5"),
        ("t", lambda t: t[::-1].copy(), "the times of member 't'"),
        ("t", lambda t: np.where(t > 0.1, np.nan, t), "'t' .*nan"),
        ("t", lambda _: None, "'t': its array is missing"),
        ("q", lambda q: q[:, :1], "'v': contains .*n = 1"),
        ("q", lambda q: q.astype(complex), "'q': contains complex128"),
        ("q", lambda q: q.astype(str), "'q': contains str"),
        ("q", lambda q: q.astype(np.float32), "'q': contains float32"),
        ("q", lambda q: np.where(q > 0, np.inf, q), "member 'q' of a run that did not diverge contains nan or inf"),
        ("ledger/kinetic", lambda K: K[:5], "'ledger/kinetic': contains"),
        ("power/control", lambda _: None, "'power/control': its array is missing"),
        ("desired", lambda _: np.zeros(3), "'desired' is unknown to this version"),
        ("wrenches/cart", lambda F: np.full((len(F), 7), np.nan), "member 'wrenches/cart' .*nan"),
        ("wrenches/cart", lambda _: np.zeros((3, 6)), "'wrenches/cart': contains"),
        ("novelty", lambda _: np.zeros(3), "'novelty' is unknown to this version"),
        ("error/error", lambda _: None, "'error/error': its array is missing"),
        ("t", lambda t: 1e300 * t, "the times of member 't' are too few, negative, too large or decreasing"),
        ("t", lambda t: t - 1.0, "the times of member 't' are too few, negative, too large or decreasing"),
        ("error/t", lambda t: 1e308 + 0 * t, "the times of member 'error/t' are negative, too large"),
        ("wrenches/cart", lambda _: np.zeros((0, 7)), "the times of member 'wrenches/cart' are too few"),
        ("about", lambda _: None, "no text 'about'"),
        ("about", lambda text: np.array("[" * 100_000), "'about' is not JSON"),
        ("about", lambda text: np.array([str(text)]), "no text 'about'"),
        ("about", lambda text: said(text, format=3), "it has format 3, but this version reads 10; .*robot-dyn"),
        ("about", lambda text: said(text, format="3"), "it has format '3'"),
        ("about", lambda text: said(text, format={"a": 3}), "it has format {'a': 3}"),
        ("about", lambda text: said(text, novelty=3), "'novelty': .*3"),
        ("about", lambda text: said(text, metadata__urdf=3), "'metadata/urdf': .*3"),
        ("about", lambda text: said(text, metadata__urdf="\ud800"), "'about': "),
        ("about", lambda text: said(text, joint_names="ab"), "'joint_names': .*'ab'"),
        ("about", lambda text: said(text, joint_names=[1, 2]), "'joint_names/0': .*1"),
        ("about", lambda text: said(text, joint_names=["a"]), "'q' has 2 joints, but 'joint_names' has 1"),
        ("about", lambda text: said(text, v="q"), "'v': its array is missing"),
        ("about", lambda text: said(text, tracking_error="u", u=None), "'u': its array is missing"),
        ("about", lambda text: said(text, power={}), "member 'power/.*' is unknown to this version"),
        ("about", lambda text: said(text, outcome__reason="done"), "'outcome/reason': .*interrupted.*'done'"),
        ("about", lambda text: said(text, outcome__t=float("nan")), "'outcome/t' is nan, which is not a time"),
        ("about", lambda text: said(text, outcome=None), "'outcome': .*None"),
        ("about", lambda text: said(text, statistics__steps=1.5), "'statistics/steps': .*1.5"),
        ("about", lambda text: said(text, statistics__wall_s=True), "'statistics/wall_s': .*True"),
    ],
)
def test_members_that_do_not_fit_together_are_refused_by_name(run, tmp_path, name: str, change, message: str) -> None:
    path = resaved(run, tmp_path / "run.npz", **{name: change})
    with pytest.raises(RunFileError, match=f"cannot be read as a run file: .*{message}"):
        rd.read(path)


def test_a_run_that_diverged_keeps_its_nans(run, tmp_path) -> None:
    """What a diverged run ends with may be anything; so a run that NumPy wrote again by itself still loads."""
    end = replace(run, outcome=Outcome(Reason.STATE_OVERFLOWS, 0.2), q=np.where(run.q > 0, np.nan, run.q))
    path = end.save(tmp_path / "run.npz")
    np.testing.assert_array_equal(rd.read(path).q, end.q)
    with np.load(path) as file:
        np.savez(tmp_path / "again.npz", **dict(file))
    np.testing.assert_array_equal(rd.read(tmp_path / "again.npz").q, end.q)


@pytest.mark.parametrize("change", [{"q": np.zeros(3)}, {"power": {}}, {"joint_names": ("a", "\ud800")}, {"t": [0.0]}])
def test_what_would_not_be_read_is_not_written(run, tmp_path, change) -> None:
    with pytest.raises(RunFileError, match="cannot be written"):
        replace(run, **change).save(tmp_path / "run.npz")
    assert not list(tmp_path.iterdir())


def with_member(run, path, size: int, shape: tuple[int, ...]):
    """Write a run file with a further member of `size` zeros whose header states a shape of float64."""
    data = np.lib.format.header_data_from_array_1_0(np.zeros(0)) | {"shape": shape}
    with (
        zipfile.ZipFile(run.save(path), "a", zipfile.ZIP_DEFLATED) as file,
        file.open("power/more.npy", "w") as member,
    ):
        np.lib.format.write_array_header_1_0(member, data)
        for _ in range(size >> 20):
            member.write(bytes(2**20))
    return path


@pytest.mark.parametrize(
    ("size", "shape", "message"),
    [
        (2**26, (2**23,), "it unpacks to 64.* MiB"),
        (2**20, (2**40,), "it unpacks to .* MiB|'power/more' is not an array"),
        (0, (2**40,), "'power/more' is not an array"),
    ],
    ids=["bomb", "bomb that lies", "lie"],
)
def test_a_bomb_is_refused_before_it_is_unpacked(run, tmp_path, size, shape, message) -> None:
    """Zeros take a thousandth of their size in a file; arrays of runs half of it, and at most 20 times as much."""
    path = with_member(run, tmp_path / "run.npz", size, shape)
    tracemalloc.start()
    with pytest.raises(RunFileError, match=message):
        rd.read(path)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 8 * 2**20


def test_runs_of_zeros_are_saved_and_loaded(tmp_path) -> None:
    """The reader's bound for bombs refuses no file of the writer, however well its arrays compress."""
    plant = rd.Plant(rd.load("planar_2r").with_(gravity=(0.0, 0.0, 0.0)), [])
    runs = rd.rollouts(plant, np.zeros((100, 2)), duration_s=1.0, method="RK4", step_s=1e-3)
    back = rd.read(runs.save(tmp_path / "runs"))
    assert runs.q is not None and back.q is not None
    assert not runs.q.any() and np.array_equal(back.q, runs.q)


def test_a_file_with_two_members_of_one_name_is_refused(run, tmp_path: Path) -> None:
    """Otherwise the last one would replace the array of the run in silence."""
    path, stream = run.save(tmp_path / "run.npz"), io.BytesIO()
    np.save(stream, run.q + 1.0)
    with zipfile.ZipFile(path, "a") as file:
        file.writestr("q", stream.getvalue())
    with pytest.raises(RunFileError, match="two members with the same name"):
        rd.read(path)


@pytest.mark.parametrize("name", ["scene.toml", "arm.urdf", "run.csv", "notes.txt"])
def test_other_files_are_not_read_as_runs(run, tmp_path: Path, name: str) -> None:
    path = tmp_path / name
    if name == "run.csv":
        run.save(path)
    else:
        path.write_text("robot = 'pendulum'")
    for other in (path, tmp_path, tmp_path / "none.npz"):
        with pytest.raises(RunFileError):
            rd.read(other)


def test_a_suffix_without_a_format_is_refused_with_those_that_have_one(run, tmp_path: Path) -> None:
    with pytest.raises(RunFileError, match=r"\.npz, \.csv, \.parquet, \.nc, \.mcap"):
        run.save(tmp_path / "run.xlsx")
    with pytest.raises(rd.RobotDynError, match=r"\.png, \.svg, \.pdf"):
        rd.plot(run).save(tmp_path / "run.xlsx")
    assert not list(tmp_path.iterdir())
