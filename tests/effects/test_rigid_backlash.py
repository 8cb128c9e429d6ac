"""Rigid backlash: bounces within the gap against closed forms, momentum, energy; an arm; contact is rigid coupling."""

from __future__ import annotations

import numpy as np
import pytest

import robot_dyn as rd
from tests.effects.test_effect_states import MASS, SLIDER, Ramp
from tests.long import long, third
from tests.slides import slides

ARM = rd.load("planar_2r")
Q = np.array([0.3, -0.5])
TIGHT = rd.integrate.Adaptive("DOP853", 1e-12, 1e-14)
BOTH = pytest.mark.parametrize("engine", ["interpreted", "compiled"])
GAP, J, RATIO = 0.02, 0.002, 9.0  # in [m], [kg], 1
REFLECTED = RATIO**2 * J


def slide(restitution: float, engine: str, force: float, effects: tuple = ()) -> rd.Trajectory:
    drive = rd.effects.RigidBacklash(GAP, J, RATIO, restitution)
    return rd.simulate(
        rd.Plant(SLIDER, [drive, *effects]), [0.0], duration_s=2.0, controller=Ramp(force), method=TIGHT,
        engine=engine, record_every_s=0.01, estimate_error=False,
    )  # fmt: skip


@pytest.mark.parametrize(
    ("side", "restitution"), [(-1, 0.5), *third([(1, 1.0), (-1, 1.0), (1, 0.5), (1, 0.0), (-1, 0.0)])]
)
@BOTH
def test_a_pushed_motor_bounces_at_an_end_of_the_gap_like_a_ball(restitution: float, side: int, engine: str) -> None:
    """δ̈ = F/B between impacts, which follow after 2 w/δ̈ with w⁺ = e w⁻ and end at t₁ (1 + e)/(1 − e); 1e-12.

    m v + B θ̇ = F t and m q + B θ = F t²/2 throughout; without loss the energy less the work of F is constant.
    """
    force = 1.3 * side
    run = slide(restitution, engine, force)
    g = 1.3 / REFLECTED
    hits, speed = [np.sqrt(2 * GAP / g)], [np.sqrt(2 * GAP * g) * restitution]
    while hits[-1] < 2.0 and speed[-1] > 1e-12:
        hits, speed = [*hits, hits[-1] + 2 * speed[-1] / g], [*speed, speed[-1] * restitution]
    k = np.searchsorted(hits, run.t, side="right") - 1
    since = run.t - np.array(hits)[k]
    bounce = GAP - np.array(speed)[k] * since + g * since**2 / 2
    resting = (k == len(hits) - 1) & (restitution < 1)
    expected = np.where(k < 0, g * run.t**2 / 2, np.where(resting, GAP, bounce))
    states = run.effect_states["rigid_backlash"]
    np.testing.assert_allclose(side * states[:, 0], expected, atol=1e-12)
    np.testing.assert_allclose(MASS * run.v[:, 0] + REFLECTED * states[:, 2], force * run.t, atol=1e-12)
    moved = (MASS + REFLECTED) * run.q[:, 0] + REFLECTED * states[:, 0]
    np.testing.assert_allclose(moved, force * run.t**2 / 2, atol=1e-12)
    ledger = run.ledger
    assert np.abs(ledger.residual).max() < 1e-12
    left = ledger.energy - ledger.energy[0] + ledger.stored["rigid_backlash"] - ledger.work["control"]
    pushed = MASS * REFLECTED / (MASS + REFLECTED) * g * GAP  # all that relative motion has when it ends
    assert left[-1] == pytest.approx(0.0 if restitution == 1 else -pushed, abs=1e-12)
    assert np.diff(left).max() < 1e-13
    if restitution < 1:
        end = hits[0] * (1 + restitution) / (1 - restitution)
        assert run.events[-1].t == pytest.approx(end, abs=1e-11)
        np.testing.assert_allclose(run.a[-1], force / (MASS + REFLECTED), rtol=1e-13)


def beats(t: float, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """A force of two frequencies on the motor, and on the joint as well where both are coordinates."""
    return np.stack([3.0 * np.cos(9.1 * t + 0.3) + 1.5 * np.cos(23.0 * t)] * len(q))


@pytest.mark.parametrize("restitution", [0.3, *long([0.9])])
def test_a_motor_in_a_backlash_is_a_body_between_rigid_stops(restitution: float) -> None:
    """The same as a second slider on the first one, whose coordinate is δ, between its rigid stops; 1e-10."""
    both = slides(("slide", "base", "cart", MASS), ("play", "cart", "motor", REFLECTED))
    options = {"duration_s": 3.0, "method": TIGHT, "record_every_s": 0.01, "estimate_error": False}
    stops = rd.effects.RigidStops([-np.inf, -GAP], [np.inf, GAP], [0.0, restitution])
    theirs = rd.simulate(rd.Plant(both, [stops]), [0.0, 0.0], controller=beats, **options)
    ours = rd.simulate(
        rd.Plant(SLIDER, [rd.effects.RigidBacklash(GAP, J, RATIO, restitution)]), [0.0], controller=beats, **options
    )
    names = " ".join(each.name for each in ours.events)
    assert all(word in names for word in ("strikes the forward end", "strikes the backward end"))
    assert ("leaves the" in names) == (restitution < 0.5)
    np.testing.assert_allclose([each.t for each in ours.events], [each.t for each in theirs.events], atol=1e-9)
    np.testing.assert_allclose(ours.q[:, 0], theirs.q[:, 0], atol=1e-10)
    np.testing.assert_allclose(ours.effect_states["rigid_backlash"][:, 0], theirs.q[:, 1], atol=1e-10)
    np.testing.assert_allclose(ours.effect_states["rigid_backlash"][:, 1], theirs.v[:, 1], atol=1e-9)


def arm_run(engine: str, effects: tuple = (), tolerance: float = 1e-11, period: float = 0.01) -> rd.Trajectory:
    drive = rd.effects.RigidBacklash([0.01, 0.02], [0.4, 0.05], [2.0, 4.0], [0.6, 0.3], viscous=0.2)
    control = rd.control.PD(rd.control.quintic(Q, [0.6, 0.4], 0.5), kp=[300.0, 90.0], kd=[40.0, 9.0], period_s=period)
    return rd.simulate(
        rd.Plant(ARM, [drive, *effects]), Q, duration_s=0.8, controller=control, engine=engine, record_every_s=0.01,
        method=rd.integrate.Adaptive("DOP853", tolerance, tolerance / 100), estimate_error=False,
    )  # fmt: skip


def test_an_arm_with_backlash_dry_friction_and_stops_closes_its_ledger_in_both_engines() -> None:
    """Two motors, joints that rub and a stop that is struck with a motor in contact; 1e-9, engines within 1e-9."""
    effects = (rd.effects.DryFriction([0.5, 0.3]), rd.effects.RigidStops([-2.0, -0.6], [0.55, 2.0], 0.4))
    ours, theirs = (arm_run(engine, effects) for engine in ("compiled", "interpreted"))
    names = " ".join(each.name for each in ours.events)
    assert all(
        word in names for word in ("joint_1 strikes its upper stop", "rd end of its backlash", "reverses", "leaves")
    )
    assert np.abs(ours.ledger.residual).max() < 1e-9
    np.testing.assert_allclose(ours.q, theirs.q, atol=1e-9)
    states = ours.effect_states["rigid_backlash"]
    assert (np.abs(states[:, :2]) <= [0.01, 0.02]).all()  # penetration is exactly 0
    np.testing.assert_allclose(states[:, 4:6], ours.v + states[:, 2:4], atol=1e-10)
    for name in ("dry_friction", "rigid_stops"):
        assert np.diff(ours.ledger.work[name]).max() < 1e-10
    lost = ours.ledger.work["rigid_backlash"] + ours.ledger.stored["rigid_backlash"]
    assert np.diff(lost).max() < 1e-10


@pytest.mark.long  # against closed forms to 1e-12 above
def test_errors_fall_with_the_tolerance() -> None:
    """A 2R with two backlashes under continuous control, 77 events, against 1e-13: of the order of the tolerance."""
    best = arm_run("interpreted", tolerance=1e-13, period=0.0)
    assert len(best.events) > 50
    for tolerance in (1e-6, 1e-10):
        run = arm_run("interpreted", tolerance=tolerance, period=0.0)
        assert [each.name for each in run.events] == [each.name for each in best.events]
        assert 1e-3 * tolerance < np.abs(run.q - best.q).max() < 4 * tolerance


def test_without_loss_the_energy_of_arm_and_motors_is_kept() -> None:
    """Under gravity alone, e = 1 at both joints: many impacts, and 1e-11 of the energy exchanged."""
    drive = rd.effects.RigidBacklash(0.02, [0.4, 0.05], [2.0, 4.0], 1.0)
    run = rd.simulate(rd.Plant(ARM, [drive]), Q, [0.4, -1.0], duration_s=1.5, method=TIGHT, record_every_s=0.01)
    assert sum("strikes" in each.name for each in run.events) > 20
    E = run.ledger.energy + run.ledger.stored["rigid_backlash"]
    np.testing.assert_allclose(E, E[0], atol=1e-11 * run.ledger.exchanged)


@BOTH
def test_a_motor_that_rests_at_an_end_is_an_armature(engine: str) -> None:
    """From its impact without restitution on, the arm with n² J at its second joint, driven there; 1e-10."""
    law = rd.control.PD(rd.control.hold([0.3, 2.5]), kp=[200.0, 40.0], kd=[30.0, 3.0])
    options = {"method": TIGHT, "estimate_error": False, "controller": law, "engine": engine}
    drive = rd.effects.RigidBacklash({"joint_2": 0.01}, {"joint_2": 0.05}, {"joint_2": 4.0})
    run = rd.simulate(rd.Plant(ARM, [drive]), Q, duration_s=0.25, record_every_s=0.1, **options)
    (hit,) = run.events
    heavy = ARM.with_(armature={"joint_2": 0.05 * 16})
    rest = rd.simulate(heavy, hit.q, hit.v, duration_s=0.25 - hit.t, record_every_s=0.0, **options)
    assert hit.name == "joint_2 strikes the forward end of its backlash"
    np.testing.assert_allclose(run.q[-1], rest.q[-1], atol=1e-10)
    np.testing.assert_allclose(run.a[-1], rest.a[-1], atol=1e-8)


@pytest.mark.parametrize("engine", ["interpreted", *long(["compiled"])])
def test_a_payload_that_a_pushed_joint_picks_up_is_an_impact_of_its_motor_too(engine: str) -> None:
    """With the motor at an end, e = 0: (m + B + M) v⁺ = (m + B) v⁻; the slider, its motor and the ledger, 1e-12."""
    force, M, at = 1.3, 0.9, 0.5
    body = rd.effects.CarriedPayload(rd.Payload("cart", M), at)
    run = slide(0.0, engine, force, (body,))
    whole = MASS + REFLECTED
    speed = force * at / whole
    after = whole * speed / (whole + M) + force * (run.t[-1] - at) / (whole + M)
    assert run.v[-1, 0] == pytest.approx(after, abs=1e-12)
    np.testing.assert_allclose(run.effect_states["rigid_backlash"][-1, :3], [GAP, 0.0, run.v[-1, 0]], atol=1e-13)
    assert np.abs(run.ledger.residual).max() < 1e-12
    assert next(each.name for each in run.events if each.t >= at) == "payload on cart picked up at rest"
