"""Runs against closed forms, and the laws every run keeps: order, coordinates, concatenation."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.special import ellipj, ellipk

import robot_dyn as rd
from tests.long import long

G = 9.80665
PENDULUM, CART_POLE = rd.load("pendulum"), rd.load("cart_pole")
DOUBLE = rd.load("planar_2r")
SKEW = rd.load("skew_tree")
CART = CART_POLE.with_(lock={"hinge": 0.4})  # 6.2 kg on a rail
TIGHT = rd.integrate.Adaptive(rtol=1e-13, atol=1e-14)
START = {"q0": [0.4, -0.7], "v0": [0.9, -0.5]}
SMOOTH = rd.Plant(DOUBLE, [rd.effects.ViscousFriction([0.4, 0.2]), rd.effects.Spring([3.0, 5.0], [0.2, -0.3])])


@pytest.mark.parametrize("amplitude", [0.01, 1.0, 3.0])
def test_pendulum_swings_with_the_exact_period(amplitude: float) -> None:
    """θ = 2 asin(k cd(ω₀ t, k)), T = 4 K(k)/ω₀, k = sin(θ₀/2), ω₀² = 3 g / (2 l); 1e-10, the step's own error."""
    k, omega = np.sin(amplitude / 2), np.sqrt(1.5 * G)
    period = 4 * ellipk(k**2) / omega
    run = rd.simulate(PENDULUM, [amplitude], duration_s=period, method="DP8", step_s=0.01)
    _, cn, dn, _ = ellipj(omega * run.t, k**2)
    np.testing.assert_allclose(run.q[:, 0], 2 * np.arcsin(k * cn / dn), atol=1e-10)
    np.testing.assert_allclose([run.q[-1, 0], run.v[-1, 0]], [amplitude, 0.0], atol=1e-10)
    if amplitude == 0.01:  # the period of small swings, long by θ₀²/16
        assert period == pytest.approx(2 * np.pi / omega * (1 + amplitude**2 / 16), rel=1e-9)


@pytest.mark.parametrize("name", ["RK4", "GaussLegendre2", "GaussLegendre4", "DP8", "Rodas5PFixed"])
def test_free_fall_on_a_rail_is_a_parabola(name: str) -> None:
    """Motion x = x₀ + v₀ t + g t²/2, a polynomial that order 2 keeps exactly: rounding of some 100 steps, 1e-13."""
    falling = rd.Plant(CART.with_(gravity=(1.7, 0.0, -G)))
    run = rd.simulate(falling, [0.3], [-0.8], duration_s=1.0, method=name, step_s=0.01, estimate_error=False)
    np.testing.assert_allclose(run.q[:, 0], 0.3 - 0.8 * run.t + 1.7 * run.t**2 / 2, atol=1e-13)
    np.testing.assert_allclose(run.v[:, 0], -0.8 + 1.7 * run.t, atol=1e-13)
    np.testing.assert_allclose(run.a, 1.7, rtol=1e-12)


def test_cart_with_spring_and_damper_is_the_damped_oscillator() -> None:
    """The law m ẍ + b ẋ + k (x − x₀) = 0; order 8 at 5 ms leaves rounding, 1e-12."""
    m, b, k, rest, x0, v0 = 6.2, 2.5, 80.0, 0.15, 0.5, -0.4
    plant = rd.Plant(CART, [rd.effects.ViscousFriction(b), rd.effects.Spring(k, rest)])
    run = rd.simulate(plant, [x0], [v0], duration_s=2.0, method="DP8", step_s=5e-3, estimate_error=False)
    decay, t, away = b / (2 * m), run.t, x0 - rest
    omega = np.sqrt(k / m - decay**2)
    wave = away * np.cos(omega * t) + (v0 + decay * away) / omega * np.sin(omega * t)
    np.testing.assert_allclose(run.q[:, 0], rest + np.exp(-decay * t) * wave, atol=1e-12)


def test_cart_pole_keeps_the_momentum_along_its_rail() -> None:
    """No force acts along x: p_x is constant (to rounding if it is a coordinate), the centre of mass uniform."""
    options = {"q0": [0.1, 0.8], "v0": [0.3, -0.5], "duration_s": 1.0, "estimate_error": False}
    run = rd.simulate(CART_POLE, **options)
    momentum = CART_POLE.momentum(run.q, run.v)[:, 0]
    centre = run.q[:, 0] + 1.2 * 0.6 * np.sin(run.q[:, 1]) / 6.2
    np.testing.assert_allclose(centre, centre[0] + momentum[0] / 6.2 * run.t, atol=1e-10)  # not kept: error O(h⁴)
    assert np.ptp(run.q[:, 1]) > 1.0
    canonical = rd.simulate(CART_POLE, **options, method="GaussLegendre4", step_s=0.01)
    np.testing.assert_allclose(CART_POLE.momentum(canonical.q, canonical.v)[:, 0], momentum[0], rtol=1e-12)


@pytest.fixture(scope="module")
def truth() -> rd.Trajectory:
    return rd.simulate(SMOOTH, **START, duration_s=1.0, method=TIGHT, estimate_error=False)


@pytest.mark.parametrize(
    ("name", "step"), [("RK4", 5e-3), ("GaussLegendre4", 0.01), *long([("Midpoint", 4e-3), ("GaussLegendre2", 4e-3)])]
)
def test_whole_runs_converge_with_the_order_of_the_method(name: str, step: float, truth) -> None:
    """Error(h)/error(h/2) → 2ᵖ; the next term of the error is O(h) of it, so p ± 0.25 at these steps."""
    method = rd.integrate.method(name)
    errors = []
    for h in (step, step / 2, step / 4):
        run = rd.simulate(SMOOTH, **START, duration_s=1.0, method=method, step_s=h, estimate_error=False)
        errors.append(np.linalg.norm(np.concatenate([run.q[-1] - truth.q[-1], run.v[-1] - truth.v[-1]])))
    assert errors[-1] > 1e-11  # far above the 1e-12 of the reference
    np.testing.assert_allclose(np.diff(np.log2(errors)), -method.order, atol=0.25)


@pytest.mark.parametrize(
    "effects", [(), (rd.effects.ViscousFriction(0.3), rd.effects.Spring(4.0, 0.1))], ids=["free", "effects"]
)
def test_canonical_and_velocity_coordinates_give_one_trajectory(effects) -> None:
    """Equations p = M v with ṗ = Cᵀ v − N + τ, and v' = M⁻¹ (…): both within 1e-11 of the flow, on general axes."""
    q0, v0 = np.linspace(0.2, -0.5, SKEW.n), np.linspace(-0.8, 0.9, SKEW.n)
    common = {"q0": q0, "v0": v0, "duration_s": 0.32, "record_every_s": 0.02, "estimate_error": False}
    canonical, velocity = (
        rd.simulate(rd.Plant(SKEW, effects), **common, method=rd.integrate.method(name), step_s=h)
        for name, h in (("GaussLegendre6", 2e-3), ("DP8", 4e-3))
    )
    assert len(canonical.t) == 17
    np.testing.assert_allclose(canonical.t, velocity.t, atol=1e-14)
    for one, other in ((canonical.q, velocity.q), (canonical.v, velocity.v), (canonical.a, velocity.a)):
        np.testing.assert_allclose(one, other, atol=1e-11 * np.abs(other).max())


def test_every_engine_gives_the_same_run() -> None:
    """The own Lagrangian and Pinocchio agree to 1e-12 in a, so 100 ms of them agree to as much."""
    common = {**START, "duration_s": 0.1, "method": "RK4", "step_s": 5e-3}
    ours, theirs = (rd.simulate(rd.Plant(each), **common) for each in (rd.Lagrangian(DOUBLE), DOUBLE))
    np.testing.assert_allclose(ours.q, theirs.q, atol=1e-12)
    np.testing.assert_allclose(ours.ledger.energy, theirs.ledger.energy, atol=1e-12)


def test_a_sample_keeps_the_equation_of_motion() -> None:
    """M a + C v + N = τ at each sample, with the acceleration that is recorded; v = dq/dt and a = dv/dt."""
    run = rd.simulate(
        SMOOTH, **START, duration_s=0.5, controller=rd.control.PD(rd.control.hold([0.1, 0.2]), kp=[20.0, 9.0], kd=2.0)
    )
    for t, q, v, a, u in zip(run.t, run.q, run.v, run.a, run.u, strict=True):
        np.testing.assert_allclose(SMOOTH.inverse_dynamics(q, v, a, t=t), u, atol=1e-11)
    h = run.t[1] - run.t[0]  # central differences err by h²/6 of the third derivative, below 1e4 here
    np.testing.assert_allclose((run.q[2:] - run.q[:-2]) / (2 * h), run.v[1:-1], atol=2e3 * h**2)
    np.testing.assert_allclose((run.v[2:] - run.v[:-2]) / (2 * h), run.a[1:-1], atol=2e4 * h**2)


def test_a_wrench_window_is_three_runs_one_after_the_other() -> None:
    """Its ends are ends of steps, so the parts are the same sequence of steps, up to rounding of their length."""
    force, start, end = [3.0, -0.7, -2.0, 0.3, 4.0, 0.5], 0.1234, 0.30017
    push = rd.effects.ExternalWrench("tip", force, start_s=start, end_s=end)
    whole = rd.simulate(rd.Plant(DOUBLE, [push]), **START, duration_s=0.4, method="RK4", step_s=2e-3)
    assert {start, end} <= set(whole.t)
    assert whole.error is not None
    assert whole.error.largest < 1e-9  # no order is lost at the ends
    state, always = START, rd.Plant(DOUBLE, [rd.effects.ExternalWrench("tip", force)])
    for plant, duration in ((rd.Plant(DOUBLE), start), (always, end - start), (rd.Plant(DOUBLE), 0.4 - end)):
        part = rd.simulate(plant, **state, duration_s=duration, method="RK4", step_s=2e-3, estimate_error=False)
        state = {"q0": part.q[-1], "v0": part.v[-1]}
    np.testing.assert_allclose(whole.q[-1], state["q0"], rtol=1e-13)
    np.testing.assert_allclose(whole.v[-1], state["v0"], rtol=1e-13)
    acts = (whole.t >= start) & (whole.t < end)
    assert np.array_equal(whole.power["external_wrench"] != 0, acts)


def test_samples_lie_at_multiples_of_the_record_period_whatever_the_step() -> None:
    """Also where steps do not divide it: 34 of 3 ms, made 36; a sample may not come a step late."""
    options = {**START, "duration_s": 0.1}
    every = rd.simulate(SMOOTH, **options, method="RK4", step_s=1e-3)
    np.testing.assert_allclose(every.t, np.arange(101) * 1e-3, atol=1e-15)
    for steps in ({"method": "RK4", "step_s": 1e-3}, {"method": "DOP853"}):
        some = rd.simulate(SMOOTH, **options, record_every_s=0.03, **steps)
        np.testing.assert_allclose(some.t, [0.0, 0.03, 0.06, 0.09, 0.1], atol=1e-15)
        np.testing.assert_allclose(some.q, every.q[[0, 30, 60, 90, 100]], atol=1e-9)
        assert some.t[-1] == 0.1
    uneven = rd.simulate(SMOOTH, **options, method="RK4", step_s=3e-3, record_every_s=0.01)
    np.testing.assert_allclose(uneven.t, np.arange(11) * 0.01, atol=1e-12)


@pytest.mark.parametrize(("step_s", "period_s"), [(0.01, 0.003), (0.01, 7e-4), (1e-3, 7e-4)])
def test_no_step_is_longer_than_the_record_period(step_s: float, period_s: float) -> None:
    """Also where the period does not divide the run; a sample is at most a step late."""
    setup = rd.Setup(SMOOTH, **START, duration_s=0.1, method="RK4", step_s=step_s, record_every_s=period_s)
    assert setup.taken_step_s <= period_s
    run = rd.simulate(setup)
    due = np.append(np.arange(0.0, 0.1, period_s), 0.1)
    assert max(np.abs(run.t - t).min() for t in due) <= setup.taken_step_s
    assert np.diff(run.t).max() < 2.0 * period_s


def test_progress_is_told_at_each_step_and_in_the_companion_runs() -> None:
    times: list[float] = []
    options = {"method": "RK4", "step_s": 2e-3, "engine": "interpreted", "on_progress": times.append}
    run = rd.simulate(SMOOTH, **START, duration_s=0.05, **options)
    assert np.array_equal(times[: len(run.t)], run.t)
    assert set(times[len(run.t) :]) == {run.t[-1]}
    assert run.joint_names == DOUBLE.joint_names
    assert [array.shape for array in (run.q, run.v, run.a, run.u)] == [(len(run.t), 2)] * 4


def test_a_frame_that_follows_a_circle_has_a_tracking_error_in_metres() -> None:
    """With the exact model the tool stays on its circle; what is told is the distance of the frame from it."""
    arm = rd.load("ur5")
    q0 = np.array([0.3, -1.3, 1.6, -1.9, -1.5, 0.2])
    g = arm.placement(q0, "tool0")
    path = rd.control.circle(g[:3, 3] + [0.0, 0.05, 0.0], 0.05, [0, 0, 1], 1.0, toward=[0, -1, 0], rotation=g[:3, :3])
    law = rd.control.OperationalSpace(arm, "tool0", path, kp=400.0, kd=40.0)
    run = rd.simulate(arm, q0=q0, duration_s=0.2, controller=law, method="RK4", step_s=4e-3, estimate_error=False)
    desired, p = path.at(run.t)[0], arm.placement(run.q, "tool0")[:, :3, 3]
    assert run.desired is None
    np.testing.assert_allclose(run.tracking_error, desired - p, atol=1e-15)
    assert run.rms_tracking_error == pytest.approx(np.sqrt(np.mean((p - desired) ** 2)))
    assert "tracking error of the frame [m]: " in run.summary
    far = replace(
        run, tracking_error=np.full_like(run.tracking_error, 3e200)
    )  # of a run that diverged: its square overflows
    assert far.rms_tracking_error == 3e200


def test_a_run_from_python_carries_its_origin() -> None:
    metadata = rd.simulate(DOUBLE, q0=[0.1, 0.2], duration_s=0.01).metadata
    assert "<robot" in metadata["urdf"]
    assert "gravity" in metadata["edits"]
    assert "pin" in metadata["versions"]


def test_the_summary_says_what_acted_and_nothing_else() -> None:
    """Gravity, payload, limits and control by name; no control without a controller."""
    bare = rd.load("planar_2r").with_(gravity=(0.0, 0.0, 0.0))
    start = {"q0": [0.3, 0.4], "duration_s": 0.01, "estimate_error": False}
    assert "\neffects: none\n" in rd.simulate(bare, **start).summary
    loaded = bare.with_(gravity=(0.0, 3.0, -4.0), payload=rd.Payload("tip", 0.5), armature=0.1, mass_scale=1.1)
    plant = rd.Plant(
        loaded, [rd.effects.EffortLimit(5.0), *rd.effects.joint_stops(-2.0, 2.0), rd.effects.ViscousFriction(0.1)]
    )
    run = rd.simulate(plant, controller=rd.control.PD(rd.control.hold([0.3, 0.4]), kp=1.0, kd=1.0), **start)
    acting = "gravity 5 m/s²", "payload 0.5 kg on tip", "mass_scale 1.1", "armature"
    assert run.acting == (*acting, "effort_limit", "joint_stops", "viscous_friction", "control")
    assert f"\neffects: {', '.join(run.acting)}\n" in run.summary
    locked = rd.simulate(bare.with_(lock={"joint_2": 0.1}), q0=[0.3], duration_s=0.01, estimate_error=False)
    assert locked.acting == ("lock joint_2",)


@pytest.mark.parametrize(("name", "unit"), [("planar_2r", "rad"), ("cart_pole", "m or rad")])
def test_the_summary_states_units(name: str, unit: str) -> None:
    """Of the errors of q; m and rad where both kinds of joints are."""
    law = rd.control.PD(rd.control.hold([0.1, 0.2]), kp=1.0, kd=1.0)
    text = rd.simulate(rd.load(name), q0=[0.1, 0.2], duration_s=0.05, controller=law).summary
    assert f"\nerror of q [{unit}]: " in text and f"\ntracking error of q [{unit}]: " in text
    assert " of the energy exchanged" in text
