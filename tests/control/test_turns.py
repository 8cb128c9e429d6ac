"""Whole turns in recorded angles: joined where a continuous joint turned on for certain, told and left elsewhere."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn.foundations import PlanWarning

LINK = '<inertial><mass value="2"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'


def urdf(kind: str = "continuous", lower: float = 0.0, upper: float = 0.0, speed: float = 50.0) -> str:
    """Two links: the joint j of a kind turns about z, and s slides."""
    limit = '<limit lower="{}" upper="{}" effort="9" velocity="{}"/>'
    return (
        f'<robot name="turner"><link name="w"/><link name="a">{LINK}</link><link name="b">{LINK}</link>'
        f'<joint name="j" type="{kind}"><parent link="w"/><child link="a"/><axis xyz="0 0 1"/>'
        f'{limit.format(lower, upper, speed)}</joint><joint name="s" type="prismatic"><parent link="a"/>'
        f'<child link="b"/><axis xyz="1 0 0"/>{limit.format(-20, 20, 50.0)}</joint></robot>'
    )


def arm(*description: Any) -> rd.Robot:
    return rd.Robot.from_text(urdf(*description))


def wrapped(q: np.ndarray, least: float = -np.pi) -> np.ndarray:
    """Angles as a driver reports them, in one turn from the least."""
    return (q - least) % (2 * np.pi) + least


def planned(robot: rd.Robot, t: np.ndarray, q: np.ndarray, ends: str = "measured") -> rd.control.Plan:
    return rd.control.from_samples(robot, {"t": t, "j": q, "s": 0 * t}, unit="rad", ends=ends)


def named(findings: tuple[str, ...]) -> list[tuple[str, int, float]]:
    """Joint, sample and time of each finding that names a sample."""
    matches = [re.search(r"^(\w+) .* at sample (\d+), (\S+) s;", each) for each in findings]
    return [(match[1], int(match[2]), float(match[3])) for match in matches if match]


@pytest.mark.parametrize("speed", [50.0, 2.5])
@pytest.mark.parametrize("count", [8, 40])
@pytest.mark.parametrize("least", [-np.pi, 0.0])
def test_a_steady_turn_is_planned_at_its_speed(least: float, count: int, speed: float) -> None:
    """2 rad/s, sampled every 0.5 s: as recorded it would be 36 rad/s. No noise is told, and no other finding."""
    t = 0.5 * np.arange(count)
    plan = planned(arm("continuous", 0.0, 0.0, speed), t, wrapped(2.0 * t, least))
    assert plan.peaks["velocity"][0] == pytest.approx(2.0, rel=1e-9)
    first = int(np.flatnonzero(np.abs(np.diff(wrapped(2.0 * t, least))) > np.pi)[0]) + 1
    assert named(plan.findings) == [("j", first + 1, t[first])]
    assert len(plan.findings) == 1


@pytest.mark.parametrize("seed", range(12))
def test_wrapped_samples_give_the_motion_of_the_angles_themselves(seed: int) -> None:
    """Random smooth motions of several turns, with steps of up to 1.5 rad, at uneven times, rounded to 6 decimals."""
    rng = np.random.default_rng(seed)
    t = np.cumsum(rng.uniform(0.5, 1.0, 80))
    shape = sum(rng.normal() * np.sin(w * t + rng.uniform(0, 6)) / w for w in (0.15, 0.3, 0.5)) + rng.normal() * t
    q = shape * 1.5 / np.abs(np.diff(shape)).max() + rng.uniform(-3, 3)
    recorded = np.round(wrapped(q, rng.uniform(-7, 4)), 6)
    plan, other = planned(arm(), t, recorded), planned(arm(), t, q - q[0] + recorded[0])
    at = np.linspace(t[0], t[-1], 2000)
    for mine, its in zip(plan.reference.at(at)[:2], other.reference.at(at)[:2], strict=True):
        np.testing.assert_allclose(mine, its, atol=1e-4)  # 1e-6 of rounding, which a spline of uneven times magnifies
    assert bool(named(plan.findings)) == (np.abs(np.diff(recorded)).max() > np.pi)


def test_noise_at_the_end_of_a_turn_is_no_motion() -> None:
    """A joint that rests at π with an encoder's noise jumps by a whole turn at every other sample."""
    t = 0.01 * np.arange(200)
    q = np.pi + 1e-3 * np.random.default_rng(1).normal(size=200)
    plan = planned(arm(), t, wrapped(q))
    assert np.ptp(plan.reference.at(t)[0][:, 0]) < 0.01
    assert any("noise" in each for each in plan.findings)


T = 0.5 * np.arange(24)
LEFT = {
    "a continuous joint beyond one turn": (arm(), np.where(T < 8, T, T - 2 * np.pi) - 4.0, 8.0),
    "limits of two turns": (arm("revolute", -2 * np.pi, 2 * np.pi, 3.0), wrapped(T), 3.5),
    "limits of two turns, beyond one": (
        arm("revolute", -2 * np.pi, 2 * np.pi, 3.0), np.where(T < 8, T, T - 2 * np.pi) - 4.0, 8.0
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", LEFT)
def test_elsewhere_a_whole_turn_is_told_with_its_sample_and_nothing_is_changed(case: str) -> None:
    """Noise is not told of it: what it says, smooth the samples, would be wrong."""
    robot, q, time = LEFT[case]
    plan = planned(robot, T, q)
    np.testing.assert_allclose(plan.reference.at(T)[0][:, 0], q, atol=1e-9)
    (found,) = [each for each in plan.findings if "whole turn" in each]
    said = re.search(r"^j .* from (\S+) to (\S+) rad in 0.5 s at (\S+) s", found)
    assert said is not None
    k = int(np.searchsorted(T, time)) - 1
    assert [float(x) for x in said.groups()] == pytest.approx([q[k], q[k + 1], T[k]], abs=1e-3)
    assert not any("noise" in each for each in plan.findings)


@pytest.mark.parametrize("q", [[0.0, 0.0, 3.5, 3.5], [0.0, 3.5], [-2.0, 2.0, -2.0, 2.0], [0.0, -3.0, 3.0, 0.0]])
def test_way_points_more_than_half_a_turn_apart_are_told_and_kept(q: list[float]) -> None:
    t = 3.0 * np.arange(len(q))
    plan = planned(arm(), t, np.array(q), ends="rest")
    np.testing.assert_allclose(plan.reference.at(t)[0][:, 0], q, atol=1e-9)
    k = int(np.argmax(np.abs(np.diff(q)) > np.pi))
    assert named(plan.findings) == [("j", k + 2, t[k + 1])]


@pytest.mark.parametrize(
    ("robot", "q"),
    [
        (arm(), 1.2 * T),  # joined already
        (arm(), 10.0 * T),  # a wheel: 5 rad between samples, all alike
        (arm(), 3.0 * np.sin(T)),  # within one turn, and never by more than half of one
        (arm("revolute", -2 * np.pi, 2 * np.pi, 12.0), 5.0 * np.sin(0.7 * T)),
        (arm("revolute", -2 * np.pi, 2 * np.pi), np.array([-2.5, 2.0])),
        (arm("prismatic", -20, 20), wrapped(2 * T)),
    ],
)
def test_a_motion_without_whole_turns_is_taken_as_it_is(robot: rd.Robot, q: np.ndarray) -> None:
    t = T[: len(q)] * (1 if len(q) > 2 else 8)
    plan = planned(robot, t, q)
    np.testing.assert_allclose(plan.reference.at(t)[0][:, 0], q, atol=1e-9 * max(np.abs(q).max(), 1))
    assert not any("turn" in each for each in plan.findings)


def test_the_table_of_a_run_is_never_joined() -> None:
    """Its velocities determine the motion: 5 rad in 2 s, between two samples."""
    robot = arm()
    run = rd.simulate(robot, q0=[0.0, 0.0], v0=[2.5, 0.0], duration_s=4.0, record_every_s=2.0)
    plan = rd.control.from_samples(robot, {name: x[:2] for name, x in run.table().items()}, ends="measured")
    assert plan.reference.at(2.0)[0][0] == pytest.approx(run.q[1, 0], abs=1e-9)
    assert not plan.findings


@pytest.mark.parametrize("kind", ["samples", "via_points"])
def test_references_of_scenes_are_joined_and_warn(tmp_path: Path, kind: str) -> None:
    t = 0.5 * np.arange(1, 9)
    (tmp_path / "arm.urdf").write_text(urdf())
    rows = np.column_stack([t, wrapped(2.0 * t), 0 * t])
    np.savetxt(tmp_path / "log.csv", rows, delimiter=",", header="t [s],j [rad],s [m]", comments="")
    ends = 'ends = "measured"' if kind == "samples" else ""
    (tmp_path / "scene.toml").write_text(
        f'robot = "arm.urdf"\nduration_s = 1.0\n[control]\nkind = "pd"\nkp = 1.0\nkd = 1.0\n'
        f'[reference]\nkind = "{kind}"\nfile = "log.csv"\n{ends}\n'
    )
    with pytest.warns(PlanWarning, match=r"j jumps by a whole turn .* at sample 4, 2 s"):
        setup = rd.read_scene(tmp_path / "scene.toml")
    np.testing.assert_allclose(setup.controller.reference.at(t)[0][:, 0], 2.0 * t, atol=1e-9)
