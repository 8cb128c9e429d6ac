"""Payloads picked up and dropped in a run: momentum, energy and closed forms; both engines, with stops and friction."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn.foundations import TraceError
from tests.effects.test_effect_states import MASS, SLIDER, Ramp

ARM = rd.load("planar_2r")
Q, V = np.array([0.4, 0.7]), np.array([1.0, -2.0])
BODY = rd.Payload("tip", 0.8, (0.1, 0.02, 0.05), ((0.02, 0, 0), (0, 0.03, 0), (0, 0, 0.01)))
TIGHT = rd.integrate.Adaptive("DOP853", 1e-13, 1e-15)
BOTH = pytest.mark.parametrize("engine", ["interpreted", "compiled"])
G = 9.80665


@pytest.mark.parametrize("method", [TIGHT, "RK4"], ids=["DOP853", "RK4"])
@BOTH
def test_a_slider_keeps_its_momentum_and_the_ledger_has_what_was_lost(method, engine: str) -> None:
    """F on m, M at rest from 0.3 s, μ at the slider's speed from 0.5 s, both dropped by turns: parabolas, 1e-12.

    RK4 is exact on them but for rounding. Work of a body: M g z and ½ M v² that come and go with it.
    """
    F, M, mu, z = 2.0, 0.9, 0.4, 0.3
    bodies = [
        rd.effects.CarriedPayload(rd.Payload("cart", M, (0.0, 0.0, z)), 0.3, 0.7),
        rd.effects.CarriedPayload(rd.Payload("cart", mu), 0.5, 0.9, at_rest=False),
    ]
    run = rd.simulate(
        rd.Plant(SLIDER, bodies), [0.1], [0.8], duration_s=1.2, controller=Ramp(F), method=method, engine=engine,
        record_every_s=0.05, estimate_error=False,
    )  # fmt: skip
    q, v, t, expected, speeds = 0.1, 0.8, 0.0, {}, []
    for end, m, after in [(0.3, MASS, MASS / (MASS + M)), (0.5, MASS + M, 1), (0.7, MASS + M + mu, 1),
                          (0.9, MASS + mu, 1), (1.3, MASS, 1)]:  # fmt: skip
        for k in range(26):
            if t - 1e-9 <= 0.05 * k < end - 1e-9:
                s = 0.05 * k - t
                expected[k] = q + v * s + F / m * s**2 / 2, v + F / m * s
        q, v = q + v * (end - t) + F / m * (end - t) ** 2 / 2, v + F / m * (end - t)
        speeds += [v]
        v, t = v * after, end
    np.testing.assert_allclose(run.q[:, 0], [expected[k][0] for k in range(25)], atol=1e-12)
    np.testing.assert_allclose(run.v[:, 0], [expected[k][1] for k in range(25)], atol=1e-12)
    lost = MASS * speeds[0] ** 2 / 2 * (MASS / (MASS + M) - 1)
    assert run.ledger.work["pick_up"][-1] == pytest.approx(lost, rel=1e-12)
    assert run.ledger.work["carried_payload"][-1] == pytest.approx(-M * speeds[2] ** 2 / 2, rel=1e-11)
    gained = mu / 2 * (speeds[1] ** 2 - speeds[3] ** 2)
    assert run.ledger.work["carried_payload 2"][-1] == pytest.approx(gained, rel=1e-11)
    between = (run.t > 0.31) & (run.t < 0.69)
    np.testing.assert_allclose(run.ledger.work["carried_payload"][between], M * G * z, rtol=1e-12)
    assert np.abs(run.ledger.residual).max() < 1e-12
    assert [(each.t, each.name.removeprefix("payload on cart ")) for each in run.events] == [
        (0.3, "picked up at rest"), (0.5, "picked up at the speed of the link"), (0.7, "dropped"), (0.9, "dropped"),
    ]  # fmt: skip


def test_a_pendulum_swings_on_with_the_momentum_it_had() -> None:
    """I v is kept where a body is picked up, v where it is dropped, and the energy of each part of the swing; 1e-11."""
    robot = rd.load("pendulum")
    body, link = rd.Payload("rod", 0.6, (0.05, 0.0, -0.4)), robot.M([0.0])[0, 0]
    carrying = robot.with_(payload=body)
    inertia = link + 0.6 * (0.4**2 + 0.05**2)
    assert carrying.M([0.3])[0, 0] == pytest.approx(inertia, rel=1e-14)
    plant = rd.Plant(robot, [rd.effects.CarriedPayload(body, 0.5, 1.1)])
    run = rd.simulate(plant, [0.9], [1.3], duration_s=2.0, method=TIGHT, record_every_s=0.01)
    energies = [
        np.array([dynamics.total_energy(q, v) for q, v in zip(run.q[part], run.v[part], strict=True)])
        for dynamics, part in ((robot, run.t < 0.4999), (carrying, (run.t > 0.5001) & (run.t < 1.0999)),
                               (robot, run.t > 1.1001))
    ]  # fmt: skip
    for part in energies:
        np.testing.assert_allclose(part, part[0], atol=1e-11)
    q, v = np.array(run.events[0].q), np.array(run.events[0].v)
    before = np.sqrt(2 * (energies[0][0] - robot.potential_energy(q)) / link)
    assert abs(v[0]) == pytest.approx(link * before / inertia, rel=1e-11)
    q = np.array(run.events[1].q)
    before = np.sqrt(2 * (energies[1][0] - carrying.potential_energy(q)) / inertia)
    assert abs(run.events[1].v[0]) == pytest.approx(before, rel=1e-11)


@pytest.mark.parametrize("at_rest", [True, False])
@BOTH
def test_a_run_is_those_of_the_robots_before_and_behind_joined_by_the_momentum(at_rest: bool, engine: str) -> None:
    """Each by itself, from the state that the law gives: (M + ΔM) v⁺ = M v⁻, or v⁺ = v⁻; 1e-11."""
    options = {"method": TIGHT, "estimate_error": False, "record_every_s": 0.1, "engine": engine}
    carrying = ARM.with_(payload=BODY)
    first = rd.simulate(ARM, Q, V, duration_s=0.3, **options)
    q, v = first.q[-1], first.v[-1]
    after = np.linalg.solve(carrying.M(q), ARM.M(q) @ v) if at_rest else v
    second = rd.simulate(carrying, q, after, duration_s=0.4, **options)
    third = rd.simulate(ARM, second.q[-1], second.v[-1], duration_s=0.3, **options)
    plant = rd.Plant(ARM, [rd.effects.CarriedPayload(BODY, 0.3, 0.7, at_rest)])
    whole = rd.simulate(plant, Q, V, duration_s=1.0, **options)
    np.testing.assert_allclose(whole.q[3:7], second.q[:4], atol=1e-11)
    np.testing.assert_allclose(whole.v[3:7], second.v[:4], atol=1e-10)
    np.testing.assert_allclose(whole.a[3], second.a[0], atol=1e-9)
    np.testing.assert_allclose(whole.q[7:], third.q, atol=1e-11)
    np.testing.assert_allclose(whole.v[-1], third.v[-1], atol=1e-10)
    lost = whole.ledger.work.get("pick_up", np.zeros(1))[-1]
    assert (lost < -0.1) == at_rest
    assert np.abs(whole.ledger.residual).max() < 1e-11


@BOTH
def test_what_is_stuck_is_kicked_loose_and_what_rests_at_a_stop_stays_above_it(engine: str) -> None:
    """With dry friction, rigid stops and a sampled controller whose ticks meet the switches the ledger closes."""
    effects = [
        rd.effects.DryFriction([0.8, 0.5]), rd.effects.RigidStops([-3.0, 0.6], [3.0, 2.0], 0.4),
        rd.effects.CarriedPayload(BODY, 0.2, 0.6),
        rd.effects.CarriedPayload(rd.Payload("tip", 0.3), 0.2, 0.45, at_rest=False),
    ]  # fmt: skip
    control = rd.control.PD(rd.control.quintic(Q, [0.9, 1.1], 0.8), kp=40.0, kd=8.0, period_s=0.02)
    options = {"method": TIGHT, "engine": engine, "record_every_s": 0.01, "estimate_error": False}
    run = rd.simulate(rd.Plant(ARM, effects), Q, duration_s=1.0, controller=control, **options)
    names = [each.name for each in run.events]
    assert names.count("payload on tip dropped") == 2 and "payload on tip picked up at rest" in names
    assert run.q[:, 1].min() >= 0.6
    assert np.abs(run.ledger.residual).max() < 1e-9
    assert run.outcome.ending == "finished"


def test_a_joint_that_sticks_slides_when_the_impact_reaches_it() -> None:
    """One joint moves, the other sticks: v⁺ of both is that of the law without friction, which is finite."""
    light, q, v = ARM.with_(gravity=(0, 0, 0)), np.array([0.3, 0.9]), np.array([1.5, 0.0])
    plant = rd.Plant(light, [rd.effects.DryFriction([0.0, 50.0]), rd.effects.CarriedPayload(BODY, 0.1)])
    run = rd.simulate(plant, q, v, duration_s=0.2, method=TIGHT, record_every_s=0.05)
    at = next(each for each in run.events if "picked up" in each.name)
    place = q + 0.1 * v
    np.testing.assert_allclose(at.q, place, atol=1e-12)
    expected = np.linalg.solve(light.with_(payload=BODY).M(place), light.M(place) @ v)
    np.testing.assert_allclose(at.v, expected, rtol=1e-11)
    assert abs(at.v[1]) > 0.01 and "joint_2 sticks" in [each.name for each in run.events if each.t > 0.1]


def test_rollouts_of_chosen_steps_and_run_files_keep_them(tmp_path) -> None:
    plant, options = rd.Plant(ARM, [rd.effects.CarriedPayload(BODY, 0.1, 0.2)]), {"record_every_s": 0.05}
    setup = rd.Setup(plant, Q, V, 0.3, None, "DOP853", **options, estimate_error=False)
    runs = rd.rollouts(setup, vary={"gravity": [[0, 0, -G], [0, 0, -1.6]]}, record=("q", "work"))
    moon = replace(setup, plant=rd.Plant(ARM.with_(gravity=(0, 0, -1.6)), setup.plant.effects))
    for k, each in enumerate((setup, moon)):
        alone = rd.simulate(each)
        np.testing.assert_allclose(runs.q[k], alone.q, atol=1e-9)
        np.testing.assert_allclose(runs.work["pick_up"][k], alone.ledger.work["pick_up"], atol=1e-9)
    run = rd.simulate(setup)
    again = rd.read(run.save(tmp_path / "run"))
    assert [each.name for each in again.events] == [each.name for each in run.events]
    np.testing.assert_array_equal(again.ledger.residual, run.ledger.residual)
    rd.replay(again).save(tmp_path / "page")


def test_a_plant_is_asked_at_a_time() -> None:
    """All queries and `linearise` take the time; machine code is refused."""
    body = rd.effects.CarriedPayload(BODY, 0.1, 0.2)
    plant, carrying = (
        rd.Plant(ARM, [rd.effects.ViscousFriction(0.1), body]),
        rd.Plant(ARM.with_(payload=BODY), [rd.effects.ViscousFriction(0.1)]),
    )
    for t, other in ((0.05, rd.Plant(ARM, [rd.effects.ViscousFriction(0.1)])), (0.15, carrying)):
        np.testing.assert_array_equal(plant.N(Q, V, t=t), other.N(Q, V, t=t))
        np.testing.assert_array_equal(plant.forward_dynamics(Q, V, V, t=t), other.forward_dynamics(Q, V, V, t=t))
        np.testing.assert_array_equal(plant.inverse_dynamics(Q, V, V, t=t), other.inverse_dynamics(Q, V, V, t=t))
        np.testing.assert_array_equal(plant.M(Q, t=t), other.M(Q))
        np.testing.assert_array_equal(plant.C(Q, V, t=t), other.C(Q, V))
        np.testing.assert_array_equal(rd.linearise(plant, Q, V, t=t)[0], rd.linearise(other, Q, V)[0])
    compiled = rd.compiled(plant)
    for query in (lambda: compiled.forward_dynamics(Q, V, V, t=0.0), lambda: compiled.M(Q), lambda: compiled.C(Q, V)):
        with pytest.raises(TraceError, match=r"carried_payload is temporary: use plant.at\(t\)"):
            query()
