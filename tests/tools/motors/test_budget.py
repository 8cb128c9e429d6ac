"""Budgets of motors: against Pinocchio's inverse dynamics on its own model, closed forms and energy; payloads, runs."""

from __future__ import annotations

import re
import subprocess
import sys
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

import robot_dyn as rd
from robot_dyn.effects import TorqueSpeed
from robot_dyn.foundations import EditError, EffectError, PlanError, QueryError
from robot_dyn.tools.motors import budget, fastest, max_payload
from robot_dyn.tools.motors.motor_budget.cells import GAUSS, KRONROD, X
from robot_dyn.tools.motors.motor_budget.pace import Limits, least_pace
from tests.command import document, refusal
from tests.command import run as ran
from tests.long import long
from tests.promised import check_document

UR5 = rd.load("ur5")
POINTS = np.array(  # pick, lift, carry, place
    [
        [0.1, -1.2, 1.9, -2.2, -1.5, 0.2],
        [0.2, -1.5, 1.6, -1.7, -1.4, 0.4],
        [0.9, -1.3, 1.4, -1.6, -1.6, 0.9],
        [1.4, -1.1, 1.8, -2.1, -1.5, 1.3],
    ]
)
TIMES = [0.0, 0.6, 1.1, 1.7]
PLAN = rd.control.from_samples(UR5, POINTS, time=TIMES)
LOAD = rd.Payload("wrist_3_link", 5.0, (0.12, 0.03, 0.05))
FRICTION = [rd.effects.ViscousFriction(1.5), rd.effects.DryFriction([4.0, 5.0, 3.0, 1.0, 1.0, 1.0], 6.0)]
ROD = rd.load("simple_pendulum")  # one joint
FREE = ROD.with_(gravity=(0.0, 0.0, 0.0))
INERTIA = float(ROD.M(np.array([0.3]))[0, 0])
toppra = pytest.mark.skipif(find_spec("toppra") is None, reason="the extra plan")


def with_appended_body(arm: rd.Robot, load: rd.Payload, armature: float = 0.0) -> tuple[Any, Any]:
    """Pinocchio's own model of an arm's file, with the payload appended to the joint of its link."""
    model: Any = pin.buildModelFromXML(arm.description.text.decode())
    frame = model.frames[model.getFrameId(load.frame)]
    body = pin.Inertia(load.mass, np.array(load.com), np.zeros((3, 3)))
    model.appendBodyToJoint(frame.parentJoint, body, frame.placement)
    model.armature, model.gravity.linear = np.full(6, armature), np.array(rd.STANDARD_GRAVITY)
    return model, model.createData()


def test_a_pick_and_place_with_5_kg_asks_for_the_torque_of_pinocchio() -> None:
    """At 1000 times to 1e-12 of the largest torque; and no peak at 20 000 other times is above that of the budget."""
    found = budget(PLAN, UR5.with_(armature=0.3), payload=LOAD)
    model, data = with_appended_body(UR5, LOAD, 0.3)
    split = found.demand.split
    rows = np.linspace(0, len(split.t) - 1, 1000).astype(int)
    states = zip(*PLAN.reference.at(split.t[rows]), strict=True)
    tau = np.array([pin.rnea(model, data, q, v, a) for q, v, a in states])
    size = np.abs(tau).max()
    np.testing.assert_allclose(split.tau[rows], tau, rtol=0, atol=1e-12 * size)
    dense = np.linspace(0.0, TIMES[-1], 20_001)
    other = np.array([pin.rnea(model, data, *each) for each in zip(*PLAN.reference.at(dense), strict=True)])
    peaks = np.array([each.peak for each in found.joints])
    # a maximum between 20 001 times is missed by τ̈ h²/8: 1e4 N m/s² · (8.5e-5 s)² / 8
    assert (np.abs(other).max(axis=0) <= peaks + 1e-12 * size).all()
    np.testing.assert_allclose(np.abs(other).max(axis=0), peaks, rtol=0, atol=1e-5)
    mean = np.trapezoid(other**2, dense, axis=0) / TIMES[-1]  # smooth: O(h²) of the ends
    np.testing.assert_allclose([each.rms for each in found.joints], np.sqrt(mean), rtol=1e-6)
    assert found.error < 1e-4


@pytest.mark.parametrize("plant", [UR5, rd.Plant(UR5, [*FRICTION, rd.effects.Spring(3.0, POINTS[0])])])
def test_causes_add_up_to_the_torque_and_their_parts_to_its_rms(plant) -> None:
    """To 1e-12 of the largest torque."""
    found = budget(PLAN, plant, payload=LOAD)
    split = found.demand.split
    assert np.abs(split.unexplained).max() <= 1e-12 * np.abs(split.tau).max()
    for each in found.joints:
        assert abs(sum(each.of_peak.values())) == pytest.approx(each.peak, rel=1e-12)
        assert sum(each.of_rms.values()) == pytest.approx(each.rms, rel=1e-12)


def test_a_joint_without_load_has_the_closed_forms_of_the_quintic() -> None:
    """I a with a = Δ/T² (60 s − 180 s² + 120 s³): peak 10/√3, rms √(120/7); energy ½ I (15/8 Δ/T)², all of it back."""
    delta, T = 1.3, 0.8
    (joint,) = budget(rd.control.quintic([0.2], [0.2 + delta], T), FREE).joints
    assert joint.peak == pytest.approx(INERTIA * 10 / np.sqrt(3) * delta / T**2, rel=1e-9)
    assert joint.rms == pytest.approx(INERTIA * np.sqrt(120 / 7) * delta / T**2, rel=1e-9)
    assert joint.speed == pytest.approx(15 / 8 * delta / T, rel=1e-9) and joint.speed_at_s == pytest.approx(T / 2)
    kinetic = INERTIA / 2 * (15 / 8 * delta / T) ** 2
    assert (joint.energy, joint.regenerated) == pytest.approx((kinetic, kinetic), rel=1e-5)  # P has a kink
    assert joint.mean_power == pytest.approx(0.0, abs=1e-9)


def test_both_sides_of_a_jump_of_the_acceleration_count() -> None:
    """+A, then −2A: the peak is 2 I A, and its rms the root of the mean square."""
    A, T = 3.0, 0.5
    motion = rd.control.PiecewisePolynomial(
        [0.0, T, 1.5 * T], [[[0.0], [0.0], [A / 2]], [[A / 2 * T**2], [A * T], [-A]]]
    )
    (joint,) = budget(motion, FREE).joints
    assert joint.peak == pytest.approx(2 * INERTIA * A, rel=1e-12)
    assert joint.rms == pytest.approx(INERTIA * A * np.sqrt(2.0), rel=1e-12)


def test_the_work_of_the_motors_is_the_change_of_potential_energy_and_what_friction_takes() -> None:
    """∫ τ v dt = ΔV + ∫ b v² dt + f ∫ |v| dt, of each sum; the integrals of the motion by the trapezoidal rule."""
    found = budget(PLAN, rd.Plant(UR5, FRICTION), payload=LOAD)
    t = np.linspace(0.0, TIMES[-1], 200_001)
    q, v, _ = PLAN.reference.at(t)
    loaded = UR5.with_(payload=LOAD)
    taken = np.trapezoid(1.5 * v**2 + np.array([4.0, 5.0, 3.0, 1.0, 1.0, 1.0]) * np.abs(v), t, axis=0).sum()
    gained = loaded.potential_energy(q[-1]) - loaded.potential_energy(q[0])
    given = sum(each.energy - each.regenerated for each in found.joints)
    assert given == pytest.approx(gained + taken, rel=1e-7)
    assert given == pytest.approx(found.duration_s * sum(each.mean_power for each in found.joints), rel=1e-9)


def test_a_joint_breaks_away_against_its_load_and_static_friction() -> None:
    """From rest: τ_b = N + f_s; it counts for the peak torque, whose limit it passes though the motion does not."""
    plant = rd.Plant(ROD, [rd.effects.DryFriction(0.5, 4.0)])
    motion = rd.control.quintic([0.7], [0.9], 5.0)
    load = float(ROD.N(np.array([0.7]))[0])
    (joint,) = budget(motion, plant, effort=100.0).joints
    assert load > 0 and joint.static_friction == 4.0 and joint.breakaway_at_s == 0.0
    assert joint.breakaway == pytest.approx(load + 4.0, rel=1e-9)
    found = budget(motion, plant, effort=(joint.breakaway + joint.peak) / 2)
    assert joint.peak < joint.breakaway and not found.fits and "to break away" in found.sentence
    (resting,) = budget(rd.control.hold([0.7]), plant, effort=100.0).joints
    assert np.isnan(resting.breakaway) and resting.peak == pytest.approx(load, rel=1e-12)


def test_rules_are_exact_for_their_degrees() -> None:
    """∫ xᵏ over [−1, 1], to 11 and 5; beyond that they are not."""
    for rule, degree in ((KRONROD, 11), (GAUSS, 5)):
        errors = [abs(float(rule @ X**k) - (1 + (-1) ** k) / (k + 1)) for k in range(degree + 2)]
        assert max(errors[:-1]) < 1e-14 < errors[-1]


def test_the_rotor_of_a_motor_acts_as_armature_where_the_arm_has_none(tmp_path: Path) -> None:
    """n² J a on top, and torques at the shaft times n."""
    file = tmp_path / "motors.csv"
    file.write_text(
        "joint,peak [N m],continuous [N m],speed [rpm],gear_ratio,rotor_inertia [kg m^2],at\n"
        + f"{ROD.joint_names[0]},2,1,3000,50,1e-4,motor\n"
    )
    motors, motion = rd.tools.motors.read_motors(file), rd.control.quintic([0.2], [1.5], 0.8)
    (bare,), (joint,) = (
        budget(motion, FREE).joints,
        budget(motion, FREE, motors=motors).joints,
    )
    assert joint.peak == pytest.approx(bare.peak * (1 + 0.25 / INERTIA), rel=1e-9)
    assert (joint.peak_limit, joint.continuous_limit) == (100.0, 50.0)
    assert joint.speed_limit == pytest.approx(3000 * np.pi / 30 / 50)
    assert joint.headroom["continuous"] == pytest.approx(1 - joint.rms / 50)
    with pytest.raises(PlanError, match=r"the rotor of .* the arm has 0\.5"):
        budget(motion, FREE.with_(armature=0.5), motors=motors)


def test_a_limit_that_is_passed_is_named_with_the_cause_that_asks_for_it() -> None:
    found = budget(PLAN, UR5, payload=LOAD, effort={"shoulder_lift_joint": 60.0}, continuous=90.0, velocity=0.9)
    small = {each.joint: each.too_small for each in found.joints if each.too_small}
    assert small["shoulder_lift_joint"][0] == "peak" and not found.fits
    assert all(kinds[-1] == "speed" for kinds in small.values() if "speed" in kinds)
    lift = found.joints[1]
    assert f"shoulder_lift_joint needs {lift.peak:.4g} N m (limit 60)" in found.sentence
    assert "for gravity" in found.sentence
    assert any("the peak torque limit of shoulder_pan_joint" in each for each in found.findings)
    free = budget(rd.control.quintic([0.0], [1.0], 1.0), FREE, effort=np.inf, velocity=np.inf)
    assert free.fits and "no limits are known" in free.sentence
    some = budget(PLAN, UR5)  # its file states no continuous torque
    assert "the motors suffice where limits are known; " in some.sentence
    every = budget(PLAN, UR5, continuous=100.0)
    assert "the motors suffice; " in every.sentence


@pytest.mark.parametrize("continuous", [*long([np.inf]), [150.0, 45.0, 40.0, 20.0, 20.0, 20.0]])
def test_the_largest_payload_is_that_of_budgets_with_many_masses(continuous) -> None:
    """Every mass up to it fits, none of those beyond; with it a limit is reached to 1e-9."""
    plant, com = rd.Plant(UR5, FRICTION), (0.1, 0.02, 0.08)
    found = max_payload(budget(PLAN, plant, continuous=continuous), "wrist_3_link", com)
    assert found.mass is not None and found.least == 0.0
    assert found.limit in (("continuous torque",) if np.ndim(continuous) else ("peak torque", "break-away torque"))
    assert found.largest_share == pytest.approx(1.0, abs=1e-9)
    tolerated = 1.01  # the budget tolerates a thousandth of the limit, some 2e-3 of the mass
    for factor, fits in ((0.5, True), (0.999, True), (2.0, False)):
        loaded = budget(
            PLAN, plant, payload=rd.Payload("wrist_3_link", factor * found.mass, com), continuous=continuous
        )
        assert loaded.fits == fits, factor
    beyond = budget(PLAN, plant, payload=rd.Payload("wrist_3_link", tolerated * found.mass, com), continuous=continuous)
    assert [each.joint for each in beyond.joints if each.too_small] == [found.joint]


@pytest.mark.parametrize("side", [1, -1])
@pytest.mark.parametrize("kind", ["effort", "continuous"])
def test_the_payload_of_a_held_rod_balances_its_weight(side: int, kind: str) -> None:
    """Held at q: τ = N + m g x sin q. On the other side it is a counterweight: too light a one does not do, either."""
    q, x, limit = 0.8, 0.4, 1.7
    N = float(ROD.N(np.array([q]))[0])
    per_mass = float(ROD.with_(payload=rd.Payload("bar", 1.0, (0.0, 0.0, -side * x))).N(np.array([q]))[0]) - N
    assert abs(per_mass) == pytest.approx(9.80665 * x * np.sin(q), rel=1e-9)
    judged = budget(rd.control.hold([q]), ROD, **({"effort": np.inf} | {kind: limit}))
    found = max_payload(judged, "bar", (0.0, 0.0, -side * x))
    least, most = sorted(((limit - N) / per_mass, (-limit - N) / per_mass))
    if most < 0:
        assert found.mass is None and found.joint == ROD.joint_names[0]
    else:
        assert (found.least, found.mass) == pytest.approx((max(0.0, least), most), rel=1e-9)


def test_the_largest_payload_counts_what_is_carried_already() -> None:
    """The same place: the mass in all is that of the arm without it."""
    motion, com = rd.control.hold([0.8]), (0.0, 0.0, -0.4)
    alone = max_payload(budget(motion, ROD, effort=15.0), "bar", com)
    found = max_payload(budget(motion, ROD, payload=rd.Payload("bar", 0.3, com), effort=15.0), "bar", com)
    assert found.mass is not None and alone.mass is not None and (alone.carried, found.carried) == (0.0, 0.3)
    assert found.mass + found.carried == pytest.approx(alone.mass, rel=1e-9)
    assert f"{found.mass:.5g} kg more, {alone.mass:.5g} kg in all" in repr(found) and "more," not in repr(alone)


def test_no_payload_fits_where_speed_is_passed_and_any_where_nothing_limits() -> None:
    motion = rd.control.quintic([0.2], [0.9], 0.5)
    fast = max_payload(budget(motion, ROD, effort=100.0, velocity=1.0), "bar")
    assert fast.mass is None and fast.limit == "speed" and "no payload" in repr(fast)
    free = max_payload(budget(motion, ROD, effort=np.inf, velocity=np.inf), "bar")
    assert free.mass == np.inf and "no known limit" in repr(free)
    with pytest.raises(EditError, match="no frame 'nowhere'"):
        max_payload(budget(motion, ROD, effort=9.0), "nowhere")


def test_an_effect_that_knows_the_mass_of_the_arm_has_no_closed_form_and_says_so() -> None:
    class Heavy(rd.effects.Active):
        def torque(self, dynamics, t, q, v):
            return -0.1 * dynamics.N(q) ** 2

    plant = rd.Plant(ROD, [Heavy()])
    with pytest.raises(QueryError, match="not affine in the mass"):
        max_payload(budget(rd.control.quintic([0.3], [0.9], 1.0), plant, effort=50.0), "bar", (0.0, 0.0, -0.4))


def followed(plant: rd.Plant, **options: Any) -> rd.Trajectory:
    law = rd.control.ComputedTorque(plant.dynamics, PLAN.reference, kp=400.0, kd=40.0)  # pyright: ignore
    return rd.simulate(
        plant, POINTS[0], **{"duration_s": TIMES[-1], "controller": law, "estimate_error": False} | options
    )


def test_the_budget_of_a_run_is_that_of_what_its_control_did() -> None:
    """Energies against the ledger, O(Δt²) between samples; peaks are those of all steps; causes add up."""
    plant = rd.Plant(UR5.with_(payload=LOAD), FRICTION[:1])
    run = followed(plant)
    found, planned = budget(run), budget(PLAN, plant)
    given = sum(each.energy - each.regenerated for each in found.joints)
    assert given == pytest.approx(run.ledger.work["control"][-1], rel=1e-4)
    assert run.extremes is not None
    largest = np.maximum(np.abs(run.extremes[2]).max(axis=0), np.abs(run.u).max(axis=0))
    np.testing.assert_array_equal([x.peak for x in found.joints], largest)
    for a, b in zip(found.joints, planned.joints, strict=True):  # the reference is followed: its model has no friction
        assert a.peak == pytest.approx(b.peak, rel=0.05) and a.rms == pytest.approx(b.rms, rel=0.05)
    split = found.demand.split
    assert np.abs(split.unexplained).max() <= 1e-12 * np.abs(split.tau).max()
    motion = rd.control.from_samples(UR5, run.table(), ends="measured")
    for a, b in zip(budget(motion, plant).joints, found.joints, strict=True):
        assert a.peak == pytest.approx(b.peak, rel=1e-3)


def test_a_run_whose_actuation_was_cut_at_the_limit_needs_a_larger_motor() -> None:
    limit = [150.0, 60.0, 150.0, 28.0, 28.0, 28.0]
    run = followed(rd.Plant(UR5.with_(payload=LOAD), [rd.effects.EffortLimit(limit)]), duration_s=0.6)
    cut, larger = budget(run, effort=limit), budget(run)
    assert not cut.fits and "peak" in cut.joints[1].too_small and "where it was cut" in cut.sentence
    assert "peak" not in larger.joints[1].too_small and any("effort limit reached" in each for each in larger.findings)


def test_what_has_no_budget_is_refused() -> None:
    run = rd.simulate(rd.Plant(ROD), [0.4], duration_s=0.05)
    lugre = rd.effects.LuGreFriction(100.0, 1.0, 0.1, 1.0, 1.5, 0.1)
    for call, error, message in (
        (lambda: budget(PLAN), QueryError, "a plan has no arm"),
        (lambda: budget(PLAN, ROD), QueryError, "has 6 joints, shoulder_pan_joint.*has 1"),
        (lambda: budget(PLAN.reference, ROD), QueryError, "has 6 joints; .* has 1"),
        (lambda: budget(POINTS, UR5), QueryError, "motion: give a plan"),  # pyright: ignore
        (lambda: budget(PLAN, UR5, motors="motors.csv"), PlanError, "read them with"),  # pyright: ignore
        (lambda: budget(PLAN, UR5, effort=-1.0), PlanError, "effort"),
        (lambda: budget(PLAN, UR5, continuous={"elbow": 1.0}), PlanError, "elbow"),
        (
            lambda: budget(PLAN, rd.Plant(UR5, [lugre])),
            EffectError,
            "lugre_friction has states.*pass the run",
        ),
        (lambda: budget(run, ROD), QueryError, "has its own plant"),
        (lambda: budget(run, payload=LOAD), QueryError, "has its own payload"),
        (
            lambda: max_payload(budget(run), "bar"),
            QueryError,
            "this is the budget of a run: pass its motion",
        ),
        (lambda: fastest(budget(run)), QueryError, "this is the budget of a run"),
        (lambda: budget(replace(run, t=run.t[:1], v=run.v[:1])), QueryError, "one sample"),
    ):
        with pytest.raises(error, match=message):
            call()


def test_the_page_of_a_budget_has_its_sentence_and_figure_and_no_scripts(tmp_path: Path) -> None:
    found = budget(PLAN, UR5)
    text = found.save(tmp_path / "budget.html").read_text(encoding="utf-8")
    assert text.startswith("<!doctype html>") and found.sentence in text
    assert "<svg" in text and "<script" not in text


@toppra
def test_the_fastest_motion_keeps_path_stops_and_pauses_and_passes_no_limit() -> None:
    """Two strokes with a pause of 0.4 s between; torque at 10 000 times within a thousandth of the limits."""
    there, back = rd.control.quintic(POINTS[0], POINTS[2], 2.0), rd.control.quintic(POINTS[2], POINTS[1], 1.5)
    breaks = [0.0, 2.0, 2.4, 3.9]
    pause = np.zeros((1, 6, 6))
    pause[0, 0] = POINTS[2]
    table = np.concatenate([there.coefficients, pause, back.coefficients])
    plant = rd.Plant(UR5, FRICTION[:1])
    found = budget(rd.control.PiecewisePolynomial(breaks, table), plant, payload=LOAD)
    fast = fastest(found)
    assert fast.strokes == 2 and fast.before_s == pytest.approx(3.9) and 0.4 < fast.duration_s < 2.0
    t = np.linspace(0, fast.duration_s, 10_000)
    q, v, a = fast.plan.reference.at(t)
    loaded = rd.Plant(UR5.with_(payload=LOAD), FRICTION[:1])
    assert (np.abs(loaded.inverse_dynamics(q, v, a, t=0.0)) <= 1.001 * UR5.effort_limit).all()
    assert (np.abs(v) <= 1.001 * UR5.velocity_limit).all()
    at_rest = np.abs(v).max(axis=1) == 0
    assert at_rest.mean() * fast.duration_s == pytest.approx(0.4, abs=1e-3)
    np.testing.assert_allclose(q[at_rest][1:-1], np.tile(POINTS[2], (at_rest.sum() - 2, 1)), atol=1e-9)
    for start, end, part in ((0, 2, q[: np.argmax(at_rest[1:])]), (2, 1, q[len(q) - np.argmax(at_rest[::-1][1:]) :])):
        along = (POINTS[end] - POINTS[start]) / np.linalg.norm(POINTS[end] - POINTS[start])
        off = part - POINTS[start] - np.outer((part - POINTS[start]) @ along, along)
        assert np.abs(off).max() < 1e-6
    assert fast.budget.fits and fast.budget.verdict in repr(fast)


@toppra
def test_the_fastest_motion_is_slowed_down_until_it_keeps_continuous_torque() -> None:
    """As little as that needs, to 1e-3 of the time; a limit below the weight has no pace, and is said."""
    lasting = np.array([150.0, 60.0, 60.0, 28.0, 28.0, 28.0])
    found = budget(PLAN, UR5, payload=LOAD, continuous=lasting)
    fast, free = fastest(found), fastest(budget(PLAN, UR5, payload=LOAD))
    assert free.slowed == 1.0 and fast.slowed > 1.0
    assert fast.duration_s == pytest.approx(fast.slowed * free.duration_s, rel=1e-12)
    used = max(each.rms / each.continuous_limit for each in fast.budget.joints)
    assert used == pytest.approx(1.0, abs=1e-6) and fast.budget.fits and "slowed down by" in repr(fast)
    held = fastest(budget(PLAN, UR5, payload=LOAD, continuous=lasting / 3))
    assert held.slowed == 1.0 and "too small: shoulder_lift_joint" in repr(held)
    assert "no pace fits: shoulder_lift_joint needs" in held.no_pace and held.no_pace in repr(held)


SWING = rd.control.quintic([0.9], [-0.9], 0.9)  # inertia relieves gravity on the way: the mean square has a minimum


def mean_square_of_the_swing(b: float = 0.0) -> np.ndarray:
    """Coefficients of ⟨(N + u b v + u² I a)²⟩ by powers of u = 1/λ, (5,), by the trapezoidal rule."""
    t = np.linspace(0, 0.9, 20_001)
    q, v, a = SWING.at(t)
    parts = [ROD.N(q)[:, 0], b * v[:, 0], INERTIA * a[:, 0]]
    table = np.zeros(5)
    for i, x in enumerate(parts):
        for j, y in enumerate(parts):
            table[i + j] += np.trapezoid(x * y, t) / 0.9
    return table


@pytest.mark.parametrize("b", [0.3, *long([0.0])])
def test_the_least_pace_is_the_first_root_of_the_mean_square_though_neither_1_nor_100_fit(b: float) -> None:
    """⟨τ²⟩ is a polynomial of u = 1/λ; halfway from its minimum to the lower of both ends an interval of λ fits."""
    square = np.polynomial.Polynomial(mean_square_of_the_swing(b))
    at = np.linspace(0.01, 1.0, 10_001)
    least = square(at).min()
    limit = np.sqrt((least + min(square(0.01), square(1.0))) / 2)
    assert least < limit**2 < min(square(0.01), square(1.0))
    roots = (square - limit**2).roots()
    largest = max(x.real for x in roots if abs(x.imag) < 1e-9 and 0 < x.real < 1)
    plant = rd.Plant(ROD, [rd.effects.ViscousFriction(b)] if b else [])
    pace = least_pace(SWING, plant, Limits(continuous=np.array([limit])))
    assert pace.fits and pace.factor == pytest.approx(1 / largest, rel=1e-6)  # O(h²) of the rule
    none = least_pace(SWING, plant, Limits(continuous=np.array([0.9 * np.sqrt(least)])))
    assert not none.fits and none.fraction == pytest.approx(1 / 0.9, rel=1e-3)  # the best of 201 places of an octave


def test_the_least_pace_counts_the_continuous_torque_gained_at_its_slower_speed() -> None:
    """⟨τ²⟩(u) = ℓ(u |v|)² with a falling line ℓ: a polynomial equation between corners of the line."""
    square, t = np.polynomial.Polynomial(mean_square_of_the_swing(0.3)), np.linspace(0, 0.9, 20_001)
    speed = np.trapezoid(np.abs(SWING.at(t)[1][:, 0]), t) / 0.9
    corner, rest = 0.6, 1.02 * np.sqrt(square(0.0))  # the arm can be held at rest, not moved at the first speed
    line = TorqueSpeed.of_joints({ROD.joint_names[0]: ((corner * speed, rest), (speed, 0.0))}, ROD.joint_names)
    plant = rd.Plant(ROD, [rd.effects.ViscousFriction(0.3)])
    pace = least_pace(SWING, plant, Limits(continuous=np.array([rest]), continuous_line=line))
    falling = rest * np.polynomial.Polynomial([1.0, -1.0]) / (1 - corner)
    allowed = [
        x.real
        for limit, low, high in ((falling, corner, 1.0), (np.polynomial.Polynomial([rest]), 0.0, corner))
        for x in (square - limit**2).roots()
        if abs(x.imag) < 1e-9 and low < x.real < high
    ]
    assert pace.fits and pace.factor == pytest.approx(1 / max(allowed), rel=1e-6)  # O(h²) of the rule


def test_the_least_pace_keeps_the_limits_of_all_joints() -> None:
    """Of Pinocchio: neither a λ below it nor 100 fits, by the rms of rnea at 2000 times."""
    arm = rd.load("ur10")
    limit = np.array([150.0, 150.0, 60.0, 20.0, 20.0, 20.0])
    points = np.radians([[0, -90, 90, -90, -90, 0], [50, -60, 90, -120, -90, 20], [100, -80, 100, -100, -90, 0]])
    motion = rd.control.from_samples(arm, points, time=[0.0, 0.3, 0.6], unit="rad").reference
    load = rd.Payload("tool0", 5.0, (0.0, 0.0, 0.1))
    (model, data), t = with_appended_body(arm, load), np.linspace(0, motion.end_s, 2000)

    def share(factor: float) -> float:
        states = zip(*(x / factor**k for k, x in enumerate(motion.at(t))), strict=True)
        tau = np.array([pin.rnea(model, data, q, v, a) for q, v, a in states])
        return float((np.sqrt(np.trapezoid(tau**2, t, axis=0) / t[-1]) / limit).max())

    pace = least_pace(motion, rd.Plant(arm.with_(payload=load)), Limits(continuous=limit))
    assert pace.fits and pace.factor > 1 and share(pace.factor) == pytest.approx(1.0, rel=1e-4)
    assert min(share(each) for each in np.linspace(1.0, 0.999 * pace.factor, 12)) > 1.0 < share(100.0)


@toppra
def test_the_given_motion_is_the_answer_where_it_fits_and_none_that_is_faster_does() -> None:
    """Close to what it needs as continuous torque; with a share of the peak torques that it passes, it is not."""
    needs = budget(PLAN, UR5, payload=LOAD)
    given = budget(PLAN, UR5, payload=LOAD, continuous=[1.001 * each.rms + 0.01 for each in needs.joints])
    fast = fastest(given)
    assert (
        fast.is_original
        and fast.budget is given
        and fast.duration_s == fast.before_s
        and fast.plan.reference is PLAN.reference
    )
    assert "the original motion, which fits" in repr(fast)
    half = fastest(given, fraction=0.4)
    assert not half.is_original and "at 40 % of the peak torques" in repr(half)


def test_a_budget_needs_no_extra_and_loads_no_drawing() -> None:
    code = (
        "import sys; sys.modules.update(dict.fromkeys(('toppra', 'ruckig', 'pandas', 'xarray', 'pyarrow', 'mcap')))\n"
        "import robot_dyn as rd; arm = rd.load('simple_pendulum')\n"
        "found = rd.tools.motors.budget(rd.control.quintic([0.0], [1.0], 1.0), arm, effort=9.0)\n"
        "print(found.fits, rd.tools.motors.max_payload(found, 'bar').mass > 0, 'matplotlib' in sys.modules)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["True", "True", "False"]


@pytest.fixture
def files(tmp_path: Path) -> Path:
    heads = ["t [s]", *(f"{name} [rad]" for name in UR5.joint_names)]
    rows = [",".join(map(str, [t, *q])) for t, q in zip(TIMES, POINTS, strict=True)]
    (tmp_path / "plan.csv").write_text("\n".join([",".join(heads), *rows]) + "\n")
    lines = [f"{name},{peak},{0.2 * peak}" for name, peak in zip(UR5.joint_names, UR5.effort_limit, strict=True)]
    (tmp_path / "motors.csv").write_text("joint,peak [N m],continuous [N m]\n" + "\n".join(lines) + "\n")
    return tmp_path


def test_the_command_ends_with_1_if_a_motor_is_too_small(files: Path) -> None:
    plan, motors = files / "plan.csv", files / "motors.csv"
    assert ran("budget", "ur5", plan).returncode == 0
    heavy = ran("budget", "ur5", plan, "--payload", "wrist_3_link=5kg@0.12,0.03,0.05", "--limits", motors)
    assert (heavy.returncode, heavy.stderr) == (1, "") and "too small: shoulder_lift_joint needs" in heavy.stdout
    assert refusal(["budget", "ur5"]).startswith("ur5: give a motion as well")
    assert "applies to a robot with a plan" in refusal(["budget", "s.toml", plan])
    assert "--fraction is for the fastest motion: add --fastest" in refusal(
        ["budget", "ur5", plan, "--fraction", "0.9"]
    )
    assert "--joint must be JOINT=COLUMN" in refusal(["budget", "ur5", plan, "--joint", "J1"])
    assert "--max-payload must be LINK@X,Y,Z" in refusal(["budget", "ur5", plan, "--max-payload", "tool0@1"])


def test_the_document_of_the_command_has_the_keys_of_its_page(files: Path) -> None:
    found = document("budget", "ur5", files / "plan.csv", "--max-payload", "wrist_3_link@0.1,0,0.05")
    check_document("budget", found, without=("fastest",))
    assert found["joints"][1]["headroom"].keys() == {"peak", "continuous", "speed"}
    own = max_payload(budget(rd.control.from_samples(UR5, files / "plan.csv"), UR5), "wrist_3_link", (0.1, 0.0, 0.05))
    assert found["max_payload"]["mass"] == pytest.approx(own.mass, rel=1e-12)


@toppra
def test_the_command_ends_with_1_if_the_fastest_motion_or_the_given_one_is_too_small(files: Path) -> None:
    """And its figure and table are those of the fastest one; its document has the keys of its page."""
    answer = document("budget", "ur5", files / "plan.csv", "--fastest")
    check_document("budget", answer, without=("max_payload",))
    assert answer["fastest"]["budget"]["fits"] and answer["fastest"]["duration_s"] < answer["duration_s"]
    plan, motors = files / "plan.csv", files / "motors.csv"
    done = ran("budget", "ur5", plan, "--fastest", "--fraction", "0.9", "-o", files / "b.svg", "--csv", files / "b.csv")
    assert done.returncode == 0 and "at 90 % of the peak torques" in done.stdout
    before, after = (float(x) for x in re.findall(r"[\d.]+", done.stdout.splitlines()[0]))
    assert after < before == pytest.approx(answer["duration_s"])
    assert "the same path at its limits" in (files / "b.svg").read_text(encoding="utf-8")
    heavy = ran("budget", "ur5", plan, "--limits", motors, "--fastest", "--payload", "wrist_3_link=5kg@0.12,0.03,0.05")
    assert heavy.returncode == 1 and heavy.stdout.rstrip().splitlines()[-1].startswith("too small: ")


def test_the_command_takes_columns_by_name(files: Path) -> None:
    """J1 to J6 over a clock: the same budget."""
    text = (files / "plan.csv").read_text().replace("t [s]", "clock [s]")
    for i, name in enumerate(UR5.joint_names):
        text = text.replace(name, f"J{i + 1}")
    (files / "named.csv").write_text(text)
    columns = [x for i, name in enumerate(UR5.joint_names) for x in ("--joint", f"{name}=J{i + 1}")]
    found = document("budget", "ur5", files / "named.csv", "--time", "clock", *columns)
    assert found["joints"] == document("budget", "ur5", files / "plan.csv")["joints"]
    told = refusal(["budget", "ur5", files / "named.csv", "--time", "clock [s]"])
    assert "--joint JOINT=COLUMN" in told


def test_the_command_takes_scenes_and_runs_and_writes_figure_and_table(files: Path) -> None:
    run = rd.simulate(rd.Plant(ROD), [0.4], duration_s=0.05).save(files / "run")
    (files / "scene.toml").write_text('robot = "simple_pendulum"\nduration_s = 0.05\n[start]\nq = [0.4]\n')
    for what in (run, files / "scene.toml"):
        assert ran("budget", what).returncode == 0
    done = ran("budget", run, "-o", files / "b.svg", "--csv", files / "b.csv", "--dark")
    assert done.returncode == 0 and (files / "b.svg").read_bytes().startswith(b"<?xml")
    assert (files / "b.csv").read_text(encoding="utf-8").startswith("joint,unit,peak,peak_at_s,")


def test_a_run_that_simulates_its_gears_has_its_own_rotors(tmp_path: Path) -> None:
    """Rotors that the file states alike change no torque; others, and one that the arm has too, are refused."""

    def motors(inertia: float) -> Any:
        file = tmp_path / f"motors_{inertia}.csv"
        file.write_text(
            "joint,peak [N m],gear_ratio,rotor_inertia [kg m^2],at\n"
            f"joint_1,200,100,{inertia},joint\njoint_2,60,100,5e-5,joint\n"
        )
        return rd.tools.motors.read_motors(file)

    arm = rd.load("planar_2r")
    gears = rd.effects.SeriesElastic([2000.0, 500.0], [1e-4, 5e-5], 100.0, damping=2.0)
    options = {"duration_s": 0.2, "controller": rd.control.PD(rd.control.hold([0.5, -0.3]), kp=200.0, kd=20.0)}
    run = rd.simulate(rd.Plant(arm, [gears]), [0.3, -0.5], **options)
    found, bare = rd.tools.motors.budget(run, motors=motors(1e-4)), rd.tools.motors.budget(run, effort=[200.0, 60.0])
    assert [x.peak for x in found.joints] == [x.peak for x in bare.joints]
    assert any("joint_1, joint_2" in finding for finding in found.findings)
    with pytest.raises(PlanError) as refused:
        rd.tools.motors.budget(run, motors=motors(2e-4))
    assert all(part in str(refused.value) for part in ("joint_1", "2 kg m²", "1 kg m²"))
    twice = rd.simulate(rd.Plant(arm.with_(armature=[1.0, 0.5]), [gears]), [0.3, -0.5], **options)
    with pytest.raises(PlanError, match="twice"):
        rd.tools.motors.budget(twice, motors=motors(1e-4))


def test_a_verdict_of_many_lines_stands_above_the_axes_of_its_figure() -> None:
    """Texts at the top of the figure end above the titles of all axes."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    from robot_dyn.tools.motors.motor_budget.diagram import draw

    figure = draw(rd.tools.motors.budget(PLAN, UR5, effort=1.0, velocity=0.1, continuous=0.5))
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    renderer = canvas.get_renderer()
    headings = [*figure.texts, *figure.subfigs[0].texts]
    bottom = min(text.get_window_extent(renderer).y0 for text in headings)
    assert max(axes.get_tightbbox(renderer).y1 for axes in figure.axes) < bottom


# --- passive joints

TWO_BARS = rd.load("planar_2r")
PASSIVE = {"joint_1": 20.0, "joint_2": 0.0}


def test_the_budget_of_a_run_with_a_passive_joint_fits() -> None:
    """The actuation of a joint without a motor is 0, which is no more than its limit of 0."""
    plant = rd.Plant(TWO_BARS, [rd.effects.EffortLimit(PASSIVE), rd.effects.ViscousFriction(0.2)])
    controller = rd.control.PD(rd.control.hold([0.4, 0.0]), kp=20.0, kd=5.0)
    run = rd.simulate(plant, [0.3, 0.0], duration_s=0.4, controller=controller)
    found = budget(run, effort=PASSIVE, velocity=50.0)
    _, passive = found.joints
    assert found.fits and (passive.peak, passive.peak_limit, passive.shares["peak"]) == (0.0, 0.0, 0.0)
    assert "joint_2" not in found.verdict and found.to_json()


def test_a_plan_that_needs_torque_of_a_passive_joint_does_not_fit() -> None:
    found = budget(rd.control.quintic([0.1, 0.2], [0.3, 0.1], 1.0), TWO_BARS, effort=PASSIVE, velocity=50.0)
    assert not found.fits and found.joints[1].too_small == ("peak",) and found.joints[1].shares["peak"] == np.inf
    assert found.to_json() and "joint_2" in str(found)
    assert max_payload(found, TWO_BARS.frame_names[-1]).mass is None


def test_a_passive_joint_that_needs_no_torque_fits() -> None:
    """A balanced load at rest, without gravity: 0 of 0."""
    found = budget(rd.control.hold([0.3]), FREE, effort=0.0, velocity=1.0)
    assert found.fits and found.joints[0].shares["peak"] == 0.0


@toppra
def test_no_path_is_planned_for_a_passive_joint() -> None:
    with pytest.raises(PlanError, match="effort of joint 'joint_2' is 0"):
        rd.tools.motors.path(TWO_BARS, [[0.1, 0.2], [0.3, 0.1]], effort=PASSIVE, velocity=3.0)


def test_an_effort_limit_of_zero_is_refused_without_motors_and_not_mentioned_with_them(tmp_path: Path) -> None:
    limit = '<limit effort="0" velocity="9"/><parent link="base"/>'
    arm = rd.Robot.from_text(TWO_BARS.description.text.decode().replace('<parent link="base"/>', limit, 1))
    motion = rd.control.quintic([0.1, 0.2], [0.3, 0.1], 1.0)
    assert arm.findings and not arm.announced_findings
    with pytest.raises(PlanError, match=r"effort limit 0 for 'joint_1'.*\{'joint_1': 0\} for a passive joint"):
        budget(motion, arm)
    (tmp_path / "motors.csv").write_text("joint,peak [N m],speed [rad/s]\njoint_1,200,9\njoint_2,60,9\n")
    for stated in (
        {"motors": rd.tools.motors.read_motors(tmp_path / "motors.csv")},
        {"effort": 200.0, "velocity": 9.0},
    ):
        assert not any("effort limit" in finding for finding in budget(motion, arm, **stated).findings)
