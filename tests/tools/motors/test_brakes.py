"""Brakes that hold an arm: closed forms of a planar arm, the bound Σ m g r, and the verdict of a budget."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn.foundations import search_box
from robot_dyn.model import gravity_bound
from robot_dyn.tools.motors import Motors, max_payload, read_motors

PLANAR = rd.load("planar_2r")
PLAN = rd.control.quintic([0.1, 0.4], [0.5, -0.2], 0.9)
G = 9.80665


def planar_arm() -> tuple[tuple[float, float], tuple[float, float], float]:
    """Masses, distances of the centres from the joints, and the length of the first link, of the description."""
    first, second = (PLANAR.model.inertias[j] for j in (1, 2))
    c1, c2 = (float(np.linalg.norm(x.lever)) for x in (first, second))
    return (first.mass, second.mass), (c1, c2), float(np.linalg.norm(PLANAR.model.jointPlacements[2].translation))


def motors(*brakes: float) -> Motors:
    names = PLANAR.joint_names
    return Motors(dict.fromkeys(names, 100.0), {}, {}, {}, brake=dict(zip(names, brakes, strict=False)))


def test_a_planar_arm_is_heaviest_when_stretched_and_level() -> None:
    """Both g (m1 c1 + m2 (l1 + c2)) and g m2 c2 are the largest torque found, and the bound."""
    (m1, m2), (c1, c2), l1 = planar_arm()
    expected = [G * (m1 * c1 + m2 * (l1 + c2)), G * m2 * c2]
    budget = rd.tools.motors.budget(PLAN, PLANAR, motors=motors(40.0, 4.0))
    holding = [joint.holding for joint in budget.joints]
    assert [x and x.gravity for x in holding] == pytest.approx(expected, rel=1e-9)  # L-BFGS-B: (1e-5)² at a maximum
    assert [x and x.bound for x in holding] == pytest.approx(expected, rel=1e-12)
    assert [x and x.factor for x in holding] == pytest.approx([40.0 / expected[0], 4.0 / expected[1]], rel=1e-9)
    assert budget.joints[0].too_small == ()
    assert budget.joints[1].too_small == ("brake",)
    assert not budget.fits


def test_a_payload_weighs_on_the_brakes() -> None:
    (m1, m2), (c1, c2), l1 = planar_arm()
    tip = rd.Payload(PLANAR.frame_names[-1], 2.0, (0.0, 0.0, 0.0))
    place = np.linalg.norm(PLANAR.placement(np.zeros(2), tip.frame)[:3, 3])
    holding = rd.tools.motors.budget(PLAN, PLANAR, payload=tip, motors=motors(80.0)).joints[0].holding
    assert holding
    reach = float(place) - np.linalg.norm(PLANAR.model.jointPlacements[1].translation)
    assert holding.gravity == pytest.approx(G * (m1 * c1 + m2 * (l1 + c2) + 2.0 * reach), rel=1e-9)


def test_the_largest_payload_is_the_mass_that_the_brake_holds() -> None:
    """Brake torque G (m₁ c₁ + m₂ (l₁ + c₂) + m reach), of the straight arm."""
    (m1, m2), (c1, c2), l1 = planar_arm()
    frame = PLANAR.frame_names[-1]
    place = np.linalg.norm(PLANAR.placement(np.zeros(2), frame)[:3, 3])
    reach = float(place) - np.linalg.norm(PLANAR.model.jointPlacements[1].translation)
    bare = G * (m1 * c1 + m2 * (l1 + c2))
    most = max_payload(rd.tools.motors.budget(PLAN, PLANAR, motors=motors(bare + 3.0 * G * reach), effort=1e4), frame)
    assert most.mass == pytest.approx(3.0, rel=1e-8) and (most.limit, most.joint) == ("brake", PLANAR.joint_names[0])
    assert max_payload(rd.tools.motors.budget(PLAN, PLANAR, motors=motors(0.9 * bare), effort=1e4), frame).mass is None


@pytest.mark.parametrize("name", ["ur5", "panda", "kinova", "baxter"])
def test_no_torque_of_gravity_is_above_the_bound(name: str) -> None:
    """At 2 000 positions, to rounding; as mounted and turned, also with coupled and prismatic joints."""
    arm = rd.load(name)
    low, high = search_box(arm.lower, arm.upper, arm.joint_types)
    q = np.random.default_rng(3).uniform(low, high, (2000, arm.n))
    for gravity in ((0.0, 0.0, -G), (3.0, -7.0, 1.0)):
        turned = arm.with_(gravity=gravity)
        bound = gravity_bound(turned.model, turned.couplings)
        assert (np.abs(turned.N(q)).max(axis=0) <= bound + 1e-12 * np.abs(bound[np.isfinite(bound)]).max()).all()


def test_the_first_joint_of_an_upright_arm_holds_nothing() -> None:
    arm = rd.load("ur5")
    plan = rd.control.quintic(np.zeros(6), np.full(6, 0.2), 1.0)
    limits = Motors({arm.joint_names[0]: 150.0}, {}, {}, {}, brake={arm.joint_names[0]: 5.0})
    holding = rd.tools.motors.budget(plan, arm, motors=limits).joints[0].holding
    assert holding
    assert (holding.gravity, holding.factor) == (0.0, np.inf)
    assert holding.bound == pytest.approx(0.0, abs=1e-12)


def test_the_brake_of_a_run_and_of_the_fastest_motion_is_judged() -> None:
    run = rd.simulate(PLANAR, [0.1, 0.4], duration_s=0.02)
    assert rd.tools.motors.budget(run, motors=motors(1.0)).joints[0].too_small == ("brake",)
    pytest.importorskip("toppra")
    limited = replace(motors(1.0), speed=dict.fromkeys(PLANAR.joint_names, 5.0))
    fastest = rd.tools.motors.fastest(rd.tools.motors.budget(PLAN, PLANAR, motors=limited))
    assert fastest.budget.joints[0].too_small == ("brake",)


def test_a_brake_at_the_motor_holds_the_ratio_times_its_torque(tmp_path: Path) -> None:
    (tmp_path / "motors.csv").write_text(
        "joint,peak [N m],brake [N m],gear_ratio,at\na,1,0.5,100,motor\nb,3,2,,joint\n"
    )
    assert read_motors(tmp_path / "motors.csv").brake == {"a": 50.0, "b": 2.0}
