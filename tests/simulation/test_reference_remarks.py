"""Remarks on references: where one jumps against the joint, and where friction holds a joint that should move."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn.simulation import Remark, RemarkKind

ARM = rd.load("planar_2r")
PLANT = rd.Plant(ARM, [rd.effects.ViscousFriction(0.3)])
TIMES = np.array([0.0, 0.2, 0.5, 0.7, 1.0])
POINTS = np.stack([0.1 + np.sin(3 * TIMES), np.cos(2 * TIMES) - 1.2], axis=1)  # from (0.1, −0.2)
START, END = POINTS[0], [0.9, 0.3]


def found(
    kind: RemarkKind, reference: Any, v0: Any = None, plant: rd.Plant = PLANT, kp: Any = 20.0
) -> tuple[Remark, ...]:
    law = rd.control.PD(reference, kp=kp, kd=3.0)
    run = rd.simulate(plant, START, v0, duration_s=0.8, controller=law, estimate_error=False, engine="interpreted")
    return tuple(each for each in run.remarks if each.kind is kind)


def test_way_points_as_samples_jump_in_velocity() -> None:
    """Through five points goes one polynomial of degree 4, whose slope at the start is known."""
    slope = np.array([np.polyder(np.polyfit(TIMES, column, 4))[-1] for column in POINTS.T])
    remarks = found(RemarkKind.JUMPS, rd.control.Samples(TIMES, POINTS))
    assert [(each.joint, each.quantity, each.at_s, each.limit) for each in remarks] == [("joint_1", "v", 0.0, 0.0)]
    assert remarks[0].value == pytest.approx(slope[0], rel=1e-9) and abs(slope[0]) > 2.5
    assert "joint_1 from 0 to 2.9" in remarks[0].text and "rd.control.via_points" in remarks[0].remedy


@pytest.mark.parametrize(
    ("reference", "v0", "jumps"),
    [
        (rd.control.via_points(TIMES, POINTS), None, []),
        (rd.control.quintic(START, END, 0.5, start_s=0.1), None, []),
        (rd.control.hold(END), None, []),  # a set point
        (
            rd.control.Samples(TIMES, POINTS, np.stack([3 * np.cos(3 * TIMES), -2 * np.sin(2 * TIMES)], axis=1)),
            [3.0, 0.0],
            [],
        ),
        (rd.control.via_points(TIMES, POINTS), [0.0, 0.4], [("joint_2", "v", 0.0, 0.0, 0.4)]),
        (rd.control.quintic(START + np.array([0.0, 0.2]), END, 0.5), None, [("joint_2", "q", 0.0, 0.0, -0.2)]),
        (rd.control.quintic(START, END, 0.5, start_s=0.1, v0=[0.7, 0.0]), None, [("joint_1", "v", 0.1, 0.7, 0.0)]),
        (rd.control.quintic(START, END, 0.5, start_s=0.9, v0=[0.7, 0.0]), None, []),  # after the end
    ],
    ids=["from rest", "later", "set point", "as fast", "moving", "elsewhere", "later and moving", "never"],
)
def test_a_reference_that_begins_otherwise_than_the_joint_is_remarked(reference, v0, jumps) -> None:
    """By more than a hundredth of its range, or of its largest velocity."""
    said = found(RemarkKind.JUMPS, reference, v0)
    assert [(each.joint, each.quantity) for each in said] == [each[:2] for each in jumps]
    for each, expected in zip(said, jumps, strict=True):
        assert (each.at_s, each.value, each.limit) == pytest.approx(expected[2:], abs=1e-12)


@pytest.mark.parametrize(("stiffness", "holds"), [(9.0, True), (11.0, False)])
def test_a_joint_that_friction_holds_throughout_is_remarked(stiffness: float, holds: bool) -> None:
    """Without gravity |u| reaches kp · 0.5 rad + kd · the largest speed of the quintic, 15/8 · 0.5 / 0.4 rad/s.

    With kd = 0 the level of 5 N m holds it up to kp = 10 N m/rad.
    """
    still = ARM.with_(gravity=(0.0, 0.0, 0.0), lock={"joint_1": 0.3})
    plant, q0 = rd.Plant(still, [rd.effects.DryFriction(5.0)]), np.array([-0.2])
    law = rd.control.PD(rd.control.quintic(q0, [0.3], 0.4), kp=stiffness, kd=0.0)
    run = rd.simulate(plant, q0, duration_s=0.8, controller=law, estimate_error=False, engine="interpreted")
    assert (np.ptp(run.q) == 0) == holds
    said = [each for each in run.remarks if each.kind is RemarkKind.HELD]
    assert [(each.joint, each.value) for each in said] == [("joint_2", -0.2)] * holds
    if holds:
        assert said[0].limit == pytest.approx(0.5, rel=1e-12)
        assert "held by friction at every step: joint_2 at -0.2 rad" in run.summary


def test_a_batch_tells_in_which_runs_a_joint_is_held_or_the_reference_jumps() -> None:
    """Each run as `simulate` does: held up to kp = 10 N m/rad, as above; from elsewhere the reference jumps."""
    still = ARM.with_(gravity=(0.0, 0.0, 0.0), lock={"joint_1": 0.3})
    law = rd.control.PD(rd.control.quintic([-0.2], [0.3], 0.4), kp=9.0, kd=0.0)
    setup = rd.Setup(rd.Plant(still, [rd.effects.DryFriction(5.0)]), [-0.2], duration_s=0.6, controller=law)
    starts, stiffness = np.array([[-0.2], [-0.2], [-0.1], [-0.35]]), np.array([9.0, 14.0, 9.5, 8.0])
    runs = rd.rollouts(setup, starts, vary={"kp": stiffness}, engine="interpreted")
    said = {each.kind: each for each in runs.remarks if each.kind in (RemarkKind.JUMPS, RemarkKind.HELD)}
    assert said[RemarkKind.JUMPS].runs == (3, 2) and "joint_2 from -0.35 to -0.2 rad" in said[RemarkKind.JUMPS].text
    assert said[RemarkKind.HELD].runs == (0, 2) and said[RemarkKind.HELD].looked == 4
    for i in range(4):
        alone = rd.simulate(runs.setup_of(i), estimate_error=False, engine="interpreted").remarks
        assert {each.kind for each in alone} >= {kind for kind in said if i in said[kind].runs}
        assert [x for x in runs[i].remarks if x.kind in said] == [x for x in alone if x.kind in said]


def test_the_summary_says_how_often_the_estimate_calls_code_of_the_user() -> None:
    """Each of its companions runs all of it again; built-in parts are not worth a line."""
    runs, calls = {}, [0]

    def law(t: float, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        calls[0] += 1
        return -20 * (q - END) - 3 * v

    for name, control, estimate in (
        ("bare", law, False),
        ("law", law, True),
        ("PD", rd.control.PD(rd.control.hold(END), kp=20, kd=3), True),
    ):
        calls[0] = 0
        run = rd.simulate(PLANT, START, duration_s=0.05, controller=control, estimate_error=estimate)
        runs[name] = run.summary, run.statistics, calls[0]
    _, statistics, count = runs["law"]
    assert count - runs["bare"][2] >= statistics.companion_evaluations > statistics.evaluations
    assert statistics.companion_runs >= 2 and statistics.user_code == "law"
    assert (
        f"in {statistics.companion_runs} companion runs, which call law as well; estimate_error=False" in runs["law"][0]
    )
    assert not any("companion runs" in runs[name][0] for name in ("bare", "PD"))
