"""Logs of other programs: text columns are skipped, other kinds of file and two publishers in one log are refused."""

from __future__ import annotations

import sqlite3
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn.foundations import PlanError
from tests.control.test_from_samples import ARM, NAMES, REST, SMOOTH, T, table

EXPECTED = rd.control.from_samples(ARM, table(REST)).reference.coefficients


def csv(path: Path, columns: dict[str, Any]) -> Path:
    rows = zip(*(map(str, np.asarray(column).tolist()) for column in columns.values()), strict=True)
    path.write_text("\n".join([",".join(columns), *map(",".join, rows)]) + "\n", "utf-8")
    return path


# --- text columns

TEXTS: dict[str, Any] = {
    "mode": ["AUTO"] * 40 + ["HOLD"] * 41,
    "enabled": [True] * 81,
    "comment": [""] * 81,
    "stamp of the clock": [f"2026-01-01 12:00:{k:02d}" for k in range(81)],
    "error": [""] * 80 + ["E-12"],
    "": [""] * 81,  # a comma at the end of each line
}


@pytest.mark.parametrize("head", TEXTS)
def test_a_text_column_that_nobody_names_is_skipped_and_reported(head: str, tmp_path: Path) -> None:
    """In files, dicts and data frames; the motion has the same bits."""
    columns = {head: TEXTS[head]} | table(REST)
    sources: list[Any] = [csv(tmp_path / "log.csv", columns), columns]
    try:
        import pandas

        sources.append(pandas.DataFrame(columns))
        sources.append(pandas.read_csv(tmp_path / "log.csv") if head else columns)
    except ImportError:
        pass
    for source in sources[:3]:
        plan = rd.control.from_samples(ARM, source)
        np.testing.assert_array_equal(plan.reference.coefficients, EXPECTED)
        assert repr(head) in plan.method and plan.findings == ()
    np.testing.assert_allclose(rd.control.from_samples(ARM, sources[-1]).reference.coefficients, EXPECTED, atol=1e-12)


def test_columns_with_numbers_are_not_skipped(tmp_path: Path) -> None:
    """A typing error in a joint, or in a column that may be a joint by another name, is refused with its line."""
    odd = [str(x) for x in REST[:, 0]]
    odd[4] = "0.3O"
    for head in (NAMES[0], "elbow"):
        path = csv(tmp_path / "log.csv", table(REST) | {head: odd})
        with pytest.raises(PlanError, match=r"log\.csv: line 6: column '.*': '0\.3O' is not a number"):
            rd.control.from_samples(ARM, path)
    with pytest.raises(PlanError, match="column 'elbow' is not a joint"):
        rd.control.from_samples(ARM, table(REST) | {"elbow": REST[:, 0]})


def test_with_named_joints_any_other_column_may_contain_text(tmp_path: Path) -> None:
    columns = table(REST, ("J1", "J2", "J3", "J4", "J5", "J6")) | {"count": ["-", *map(str, range(80))]}
    joints = {name: f"J{k + 1}" for k, name in enumerate(NAMES)}
    plan = rd.control.from_samples(ARM, csv(tmp_path / "log.csv", columns), joints=joints)
    np.testing.assert_array_equal(plan.reference.coefficients, EXPECTED)


# --- other kinds of file


def sqlite(path: Path) -> None:
    base = sqlite3.connect(path)
    base.execute("create table messages (id integer)")
    base.commit()
    base.close()


def packed(path: Path) -> None:
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("xl/workbook.xml", "<workbook/>")


def starting(data: bytes) -> Any:
    return lambda path: path.write_bytes(data + bytes(100))


KINDS = {
    "bag_0.db3": (sqlite, "mcap convert"),
    "run.bag": (starting(b"#ROSBAG V2.0\n"), "rosbags-convert"),
    "log.xlsx": (packed, "read_excel"),
    "log.xls": (starting(b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1"), "read_excel"),
    "log.mat": (starting(b"MATLAB 5.0 MAT-file"), "loadmat"),
    "log.h5": (starting(b"\x89HDF\r\n\x1a\n"), "h5py"),
    "log.parquet": (starting(b"PAR1"), "read_parquet"),
    "log.feather": (starting(b"ARROW1"), "read_feather"),
    "log.npz": (lambda path: np.savez(path, q=REST), "numpy.load"),
    "log.npy": (lambda path: np.save(path, REST), "numpy.load"),
    "log.pkl": (starting(b"\x80\x04"), "CSV"),
    "log.csv.gz": (starting(b"\x1f\x8b\x08"), "unpack"),
}


@pytest.mark.parametrize("name", KINDS)
def test_a_file_of_another_kind_is_refused_with_a_way_to_read_it(name: str, tmp_path: Path) -> None:
    write, remedy = KINDS[name]
    write(tmp_path / name)
    with pytest.raises(PlanError, match=remedy) as raised:
        rd.control.from_samples(ARM, tmp_path / name)
    assert str(raised.value).startswith(f"{tmp_path / name}: ")


@pytest.mark.parametrize("name", ["bag_0.db3", "run.bag", "log.xls", "log.parquet", "log.npy"])
def test_a_renamed_file_is_refused_by_its_content(name: str, tmp_path: Path) -> None:
    write, remedy = KINDS[name]
    write(tmp_path / name)
    (tmp_path / name).rename(tmp_path / "log.csv")
    with pytest.raises(PlanError, match=remedy):
        rd.control.from_samples(ARM, tmp_path / "log.csv")


def test_the_folder_of_a_bag_is_refused_with_the_file_to_give(tmp_path: Path) -> None:
    with pytest.raises(PlanError, match=r"is a folder; give the \.mcap file in it"):
        rd.control.from_samples(ARM, tmp_path)


def test_a_scene_refuses_it_in_the_same_words(tmp_path: Path) -> None:
    sqlite(tmp_path / "bag_0.db3")
    scene = '[control]\nkind = "pd"\nbandwidth_rad_s = 3\n[reference]\nkind = "samples"\nfile = "bag_0.db3"\n'
    (tmp_path / "scene.toml").write_text(f'robot = "ur5"\nduration_s = 1.0\n{scene}')
    with pytest.raises(PlanError) as raised:
        rd.control.from_samples(ARM, tmp_path / "bag_0.db3")
    with pytest.raises(rd.RobotDynError) as in_scene:
        rd.read_scene(tmp_path / "scene.toml").setup()
    assert str(raised.value).rpartition("bag_0.db3: ")[2] in str(in_scene.value)


# --- two publishers


def merged(order: np.ndarray, t: np.ndarray, q: np.ndarray) -> dict[str, np.ndarray]:
    return {"t": t[order]} | dict(zip(NAMES, q[order].T, strict=True))


def both(shift: float, other: np.ndarray, every: int = 1, order: Any = "by turns") -> dict[str, np.ndarray]:
    """The motion and, from every so many samples, another one at times later by a shift; by turns, or by time."""
    t, q = np.concatenate([T, T[::every] + shift]), np.concatenate([SMOOTH, other[::every]])
    rows = np.concatenate([np.arange(81), np.arange(81)[::every] + 0.5])
    return merged(np.argsort(rows if order == "by turns" else t, kind="stable"), t, q)


TWO = {
    "clocks 100 s apart": both(100.0, SMOOTH),
    "the second is late": both(-0.06, SMOOTH),
    "equal times": both(0.0, SMOOTH),
    "a slower publisher": both(-0.11, SMOOTH, every=3),
    "zeros of a simulator": both(0.01, 0.0 * SMOOTH, order="by time"),
    "zeros shortly after": both(1e-4, 0.0 * SMOOTH, order="by time"),
    "slower zeros": both(0.01, 0.0 * SMOOTH, every=4, order="by time"),
    "the motion 1 s later": both(0.0125, SMOOTH[::-1], order="by time"),
    "a second arm, 0.3 rad away": both(1e-3, SMOOTH + 0.3, order="by time"),
    "a copy one step late": both(2e-3, np.roll(SMOOTH, 1, axis=0), order="by time"),
    "a copy one step late, and long after": both(0.02, np.roll(SMOOTH, 1, axis=0), order="by time"),
    "a copy two steps late": both(2e-3, np.roll(SMOOTH, 2, axis=0), order="by time"),
    "a noisy copy three steps late": both(
        3e-3, np.roll(SMOOTH, 3, axis=0) + 1e-5 * np.random.default_rng(2).standard_normal((81, 6)), order="by time"
    ),
    "a copy one step early": both(3e-3, np.roll(SMOOTH, -2, axis=0), order="by time"),
}


@pytest.mark.parametrize("ends", [None, "measured"])
@pytest.mark.parametrize("name", TWO)
def test_two_publishers_in_one_log_are_named(name: str, ends: str | None, tmp_path: Path) -> None:
    for source in (TWO[name], csv(tmp_path / "log.csv", TWO[name])):
        with pytest.raises(PlanError, match="two publishers appear to be interleaved"):
            rd.control.from_samples(ARM, source, ends=ends)


RNG = np.random.default_rng(1)
GLITCHES = SMOOTH.copy()
GLITCHES[[20, 40, 60], 2] += 1.0


@pytest.mark.parametrize(
    ("t", "q"),
    [
        (T, SMOOTH + 0.02 * RNG.standard_normal(SMOOTH.shape)),  # noise faster than the limits
        (T / 40, SMOOTH + 2e-3 * np.round(RNG.random(SMOOTH.shape))),  # an encoder of 2 mrad at 1.6 kHz
        (T, GLITCHES),
        (T / 50, SMOOTH),  # 50 times too fast, but one motion
        (10 * T, (np.arange(81)[:, None] % 2) * np.full(6, 0.3)),  # way points there and back, within the limits
        (10 * T, (np.arange(81)[:, None] % 2) * 0.3 + np.linspace(0, 2, 81)[:, None] * np.ones(6)),  # a raster
        (T, np.repeat(SMOOTH[::2], 2, axis=0)[:81]),  # logged at twice the rate of the state
        (T + 0.01 * (np.arange(81) % 2), SMOOTH),  # uneven periods
        (T + 0.01 * (np.arange(81) % 2), SMOOTH + 0.01 * RNG.standard_normal(SMOOTH.shape)),
    ],
)
def test_one_publisher_is_not_refused_as_two(t: np.ndarray, q: np.ndarray) -> None:
    rd.control.from_samples(ARM, q, time=t, ends="measured", unit="rad")


@pytest.mark.parametrize("order", [[*range(40), 41, 40, *range(42, 81)], [*range(40, 81), *range(40)],
                                   [*range(80, -1, -1)], RNG.permutation(81)])  # fmt: skip
def test_times_out_of_order_of_one_publisher_are_to_be_sorted(order: Any) -> None:
    with pytest.raises(PlanError, match="times must increase"):
        rd.control.from_samples(ARM, merged(np.asarray(order), T, SMOOTH), ends="measured")
