"""Samples as a motion: it passes through them, smoothly; what is doubtful in them is said or refused."""

from __future__ import annotations

import re
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn.foundations import ControlError, PlanError

ARM = rd.load("ur5")
T = np.linspace(0, 2, 81)
SMOOTH = np.sin(np.outer(T, [0.5, 0.6, 0.7, 0.8, 0.9, 1.0]) + np.arange(6))
REST = 0.3 + np.outer(10 * (T / 2) ** 3 - 15 * (T / 2) ** 4 + 6 * (T / 2) ** 5, np.linspace(0.5, 1.0, 6))
NAMES = ARM.joint_names


def table(q: np.ndarray, names: tuple[str, ...] = NAMES) -> dict[str, np.ndarray]:
    return {"t": T} | dict(zip(names, q.T, strict=True))


def derivatives(piece: np.ndarray, s: float) -> list[np.ndarray]:
    """The polynomial and its first four derivatives, by NumPy."""
    return [np.polynomial.polynomial.polyval(s, np.polynomial.polynomial.polyder(piece, r)) for r in range(5)]


@pytest.mark.parametrize(("ends", "q"), [("rest", REST), ("measured", SMOOTH)])
def test_the_motion_passes_through_the_samples_with_four_continuous_derivatives(ends: str, q: np.ndarray) -> None:
    plan = rd.control.from_samples(ARM, table(q), ends=ends)
    np.testing.assert_allclose(plan.reference.at(T)[0], q, atol=1e-13)
    h, c = np.diff(plan.reference.breaks), plan.reference.coefficients
    for k in range(len(c) - 1):
        left, right = derivatives(c[k], h[k]), derivatives(c[k + 1], 0.0)
        for r in range(5):  # rounding grows by 1/h = 40 with each derivative
            np.testing.assert_allclose(left[r], right[r], atol=1e-12 * 40**r)
    assert plan.findings == () and plan.duration_s == 2.0


def test_ends_at_rest_have_neither_velocity_nor_acceleration() -> None:
    plan = rd.control.from_samples(ARM, table(REST))
    for t in (0.0, 2.0):
        _, v, a = plan.reference.at(t)
        np.testing.assert_allclose(np.concatenate([v, a]), 0, atol=1e-10)


def test_of_a_motion_of_degree_five_nothing_is_lost() -> None:
    """The minimum-jerk motion is one polynomial, which the spline is: only rounding remains between the samples."""
    plan = rd.control.from_samples(ARM, table(REST))
    t = np.linspace(0, 2, 1001)
    exact = rd.control.quintic(REST[0], REST[-1], 2.0).at(t)
    for mine, its, tolerance in zip(plan.reference.at(t), exact, (1e-13, 1e-11, 1e-9), strict=True):
        np.testing.assert_allclose(mine, its, atol=tolerance)


def test_the_error_that_is_said_is_that_of_the_samples_left_out() -> None:
    plan = rd.control.from_samples(ARM, table(SMOOTH), ends="measured")
    half = rd.control.Samples(T[::2], SMOOTH[::2])
    off = np.abs(half.at(T[1::2])[0] - SMOOTH[1::2])
    assert f"misses the others by at most {off.max():.2g} rad" in plan.method


def test_arrays_tables_frames_and_files_in_any_unit_are_one_motion(tmp_path: Path) -> None:
    pandas = pytest.importorskip("pandas")
    read = partial(rd.control.from_samples, ARM, ends="rest")
    expected = read(SMOOTH, time=T).reference.coefficients
    shuffled = {"time [ms]": 1000 * T} | {
        f"{name} [deg]": np.degrees(SMOOTH[:, NAMES.index(name)]) for name in sorted(NAMES)
    }
    path = tmp_path / "log.csv"
    pandas.DataFrame(shuffled).to_csv(path, index=False)
    mapped = {"t": T, "gripper": T} | {f"J{i}": SMOOTH[:, i] for i in range(6)}
    for plan in (
        read(shuffled),
        read(pandas.DataFrame(shuffled)),
        read(path),
        read(table(SMOOTH), unit="rad"),
        read(table(np.degrees(SMOOTH)), unit="deg"),
        read(SMOOTH, time=T[1]),
        read(mapped, joints={name: f"J{i}" for i, name in enumerate(NAMES)}),
    ):
        scale = 40.0 ** np.arange(6)[:, None]  # of rounding in a coefficient of tʲ
        np.testing.assert_allclose(plan.reference.coefficients / scale, expected / scale, atol=1e-12)
    stamps = pandas.DataFrame({"t": pandas.to_datetime(1.7e9 + T, unit="s")} | table(SMOOTH) | {"t": T})
    assert read(stamps, start_s=3.0).reference.start_s == 3.0


def test_the_table_of_a_run_is_read_back(tmp_path: Path) -> None:
    """Its q, v and a are met at the samples, exactly."""
    arm = rd.load("planar_2r")
    run = rd.simulate(arm, q0=[0.3, 0.4], duration_s=0.5)
    plan = rd.control.from_samples(arm, run.save(tmp_path / "run.csv"), ends="measured")
    for mine, its in zip(plan.reference.at(run.t), (run.q, run.v, run.a), strict=True):
        np.testing.assert_allclose(mine, its, atol=1e-9)
    assert np.abs(rd.control.from_samples(arm, tmp_path / "run.csv", ends="rest").reference.at(0.0)[1]).max() < 1e-10


def test_samples_that_move_at_an_end_need_a_word() -> None:
    """A stop within one step would take a torque that the motion does not need."""
    with pytest.raises(PlanError, match=r"moves at .* rad/s at the start.*give ends='measured'.*ends='rest'"):
        rd.control.from_samples(ARM, table(SMOOTH))
    with pytest.raises(PlanError, match=r"at the end of the samples; give"):
        rd.control.from_samples(ARM, {"t": T[:41]} | {name: x[:41] for name, x in table(REST).items() if name != "t"})
    assert rd.control.from_samples(ARM, REST[::20], time=T[::20]).duration_s == 2.0  # way points are few


@pytest.mark.parametrize(
    ("deviation", "kept"),
    [
        *((x, np.ones(81, bool)) for x in (1e-3, 1e-4)),
        *((1e-3, x) for x in (np.arange(81) != 40, abs(np.arange(81) - 40) > 8, (np.arange(81) % 2 == 0) | (T < 1))),
    ],
)
def test_noise_is_told_with_its_deviation_and_the_acceleration_it_makes(deviation: float, kept: np.ndarray) -> None:
    """Of 81 samples the deviation of fourth differences is known to some 10 %; second ones have √6 σ / h².

    Also where a sample is missing, at a gap, and at half the rate: divided differences have a known deviation.
    """
    noisy = REST + deviation * np.random.default_rng(3).normal(size=REST.shape)
    (found,) = [
        x for x in rd.control.from_samples(ARM, noisy[kept], time=T[kept], ends="rest").findings if "noise" in x
    ]
    said = re.search(r"noise or rounding of (\S+) rad, or inexact times, causes accelerations of (\S+) rad", found)
    assert said is not None and float(said[1]) == pytest.approx(deviation, rel=0.5)
    assert not kept.all() or float(said[2]) == pytest.approx(np.sqrt(6) * deviation / T[1] ** 2, rel=0.35)
    assert "noise" not in " ".join(rd.control.from_samples(ARM, REST[kept], time=T[kept], ends="rest").findings)


def test_times_that_are_off_are_told_as_noise_and_uneven_ones_are_not() -> None:
    rng = np.random.default_rng(5)
    off = T + 0.2 * T[1] * rng.uniform(-1, 1, len(T)) * (T > 0)
    assert "inexact times" in " ".join(rd.control.from_samples(ARM, SMOOTH, time=off, ends="measured").findings)
    there = np.sin(np.outer(off, [0.5, 0.6, 0.7, 0.8, 0.9, 1.0]) + np.arange(6))
    assert not rd.control.from_samples(ARM, there, time=off, ends="measured").findings


def test_rounding_of_a_log_is_told_and_a_smooth_one_is_not_called_noisy() -> None:
    """0.1° every 25 ms is an acceleration of √6 · 0.1° / √12 / h² = 2 rad/s², of some 3 here."""
    degrees = np.degrees(REST)
    found = rd.control.from_samples(ARM, np.round(degrees, 1), time=T, unit="deg").findings
    assert any(re.search(r"noise or rounding of 0\.000[456] rad", each) for each in found)
    for q in (REST, SMOOTH):
        assert not rd.control.from_samples(ARM, q, time=T, ends="measured").findings


def changed(row: int, joint: int, x: float) -> np.ndarray:
    q = REST.copy()
    q[row, joint] = x
    return q


@pytest.mark.parametrize(
    ("source", "options", "message"),
    [
        (table(changed(40, 2, 2.9)), {}, r"elbow_joint jumps: from .* to 2\.9 rad in 0\.025 s at 0\.975 s"),
        (table(changed(40, 2, 4.0)), {}, "elbow_joint is at 4 rad at 1 s, outside its limits -3.1416 to 3.1416"),
        (
            table(np.where(T[:, None] > 1, REST - 2 * np.pi * np.eye(6)[0], REST)),
            {},
            r"pan_joint jumps by a whole turn: from 0\.55 to -5\.7215 rad .* numpy\.unwrap",
        ),
        (
            {"t": [0.5, 90.5, 180.7]} | dict.fromkeys(NAMES, np.array([0.1, 0.2, 0.3])),
            {},
            "samples are 90.1 s apart: are the times in ms",
        ),
        (table(changed(40, 0, 0.55 - 7.08)), {}, r"pan_joint jumps: from .*"),
        ({"t": [0, 0.3]} | dict.fromkeys(NAMES, np.array([0, 0.9])), {}, r"moves at 5\.625 rad/s at 0\.15 s, although"),
        (
            {"t": [0, 1, 1.5, 2, 3]} | dict.fromkeys(NAMES, np.array([0, 3.1, 3.1, 3.1, 0])),
            {},
            r"elbow_joint is at 3\.2\d* rad at 1\.\d* s, between samples within its limits",
        ),
        (table(REST) | {"t": 1.7e9 + T}, {}, "first sample is at 1700000000 s, but runs begin at 0 s; pass start_s=0"),
        (
            table(REST) | {"t": 1000 * T + 0.5},
            {},
            "no joint reaches 1 % of its velocity limit in 2000 s, .*are the times in ms",
        ),
        (table(REST) | {"t": T + (T > 1)}, {}, r"1 gap in time, the longest of 1\.025 s from 1 s"),
        (
            table(SMOOTH),
            {"ends": "rest"},
            r"moves at .* rad/s at the start of the samples, although the motion .* at rest; ends='measured'",
        ),
        (
            {name: x for name, x in table(REST).items() if name != "elbow_joint"},
            {"q0": np.full(6, 0.2)},
            "elbow_joint has no samples and rests at 0.2 rad",
        ),
    ],
)
def test_what_is_doubtful_is_found(source: dict, options: dict[str, Any], message: str) -> None:
    plan = rd.control.from_samples(ARM, source, **options)
    assert any(re.search(message, each) for each in plan.findings), plan.findings
    assert all(f"finding: {each}" in repr(plan) for each in plan.findings)


@pytest.mark.parametrize(
    ("source", "options", "message"),
    [
        (table(np.degrees(SMOOTH)), {}, "angles may be in degrees: shoulder_pan_joint reaches 48"),
        (
            table(np.where(np.arange(6) == 2, np.degrees(SMOOTH), SMOOTH)),
            {},
            r"degrees: elbow.* if shoulder_pan_joint is in degrees, too; else state units, as in 'elbow_joint \[deg\]'",
        ),
        (table(REST, ("elbow", *NAMES[1:])), {}, "column 'elbow' is not a joint; nearest: elbow_joint"),
        ({name: x for name, x in table(REST).items() if name != NAMES[5]}, {}, "no column of wrist_3_joint; nearest:"),
        (table(REST) | {"t": np.where(T == 1, 0.9, T)}, {}, r"times must increase: sample 41 is at 0\.9 s"),
        (
            table(REST) | {"t": np.where(T == 1, 0.975, T)},
            {},
            r"sample 41 is at 0\.975 s, the previous one at 0\.975 s",
        ),
        (table(changed(7, 1, np.nan)), {}, "column 'shoulder_lift_joint': sample 8 is nan"),
        (dict(zip(NAMES, REST.T, strict=True)), {}, "there is no column of time; known: shoulder"),
        (table(REST), {"joints": {"elbow": "elbow_joint"}}, "no joint 'elbow'; nearest: elbow_joint"),
        (table(REST), {"ends": "still"}, "no ends 'still'"),
        ({f"{n} [deg]" if n != "t" else n: x for n, x in table(REST).items()}, {"unit": "rad"}, "states a unit other"),
        (
            {f"{n} [turns]" if n != "t" else n: x for n, x in table(REST).items()},
            {},
            "the unit must be one of rad, deg",
        ),
        ("missing.csv", {}, "there is no such file"),
        (table(REST) | {"t": np.round(1000 * T)}, {}, r"times may be in ms, µs or ns: they are integers, 25 apart"),
        (table(REST) | {"time": T}, {}, "2 columns may be the time, 't', 'time'"),
        (table(REST), {"time": T}, "column 't' contains times, but time="),
        ({"t": T, "a": T}, {"joints": {NAMES[0]: "a", NAMES[1]: "a"}}, "column 'a' is given for several joints"),
        ({"t": T}, {"q0": REST[0]}, "there is no column of any joint"),
        (table(REST) | {NAMES[0]: REST[:, 0].astype(str)}, {}, r"must contain numbers, sample 1 is '0\.3"),
        ({"t": T[:3]} | dict.fromkeys(NAMES, T), {}, "columns must have equal lengths of at least 2; got .*'t' 3"),
        (
            {"t [s]": T} | {f"q {n} [deg]": T for n in NAMES} | {f"v {n}": T for n in NAMES},
            {},
            "must be in rad/s or m/s; state the unit",
        ),
    ],
)
def test_what_has_no_single_meaning_is_refused(source: Any, options: dict[str, Any], message: str) -> None:
    with pytest.raises(PlanError, match=message):
        rd.control.from_samples(ARM, source, **options)


def extreme(scale: float = 1.0, head: str = "t", **columns: Any) -> dict[str, Any]:
    """Five samples, scale apart, with other columns."""
    return {head: scale * np.arange(5.0)} | dict.fromkeys(NAMES, np.linspace(0.0, 0.1, 5)) | columns


@pytest.mark.parametrize("ends", ["rest", "measured"])
@pytest.mark.parametrize(
    ("source", "options", "message"),
    [
        (extreme(t=[0.0, 1e-300, 1.0, 2.0, 3.0]), {}, "times: sample 2 is 1e-300 s after the previous one"),
        (extreme(1e299), {}, r"times: sample 2 is 1e\+299 s after"),
        (extreme(1e300, "t [ms]"), {}, r"times: sample 2 is 1e\+297 s after"),
        (extreme(t=[-1.7e308, 0.0, 1.0, 2.0, 1.7e308]), {}, "times: sample 2"),
        (np.zeros((5, 6)), {"time": 1e308}, r"times: sample 2 is 1e\+308 s after"),
        (np.zeros((5, 6)), {"time": 1e-300}, "times: sample 2 is 1e-300 s after"),
        (extreme(0.1), {"start_s": 1e17}, r"start_s is 1e\+17 s, where floating-point times are 16 s apart"),
        (extreme(0.1), {"start_s": -1e17}, r"start_s is -1e\+17 s"),
        (
            extreme(elbow_joint=[0.0, 1e308, 0.0, 0.0, 0.0]),
            {"unit": "rad"},
            r"'elbow_joint': sample 2 is 1e\+308 rad, beyond 1e\+12 rad",
        ),
    ],
)
def test_times_and_positions_that_overflow_or_vanish_are_refused(
    source: Any, options: dict[str, Any], ends: str, message: str
) -> None:
    with pytest.raises(PlanError, match=message):
        rd.control.from_samples(ARM, source, ends=ends, **options)


@pytest.mark.parametrize("ends", ["rest", "measured"])
def test_samples_that_nearly_coincide_are_refused_where_no_spline_passes_through_them(ends: str) -> None:
    t = np.concatenate([[0.0, 1e-12], np.arange(1.0, 30.0)])
    q = np.random.default_rng(0).random((31, 6))
    with pytest.raises(ControlError, match="no spline of degree 5 passes through the samples"):
        rd.control.from_samples(ARM, q, time=t, ends=ends)
    with pytest.raises(ControlError, match="no spline of degree 5 passes through the samples"):
        rd.control.Samples(t, q)


ROWS = "\n".join(",".join(f"{x:.9g}" for x in (t, *q)) for t, q in zip(T, REST, strict=True))
HEADS = ",".join(("t", *NAMES))


@pytest.mark.parametrize("text", [f"\ufeff{HEADS}\n{ROWS}", f"{HEADS}\n{ROWS}".replace("\n", "\r\n")])
def test_marks_and_line_ends_of_editors_change_nothing(tmp_path: Path, text: str) -> None:
    (tmp_path / "log.csv").write_bytes(text.encode())
    found = rd.control.from_samples(ARM, tmp_path / "log.csv").reference
    np.testing.assert_allclose(found.at(T)[0], REST, atol=1e-8)  # 9 digits were written


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (f"{HEADS}\n{ROWS}".replace(",", ";"), r"log\.csv: there is only one column, 't;.*pandas\.read_csv"),
        *((f"{HEADS}\n{ROWS}".replace(",", separator), "only one column") for separator in "\t| "),
        (f'{HEADS}\n"0,1",0,0,0,0,0,0', "line 2: column 't': '0,1' is not a number"),
        (f"{HEADS}\n{ROWS}".encode("utf-16"), "is not a CSV file in UTF-8"),
        ("", "the file or its first line is empty"),
        ("\n", "the file or its first line is empty"),
        (HEADS, "has no samples below its first line"),
        (f"{HEADS}\n0,1,1,1,1,1,1", "equal lengths of at least 2"),
        (ROWS, "the first line contains numbers, 0, 0.3"),
        (f"{HEADS},{NAMES[0]}\n{ROWS}", f"column '{NAMES[0]}' appears twice"),
        (f"{HEADS}\n0,1_0,0,0,0,0,0", "line 2: column 'shoulder_pan_joint': '1_0' is not a number"),
        (f"{HEADS}\n0,,0,0,0,0,0", "line 2: column 'shoulder_pan_joint': '' is not a number"),
        (f"{HEADS}\n0,0,0,0,0,0", "line 2 has 6 entries for 7 columns"),
        (f"{HEADS}\n{ROWS}\n9,0,0,0,0,0,inf", "column 'wrist_3_joint': sample 82 is inf"),
    ],
)
def test_what_is_no_table_is_told_by_file_and_line(tmp_path: Path, text: str | bytes, message: str) -> None:
    (tmp_path / "log.csv").write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(PlanError, match=message):
        rd.control.from_samples(ARM, tmp_path / "log.csv")


@pytest.mark.parametrize("heading", ["joint", " joint ", "joint (rad)"])
def test_a_table_of_one_column_is_read_where_the_times_are_given(tmp_path: Path, heading: str) -> None:
    """Of an arm of one joint; a period in place of a column of times."""
    arm, q = rd.load("pendulum"), np.sin(np.linspace(0, np.pi, 81)) ** 3
    name = arm.joint_names[0]
    (tmp_path / "log.csv").write_text("\n".join([heading.replace("joint", name), *map(repr, q.tolist())]) + "\n")
    found = rd.control.from_samples(arm, tmp_path / "log.csv", time=0.05).reference
    expected = rd.control.from_samples(arm, q[:, None], time=0.05).reference
    np.testing.assert_array_equal(found.coefficients, expected.coefficients)


def test_a_file_that_is_too_large_is_refused_before_it_is_read(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    with path.open("wb") as stream:
        stream.truncate(2**28 + 1)  # takes no space
    with pytest.raises(PlanError, match="is larger than 256 MiB; give a CSV file"):
        rd.control.from_samples(ARM, path)


def test_units_may_stand_in_parentheses_and_times_in_the_index() -> None:
    expected = rd.control.from_samples(ARM, REST, time=T).reference.coefficients
    found = rd.control.from_samples(
        ARM, {"Time (s)": T} | {f"{n} (rad)": x for n, x in zip(NAMES, REST.T, strict=True)}
    )
    np.testing.assert_array_equal(found.reference.coefficients, expected)
    pandas = pytest.importorskip("pandas")
    frame = pandas.DataFrame(table(REST)).set_index("t")
    zoned = frame.set_index(pandas.to_datetime(1.7e9 + T, unit="s", utc=True).rename("stamp"))
    for source, options in ((frame, {}), (frame, {"time": T}), (zoned, {})):
        plan = rd.control.from_samples(ARM, source, **options)
        np.testing.assert_allclose(plan.reference.breaks, T, atol=1e-6)  # of stamps since 1970, in float
        np.testing.assert_allclose(plan.reference.at(plan.reference.breaks)[0], REST, atol=1e-12)
    twice = frame.reset_index().set_axis(["t", *NAMES[:5], NAMES[4]], axis=1)
    with pytest.raises(PlanError, match="column 'wrist_2_joint' appears twice"):
        rd.control.from_samples(ARM, twice)
    missing = zoned.set_index(pandas.Index([*zoned.index[:-1], pandas.NaT], name="stamp"))
    with pytest.raises(PlanError, match="column 'stamp': sample 81 is NaT"):
        rd.control.from_samples(ARM, missing)
