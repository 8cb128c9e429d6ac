"""The actuation along a run by cause: u = M a + C v + ∂V/∂q − Σ τ_effect at its samples, with states of effects."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn.foundations import QueryError
from tests.long import long, third
from tests.user_parts import Push

BODY = rd.Payload("tool0", 5.0, (0.1, 0.0, 0.2))
ROUNDING = 1e-12  # of the largest torque
E = rd.effects


def plants() -> dict[str, rd.Plant]:
    """Smooth ones, ones with states, and set-valued ones that stick, strike and switch."""
    ur5, arm = rd.load("ur5"), rd.load("planar_2r")
    push = E.ExternalWrench("tool0", [3.0, -2.0, 1.0, 0.1, 0.2, -0.3], start_s=0.1, end_s=0.2)
    return {
        "friction and springs": rd.Plant(
            ur5.with_(payload=BODY), [E.ViscousFriction(0.5), E.RegularisedCoulombFriction(0.3), E.Spring(2.0, 0.1)]
        ),
        "payload": rd.Plant(ur5, [E.CarriedPayload(BODY, 0.1, 0.25), push]),
        "Dahl": rd.Plant(arm, [E.DahlFriction(50.0, 0.4)]),
        "LuGre": rd.Plant(arm, [E.LuGreFriction(200.0, 1.0, 0.1, 0.5, 0.7, 0.05)]),
        "geared motors": rd.Plant(arm, [E.SeriesElastic([900.0, 0.0], 0.01, 10.0, damping=2.0, viscous=0.1)]),
        "backlash": rd.Plant(arm, [E.RigidBacklash([0.01, 0.0], 0.01, 10.0, viscous=0.2), E.ViscousFriction(0.2)]),
        "dry friction": rd.Plant(arm, [E.DryFriction(2.0, 2.5)]),
        "stops": rd.Plant(arm, [E.RigidStops([-0.5, -0.2], [0.5, 0.5], 0.3), E.DryFriction(0.7)]),
        "limits": rd.Plant(arm, [E.EffortLimit(0.8), E.ActuatorLag(0.02), E.ViscousFriction(0.2)]),
    }


def pull(t: float, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    return np.array([3.0, -1.0, 0.5, 0.2, -0.4, 0.3][: len(q)]) * np.sin(9.0 * t + np.arange(len(q)))


@pytest.mark.parametrize(
    ("name", "engine"),
    [
        *((name, "compiled") for name in ("payload", "LuGre", "geared motors", "dry friction", "stops", "limits")),
        *long((name, "compiled") for name in ("friction and springs", "Dahl", "backlash")),
        *third((name, "interpreted") for name in plants()),
    ],
)
def test_causes_add_up_to_the_actuation(name: str, engine: str) -> None:
    """To rounding, at all samples: those of joints that stick, strike and break away too."""
    plant = plants()[name]
    n = plant.dynamics.n
    hold = rd.control.PD(rd.control.hold([0.5] * n), kp=20.0, kd=2.0)
    start = np.linspace(0.3, 0.4, n), np.linspace(1.0, -0.6, n)
    run = rd.simulate(plant, *start, duration_s=0.4, controller=hold, engine=engine, estimate_error=False)
    split = run.causes()
    largest = max(np.abs(each).max() for each in split.torques.values())
    assert np.abs(run.u).max() > 0.01 * largest
    assert np.abs(split.unexplained).max() <= ROUNDING * largest
    assert split.tau is run.u or np.array_equal(split.tau, run.u)
    assert list(split.torques)[:3] == ["inertia", "Coriolis", "gravity"]


def test_each_cause_of_a_run_is_its_term() -> None:
    """M a, C v, ∂V/∂q of the samples, and laws of the effects: the state of Dahl's model, the deflection of springs."""
    arm = rd.load("planar_2r")
    k, damping, ratio = 900.0, 2.0, 10.0
    motors = E.SeriesElastic([k, 0.0], 0.01, ratio, damping=damping)
    run = rd.simulate(rd.Plant(arm, [E.DahlFriction(50.0, 0.4), motors]), [0.3, 0.4], [1.0, -0.5], duration_s=0.3)
    found = run.causes().torques
    np.testing.assert_allclose(found["inertia"], np.einsum("kij,kj->ki", arm.M(run.q), run.a), atol=1e-11)
    np.testing.assert_allclose(found["Coriolis"], np.einsum("kij,kj->ki", arm.C(run.q, run.v), run.v), atol=1e-11)
    np.testing.assert_allclose(found["gravity"], arm.N(run.q), atol=1e-12)
    np.testing.assert_allclose(found["dahl_friction"], 50.0 * run.effect_states["dahl_friction"], atol=1e-12)
    deflection, speed = run.effect_states["series_elastic"].T
    spring = k * deflection + damping * (speed - run.v[:, 0])
    # what the motor takes for itself: its actuation less the torque of its spring
    np.testing.assert_allclose(found["series_elastic"][:, 0], run.u[:, 0] - spring, atol=1e-11)
    assert not found["series_elastic"][:, 1].any()


def test_dry_friction_at_rest_takes_the_load() -> None:
    """An arm without gravity, pulled below the level: u is friction alone, which stays at its level after it slides."""
    arm, level = rd.load("planar_2r").with_(gravity=(0.0, 0.0, 0.0)), 1.0
    ramp = lambda t, q, v: np.array([2.0 * t, 0.0])  # noqa: E731
    run = rd.simulate(rd.Plant(arm, [E.DryFriction(level)]), [0.3, 0.4], duration_s=0.8, controller=ramp)
    found, held = run.causes().torques, run.t < 0.5
    np.testing.assert_allclose(found["dry_friction"][held], run.u[held], atol=1e-15)
    assert not found["inertia"][held].any()
    later = run.t > 0.51
    np.testing.assert_allclose(found["dry_friction"][later, 0], level, rtol=1e-13)


def test_a_joint_that_breaks_away_at_the_start_accelerates_there() -> None:
    """The sample at t = 0 has the acceleration after it, M a = u − ∂V/∂q ∓ f_k, and its causes add up."""
    arm, q = rd.load("planar_2r"), np.array([0.3, 0.4])
    for engine in ("interpreted", "compiled"):
        run = rd.simulate(rd.Plant(arm, [E.DryFriction(0.7)]), q, duration_s=0.1, engine=engine)
        assert np.array_equal(run.v[0], [0.0, 0.0]) and abs(run.a[0, 0]) > 1.0
        np.testing.assert_allclose(run.a[0], run.a[1], rtol=0.01)
        split = run.causes()
        assert np.abs(split.unexplained).max() <= ROUNDING * np.abs(split.torques["gravity"]).max()


def test_a_stop_bears_what_friction_does_not() -> None:
    """An arm at rest on its stops, with dry friction: friction takes the load up to its level, stops the rest."""
    arm, level = rd.load("planar_2r"), 0.7
    plant = rd.Plant(arm, [E.RigidStops([-0.3, -0.2], [0.5, 0.5]), E.DryFriction(level)])
    run = rd.simulate(plant, [0.3, 0.2], duration_s=3.0)
    found = run.causes().torques
    resting = (run.v == 0).all(axis=1) & (run.a == 0).all(axis=1)
    load = -arm.N(run.q[resting])
    assert resting.any() and np.abs(load).max() > level
    np.testing.assert_allclose(found["dry_friction"][resting], load.clip(-level, level), atol=1e-12)
    total = found["dry_friction"][resting] + found["rigid_stops"][resting]
    np.testing.assert_allclose(total, load, atol=1e-12)


def test_causes_are_kept_in_run_files(tmp_path) -> None:
    """A file holds what effects exerted, so that a run is split where its plant is not known."""
    run = rd.simulate(plants()["LuGre"], [0.3, 0.4], [1.0, -0.5], duration_s=0.2, controller=pull)
    again = rd.read(run.save(tmp_path / "run.npz")).causes()
    for name, torque in run.causes().torques.items():
        np.testing.assert_array_equal(again.torques[name], torque)


def test_a_run_without_what_its_effects_exerted_says_so() -> None:
    run = rd.simulate(plants()["LuGre"], [0.3, 0.4], [1.0, -0.5], duration_s=0.1)
    with pytest.raises(QueryError, match=r"contains no torques of its effects.*simulate it again"):
        replace(run, effect_torques=None).causes()
    with pytest.raises(QueryError, match="contains no URDF"):
        replace(run, metadata={}).causes()
    with pytest.raises(QueryError, match="no accelerations"):
        replace(run, a=run.a * np.nan).causes()


def test_a_users_effect_is_a_cause_and_is_not_called_again_later() -> None:
    """It may change after the run: what it exerted is known when simulate returns. Without an estimate it is not."""
    plant = rd.Plant(rd.load("planar_2r"), [Push(lambda t, q, v: 0.3 + 0 * v)])
    run = rd.simulate(plant, [0.3, 0.4], duration_s=0.05, method="RK4")
    assert "effect_torques" in vars(run)
    np.testing.assert_array_equal(run.causes().torques["push"], np.full_like(run.q, -0.3))
    brief = rd.simulate(plant, [0.3, 0.4], duration_s=0.05, method="RK4", estimate_error=False)
    with pytest.raises(QueryError, match="simulate it again with its error estimate"):
        brief.causes()


def test_a_run_that_diverges_is_split_as_far_as_it_is_finite() -> None:
    """Its rows with nan or inf are NaN, and nothing is raised."""
    plant = rd.Plant(rd.load("planar_2r"), [E.ViscousFriction(0.2)])
    run = rd.simulate(plant, [0.3, 0.4], duration_s=2.0, controller=lambda t, q, v: 1e3 * v, method="RK4")
    assert run.outcome.ending == "diverged"
    split = run.causes()
    assert np.isfinite(split.tau[:20]).all() and np.isfinite(split.unexplained[:20]).all()
