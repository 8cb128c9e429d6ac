"""The energy ledger: E(t) − E(0) = Σ W_k(t) + residual, and a residual that is the method's error alone."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn.effects import numbered
from tests.long import long, third

DOUBLE = rd.load("planar_2r")
SKEW, CART_POLE = rd.load("skew_tree"), rd.load("cart_pole")
FORCE = [3.0, -0.7, -2.0, 0.3, 4.0, 0.5]
FRICTION, SPRING = rd.effects.ViscousFriction([0.4, 0.2]), rd.effects.Spring([8.0, 5.0], [0.2, -0.3])
DRY = rd.effects.RegularisedCoulombFriction([0.5, 0.2], 0.5)  # smooth on the scale of a step
WINDOW = rd.effects.ExternalWrench("tip", FORCE, start_s=0.12, end_s=0.24)
PD = rd.control.PD(rd.control.quintic([0.4, -0.7], [0.9, 0.2], 0.3), kp=[60.0, 20.0], kd=[4.0, 1.0])
SAMPLED = rd.control.PD(PD.reference, kp=PD.kp, kd=PD.kd, period_s=0.02)
START = {"q0": [0.4, -0.7], "v0": [0.9, -0.5], "duration_s": 0.4}

SCENES = {
    "free": (rd.Plant(DOUBLE), None),
    "friction": (rd.Plant(DOUBLE, [FRICTION, DRY]), None),
    "spring": (rd.Plant(DOUBLE, [SPRING]), None),
    "wrench in a window": (rd.Plant(DOUBLE, [WINDOW]), None),
    "control": (rd.Plant(DOUBLE), PD),
    "all": (rd.Plant(DOUBLE, [FRICTION, DRY, SPRING, WINDOW]), PD),
    "all, sampled": (rd.Plant(DOUBLE, [FRICTION, DRY, SPRING, WINDOW]), SAMPLED),
}
CASES = [pytest.param(*scene, id=name) for name, scene in SCENES.items()]
scenes = pytest.mark.parametrize(("plant", "law"), [*third(CASES[:-1]), CASES[-1]])


@scenes
@pytest.mark.parametrize(
    ("name", "step"), [("RK4", 5e-3), ("GaussLegendre4", 5e-3), *long([("Midpoint", 1e-3), ("GaussLegendre2", 1e-3)])]
)
def test_residual_shrinks_with_the_order_of_the_method(name: str, step: float, plant, law) -> None:
    """Work is integrated by the method itself: residual(h)/residual(h/2) is 2ᵖ at least, less 0.3 of p at this h.

    Switches lie at multiples of 4 h, so that h is halved everywhere.
    """
    method, residuals = rd.integrate.method(name), []
    for h in (step, step / 2):
        run = rd.simulate(plant, **START, controller=law, method=method, step_s=h, estimate_error=False)
        residuals.append(np.abs(run.ledger.residual).max())
    assert residuals[1] > 1e-13
    assert np.log2(residuals[0] / residuals[1]) > method.order - 0.3


@scenes
@pytest.mark.parametrize("method", [rd.integrate.method("DP8"), rd.integrate.Adaptive()], ids=["DP8", "Adaptive"])
def test_the_ledger_closes_to_a_billionth_of_the_energy_exchanged(method, plant, law) -> None:
    """Order 8 at 5 ms is at rounding; tolerances of 1e-10 leave less than 1e-9."""
    step = {} if isinstance(method, rd.integrate.Adaptive) else {"step_s": 5e-3}
    run = rd.simulate(plant, **START, **step, controller=law, method=method, estimate_error=False)
    ledger = run.ledger
    assert run.outcome.ending == "finished"
    assert ledger.closure < 1e-9
    assert ledger.closure == np.abs(ledger.residual).max() / ledger.exchanged
    assert ledger.exchanged >= ledger.kinetic.max() + sum(np.abs(W[-1]) for W in ledger.work.values())


@scenes
def test_energy_and_work_are_those_of_their_definitions(plant, law) -> None:
    """E of the recorded states; W = ∫ τᵀ v dt by Simpson's rule over the samples between switches, error O(h⁴)."""
    run = rd.simulate(plant, **START, controller=law, method=rd.integrate.method("DP8"), step_s=1e-3)
    ledger, robot = run.ledger, DOUBLE
    M = robot.M(run.q)
    np.testing.assert_allclose(ledger.kinetic, (run.v * np.matvec(M, run.v)).sum(axis=1) / 2, rtol=1e-12)
    spring = SPRING.potential(robot, 0.0, run.q) if SPRING in plant.effects else 0.0
    np.testing.assert_allclose(ledger.potential, robot.potential_energy(run.q) + spring, rtol=1e-12)
    np.testing.assert_allclose(run.power["control"], (run.u * run.v).sum(axis=1), atol=1e-12)
    for effect, power in ((FRICTION, "viscous_friction"), (DRY, "regularised_coulomb_friction")):
        if effect in plant.effects:
            by_hand = (effect.torque(robot, 0.0, run.q, run.v) * run.v).sum(axis=1)
            np.testing.assert_allclose(run.power[power], by_hand, atol=1e-13)
    assert list(run.power) == list(ledger.work)
    inside = run.t >= 0.24 if WINDOW in plant.effects else run.t >= 0.0
    if law is SAMPLED:
        inside = run.t >= 0.38  # a tick of it: control's power jumps there
        inside[-1] = False  # a tick, too, after which the power is another
    else:
        inside = inside & (run.t <= 0.3 + 1e-12 if law is PD else True)  # where the reference ends
    for source, work in ledger.work.items():
        t, P, W = run.t[inside], run.power[source][inside], work[inside]
        middle = (t[1] - t[0]) / 3 * (P[:-2] + 4 * P[1:-1] + P[2:])
        np.testing.assert_allclose(W[2:] - W[:-2], middle, atol=1e-9 * max(1.0, np.abs(P).max()))


def test_power_is_the_derivative_of_work() -> None:
    """Central differences over 0.5 ms err by h²/6 · W‴, and W‴ is below 1e5 W/s² here."""
    plant, law = SCENES["all"][0], SCENES["all"][1]
    run = rd.simulate(plant, **START, controller=law, method=rd.integrate.method("RK4"), step_s=5e-4)
    for source, work in run.ledger.work.items():
        slope = (work[2:] - work[:-2]) / (run.t[2:] - run.t[:-2])
        cuts = np.array([0.12, 0.24, 0.3])
        smooth = (np.abs(run.t[1:-1, None] - cuts) > 6e-4).all(axis=1)
        even = np.isclose(run.t[2:] - run.t[1:-1], run.t[1:-1] - run.t[:-2], rtol=1e-6)
        np.testing.assert_allclose(slope[smooth & even], run.power[source][1:-1][smooth & even], atol=1e5 / 6 * 5e-4**2)
        assert np.abs(work).max() > 1e-3


@pytest.mark.parametrize("effect", [FRICTION, DRY], ids=lambda e: e.name)
@pytest.mark.parametrize("name", ["RK4", *long(["GaussLegendre4", "Rodas5PFixed"])])
def test_work_of_a_dissipative_effect_only_falls(name: str, effect) -> None:
    run = rd.simulate(rd.Plant(DOUBLE, [effect]), **START, method=rd.integrate.method(name), estimate_error=False)
    work = run.ledger.work[effect.name]
    assert work[0] == 0.0
    assert (np.diff(work) < 0).all()
    assert (run.power[effect.name] <= 0).all()
    assert run.ledger.energy[-1] < run.ledger.energy[0]


def test_conservative_effects_are_in_the_potential_and_do_no_work() -> None:
    """With a spring and stops only, E is constant, by the error of order 8."""
    stops, _ = rd.effects.joint_stops([-0.5, -1.0], [0.6, -0.2], stiffness=200.0)
    plant = rd.Plant(DOUBLE, [SPRING, stops])
    run = rd.simulate(plant, **START, method=rd.integrate.method("DP8"), step_s=1e-3, estimate_error=False)
    assert list(run.ledger.work) == list(run.power) == ["control"]
    assert not run.ledger.work["control"].any()
    own = DOUBLE.potential_energy(run.q) + sum(e.potential(DOUBLE, 0.0, run.q) for e in (SPRING, stops))
    np.testing.assert_allclose(run.ledger.potential, own, rtol=1e-13)
    assert np.ptp(stops.potential(DOUBLE, 0.0, run.q)) > 1e-3  # a stop was met
    assert np.ptp(run.ledger.kinetic) > 1.0
    np.testing.assert_allclose(run.ledger.energy, run.ledger.energy[0], atol=1e-4)  # a stop is a kink: k v² h³ at most


def test_effects_of_one_name_keep_their_own_accounts() -> None:
    """Half the friction twice is the whole of it."""
    halves = rd.Plant(DOUBLE, [rd.effects.ViscousFriction([0.2, 0.1]), SPRING, rd.effects.ViscousFriction([0.2, 0.1])])
    one = rd.simulate(rd.Plant(DOUBLE, [FRICTION, SPRING]), **START, estimate_error=False).ledger
    two = rd.simulate(halves, **START, estimate_error=False).ledger
    assert len(two.work) == 3
    _, first, second = two.work.values()
    np.testing.assert_allclose(first, second, rtol=1e-14)
    np.testing.assert_allclose(first + second, one.work["viscous_friction"], atol=1e-12)


@dataclass(frozen=True, eq=False)
class Grease(rd.effects.Dissipative):
    """Its name has a space."""

    name = "grease drag"
    damping: float

    def torque(self, dynamics: Any, t: float, q: Any, v: Any) -> Any:
        return -self.damping * v


def test_effects_of_one_name_with_a_space_keep_their_own_accounts() -> None:
    """Their powers are −b |v|²; the ledger closes to the tolerance of 1e-10, times some growth."""
    run = rd.simulate(rd.Plant(DOUBLE, [Grease(0.3), Grease(0.7)]), **START, engine="interpreted")
    assert list(run.power) == ["control", "grease drag", "grease drag 2"]
    np.testing.assert_allclose(run.power["grease drag 2"], -0.7 * (run.v**2).sum(axis=1), rtol=1e-12, atol=1e-14)
    np.testing.assert_allclose(run.power["grease drag"], run.power["grease drag 2"] * 3 / 7, rtol=1e-12, atol=1e-14)
    assert run.ledger.closure < 1e-8


@pytest.mark.parametrize("names", [("a b",) * 3, ("a 2", "a", "a"), ("a", "a", "a 2", "a 2")])
def test_numbered_names_differ(names: tuple[str, ...]) -> None:
    made = numbered(*names)
    assert len(set(made)) == len(names)
    assert all(new.startswith(name) for name, new in zip(names, made, strict=True))


def test_a_dissipative_effect_that_gains_is_told_whatever_its_name() -> None:
    run = rd.simulate(rd.Plant(DOUBLE, [Grease(0.3), Grease(-0.2)]), **START, engine="interpreted")
    assert [each.joint for each in run.remarks if each.kind == "dissipative_effect_gains"] == ["grease drag 2"]


def test_a_lift_at_constant_force_does_the_work_of_mechanics() -> None:
    """On a rail, W = F x for a constant force: the wrench pushes, E rises by as much; rounding, 1e-12."""
    cart = CART_POLE.with_(lock={"hinge": 0.4}, gravity=(0.0, 0.0, 0.0))
    push = rd.effects.ExternalWrench("cart", [7.0, 1.0, 2.0, 0.0, 0.0, 0.0])
    run = rd.simulate(rd.Plant(cart, [push]), q0=[0.2], v0=[-0.3], duration_s=1.0, estimate_error=False)
    np.testing.assert_allclose(run.ledger.work["external_wrench"], 7.0 * (run.q[:, 0] - 0.2), atol=1e-12)
    np.testing.assert_allclose(run.ledger.kinetic, 3.1 * run.v[:, 0] ** 2, atol=1e-12)
    np.testing.assert_allclose(run.power["external_wrench"], 7.0 * run.v[:, 0], atol=1e-12)


def test_nothing_moves_and_nothing_is_exchanged() -> None:
    run = rd.simulate(rd.Plant(DOUBLE.with_(gravity=(0, 0, 0))), q0=[0.4, -0.7], v0=[0.0, 0.0], duration_s=0.1)
    assert run.ledger.exchanged == run.ledger.closure == 0.0
    np.testing.assert_array_equal(run.q, np.tile([0.4, -0.7], (len(run.t), 1)))


def test_gauss_keeps_the_energy_of_a_long_swing_and_euler_does_not() -> None:
    """Symplectic in (q, p): no drift over 20 s, the error of E stays within twice that of the first 4 s."""
    start = {"q0": [-1.0, 0.5], "v0": [0.0, 0.0], "step_s": 0.01, "estimate_error": False}
    gauss = rd.simulate(DOUBLE, **start, duration_s=20.0, method="GaussLegendre4").ledger.residual
    assert np.abs(gauss[1600:]).max() < 2 * np.abs(gauss[:400]).max() < 1e-4
    euler = rd.simulate(DOUBLE, **start, duration_s=5.0, method="Euler").ledger
    assert euler.residual[-1] > 1.0


@dataclass(frozen=True, eq=False)
class Lopsided(rd.effects.Conservative):
    """A spring whose potential is too large by a half, and whose rest may move: d(E − W)/dt is not 0."""

    share: float = 1.0
    speed: float = 0.0

    def torque(self, dynamics: Any, t: float, q: Any, v: Any) -> Any:
        return -3.0 * (q - self.speed * t)

    def potential(self, dynamics: Any, t: float, q: Any) -> Any:
        return (1.5 * self.share * (q - self.speed * t) ** 2).sum(axis=-1)


@pytest.mark.parametrize("effect", [Lopsided(1.5), Lopsided(1.0, 2.0)], ids=["not its potential", "depends on time"])
def test_work_that_nothing_books_is_the_cause_of_a_ledger_that_does_not_close(effect: Lopsided) -> None:
    """dE/dt = Σ P fails at states, whatever the steps: a smaller step is no remedy, and is not proposed."""
    run = rd.simulate(rd.Plant(DOUBLE, [effect]), **START, engine="interpreted")
    assert "does not close: lopsided does" in run.leak
    assert "that its potential does not give" in run.leak
    assert "step" not in run.leak


def test_long_steps_are_the_cause_of_a_ledger_that_does_not_close() -> None:
    """Of order 1, at 20 ms, with all work booked: a quarter of the step, or a smaller tolerance, is the remedy."""
    run = rd.simulate(DOUBLE, [0.4, 0.2], [3.0, 2.0], duration_s=0.6, method="Euler", step_s=0.02)
    assert run.leak == "it does not close: the steps are too long for the motion; use step_s = 5e-03"
    finer = rd.simulate(DOUBLE, [0.4, 0.2], [3.0, 2.0], duration_s=0.6, method="Euler", step_s=0.005)
    assert finer.ledger.closure < run.ledger.closure / 2
    loose = rd.integrate.Adaptive(rtol=3e-2, atol=1e-1)
    run = rd.simulate(DOUBLE, [0.4, 0.2], [3.0, 2.0], duration_s=3.0, method=loose)
    assert run.leak == "it does not close: the tolerance is too loose; use rtol = 3e-04"


def test_a_stop_passed_within_a_step_is_the_cause_of_a_ledger_that_does_not_close() -> None:
    """Half an oscillation in the stop takes 25 ms, less than three steps; Rodas5PFixed damps it."""
    plant = rd.Plant(DOUBLE, rd.effects.joint_stops(-0.5, 0.6, 2e3, 0.0))
    run = rd.simulate(
        plant, [0.4, 0.2], [3.0, 2.0], duration_s=0.4, method="Rodas5PFixed", step_s=0.02, estimate_error=False
    )
    assert "does not close: joint 'joint_2' switches and switches back within 3 steps, at t = 0.1" in run.leak
    assert run.leak.endswith("use step_s = 5e-03")


def test_rounding_at_rest_is_no_leak() -> None:
    """Held by gravity compensation, K is 1e-30 J and the residual 1e-14 J of potentials of 10 J: rounding of these."""
    arm, q = rd.load("ur5"), [0.3, -0.6, 0.4, -1.2, 0.5, 1.1]
    run = rd.simulate(arm, q, duration_s=0.1, controller=rd.control.PDGravity(arm, rd.control.hold(q), kp=10.0, kd=1.0))
    assert run.ledger.closure > 1e-3
    assert run.leak == ""
    assert "does not close" not in run.summary


def test_an_arm_that_stands_exchanges_no_energy() -> None:
    """Held by its own weight's torque: what is left of power is rounding, and no part of it is stated."""
    q = np.array([0.4, -0.7])
    held = rd.simulate(
        DOUBLE, q, duration_s=0.2, controller=rd.control.PDGravity(DOUBLE, rd.control.hold(q), kp=9, kd=3)
    )
    assert not held.ledger.exchanges
    assert "J, no energy exchanged" in held.summary
    moved = rd.simulate(rd.Plant(DOUBLE), q, [1e-3, 0.0], duration_s=0.2)
    assert moved.ledger.exchanges
    assert "of the energy exchanged" in moved.summary
