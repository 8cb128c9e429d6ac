"""Effects with states, ż = rate(t, q, v, u, z): actuator lag, LuGre and Dahl friction against closed forms."""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn.foundations import EffectError
from tests.long import long, third
from tests.slides import slides

MASS = 0.7
SLIDER = slides(("slide", "base", "cart", MASS))
ARM = rd.load("planar_2r")
Q = np.array([0.1, 0.2])
FRICTION = rd.effects.LuGreFriction(120.0, [1.0, 0.8], 0.8, [1.0, 0.5], 1.5, 0.1)
BOTH = pytest.mark.parametrize("engine", ["interpreted", "compiled"])
SLOW_INTERPRETED = pytest.mark.parametrize("engine", [pytest.param("interpreted", marks=pytest.mark.long), "compiled"])


@dataclass(frozen=True, eq=False)
class Ramp(rd.control.Stateless):
    """u = c + d t."""

    constant: float
    slope: float = 0.0
    period_s: float = 0.0
    n: int = 1

    def torque(self, t, q, v, z):
        return np.stack([self.constant + self.slope * t])


def slide(effects, control, engine: str, **options) -> rd.Trajectory:
    options = {"method": "DP8", "step_s": 1e-3, "record_every_s": 0.01, "estimate_error": False} | options
    return rd.simulate(rd.Plant(SLIDER, effects), q0=[0.0], controller=control, engine=engine, **options)


@BOTH
def test_a_lag_of_first_order_follows_a_constant_command(engine: str) -> None:
    """The torque is u₀ (1 − exp(−t/T)), v = u₀/m (t − u T/u₀), and the work of the control is the kinetic energy."""
    u0, T = 3.0, 0.08
    run = slide([rd.effects.ActuatorLag(T)], Ramp(u0), engine, duration_s=0.4)
    u = u0 * (1 - np.exp(-run.t / T))
    np.testing.assert_allclose(run.u[:, 0], u, atol=1e-12)
    np.testing.assert_allclose(run.v[:, 0], (u0 * run.t - u * T) / MASS, atol=1e-12)
    np.testing.assert_allclose(run.effect_states["actuator_lag"][:, 0], u, atol=1e-12)
    np.testing.assert_allclose(run.ledger.work["control"], MASS * run.v[:, 0] ** 2 / 2, atol=1e-12)
    np.testing.assert_allclose(run.power["control"], u * run.v[:, 0], atol=1e-12)


@BOTH
def test_a_lag_follows_what_a_sampled_controller_holds(engine: str) -> None:
    """Between ticks c is constant: u(t + Δ) = c + (u(t) − c) exp(−Δ/T), while c changes from tick to tick."""
    T, period = 0.08, 0.05
    run = slide([rd.effects.ActuatorLag(T)], Ramp(1.0, 4.0, period), engine, duration_s=0.4)
    u, expected = 0.0, []
    for tick in np.arange(0, 0.4 - 1e-9, period):
        c = 1.0 + 4.0 * tick
        expected += [c + (u - c) * np.exp(-0.01 * k / T) for k in range(5)]
        u = c + (u - c) * np.exp(-period / T)
    np.testing.assert_allclose(run.u[:-1, 0], expected, atol=1e-12)
    assert run.extremes is not None
    assert run.extremes[2, 1, 0] == pytest.approx(u, abs=1e-9)  # the observer sees what is applied, not the command


@pytest.mark.parametrize(
    ("effects", "peak"),
    [
        ([rd.effects.EffortLimit(1.0), rd.effects.ActuatorLag(0.05)], 1.0 - np.exp(-6.0)),
        ([rd.effects.ActuatorLag(0.05), rd.effects.EffortLimit(1.0)], 1.0),
    ],
)
@BOTH
def test_a_limit_before_a_lag_cuts_the_command_and_one_after_it_the_torque(effects, peak: float, engine: str) -> None:
    """Command 3: cut to 1 and followed for six time constants; or followed, and cut after 0.4 of one."""
    for period in (0.0, 0.3):
        run = slide(effects, Ramp(3.0, 0.0, period), engine, duration_s=0.3)
        assert run.u.max() == pytest.approx(peak, abs=1e-9)


@SLOW_INTERPRETED
def test_lugre_friction_slides_steadily_at_its_level(engine: str) -> None:
    """Pushed by F beyond breakaway the speed goes to the root of F = g(v) + σ₂ v, and z to g / σ₀."""
    s0, s1, s2, fc, fs, vs, F = 400.0, 3.0, 2.0, 1.0, 1.4, 0.2, 2.5
    friction = rd.effects.LuGreFriction(s0, s1, s2, fc, fs, vs)
    run = slide([friction], Ramp(F), engine, duration_s=12.0, step_s=2e-3, record_every_s=0.1)
    v = run.v[-1, 0]
    level = fc + (fs - fc) * np.exp(-((v / vs) ** 2))
    assert v == pytest.approx((F - level) / s2, abs=1e-9)
    assert run.effect_states["lugre_friction"][-1, 0] == pytest.approx(level / s0, rel=1e-9)
    assert run.power["lugre_friction"][-1] == pytest.approx(-F * v, rel=1e-8)
    assert run.ledger.stored["lugre_friction"][-1] == pytest.approx(level**2 / (2 * s0), rel=1e-9)


@SLOW_INTERPRETED
def test_lugre_friction_at_rest_is_a_spring(engine: str) -> None:
    """Pushed slowly by F < f, with g = f: dz/dx = 1 − σ₀ z / f, so it rests at x = −(f/σ₀) ln(1 − F/f), σ₀ z = F."""
    s0, f, F = 50.0, 1.2, 0.7
    friction = rd.effects.LuGreFriction(s0, 0.0, 40.0, f, f, 0.1)  # heavily damped: it does not overshoot
    run = slide([friction], Ramp(F), engine, duration_s=50.0, step_s=0.02, record_every_s=0.5)
    assert run.q[-1, 0] == pytest.approx(-f / s0 * np.log(1 - F / f), rel=1e-9)
    assert s0 * run.effect_states["lugre_friction"][-1, 0] == pytest.approx(F, rel=1e-9)
    small = slide([friction], Ramp(1e-4 * f), engine, duration_s=50.0, step_s=0.02, record_every_s=0.5)
    assert 1e-4 * f / small.q[-1, 0] == pytest.approx(s0, rel=1e-4)  # presliding stiffness


def setup(engine: str, period: float = 0.0, **options) -> rd.Setup:
    effects = [rd.effects.ActuatorLag([0.05, 0.02]), FRICTION, rd.effects.EffortLimit(15.0)]
    control = rd.control.PID(rd.control.quintic(Q, [0.6, -0.3], 0.3), kp=90.0, ki=60.0, kd=20.0, period_s=period)
    return rd.Setup(
        rd.Plant(ARM, effects), Q, controller=control, record_every_s=0.01, estimate_error=False, engine=engine,
        **({"duration_s": 0.3, "method": "RK4", "step_s": 1e-3} | options),
    )  # fmt: skip


REST = [(name, period) for name in ("SemiImplicitEuler", "Rodas5PFixed") for period in (0.0, 0.005)]


@pytest.mark.parametrize(
    ("method", "period"),
    [("RK4", 0.0), ("GaussLegendre4", 0.005), *third([("RK4", 0.005), ("GaussLegendre4", 0.0), *REST])],
)
def test_both_engines_make_the_same_run_of_effects_with_states(method: str, period: float) -> None:
    """Beside controller states, in (q, v) and in (q, p); 100 steps leave some 1e-10 of rounding in stiff ones."""
    options = {"method": method, "duration_s": 0.1}
    ours, theirs = (rd.simulate(setup(engine, period, **options)) for engine in ("compiled", "interpreted"))
    assert ours.outcome.ending == "finished"
    np.testing.assert_allclose(ours.q, theirs.q, atol=1e-11)
    np.testing.assert_allclose(ours.u, theirs.u, atol=1e-8)
    np.testing.assert_allclose(ours.a, theirs.a, atol=1e-7)
    assert ours.controller_states is not None and ours.controller_states.shape == (11, 2)
    for name, z in theirs.effect_states.items():
        assert z.shape == (11, 2) and np.abs(z[-1]).min() > 0
        np.testing.assert_allclose(ours.effect_states[name], z, atol=1e-9)
    error = {"RK4": 1e-6, "GaussLegendre4": 1e-9, "Rodas5PFixed": 1e-6}.get(method, 0.1)
    assert ours.ledger.closure < error
    equation_of_motion = ARM.inverse_dynamics(ours.q, ours.v, ours.a)
    v, z = ours.v, ours.effect_states["lugre_friction"]
    level = FRICTION.coulomb + (1.5 - FRICTION.coulomb) * np.exp(-((v / 0.1) ** 2))
    bristles = v - 120.0 * np.abs(v) * z / level
    torque = 120.0 * z + FRICTION.bristle_damping * bristles + 0.8 * v
    np.testing.assert_allclose(equation_of_motion, ours.u - torque, atol=1e-9)


def only_takes_energy(swing: rd.Trajectory, effect: str, moved: float) -> None:
    """Work done on it minus what it stores never falls; without storage it would."""
    work, stored = swing.ledger.work[effect], swing.ledger.stored[effect]
    assert np.diff(work + stored).max() < 1e-9
    assert np.diff(work).max() > moved


def test_passive_bristles_only_take_energy() -> None:
    """With σ₂ ≥ σ₁ (f_s/f_c − 1)."""
    friction = rd.effects.LuGreFriction(200.0, 0.5, 0.4, 1.0, 1.6, 0.1)
    swing = rd.simulate(
        rd.Plant(rd.load("pendulum"), [friction]), q0=[0.9], duration_s=3.0, method="RK4", step_s=5e-4,
        record_every_s=0.01, estimate_error=False,
    )  # fmt: skip
    only_takes_energy(swing, "lugre_friction", 1e-6)
    assert swing.ledger.closure < 1e-7


def test_effect_states_are_kept_in_run_files_and_tables(tmp_path) -> None:
    run = rd.simulate(setup("compiled"))
    again = rd.read(run.save(tmp_path / "run"))
    for name in ("actuator_lag", "lugre_friction"):
        np.testing.assert_array_equal(again.effect_states[name], run.effect_states[name])
    np.testing.assert_array_equal(again.ledger.stored["lugre_friction"], run.ledger.stored["lugre_friction"])

    heading = run.save(tmp_path / "run.csv").read_text(encoding="utf-8").splitlines()[0]
    assert heading.endswith("actuator_lag state 1,actuator_lag state 2,lugre_friction state 1,lugre_friction state 2")


def test_a_plant_that_is_asked_takes_relaxed_states() -> None:
    """At z = 0 LuGre friction is −(σ₁ + σ₂) v, one state or a batch; a lag passes the actuation; also compiled."""
    plant, v = rd.Plant(ARM, [rd.effects.ActuatorLag(0.1), FRICTION]), np.array([[0.3, -0.7], [1.0, 2.0]])
    expected = -(np.array([1.0, 0.8]) + 0.8) * v
    np.testing.assert_allclose(plant.torque(v, v, t=0.0), expected, rtol=1e-14)
    np.testing.assert_array_equal(plant.actuation(v), v)
    np.testing.assert_allclose(rd.compiled(plant).torque(v, v, t=0.0), expected, rtol=1e-14)
    with pytest.raises(rd.RobotDynError, match="no actuation within the limits of the plant holds this state"):
        rd.linearise(rd.Plant(ARM, [rd.effects.EffortLimit(0.01)]), Q)


@dataclass(frozen=True, eq=False)
class Wrong(rd.effects.Stateful, rd.effects.Active):
    """An effect whose rate has another number of entries than it has states."""

    stiffness: float = field(default=1.0, metadata=rd.effects.coefficient("N m/rad", shapes=((),)))

    def state_size(self, n):
        return 3

    def state_rate(self, dynamics, t, q, v, u, z):
        return v

    def torque(self, dynamics, t, q, v, z):
        return -self.stiffness * z[:2]


def test_states_that_do_not_fit_are_refused() -> None:
    with pytest.raises(EffectError, match=r"Wrong.state_rate returned shape \(2,\) for 3 states"):
        rd.Setup(rd.Plant(ARM, [Wrong()]), Q, duration_s=0.1)

    class Both(Wrong, rd.effects.Conservative):
        def potential(self, dynamics, t, q):
            return q[..., 0]

    with pytest.raises(EffectError, match="both is Conservative and has states"):
        rd.Plant(ARM, [Both()])


STIFFNESS, LEVEL = 40.0, 1.3  # [N/m], [N]


def beats(t: float, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """A force of two frequencies, so that reversals fall on many parts of the curve."""
    return np.stack([2.0 * np.sin(3.1 * t + 0.4) + 1.1 * np.sin(7.3 * t)])


def dahl_run(exponent: float | None, engine: str, **options) -> rd.Trajectory:
    plant = rd.Plant(SLIDER, [rd.effects.DahlFriction(STIFFNESS, LEVEL, exponent)])
    options = {"duration_s": 6.0, "record_every_s": 0.01, "estimate_error": False} | options
    return rd.simulate(plant, q0=[0.0], controller=beats, engine=engine, **options)


def curve(start: float, path: np.ndarray, side: float, exponent: float) -> np.ndarray:
    """F after a path of one direction: w = 1 − side F/f, w = w₀ e^(−σ|Δq|/f), or w^(1−α) = w₀^(1−α) + (α−1) σ|Δq|/f."""
    w, way = 1 - side * start / LEVEL, STIFFNESS * np.abs(path) / LEVEL
    after = w * np.exp(-way) if exponent == 1 else (w ** (1 - exponent) + (exponent - 1) * way) ** (1 / (1 - exponent))
    return side * LEVEL * (1 - after)


@pytest.mark.parametrize("exponent", [None, 1.5, *long([1.0, 3.0])])
@BOTH
def test_the_hysteresis_is_that_of_the_closed_form(exponent: float | None, engine: str) -> None:
    """From reversal to reversal F is a function of the path alone; a tolerance of 1e-12 leaves 1e-9."""
    swing = dahl_run(exponent, engine, method=rd.integrate.Adaptive("DOP853", 1e-12, 1e-14))
    turns = [(each.t, each.q[0]) for each in swing.events]
    assert len(turns) > 4
    at, place = np.array([0.0, *(t for t, _ in turns), np.inf]), np.array([0.0, *(q for _, q in turns)])
    force, expected = 0.0, np.empty(len(swing.t))
    for k, (start, end) in enumerate(pairwise(at)):
        inside = (swing.t >= start) & (swing.t < end)
        way = swing.q[inside, 0] - place[k]
        side = float(np.sign(way.sum()))
        expected[inside] = curve(force, way, side, exponent or 1.0)
        if k + 1 < len(place):
            force = float(curve(force, np.array([place[k + 1] - place[k]]), side, exponent or 1.0)[0])
    found = STIFFNESS * swing.effect_states["dahl_friction"][:, 0]
    assert np.ptp(found) > 1.5 * LEVEL
    np.testing.assert_allclose(found, expected, atol=1e-9)
    assert np.abs(swing.ledger.residual).max() < 1e-10


@pytest.mark.parametrize("exponent", [2.5, *long([None])])
def test_bristles_only_take_energy(exponent: float | None) -> None:
    only_takes_energy(dahl_run(exponent, "interpreted"), "dahl_friction", 1e-3)


def test_an_exponent_of_one_that_is_stated_is_the_default() -> None:
    np.testing.assert_allclose(dahl_run(1.0, "interpreted").q, dahl_run(None, "interpreted").q, atol=1e-10)
