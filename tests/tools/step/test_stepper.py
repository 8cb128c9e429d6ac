"""Lanes against `simulate`, one by one; forks, resets and divergence; errors with their remedies."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pytest

import robot_dyn as rd
from robot_dyn.foundations import QueryError, with_values
from robot_dyn.tools.step import State, Stepper

LANES = 70  # more than a tile of 64
PERIOD_S, STEP_S = 0.02, 2e-3
ARM = rd.load("planar_2r")
PLANT = rd.Plant(ARM, [rd.effects.EffortLimit(20.0), rd.effects.ViscousFriction(0.3)])


@dataclass(frozen=True, eq=False)
class Schedule(rd.control.Stateless):
    """Torques in zero-order hold, (periods, n)."""

    torques: np.ndarray
    period_s: float
    n = 2  # pyright: ignore[reportAssignmentType, reportIncompatibleMethodOverride]

    def torque(self, t: float, q: Any, v: Any, z: Any) -> Any:
        return self.torques[min(round(t / PERIOD_S), len(self.torques) - 1)]

    def thresholds(self) -> tuple[()]:
        return ()


def stepper(n: int, **changes: Any) -> Stepper:
    options: dict[str, Any] = {"step_s": STEP_S} | changes
    return Stepper(PLANT, n, period_s=PERIOD_S, **options)


def starts(n: int) -> tuple[np.ndarray, np.ndarray]:
    q, v = np.random.default_rng(0).uniform(-1.0, 1.0, (2, n, 2))
    return q, v


def actions(periods: int, n: int) -> np.ndarray:
    return np.random.default_rng(1).normal(size=(periods, n, 2)) * 12.0


def after(arms: Stepper, actions: Any) -> State:
    """Return the state after several periods."""
    return [arms.step(u) for u in actions][-1]


def test_lanes_are_runs_of_simulate_with_the_torque_held() -> None:
    """Some lanes of both tiles, 12 periods with the effort limit reached, to 1e-9: rounding grows by some e⁵ here."""
    arms, u = stepper(LANES), actions(12, LANES)
    q, v = starts(LANES)
    arms.reset(q, v)
    states = [arms.step(x) for x in u]
    assert (np.abs(u) > 20.0).any() and not states[-1].diverged.any()
    assert np.all(states[-1].t == 12 * PERIOD_S)
    for lane in (*np.random.default_rng(2).choice(LANES - 1, 5, replace=False).tolist(), LANES - 1):
        run = rd.simulate(
            PLANT, q[lane], v0=v[lane], duration_s=12 * PERIOD_S, method="RK4", step_s=STEP_S, estimate_error=False,
            record_every_s=PERIOD_S, controller=Schedule(u[:, lane], PERIOD_S), engine="interpreted",
        )  # fmt: skip
        assert np.max(np.abs(run.q[1:] - [state.q[lane] for state in states])) < 1e-9
        assert np.max(np.abs(run.v[1:] - [state.v[lane] for state in states])) < 1e-8


def test_threads_and_the_number_of_lanes_do_not_change_the_bits() -> None:
    one, two, few = stepper(LANES), stepper(LANES, threads=2), stepper(3)
    (q, v), u = starts(LANES), actions(4, LANES)
    for arms in (one, two):
        arms.reset(q, v)
    few.reset(q[:3], v[:3])
    a, b, c = after(one, u), after(two, u), after(few, u[:, :3])
    assert np.array_equal(a.q, b.q) and np.array_equal(a.v, b.v) and np.array_equal(a.q[:3], c.q)


def test_a_mask_resets_some_lanes_and_leaves_the_others() -> None:
    arms, (q, v), u = stepper(LANES), starts(LANES), actions(6, LANES)
    other = stepper(LANES)
    other.reset(q, v)
    arms.reset(q, v)
    before, _ = after(arms, u[:3]), after(other, u[:3])
    mask = np.arange(LANES) % 3 == 0
    garbage = np.where(mask[:, None], q, np.nan)
    started = arms.reset(garbage, v, mask)
    assert np.array_equal(started.q, np.where(mask[:, None], q, before.q))
    assert np.array_equal(started.t, np.where(mask, 0.0, 3 * PERIOD_S))
    fresh = stepper(LANES)
    fresh.reset(q, v)
    a, b, c = (after(x, u[3:]) for x in (arms, other, fresh))
    assert np.array_equal(a.q, np.where(mask[:, None], c.q, b.q))
    assert np.array_equal(a.v, np.where(mask[:, None], c.v, b.v))


def test_a_state_is_restored_bit_by_bit_with_the_states_of_effects() -> None:
    plant = rd.Plant(ARM, [*PLANT.effects, rd.effects.ActuatorLag(0.03)])
    arms, twin = (Stepper(plant, LANES, period_s=PERIOD_S, step_s=STEP_S) for _ in range(2))
    (q, v), u = starts(LANES), actions(6, LANES)
    arms.reset(q, v)
    middle = after(arms, u[:3])
    assert middle.z.shape == (LANES, 2) and np.abs(middle.z).max() > 1.0
    ends = [arms.step(x) for x in u[3:]]
    twin.reset(q, v)
    for engine in (arms, twin):
        engine.set_state(middle)
        for x, end in zip(u[3:], ends, strict=True):
            state = engine.step(x)
            assert all(np.array_equal(getattr(state, name), getattr(end, name)) for name in vars(end))
    mask = np.arange(LANES) < 5
    arms.set_state(middle, mask)
    assert np.array_equal(arms.state.q, np.where(mask[:, None], middle.q, ends[-1].q))


def test_a_state_does_not_change_with_later_steps() -> None:
    """In one tile too, where states need no transposition."""
    arms = stepper(3)
    first = arms.reset(*starts(3))
    kept = {name: x.copy() for name, x in vars(first).items()}
    after(arms, actions(2, 3))
    assert all(np.array_equal(getattr(first, name), x) for name, x in kept.items())


def test_a_lane_that_diverges_is_nan_until_it_is_reset_and_the_others_go_on() -> None:
    """A start at 1e9 rad/s overflows in steps of 2 ms."""
    arms, twin, (q, v), u = stepper(LANES), stepper(LANES), starts(LANES), actions(5, LANES)
    fast = v.copy()
    fast[[7, 69]] = 1e9
    arms.reset(q, fast)
    twin.reset(q, v)
    after(arms, u[:2])
    state, other = arms.step(np.where(arms.state.diverged[:, None], np.nan, u[2])), after(twin, u[:3])
    assert np.flatnonzero(state.diverged).tolist() == [7, 69]
    assert np.isnan(state.q[[7, 69]]).all() and np.isnan(state.v[[7, 69]]).all()
    well = ~state.diverged
    assert np.array_equal(state.q[well], other.q[well])
    arms.set_state(state)
    assert np.flatnonzero(arms.step(u[3]).diverged).tolist() == [7, 69]
    again = arms.reset(q, v, state.diverged)
    assert not again.diverged.any() and np.array_equal(again.q[7], q[7])
    assert not arms.step(u[4]).diverged.any()


def test_parameters_of_lanes_are_those_of_their_runs() -> None:
    """Each lane is a stepper of one lane whose plant has its numbers: equal to 1e-12."""
    masses, viscous = np.array([0.5, 1.0, 2.0]), np.array([[0.1, 0.2], [0.3, 0.1], [0.0, 0.4]])
    (q, v), u = starts(3), actions(3, 3)
    limit = np.array([5.0, 20.0, 50.0])
    vary = {"mass_scale": masses, "viscous_friction.viscous": viscous, "effort_limit.limit": limit}
    arms = stepper(3, vary=vary)
    arms.reset(q, v)
    state = after(arms, u)
    for k in range(3):
        effects = [rd.effects.EffortLimit(limit[k]), rd.effects.ViscousFriction(viscous[k])]
        one = Stepper(rd.Plant(ARM.with_(mass_scale=masses[k]), effects), 1, period_s=PERIOD_S, step_s=STEP_S)
        one.reset(q[k], v[k])
        end = after(one, u[:, k : k + 1])
        assert np.max(np.abs(end.q[0] - state.q[k])) < 1e-12


@dataclass(frozen=True)
class Wind(rd.effects.Active):
    """A torque that depends on the time."""

    thresholds = staticmethod(lambda n: ())  # pyright: ignore[reportAssignmentType]

    def torque(self, dynamics: Any, t: Any, q: Any, v: Any) -> Any:
        return 0 * q + np.sin(t)


JOINTS, HELD = rd.control.hold([0.0, 0.0]), rd.control.hold([0.9, 0.2, 0.0])
GAINS: dict[str, Any] = {"kp": 60.0, "kd": 9.0}
SAMPLED = rd.control.PD(JOINTS, period_s=4e-3, **GAINS)
CONTROLLERS = {
    "sampled PD": SAMPLED,
    "continuous PD": rd.control.PD(JOINTS, **GAINS),
    "PID": rd.control.PID(JOINTS, ki=80.0, period_s=2e-2, **GAINS),
    "computed torque": rd.control.ComputedTorque(ARM, JOINTS, bandwidth_rad_s=12.0),
    "sampled computed torque": rd.control.ComputedTorque(ARM, JOINTS, bandwidth_rad_s=12.0, period_s=1e-2),
    "PD with gravity": rd.control.PDGravity(ARM, JOINTS, **GAINS),
    "feedforward": rd.control.FeedForward(ARM, JOINTS, period_s=5e-3, **GAINS),
    "operational space": rd.control.OperationalSpace(
        ARM, "tip", rd.control.CartesianReference(HELD), rows=(0, 1), kp=90.0, kd=15.0, period_s=4e-3
    ),
    "loop with delays and noise": rd.control.Loop(
        SAMPLED,
        position=(rd.control.Noise(1e-3),),
        velocity=(rd.control.Quantisation(1e-2),),
        measurement_delay_periods=1.5,
        actuation_delay_periods=1.0,
        noise_seed=3,
    ),
}


def following(controller: Any, points: np.ndarray) -> Any:
    """Return a controller whose reference is at one point after the other, (periods, k), for a period each."""
    steps = rd.control.PiecewisePolynomial(PERIOD_S * np.arange(len(points) + 1), points[:, None, :])
    if isinstance(controller, rd.control.Loop):
        return replace(controller, controller=following(controller.controller, points))
    in_space = isinstance(controller, rd.control.OperationalSpace)
    return with_values(controller, {"reference": rd.control.CartesianReference(steps) if in_space else steps})


@pytest.mark.parametrize("name", CONTROLLERS)
def test_set_points_of_a_controller_are_a_reference_of_steps(name: str) -> None:
    """Lanes equal runs that follow the set-points as a reference of steps, to 1e-9 as above; noise is that of a run.

    A continuous controller has no effort limit, at which `simulate` would cut steps.
    """
    controller, n, periods = CONTROLLERS[name], 3, 10
    plant = PLANT if controller.period_s else rd.Plant(ARM, [rd.effects.ViscousFriction(0.3)])
    (q, v), rng = starts(n), np.random.default_rng(4)
    points = rng.uniform(-0.5, 0.5, (periods, n, 2))
    if controller.task_frame:
        points = np.concatenate([np.add(points, [0.9, 0.2]), np.zeros((periods, n, 1))], axis=2)
    arms = Stepper(plant, n, period_s=PERIOD_S, step_s=STEP_S, controller=controller)
    assert arms.action_names == (("x", "y", "z") if controller.task_frame else ARM.joint_names)
    arms.reset(q, v)
    after(arms, rng.permutation(points))  # a reset forgets the states of the controller, and starts its noise again
    arms.reset(q, v)
    states = [arms.step(x) for x in points]
    for lane in range(n):
        run = rd.simulate(
            plant, q[lane], v0=v[lane], duration_s=periods * PERIOD_S, method="RK4", step_s=STEP_S,
            estimate_error=False, record_every_s=PERIOD_S, engine="interpreted",
            controller=following(controller.of_run(lane), points[:, lane]),
        )  # fmt: skip
        assert np.max(np.abs(run.q[1:] - [state.q[lane] for state in states])) < 1e-9
        assert np.max(np.abs(run.v[1:] - [state.v[lane] for state in states])) < 1e-8


def test_gains_and_models_of_a_controller_may_differ_by_lane() -> None:
    """Each lane is a stepper of one lane whose controller has its numbers, and the same commands: equal to 1e-12."""
    kp, mass, (q, v) = np.array([30.0, 60.0, 90.0]), np.array([0.8, 1.0, 1.2]), starts(3)
    controller, points = CONTROLLERS["sampled computed torque"], actions(4, 3) / 12.0
    arms = stepper(3, controller=controller, vary={"kp": kp, "model.mass_scale": mass})
    arms.reset(q, v)
    end = after(arms, points)
    for k in range(3):
        model = ARM.with_(mass_scale=mass[k])
        one = stepper(1, controller=replace_gains(controller, model, kp[k]))
        one.reset(q[k], v[k])
        assert np.max(np.abs(after(one, points[:, k : k + 1]).q[0] - end.q[k])) < 1e-12


def replace_gains(controller: Any, model: Any, kp: float) -> Any:
    """Return a computed torque with another model and another position gain."""
    return rd.control.ComputedTorque(model, controller.reference, kp=kp, kd=controller.kd, period_s=controller.period_s)


def test_energy_residual_is_the_error_of_the_method() -> None:
    """E − E₀ − Σ W of RK4 falls by 2⁴ in half the step, here within 20 %; of a diverged lane it is nan."""
    plant = rd.Plant(ARM, [rd.effects.ViscousFriction(0.3)])
    (q, v), u = starts(5), actions(1, 5)[0]
    residuals = []
    for step_s in (1e-2, 5e-3):
        arms = Stepper(plant, 5, period_s=PERIOD_S, step_s=step_s, ledger=True)
        arms.reset(q, 3 * v)
        state = arms.step(u)
        residuals.append(arms.energy_residual)
    energy = rd.Lagrangian(ARM).total_energy
    work = energy(state.q, state.v) - energy(q, 3 * v)
    assert np.all(np.abs(residuals[1]) < 1e-5 * np.abs(work))
    assert residuals[0] / residuals[1] == pytest.approx(np.full(5, 16.0), rel=0.2)
    arms.reset(q, np.where(np.arange(5)[:, None] == 2, 1e9, v))
    arms.step(u)
    assert np.flatnonzero(np.isnan(arms.energy_residual)).tolist() == [2]


@dataclass(frozen=True, eq=False)
class Waving(rd.control.Stateless):
    """A controller with a reference that depends on the time."""

    reference: rd.control.PiecewisePolynomial
    n = 2  # pyright: ignore[reportAssignmentType, reportIncompatibleMethodOverride]

    def torque(self, t: Any, q: Any, v: Any, z: Any) -> Any:
        return self.reference.at(t)[0] - q + np.sin(t)

    def thresholds(self) -> tuple[()]:
        return ()


@dataclass(frozen=True, eq=False)
class Two(Waving):
    """A controller with two references."""

    other: rd.control.PiecewisePolynomial = JOINTS


def test_a_controller_that_cannot_be_commanded_is_refused_by_name() -> None:
    law = rd.control.ControlLaw(lambda t, q, v: -q, 2)
    limited = rd.control.PID(JOINTS, ki=1.0, effort_limit=5.0, **GAINS)
    refused: list[tuple[str, Any]] = [
        ("no reference.*rd.control.PD", law),
        ("rd.control.PD.*got", lambda t, q, v: -q),
        ("Two has PiecewisePolynomial, PiecewisePolynomial", Two(JOINTS)),
        ("Waving depends on the time", Waving(JOINTS)),
        ("period_s=0.021", replace(SAMPLED, period_s=7e-3)),
        ("period_s=0.03", replace(SAMPLED, period_s=0.03)),
        ("limit.*uncut", limited),
    ]
    for words, controller in refused:
        with pytest.raises(QueryError, match=words):
            Stepper(ARM, 2, controller=controller)
    arms = stepper(2, controller=limited, uncut=True)
    arms.reset([0.3, 0.1])
    assert np.isfinite(arms.step(np.ones((2, 2))).q).all()


def test_what_cannot_step_in_lanes_is_refused_by_name() -> None:
    refused = {
        "dry_friction": rd.effects.DryFriction(1.0),
        "stop": rd.effects.joint_stops(-1.0, 1.0, stiffness=1e4, damping=10.0)[0],
        "wind": Wind(),
    }
    for name, effect in refused.items():
        with pytest.raises(QueryError, match=name):
            Stepper(rd.Plant(ARM, [effect]), 2)


def test_bad_input_is_one_error_with_its_remedy() -> None:
    arms, (q, v) = stepper(3), starts(3)
    with pytest.raises(QueryError, match="reset"):
        arms.step(np.zeros((3, 2)))
    arms.reset(q, v, np.array([True, False, True]))
    with pytest.raises(QueryError, match="lane 1"):
        arms.step(np.zeros((3, 2)))
    before = arms.reset(q, v)
    u = np.zeros((3, 2))
    u[2, 1] = np.nan
    wrong: list[tuple[str, Any]] = [
        ("lane 2", lambda: arms.step(u)),
        (r"\(3, 2\)", lambda: arms.step(u[:2])),
        (r"\(3, 2\)", lambda: arms.step([0.0, 0.0])),
        ("q ", lambda: arms.reset(np.zeros(3))),
        ("q", lambda: arms.reset(np.full((3, 2), np.inf))),
        ("mask", lambda: arms.reset(q, v, [0, 1, 2])),
        ("mask", lambda: arms.set_state(before, [True])),
        ("state", lambda: arms.set_state(q)),  # pyright: ignore[reportArgumentType]
        ("state: t", lambda: arms.set_state(State(*(x[:2] for x in vars(before).values())))),
        ("viscous", lambda: stepper(3, vary={"viscous_friction.viscos": np.ones(3)})),
        ("3 lanes", lambda: stepper(3, vary={"mass_scale": np.ones(4)})),
        ("vary", lambda: stepper(3, vary=[1.0])),
        ("torque_of_lane is the action", lambda: stepper(3, vary={"torque_of_lane": np.ones((3, 2))})),
        ("ledger", lambda: arms.energy_residual),
        ("ledger", lambda: stepper(3, ledger=1)),
        ("DOP853", lambda: stepper(3, method="DOP853", step_s=None)),
        ("n must", lambda: stepper(0)),
        ("period_s", lambda: Stepper(PLANT, 3, period_s=-1.0)),
    ]
    for words, call in wrong:
        with pytest.raises(QueryError, match=words):
            call()
    now = arms.state
    assert all(np.array_equal(getattr(now, name), x) for name, x in vars(before).items())
    assert now.t.sum() == 0
