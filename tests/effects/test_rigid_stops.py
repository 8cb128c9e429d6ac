"""Rigid stops: never passed, struck by Newton's law, and at rest against them what closed forms say."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn.foundations import QueryError
from tests.campaigns.estimates.held import held_scene
from tests.campaigns.estimates.scenes import arms
from tests.long import long

ENGINES = ["interpreted", "compiled"]
G = 9.80665
RAIL = arms()["rail"]  # 1 kg on a vertical rail
ARM = rd.load("planar_2r")
TIGHT = rd.integrate.Adaptive(rtol=1e-12, atol=1e-12)
OPTIONS = {"estimate_error": False, "method": TIGHT}


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize(("e", "most"), [(0.5, 100), *long([(0.9, 500)])])
def test_a_bouncing_joint_comes_to_rest_when_and_where_it_must(engine: str, e: float, most: int) -> None:
    """From height h: at T = √(2h/g) (1 + e) / (1 − e), to 1e-9, exactly at the stop; the energy it had is lost."""
    h = 0.8
    plant = rd.Plant(RAIL, [rd.effects.RigidStops(0.0, np.inf, e)])
    T = np.sqrt(2 * h / G) * (1 + e) / (1 - e)
    run = rd.simulate(plant, [h], duration_s=T + 0.5, engine=engine, **OPTIONS)
    (rest,) = [each for each in run.events if "rest" in each.name]
    assert rest.t == pytest.approx(T, abs=1e-9)
    assert run.q[-1, 0] == 0.0
    assert run.v[-1, 0] == 0.0
    assert (run.q >= 0).all()
    assert run.statistics.steps <= most
    assert run.ledger.work["rigid_stops"][-1] == pytest.approx(-G * h, rel=1e-11)


def test_without_loss_energy_stays_over_a_thousand_impacts() -> None:
    """E = 1, prismatic: 1e-12 of the energy, to rounding of some ten thousand stages."""
    h = 0.3
    T = 1000 * 2 * np.sqrt(2 * h / G)
    plant = rd.Plant(RAIL, [rd.effects.RigidStops(0.0, np.inf, 1.0)])
    run = rd.simulate(plant, [h], duration_s=T, record_every_s=T / 200, engine="compiled", **OPTIONS)
    energy = run.ledger.kinetic + run.ledger.potential
    assert len(run.events) in (999, 1000, 1001)
    assert np.abs(energy / energy[0] - 1).max() <= 1e-12


@dataclass(frozen=True, eq=False)
class OneWay(rd.effects.Dissipative):
    """A damper of motion upwards alone: its formula changes where v = 0."""

    up: Any = field(metadata=rd.effects.coefficient("N m s/rad", symbol="b", minimum=0))
    down: Any = field(default=0.0, metadata=rd.effects.coefficient("N m s/rad", symbol="b₋", minimum=0))

    def torque(self, dynamics: Any, t: float, q: Any, v: Any) -> Any:
        return -self.up * np.maximum(v, 0.0) - self.down * np.minimum(v, 0.0)

    def thresholds(self, n: int) -> tuple[rd.effects.Threshold, ...]:
        return (rd.effects.Threshold(0, 0.0, "damper", "taken along", "left", of_velocity=True),)

    def on_side(self, n: int, sides: Any) -> OneWay:
        ((_, side),) = sides.items()
        b = self.up if side > 0 else self.down
        return replace(self, up=b, down=b)


@pytest.mark.parametrize("engine", ENGINES)
def test_an_impact_may_throw_a_velocity_over_the_threshold_of_another_effect(engine: str) -> None:
    """Down freely from h, up against b v: v₁ = e √(2 g h), at rest after t = ln(1 + b v₁/g)/b, (v₁ − g t)/b up."""
    h, b, e = 0.8, 3.1, 0.9
    plant = rd.Plant(RAIL, [OneWay(b), rd.effects.RigidStops(0.0, np.inf, e)])
    run = rd.simulate(plant, [h], duration_s=1.0, engine=engine, **OPTIONS)
    first, top, second = run.events[:3]
    v = e * np.sqrt(2 * G * h)
    up = np.log(1 + b * v / G) / b
    height = (v - G * up) / b
    assert first.v[0] == pytest.approx(v, rel=1e-12)
    assert top.t - first.t == pytest.approx(up, rel=1e-11)
    assert top.q[0] == pytest.approx(height, rel=1e-11)
    assert second.t - top.t == pytest.approx(np.sqrt(2 * height / G), rel=1e-11)


def panda_between_stops() -> tuple[rd.Plant, list[float], list[float], float]:
    """Stops without loss for the plant, q₀, v₀ and a duration, some 54 impacts."""
    panda = rd.load("panda")
    panda = panda.with_(lock=dict.fromkeys(panda.joint_names[7:], 0.0))
    stops = rd.effects.RigidStops([-1, -1.2, -1, -2.5, -1, 0.6, -1], [1, 0.4, 1, -1, 1, 2.2, 1], 1.0)
    return rd.Plant(panda, [stops]), [0, -0.5, 0.2, -1.9, 0.1, 1.4, 0.5], [0.0] * 7, 2.0


@pytest.mark.parametrize(
    "case",
    [(rd.Plant(ARM, [rd.effects.RigidStops(-1.0, 1.0, 1.0)]), [0.3, 0.4], [1.0, -0.5], 6.0), panda_between_stops()],
    ids=["planar_2r", "panda"],
)  # fmt: skip
def test_without_loss_the_energy_of_an_arm_drifts_by_its_tolerance(case) -> None:
    """At e = 1 no impact changes the energy: what drifts is the truncation of the motion between, at most 1e3 rtol.

    From 1e-6 to 1e-12 it falls by five decades at least.
    """
    plant, q0, v0, T = case
    drifts = {}
    for tolerance in (1e-6, 1e-9, 1e-12):
        run = rd.simulate(
            plant, q0, v0, duration_s=T, engine="compiled", estimate_error=False, record_every_s=T / 100,
            method=rd.integrate.Adaptive(rtol=tolerance, atol=tolerance),
        )  # fmt: skip
        energy = run.ledger.kinetic + run.ledger.potential
        drifts[tolerance] = np.abs(energy - energy[0]).max() / run.ledger.kinetic.max()
        assert sum("strikes" in each.name for each in run.events) > 30
        assert drifts[tolerance] <= 1e3 * tolerance
        assert np.abs(run.ledger.work["rigid_stops"]).max() <= 1e-12 * run.ledger.kinetic.max()
    assert drifts[1e-12] <= 1e-5 * drifts[1e-6]


def test_an_impact_obeys_newtons_law_and_the_momentum_of_the_others_stays() -> None:
    """v⁺ = −e v⁻ at the joint that strikes; M (v⁺ − v⁻) has no entry at the other one; ΔK as booked."""
    e = 0.6
    plant = rd.Plant(ARM.with_(gravity=(0, 0, 0)), [rd.effects.RigidStops([-9.0, -9.0], [0.7, 9.0], e)])
    q0, v0 = np.array([0.2, 0.5]), np.array([1.3, -0.8])
    run = rd.simulate(plant, q0, v0, duration_s=0.6, **OPTIONS)
    struck = run.events[0]
    free = rd.simulate(plant.dynamics, q0, v0, duration_s=struck.t, record_every_s=struck.t, **OPTIONS)
    before, after, M = free.v[-1], np.array(struck.v), ARM.M(np.array(struck.q))
    assert struck.q[0] == 0.7
    assert after[0] == pytest.approx(-e * before[0], rel=1e-10)
    assert abs((M @ (after - before))[1]) <= 1e-9
    lost = (after @ M @ after - before @ M @ before) / 2
    assert run.ledger.work["rigid_stops"][-1] == pytest.approx(lost, rel=1e-9)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_joint_rests_at_its_stop_under_load_and_leaves_it_when_pulled(engine: str) -> None:
    """1 kg at rest on a stop; a pull 4 t lifts it at t = g/4, and then q = ∫∫ (4 t − g)."""
    plant = rd.Plant(RAIL, [rd.effects.RigidStops(0.0, 5.0)])
    run = rd.simulate(
        plant, [0.0], duration_s=3.0, controller=lambda t, q, v: np.array([4.0 * t]), engine=engine, **OPTIONS
    )
    (leaves,) = run.events
    assert leaves.name.endswith("leaves its lower stop")
    assert leaves.t == pytest.approx(G / 4, rel=1e-12)
    assert run.q[-1, 0] == pytest.approx(4 * (3 - G / 4) ** 3 / 6, rel=1e-11)


def test_stops_are_never_passed_and_the_ledger_closes() -> None:
    """Twenty random runs of two joints between stops, with friction, some starting at a stop: every one ends."""
    rng = np.random.default_rng(20261128)
    for k in range(20):
        lower, upper = -rng.uniform(0.3, 1.2, 2), rng.uniform(0.3, 1.2, 2)
        stops = rd.effects.RigidStops(lower, upper, rng.uniform(0, 1, 2))
        level = rng.uniform(0, 4, 2)
        plant = rd.Plant(
            ARM, [rd.effects.DryFriction(level, level * rng.uniform(1, 1.5)), rd.effects.ViscousFriction(0.1), stops]
        )
        q0 = rng.uniform(lower, upper)
        q0[0] = upper[0] if k % 3 == 0 else q0[0]
        run = rd.simulate(plant, q0, rng.normal(size=2), duration_s=1.5, engine="compiled", estimate_error=False,
                          method=rd.integrate.Adaptive(rtol=1e-10, atol=1e-10))  # fmt: skip
        assert run.outcome.ending == "finished", (k, run.outcome)
        assert (run.q >= lower).all(), k
        assert (run.q <= upper).all(), k
        ledger = run.ledger
        energy = ledger.kinetic + ledger.potential - sum(ledger.work.values())
        assert np.abs(energy - energy[0]).max() <= 1e-7, k
        steps = np.diff([each.t for each in run.events])
        assert (np.diff(ledger.work["rigid_stops"]) <= 1e-12).all(), k  # no impact adds energy
        assert (steps >= 0).all()


def test_joints_that_strike_together_are_solved_together() -> None:
    """Both at once, v⁺ = −e v⁻ for each; with different restitution no energy is made."""
    stops = rd.effects.RigidStops([-9.0, -9.0], [0.5, 0.5], [0.2, 0.9])
    plant = rd.Plant(ARM.with_(gravity=(0, 0, 0)), [stops])
    run = rd.simulate(plant, [0.5, 0.5], [1.0, 2.0], duration_s=0.01, **OPTIONS)
    assert [each.t for each in run.events] == [0.0, 0.0]
    assert run.events[0].v == pytest.approx((-0.2, -1.8), rel=1e-13)
    assert run.ledger.work["rigid_stops"][-1] < 0


def test_stops_that_are_struck_in_turn_come_to_rest_together() -> None:
    """A cart and its pole driven into a corner: each impact kicks the other joint off its stop, ever less."""
    arm = rd.load("cart_pole")
    stops = rd.effects.RigidStops([-0.6556, 0.5434], [-0.0705, 0.9402], [0.6, 0.0])
    drive = rd.control.PD(rd.control.hold([-0.7727, 0.6249]), kp=[370.0, 4.3], kd=[17.3, 1.14])
    plant = rd.Plant(arm, [rd.effects.ViscousFriction([3.6, 0.52]), stops])
    loose = {"method": rd.integrate.Adaptive(rtol=1e-4, atol=1e-6), "estimate_error": False}
    run = rd.simulate(plant, [-0.5163, 0.7435], [0.6811, 0.9512], duration_s=1.0, controller=drive, **loose)
    assert run.outcome.ending == "finished"
    assert len(run.events) < 300
    assert (np.diff(run.ledger.work["rigid_stops"]) <= 1e-12).all()


def test_joints_that_stops_throw_at_each_other_end_at_rest_all_of_them() -> None:
    """Three joints of a Panda at their stops, each impact of one a kick to the others: v = 0 of all three behind it.

    Impulses of three stops leave the other momenta as they are, and joint 3, which its load pulls off, starts from 0.
    """
    setup = held_scene(25158787, 74, "panda")[0].setup
    run = rd.simulate(replace(setup, duration_s=0.128, estimate_error=False, engine="interpreted"))
    last = [each for each in run.events if 0.1271 < each.t < 0.1272][-1]
    np.testing.assert_array_equal(np.array(last.v)[[0, 2, 6]], 0.0)
    M = setup.plant.dynamics.M(np.array(last.q))
    first = next(each for each in run.events if each.t > 0.12713)
    others = [1, 3, 4, 5]
    change = M @ (np.array(last.v) - first.v)
    assert np.abs(change[others]).max() < 1e-2 * np.abs(change).max()  # what loads do in 4 µs


@pytest.mark.parametrize("method", ["MoreauJean", "RK4", "DOP853"])
def test_a_start_of_a_batch_beyond_a_stop_is_refused_by_number(method: str) -> None:
    plant = rd.Plant(ARM, [rd.effects.RigidStops([-1.0, -1.0], [1.0, 1.0])])
    with pytest.raises(QueryError, match=r"q0 of run 1: 'joint_2' is 0\.2 beyond its upper stop"):
        rd.rollouts(plant, [[0.3, 0.2], [0.3, 1.2]], method=method)
    upper = [[1.0, 1.0], [1.0, 0.5]]
    with pytest.raises(QueryError, match=r"q0 of run 1: 'joint_2' is 0\.1 beyond its upper stop"):
        rd.rollouts(plant, [0.3, 0.6], vary={"rigid_stops.upper": upper}, method=method)


@pytest.mark.parametrize("method", ["RK4", "DOP853"])
def test_rollouts_are_the_runs_of_simulate(method: str) -> None:
    """To the last bit, friction swept."""
    plant = rd.Plant(ARM, [rd.effects.DryFriction([3.0, 1.0]), rd.effects.RigidStops([-1.5, -2.0], [1.0, 2.0], 0.5)])
    setup = rd.Setup(plant, [0.3, 0.4], duration_s=1.0, record_every_s=0.1, engine="compiled", method=method,
                     estimate_error=False)  # fmt: skip
    levels = np.array([[3.0, 1.0], [0.5, 2.0]])
    runs = rd.rollouts(setup, vary={"dry_friction.coulomb": levels})
    for i, level in enumerate(levels):
        one = rd.simulate(setup, plant=rd.Plant(ARM, [rd.effects.DryFriction(level), plant.effects[1]]))
        assert runs.q is not None
        assert (runs.q[i] == one.q).all()


def test_impacts_that_another_joint_feeds_come_to_an_end() -> None:
    """Joint 2 is pressed on a stop without loss, joint 1 sticks and slides at each of its ever smaller bounces."""
    plant = rd.Plant(ARM, [rd.effects.DryFriction([5.355, 0.0], [6.356, 0.0]), rd.effects.ViscousFriction(0.1),
                           rd.effects.RigidStops([-0.2, -0.3], [0.6, 0.7], [0.5, 1.0])])  # fmt: skip
    drive = rd.control.PD(rd.control.hold([0.322, -0.759]), kp=[215.56, 19.219], kd=[3.593, 0.32])
    run = rd.simulate(
        plant, [0.3, 0.4], [0.238, 1.792], duration_s=2.0, controller=drive, engine="compiled", estimate_error=False,
        method=rd.integrate.Adaptive(rtol=1e-9, atol=1e-9),
    )  # fmt: skip
    assert run.outcome.ending == "finished"
    assert run.ledger.closure <= 1e-8


@pytest.mark.parametrize("speed", [1e-2, 1e-7])  # [rad/s]: bounces that are followed, and bounces that are ended
def test_a_joint_that_an_impact_kicks_off_its_stop_gives_its_momentum_back(speed: float) -> None:
    """Joint 1 strikes at speed v, and joint 2, pressed on its stop, is kicked off it and comes to rest.

        v₁⁺ = −e v,  v₂⁺ = (1 + e) v M₁₂/M₂₂;   behind the bounces of joint 2, v₁ = −e v + (1 + e) v M₁₂²/(M₁₁ M₂₂)

    The stop of joint 2 pushes joint 2 alone, so that M₁₁ v₁ + M₁₂ v₂ stays after the impact, and no load acts on it.
    What C v adds in the time of bounces is of the order of v², 1e-14 here.
    """
    e, q = 0.7, np.array([0.3, 1.5])
    M = ARM.M(q)
    stops = rd.effects.RigidStops([-9.0, q[1]], [q[0], 9.0], [e, 0.5])
    run = rd.simulate(
        rd.Plant(ARM.with_(gravity=(0, 0, 0)), [stops]), [q[0] - speed / 100, q[1]], [speed, 0.0], duration_s=0.05,
        controller=lambda t, q, v: np.array([0.0, -5.0]), **OPTIONS,
    )  # fmt: skip
    after = speed * ((1 + e) * M[0, 1] ** 2 / (M[0, 0] * M[1, 1]) - e)
    assert run.v[-1] == pytest.approx([after, 0.0], rel=1e-9, abs=1e-14)
    assert run.q[-1, 1] == q[1]


def test_joints_that_impacts_kick_off_their_stops_strike_again_when_they_must() -> None:
    """As above, but joint 1 is thrown back by joint 2 in flight: at every speed v₁ ends at the same part of v.

    Speeds differ by 1e3; the flights of the slower one last from 1e-5 s to 1e-6 s, and 1e-5 of them is rounding of q.
    """
    parts = []
    for speed in (1e-2, 1e-5):
        stops = rd.effects.RigidStops([-9.0, 0.4], [0.3, 9.0], [0.7, 0.5])
        run = rd.simulate(
            rd.Plant(ARM.with_(gravity=(0, 0, 0)), [stops]), [0.3 - speed / 100, 0.4], [speed, 0.0], duration_s=0.05,
            controller=lambda t, q, v: np.array([0.0, -5.0]), **OPTIONS,
        )  # fmt: skip
        parts.append(run.v[-1, 0] / speed)
    assert parts[1] == pytest.approx(parts[0], rel=1e-4)


def test_an_impact_may_throw_a_joint_against_the_load_that_just_let_it_go() -> None:
    """Joint 2 breaks away downwards at t = 0, as joint 1 strikes its stop, whose impact throws joint 2 upwards.

    No energy is lost but by friction and the impact: the ledger closes to rounding.
    """
    plant = rd.Plant(
        ARM.with_(gravity=(0, 0, 0)),
        [rd.effects.DryFriction([0, 2.0], [0, 2.5]), rd.effects.RigidStops(-9.0, 0.5, 0.5)],
    )
    run = rd.simulate(
        plant, [0.5, 0.4], [1.0, 0.0], duration_s=0.05, controller=lambda t, q, v: np.array([0.0, -6.0]), **OPTIONS
    )
    assert [each.t for each in run.events[:2]] == [0.0, 0.0]
    assert run.events[1].v[1] > 3
    assert run.ledger.closure <= 1e-12


def test_the_stops_of_the_file_are_the_limits_of_its_joints() -> None:
    ur5 = rd.load("ur5")
    (both,) = rd.Plant(ur5, [rd.effects.RigidStops("urdf", "urdf")]).effects
    (one,) = rd.Plant(ur5, [rd.effects.RigidStops(-1.0, "urdf")]).effects
    assert (both.lower == ur5.lower).all()
    assert (both.upper == ur5.upper).all()
    assert (one.upper == ur5.upper).all()
