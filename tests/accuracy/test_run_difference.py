"""Two runs compared: closed forms of their difference, when they part, and the settings that differ."""

from __future__ import annotations

from dataclasses import replace
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn.accuracy.run_difference_figure import draw
from robot_dyn.foundations import QueryError
from tests.campaigns.run_pairs import one_motion, two_motions
from tests.chains import body, chain
from tests.command import document
from tests.command import run as ran
from tests.long import long, stress
from tests.promised import check_document

DAMPING, SPEED, DURATION = 0.8, 1.3, 0.5
FREE = rd.load("pendulum").with_(gravity=(0.0, 0.0, 0.0))


def loaded(mass: float) -> rd.Robot:
    return FREE.with_(payload=rd.Payload("rod", mass, (0.0, 0.0, -0.3)))


def coasting(arm: rd.Robot, **given: Any) -> rd.Trajectory:
    """A pendulum without gravity that viscous friction slows: q = v₀ I/b (1 − e^(−b t/I)), with the I of `arm.M`."""
    plant = rd.Plant(arm, [rd.effects.ViscousFriction(DAMPING)])
    options: Any = {"duration_s": DURATION, "record_every_s": 0.01} | given
    return rd.simulate(plant, q0=[0.0], v0=[SPEED], **options)


def motion(arm: rd.Robot, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    I = float(arm.M(np.zeros(1))[0, 0])  # noqa: E741
    return SPEED * I / DAMPING * (1 - np.exp(-DAMPING * t / I)), SPEED * np.exp(-DAMPING * t / I)


def over_time(t: np.ndarray, x: np.ndarray) -> float:
    return float(np.sqrt(np.trapezoid(x**2, t) / (t[-1] - t[0])))


def test_two_payloads_differ_by_the_closed_form() -> None:
    """Runs are accurate to rtol 1e-10, and differences are some 0.1: nine digits of them."""
    a, b = loaded(1.0), loaded(2.5)
    found = rd.diff_runs(coasting(a), coasting(b))
    t = np.linspace(0.0, DURATION, 51)
    for each, x, y in zip(found.joints[:2], motion(a, t), motion(b, t), strict=True):
        assert each.rms == pytest.approx(over_time(t, y - x), rel=1e-8)
        assert each.largest == pytest.approx(np.abs(y - x).max(), rel=1e-8)
        assert each.at_s == pytest.approx(t[np.abs(y - x).argmax()])
    assert [each.quantity for each in found.joints] == ["q", "v", "u"] and found.common == found.samples
    assert found.samples == 51 and (found.start_s, found.end_s) == (0.0, DURATION)
    (setting,) = found.settings
    assert (setting.name, setting.a, setting.b) == ("payload on rod", "1 kg at 0, 0, -0.3 m", "2.5 kg at 0, 0, -0.3 m")
    assert found.parted_s == pytest.approx(0.01) and "part at t = 0.01 s" in repr(found)


def test_a_run_does_not_differ_from_itself() -> None:
    run = coasting(loaded(1.0))
    found = rd.diff_runs(run, coasting(loaded(1.0)))
    assert all(each.rms == each.largest == 0 for each in found.joints)
    assert found.parted_s is None and found.settings == () and found.left_out == ()
    assert "are equal at all 51 times" in found.sentence and "all settings are equal" in repr(found)


def test_a_known_shift_is_found_with_its_time() -> None:
    """A shift of one joint of two from t = 0.3 s on, twice as large at 0.4 s."""
    arm, shift = rd.load("planar_2r"), 1e-3
    run = rd.simulate(arm, q0=[0.4, -0.7], duration_s=0.5, record_every_s=0.01)
    bump = np.where(run.t >= 0.3 - 1e-9, shift, 0.0) * np.where(np.isclose(run.t, 0.4), 2.0, 1.0)
    found = rd.diff_runs(run, replace(run, q=run.q + np.outer(bump, [0, 1])))
    first, _, _, second, *_ = found.joints
    assert (first.rms, first.largest) == (0.0, 0.0)
    assert second.largest == pytest.approx(2 * shift) and second.at_s == pytest.approx(0.4)
    assert second.rms == pytest.approx(over_time(run.t, bump), rel=1e-9)
    assert found.parted_s == pytest.approx(0.3)


def test_one_motion_by_two_methods_does_not_part_within_their_errors() -> None:
    """RK4 with a long step differs from DOP853 by more than the tolerance, and by no more than it says."""
    a = coasting(loaded(1.0))
    b = coasting(loaded(1.0), method="RK4", step_s=0.05, record_every_s=0.05)
    found = rd.diff_runs(a, b)
    assert b.error is not None and found.parted_s is None and 0 < found.joints[0].largest < 4 * b.error.largest
    assert {each.name for each in found.settings} == {"method", "rtol", "atol", "step"}
    blind = rd.diff_runs(replace(a, error=None), b, tolerance=found.joints[0].largest / 2)
    assert blind.parted_s is not None and any("no estimate" in each for each in blind.left_out)
    assert rd.diff_runs(replace(a, error=None), b, tolerance=found.joints[0].largest * 2).parted_s is None


def test_samples_at_other_times_are_interpolated_without_parting() -> None:
    """What a quintic leaves between samples 0.013 s apart is allowed for, and is a part of what they part beyond."""
    a, b = coasting(loaded(1.0)), coasting(loaded(1.0), record_every_s=0.013)
    found = rd.diff_runs(a, b)
    assert a.error is not None and b.error is not None
    assert found.common < found.samples and found.fraction > 0.9 and found.parted_s is None
    assert 0 < found.interpolation <= a.error.largest + b.error.largest
    assert found.joints[0].largest <= 2 * (a.error.largest + b.error.largest) + found.interpolation
    parts = rd.diff_runs(a, coasting(loaded(1.001), record_every_s=0.013))
    t = np.linspace(0, DURATION, 5001)
    gap = abs(motion(loaded(1.0), t)[0] - motion(loaded(1.001), t)[0]).max()
    assert parts.parted_s is not None and parts.joints[0].largest == pytest.approx(gap, rel=1e-4)


BOUNCING = rd.Plant(rd.load("planar_2r"), [rd.effects.RigidStops(-1.0, 1.0, 0.6)])


def bouncing(period: float, **given: Any) -> rd.Trajectory:
    return rd.simulate(BOUNCING, [0.9, 0.2], [2.0, 1.0], duration_s=1.0, record_every_s=period, **given)


@pytest.mark.parametrize(("first", "second"), [(0.05, 0.03), (0.01, 0.013), (0.005, 0.007)])
def test_one_motion_across_impacts_does_not_part(first: float, second: float) -> None:
    """Polynomials across an impact err by 0.02 rad; at common samples both are the same to 1e-15."""
    found = rd.diff_runs(bouncing(first), bouncing(second))
    assert found.parted_s is None and found.common > 1
    errors = [run.error.largest for run in found.runs if run.error is not None]
    assert all(each.largest <= 2 * sum(errors) + found.interpolation for each in found.joints if each.quantity == "q")
    assert all(each.largest < 1e-9 for each in found.joints)  # v and u are those of common samples


def test_runs_with_few_times_in_common_are_not_said_to_be_the_same_motion() -> None:
    """Every 0.05 and 0.03 s, with an impact in most intervals: 8 common samples, between which both have others."""
    found = rd.diff_runs(bouncing(0.05), bouncing(0.03))
    assert found.parted_s is None and not found.is_conclusive and found.fraction < 0.5
    assert "record both at the same times" in found.sentence and "do not part" not in found.sentence
    page = rd.replay(bouncing(0.05), bouncing(0.03)).document
    (title,) = [each["title"] for each in page["plots"] if each["title"].startswith("difference of q")]
    assert "record both at the same times" in title and "do not part" not in title


def test_the_times_of_the_coarser_run_are_all_the_time_if_both_have_them() -> None:
    """A run every 0.05 s has nothing between two of its samples that a run every 0.01 s could be compared with."""
    found = rd.diff_runs(bouncing(0.05), bouncing(0.01))
    assert (found.samples, found.common, found.fraction) == (21, 21, 1.0)


def test_runs_without_any_time_to_compare_have_no_numbers() -> None:
    run = bouncing(0.05)
    found = rd.diff_runs(run, replace(run, t=run.t + 0.02))
    assert found.fraction < 0.5 and not found.is_conclusive
    none = rd.diff_runs(replace(run, a=np.full_like(run.a, np.nan)), replace(run, t=run.t + 0.02, a=run.a * np.nan))
    assert none.samples == 0 and none.parted_s is None and np.isnan(none.joints[0].largest) and none.fraction == 0
    assert (none.start_s, none.end_s) == (0.02, 1.0)
    assert rd.replay(run, replace(run, t=run.t + 0.02, a=run.a * np.nan)).document["plots"]


@pytest.mark.parametrize("order", [1, 2, 3])
def test_an_event_that_no_run_names_does_not_part_one_motion(order: int) -> None:
    """Q = c (t − t₀)₊ᵏ/k! on a slow sine: an impact, a jump of a force, or of its rate, anywhere between samples."""
    run, rng = coasting(FREE), np.random.default_rng(order)
    factorial = (1, 1, 2, 6)

    def recorded(period: float, kink: float, size: float) -> rd.Trajectory:
        t = np.append(np.arange(0.0, 1.0 - 1e-9, period), 1.0)
        s, beyond = np.maximum(t - kink, 0.0), t > kink
        q, v, a = (
            0.1 * np.sin(t + d * np.pi / 2)
            + (size * beyond * s ** (order - d) / factorial[order - d] if d <= order else 0.0)
            for d in range(3)
        )
        columns = {name: x[:, None] for name, x in (("q", q), ("v", v), ("a", a), ("u", 0 * q))}
        return replace(run, t=t, error=None, events=(), **columns)

    interpolated = 0
    for _ in range(80):
        periods, kink = rng.uniform(0.01, 0.1, 2), rng.uniform(0, 1)
        size = 10 ** rng.uniform(-8, 1)
        made = [recorded(h, kink, size) for h in periods]
        found = rd.diff_runs(*made, tolerance=10 ** rng.uniform(-8, -2))
        assert found.parted_s is None, (periods, kink, size)
        interpolated += found.common < found.samples
    assert interpolated > 40


@pytest.mark.parametrize("index", [0, 4, *long([1, 2, 6, 7]), *stress([3, 8, 17, 19, 20, 22, 23])])
def test_pairs_of_one_motion_do_not_part_and_pairs_that_differ_by_ten_times_their_errors_do(index: int) -> None:
    """Scenes of `run_pairs`; the whole campaign is `python -m tests.campaigns.run_pairs`."""
    one, two = one_motion(7, index), two_motions(7, index)
    assert one is not None and not one.parted, str(one)
    assert two is not None and two.parted, str(two)


def test_the_common_part_of_runs_of_different_length_is_compared_and_said() -> None:
    a, b = coasting(loaded(1.0)), coasting(loaded(1.0), duration_s=0.8)
    found = rd.diff_runs(a, b)
    assert found.end_s == DURATION and found.parted_s is None
    assert found.left_out == ("0.5 to 0.8 s, covered by run 2 only",)


@pytest.mark.parametrize("changes", ["damping", "gain", "reference", "period", "model", "start", "gravity"])
def test_each_setting_that_differs_is_named_and_no_other(changes: str) -> None:
    arm, q = rd.load("planar_2r"), np.array([0.4, -0.7])

    def run(changed: str) -> rd.Trajectory:
        is_it = lambda name: changed == name  # noqa: E731
        plan = rd.control.quintic(q, q + (0.3 if is_it("reference") else 0.2), 0.1)
        model = arm.with_(mass_scale=1.1) if is_it("model") else arm
        period = 0.002 if is_it("period") else 0.001
        law = rd.control.ComputedTorque(model, plan, kp=101.0 if is_it("gain") else 100.0, kd=20.0, period_s=period)
        moved = arm.with_(gravity=(0.0, 0.0, -1.0)) if is_it("gravity") else arm
        plant = rd.Plant(moved, [rd.effects.ViscousFriction(0.1000000001 if is_it("damping") else 0.1)])
        start = q + (0.01 if is_it("start") else 0.0)
        return rd.simulate(plant, q0=start, duration_s=0.1, controller=law, estimate_error=False)

    found = {each.name: (each.a, each.b) for each in rd.diff_runs(run(""), run(changes)).settings}
    expected = {
        "damping": {"viscous_friction.viscous": ("0.1 N m s/rad", "0.1000000001 N m s/rad")},
        "gain": {"control.kp": ("100 1/s²", "101 1/s²")},
        "period": {"control": tuple(f"ComputedTorque, every {x} s, constant between" for x in ("0.001", "0.002"))},
        "model": {"control.model.mass_scale": ("1", "1.1")},
        "start": {"start q": ("0.4, -0.7", "0.41, -0.69")},
    }
    if changes in expected:
        assert found == expected[changes]
    else:
        assert list(found) == [changes]


def test_runs_that_have_nothing_in_common_are_refused() -> None:
    run = coasting(FREE)
    other = rd.simulate(rd.load("planar_2r"), q0=[0.1, 0.2], duration_s=0.1)
    for a, b in ((run, other), (other, run)):
        with pytest.raises(QueryError, match=r"different joints .* planar_2r \(.*; compare runs of one robot"):
            rd.diff_runs(a, b)
    named = replace(run, metadata=run.metadata | {"robot": "another"})
    with pytest.raises(QueryError, match="different robots, pendulum and another"):
        rd.diff_runs(run, named)
    with pytest.raises(QueryError, match=r"no time in common: 0 to 0\.5 s and 1 to 1\.5 s"):
        rd.diff_runs(run, replace(run, t=run.t + 1))
    with pytest.raises(QueryError, match="tolerance"):
        rd.diff_runs(run, run, tolerance=0.0)


def test_files_name_their_runs_and_old_files_say_what_is_not_known(tmp_path: Path) -> None:
    for name, mass in (("light", 1.0), ("heavy", 2.0)):
        coasting(loaded(mass)).save(tmp_path / name)
    light, heavy = (rd.read(tmp_path / f"{name}.npz") for name in ("light", "heavy"))
    found = rd.diff_runs(light, heavy)
    assert found.names == ("light", "heavy") and [each.name for each in found.settings] == ["payload on rod"]
    old = replace(light, metadata={name: text for name, text in light.metadata.items() if name != "settings"})
    assert "edits" in {each.name for each in rd.diff_runs(old, heavy).settings}
    assert any("contains no settings" in each for each in rd.diff_runs(old, heavy).left_out)


def test_the_command_writes_its_figure_and_its_document(tmp_path: Path) -> None:
    """JSON has the keys that docs/reference/json.md promises; the exit code is 0 though the runs differ."""
    for name, mass in (("a", 1.0), ("b", 2.0)):
        coasting(loaded(mass)).save(tmp_path / name)
    paths = (tmp_path / "a.npz", tmp_path / "b.npz")
    found = document("diff-runs", *paths)
    check_document("diff-runs", found)
    assert found["joints"] and found["settings"]
    assert ran("diff-runs", *paths, "-o", tmp_path / "d.svg", "--csv", tmp_path / "d.csv").returncode == 0
    assert (tmp_path / "d.svg").read_bytes().startswith(b"<?xml")
    assert (tmp_path / "d.csv").read_text(encoding="utf-8").startswith("joint,quantity,unit,rms,largest,at_s\n")


def test_runs_are_named_by_both_settings_in_which_they_differ() -> None:
    """By one where one differs, by both where two do; "…" says that more than two differ. Pages have the same names."""
    arm, q = rd.load("planar_2r"), np.array([0.4, -0.7])

    def run(kp: float, kd: float, damping: float = 0.1) -> rd.Trajectory:
        law = rd.control.PD(rd.control.hold(q + 0.1), kp=kp, kd=kd)
        plant = rd.Plant(arm, [rd.effects.ViscousFriction(damping)])
        return rd.simulate(plant, q0=q, duration_s=0.05, controller=law, estimate_error=False)

    a = run(100.0, 20.0)
    one = rd.diff_runs(a, run(400.0, 20.0)).names
    assert one == ("control.kp 100 N m/rad", "control.kp 400 N m/rad")
    two = rd.diff_runs(a, run(400.0, 40.0)).names
    assert two == ("kp 100, kd 20", "kp 400, kd 40")
    assert all(each.endswith(", …") for each in rd.diff_runs(a, run(400.0, 40.0, 0.2)).names)
    title = rd.replay(a, run(400.0, 20.0)).document["title"]
    assert title == f"planar_2r: {one[0]} / {one[1]} (transparent, dashed)"


def test_titles_of_many_joints_with_long_names_do_not_overlap() -> None:
    """12 joints in rows of 4, on paper and on the narrower page; names stay distinct by their ends."""
    from matplotlib.text import Text

    names = [f"left_hand_middle_finger_distal_phalanx_flexion_joint_{k}" for k in range(12)]
    arm = rd.Robot.from_text(chain(*[body()] * 12, names=names))
    a, b = (rd.simulate(arm, q0=np.full(12, q), duration_s=0.02, estimate_error=False) for q in (0.0, 0.1))
    for theme in ("light", "page"):
        figure = draw(rd.diff_runs(a, b), theme)
        figure.draw_without_rendering()
        parts: list[Any] = [text for axes in figure.axes for text in axes.get_children() if isinstance(text, Text)]
        titles = [text for text in parts if "joint_" in text.get_text()]
        assert len({title.get_text() for title in titles}) == 12
        for one, other in combinations([title.get_window_extent() for title in titles], 2):
            assert not one.overlaps(other)
