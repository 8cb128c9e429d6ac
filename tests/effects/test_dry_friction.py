"""Dry friction that sticks: what holds does not move, what slides stops where and when closed forms say."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cache
from typing import Any

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn.effects.set_valued import settled
from robot_dyn.foundations import EffectError, SingularError, coefficient
from tests.campaigns.estimates.scenes import arms
from tests.long import long

ENGINES = ["interpreted", "compiled"]
RAIL = arms()["rail"]  # 1 kg on a vertical rail
ARM = rd.load("planar_2r")
TIGHT = rd.integrate.Adaptive(rtol=1e-12, atol=1e-12)
OPTIONS = {"estimate_error": False, "method": TIGHT}


def DRIVE(t, q, v):
    """A push to and fro, about as large as friction."""
    return np.array([4.0 * np.sin(3 * t), 1.6 * np.cos(5 * t)])


def level(robot: rd.Robot, g: float = 0.0) -> rd.Robot:
    """The rail in gravity −g along it."""
    return robot.with_(gravity=(0, 0, -g))


@pytest.mark.parametrize("part", [0.3, 0.97, 1.0, 1 + 1e-15])
def test_a_load_within_friction_moves_nothing(part: float) -> None:
    """A block on an incline for an hour: 0.0 to the last bit, also with the load exactly at the limit."""
    g = 9.80665 * np.sin(np.radians(20))
    run = rd.simulate(
        rd.Plant(level(RAIL, g), [rd.effects.DryFriction(g / part)]), [0.25], duration_s=3600.0, **OPTIONS
    )
    assert (run.q == 0.25).all()
    assert (run.v == 0).all()
    assert run.outcome.ending == "finished"


def test_a_load_above_friction_moves_by_what_is_left() -> None:
    """1e-9 above: q = −(g − f) t²/2, to the rounding of the load itself."""
    run = rd.simulate(
        rd.Plant(level(RAIL, 5.0), [rd.effects.DryFriction(5.0 * (1 - 1e-9))]), [0.0], duration_s=4.0, **OPTIONS
    )
    assert run.q[-1, 0] == pytest.approx(-5e-9 * 8, rel=1e-6)


@dataclass(frozen=True, eq=False)
class Drag(rd.effects.Dissipative):
    """τ = −c v, with c under the names that set-valued effects give their mode."""

    held: Any = field(metadata=coefficient("N m s/rad", minimum=0))
    _direction: Any = field(metadata=coefficient("N m s/rad", minimum=0))

    def thresholds(self, n: int) -> tuple[()]:
        return ()

    def torque(self, dynamics, t, q, v):
        return -(self.held + self._direction) * v


@pytest.mark.parametrize("engine", ENGINES)
def test_the_mode_is_written_into_effects_that_have_one_alone(engine: str) -> None:
    """Beside dry friction, drag of the user's is what viscous friction with the same coefficients is."""
    start, friction = ([0.31, -0.73], [0.9, -1.7]), rd.effects.DryFriction([0.4, 0.2])
    plants = [
        rd.Plant(ARM, [each, friction]) for each in (Drag(1.5, [0.5, 1.5]), rd.effects.ViscousFriction([2.0, 3.0]))
    ]
    ours, theirs = (rd.simulate(each, *start, duration_s=0.3, engine=engine, **OPTIONS) for each in plants)
    np.testing.assert_allclose(ours.q, theirs.q, rtol=0, atol=1e-13)


@pytest.mark.parametrize("engine", ENGINES)
@pytest.mark.parametrize(("v0", "g"), [(1.7, 2.0), (-2.3, 2.0), (0.9, 0.0)])
def test_a_sliding_block_stops_when_and_where_it_must(engine: str, v0: float, g: float) -> None:
    """At t = |v₀| / (f ± g) and v₀² / 2 (f ± g), to 1e-12, and stays there: f > g."""
    f = 3.0
    run = rd.simulate(
        rd.Plant(level(RAIL, g), [rd.effects.DryFriction(f)]), [0.1], [v0], duration_s=3.0, engine=engine, **OPTIONS
    )
    slows = f + g * np.sign(v0)
    (stop,) = run.events
    assert stop.name.endswith("sticks")
    assert stop.t == pytest.approx(abs(v0) / slows, rel=1e-12)
    assert run.q[-1, 0] == pytest.approx(0.1 + v0 * abs(v0) / (2 * slows), rel=1e-12)
    assert run.v[-1, 0] == 0.0
    assert run.ledger.work["dry_friction"][-1] == pytest.approx(-f * abs(run.q[-1, 0] - 0.1), rel=1e-12)


@pytest.mark.parametrize(("engine", "slips"), [("compiled", 10), *long([("interpreted", 3)])])
def test_stick_slip_has_the_period_of_its_closed_form(engine: str, slips: int) -> None:
    """A spring k drawn at speed V, f_s of rest and f_k of sliding.

    r = (f_s − f_k) / k,  T = 2 r / V + (2/ω) (π − atan(ω r / V)),  slips of V t_slip + 2 r; 1e-9 in all.
    """
    k, V, fs, fk = 9.0, 0.1, 1.4, 1.0
    omega, r = np.sqrt(k), (fs - fk) / k
    slip = 2 / omega * (np.pi - np.arctan(omega * r / V))
    drawn = lambda t, q, v: k * (V * t - q)  # noqa: E731
    plant = rd.Plant(level(RAIL), [rd.effects.DryFriction(fk, fs)])
    run = rd.simulate(plant, [0.0], duration_s=3.0 * slips, controller=drawn, engine=engine, **OPTIONS)
    starts = np.array([each.t for each in run.events if each.name.endswith("slides")])
    stops = np.array([each.t for each in run.events if each.name.endswith("sticks")])
    places = np.array([each.q[0] for each in run.events if each.name.endswith("sticks")])
    assert len(starts) > slips
    assert starts[0] == pytest.approx(fs / (k * V), abs=1e-10)
    assert np.diff(starts)[1:] == pytest.approx(2 * r / V + slip, abs=1e-9)
    assert stops[1:] - starts[1 : len(stops)] == pytest.approx(slip, abs=1e-9)
    assert np.diff(places)[1:] == pytest.approx(V * slip + 2 * r, abs=1e-9)


def test_friction_of_rest_alone_catches_what_turns_round() -> None:
    """f_k = 0: 1 kg thrown up on a rail slides freely to its highest point, and stays there."""
    run = rd.simulate(
        rd.Plant(level(RAIL, 2.0), [rd.effects.DryFriction(0.0, 3.0)]), [0.0], [1.0], duration_s=2.0, **OPTIONS
    )
    (stop,) = run.events
    assert stop.t == pytest.approx(0.5, rel=1e-12)
    assert run.q[-1, 0] == pytest.approx(0.25, rel=1e-12)


def test_what_cannot_be_decided_is_refused() -> None:
    """A joint without inertia is named, as without friction; balls and longdouble do not decide what is held."""
    with pytest.warns(rd.ModelWarning):
        tip = rd.load("massless_tip")
    with pytest.raises(SingularError, match="'pointer_joint' carries no inertia"):
        rd.Plant(tip, [rd.effects.DryFriction(1.0)]).forward_dynamics([0.3, 0.4], [0.0, 0.0], [0.0, 0.0], t=0.0)
    for arithmetic in (rd.accuracy.Ball(80), np.longdouble):
        plant = rd.Plant(rd.Lagrangian(ARM, arithmetic), [rd.effects.DryFriction(1.0)])
        with pytest.raises(EffectError, match="dry_friction: held joints can be determined in float64 only"):
            plant.forward_dynamics([0.3, 0.4], [0.0, 0.0], [0.0, 0.0], t=0.0)


def test_stribecks_curve_is_followed_while_sliding() -> None:
    """V' = −f(v) of 1 kg against SciPy, from 2 m/s; friction of rest holds what sliding would not."""
    from scipy.integrate import solve_ivp

    fk, fs, vs = 1.0, 1.6, 0.5
    plant = rd.Plant(level(RAIL), [rd.effects.DryFriction(fk, fs, vs)])
    run = rd.simulate(plant, [0.0], [2.0], duration_s=3.0, record_every_s=0.1, **OPTIONS)
    stops = lambda t, y: y[1]  # noqa: E731
    stops.terminal = True
    of = solve_ivp(
        lambda t, y: [y[1], -(fk + (fs - fk) * np.exp(-((y[1] / vs) ** 2)))], (0, 3), [0.0, 2.0], "DOP853",
        rtol=1e-13, atol=1e-13, events=stops,
    )  # fmt: skip
    assert run.events[0].t == pytest.approx(of.t_events[0][0], rel=1e-11)
    assert run.q[-1, 0] == pytest.approx(of.y[0, -1], rel=1e-11)


@pytest.mark.parametrize("engine", ENGINES)
def test_a_step_up_to_an_event_has_an_error_within_the_tolerance_too(engine: str) -> None:
    """A reversal in 2e-5 s through Stribeck's curve, which a long step leaps over: t = ∫ dv / (F + f(v)).

    By quadrature, to 1e-11 s; without the curve it is off by (f_s − f_k) v_s √π / 2 F² = 2e-8.
    """
    from scipy.integrate import quad

    F, fk, fs, vs = 600.0, 1.0, 1.4, 0.02
    plant = rd.Plant(level(RAIL, F), [rd.effects.DryFriction(fk, fs, vs)])
    run = rd.simulate(plant, [0.0], [30.0], duration_s=0.1, engine=engine, **OPTIONS)
    parts = [quad(lambda v: 1 / (F + fk + (fs - fk) * np.exp(-((v / vs) ** 2))), a, b, epsabs=1e-15, epsrel=1e-13)[0]
             for a, b in ((0.0, 0.05), (0.05, 0.2), (0.2, 30.0))]  # fmt: skip
    assert run.events[0].name.endswith("reverses")
    assert run.events[0].t == pytest.approx(sum(parts), abs=1e-11)


def test_an_arm_obeys_the_law_of_friction_at_every_sample() -> None:
    """Where a joint slides M a + C v + N = u − f sign(v); where it rests the torque that is missing is at most f."""
    f = np.array([3.0, 1.0])
    run = rd.simulate(
        rd.Plant(ARM, [rd.effects.DryFriction(f)]), [-1.4, 0.2], duration_s=4.0, controller=DRIVE, **OPTIONS
    )
    missing = ARM.inverse_dynamics(run.q, run.v, run.a) - run.u
    events = np.array([each.t for each in run.events])
    apart = np.abs(run.t[:, None] - events).min(axis=1) > 1e-9
    rests = (run.v == 0) & apart[:, None]
    slides = (run.v != 0) & apart[:, None]
    assert rests.any()
    assert (np.abs(missing) <= f + 1e-9)[rests].all()
    assert np.abs(missing + f * np.sign(run.v))[slides].max() <= 1e-9
    ledger = run.ledger
    energy = ledger.kinetic + ledger.potential - sum(ledger.work.values())
    assert np.abs(energy - energy[0]).max() <= 1e-9


def test_both_engines_switch_alike() -> None:
    """The same events in the same order; times to 1e-10, since roundings differ."""
    plant = rd.Plant(ARM, [rd.effects.DryFriction([3.0, 1.0], [3.5, 1.0])])
    runs = [
        rd.simulate(plant, [-1.4, 0.2], duration_s=3.0, controller=DRIVE, engine=engine, **OPTIONS)
        for engine in ENGINES
    ]
    names = [[each.name for each in run.events] for run in runs]
    assert names[0] == names[1]
    assert len(names[0]) > 5
    for one, other in zip(*(run.events for run in runs), strict=True):
        assert abs(one.t - other.t) < 1e-10


def test_joints_that_break_away_together_move_the_way_they_were_let_go() -> None:
    """Coupled joints loaded at f_s, some beyond, f_k < f_s: |λ| ≤ f_s of those held, a along the slip of the others."""
    rng, panda = np.random.default_rng(5), rd.load("panda")
    arms = ARM, panda.with_(lock=dict.fromkeys(panda.joint_names[7:], 0.0))
    for k in range(300):
        arm = arms[k % 2]
        n, q = arm.n, rng.uniform(-1, 1, arm.n)
        M, fk = arm.M(q), rng.uniform(0.1, 3, n)
        fs = fk * rng.uniform(1, 1.8, n)
        load = fs * rng.choice([-1, 1], n) * rng.choice([0.5, 1, 1, 1.001, 1.3], n)
        i = int(rng.integers(n))
        forced = {i: int(np.sign(load[i]))} if k % 3 == 0 and abs(load[i]) >= fs[i] else {}
        _, mode = settled([rd.effects.DryFriction(fk, fs)], M, load, q, np.zeros(n), forced)
        free = 1 - mode.held
        a = np.linalg.solve(M * np.outer(free, free) + np.diag(mode.held), free * (load - fk * mode.direction))
        assert (np.abs(load - M @ a)[mode.held > 0] <= (1 + 1e-9) * fs[mode.held > 0]).all(), k
        assert (a * mode.direction >= -1e-9 * np.abs(a).max()).all(), k


@pytest.mark.parametrize("n", [1, 2, 7])
def test_a_joint_at_its_limit_is_let_go_whatever_the_rounding_of_its_load(n: int) -> None:
    """Loaded to f_s but for some units in the last place, and known to break away: it is not held again."""
    rng = np.random.default_rng([8, n])
    for _ in range(60):
        U = rng.normal(size=(n, n))
        fs, i = rng.uniform(0.1, 5, n), int(rng.integers(n))
        load = np.zeros(n)
        load[i] = fs[i] * (1 + float(rng.integers(-8, 9)) * np.finfo(float).eps)
        _, mode = settled([rd.effects.DryFriction(fs)], U @ U.T + np.eye(n), load, np.zeros(n), np.zeros(n), {i: 1})
        assert mode.held.tolist() == [k != i for k in range(n)]
        assert mode.direction[i] == 1


def driven_panda(integrator: rd.Integrator | rd.integrate.Adaptive | str, **options) -> rd.Trajectory:
    """Panda, driven about its weight against dry and viscous friction, some 55 switches in 2 s."""
    panda = rd.load("panda")
    panda = panda.with_(lock=dict.fromkeys(panda.joint_names[7:], 0.0))
    q0 = np.array([0, -0.5, 0.2, -1.9, 0.1, 1.4, 0.5])
    A, omega = np.array([6, 10, 5, 8, 2, 1.5, 0.6]), np.array([4, 5, 6, 4.5, 7, 5.5, 8])
    weight, levels = panda.N(q0), [3, 6, 2, 4, 1, 0.8, 0.3]
    return rd.simulate(
        rd.Plant(panda, [rd.effects.ViscousFriction(0.1), rd.effects.DryFriction(levels)]), q0, duration_s=2.0,
        controller=lambda t, q, v: 0.8 * weight + A * np.sin(omega * t + 0.3), engine="compiled",
        estimate_error=False, method=integrator, **options,
    )  # fmt: skip


def test_a_joint_breaks_away_in_machine_code_as_in_python() -> None:
    """Machine code has the right angles of a file in full, Pinocchio 1e-11 of the loads beside it: one decides."""
    plant = rd.Plant(rd.load("ur5"), [rd.effects.DryFriction(2.0)])
    compiled, interpreted = (
        rd.simulate(plant, [0.3, -0.9, 0.8, -0.2, 0.4, 0.1], duration_s=0.25, engine=engine, estimate_error=False)
        for engine in ("compiled", "interpreted")
    )
    assert names(compiled) == names(interpreted)
    assert names(compiled)[-1] == "elbow_joint slides"
    for one, other in zip(compiled.events, interpreted.events, strict=True):
        assert one.t == pytest.approx(other.t, abs=1e-10)


def names(run: rd.Trajectory) -> list[str]:
    return [each.name for each in run.events]


@pytest.mark.long
def test_an_arm_of_seven_joints_sticks_and_slides_to_eleven_digits() -> None:
    """Errors of at most ten times the tolerance."""
    exact, *others = (
        driven_panda(rd.integrate.Adaptive(rtol=tolerance, atol=tolerance), record_every_s=0.02)
        for tolerance in (1e-13, 1e-8, 1e-12)
    )
    assert len(exact.events) > 50
    for tolerance, other in zip((1e-8, 1e-12), others, strict=True):
        assert names(other) == names(exact)
        assert np.abs(other.q - exact.q).max() <= 10 * tolerance


@cache
def exactly_driven_panda() -> rd.Trajectory:
    return driven_panda(rd.integrate.Adaptive(rtol=1e-13, atol=1e-13), record_every_s=2.0)


@pytest.mark.parametrize(("method", "coarsest", "order"), long([("RK4", 64, 3.5), ("DP8", 32, 5.0)]))
def test_fixed_steps_keep_their_order_on_an_arm_of_seven_joints(method: str, coarsest: int, order: float) -> None:
    """Mean slope over four halvings from 1/16 s or 1/32 s, where the events are already those of the exact motion."""
    exact = exactly_driven_panda()
    errors = []
    for k in range(5):
        run = driven_panda(method, step_s=2.0 / (coarsest * 2**k), record_every_s=2.0)
        assert names(run) == names(exact)
        errors.append(np.abs(run.q[-1] - exact.q[-1]).max())
    assert np.log2(errors[0] / errors[-1]) / 4 >= order


@pytest.mark.parametrize(("method", "order"), [("RK4", 4), *long([("Midpoint", 2), ("DP8", 8)])])
def test_fixed_steps_keep_their_order_across_sticking(method: str, order: int) -> None:
    """Mean slope over three halvings, against DOP853 at 1e-12; within 1 of the order of the method."""
    plant = rd.Plant(ARM, [rd.effects.DryFriction([3.0, 1.0])])
    options = {"duration_s": 2.0, "controller": DRIVE, "estimate_error": False, "record_every_s": 2.0}
    exact = rd.simulate(plant, [-1.4, 0.2], method=TIGHT, **options).q[-1]
    steps = [0.05 / 2**k for k in range(4)] if method != "DP8" else [0.1 / 2**k for k in range(3)]
    errors = [
        np.abs(rd.simulate(plant, [-1.4, 0.2], method=method, step_s=h, **options).q[-1] - exact).max() for h in steps
    ]
    slope = np.log2(errors[0] / errors[-1]) / (len(steps) - 1)
    assert slope > order - 1
