"""A generator of random batches: soft and rigid stops, dry friction, windows, limits, sampled control with delay."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

import robot_dyn as rd

FAMILIES = ("soft stops", "rigid stops", "dry friction", "window", "effort limit", "bristles", "sampled")
METHODS = ("RK4", "RK4", "RK4", "DP8", "GaussLegendre4", "DOP853")
EVENTS = ("RK4", "RK4", "DP8", "DOP853")  # of methods whose steps can end where joints are held
MOST = 6  # runs


@dataclass(frozen=True)
class Batch:
    """A setup, the starts (B, n) of its runs, and values that differ from run to run, (B, …) by name."""

    setup: rd.Setup
    q0: np.ndarray
    v0: np.ndarray
    params: dict[str, np.ndarray]
    label: str


def batch(seed: int, index: int) -> Batch:
    rng = np.random.default_rng([seed, index])
    family = FAMILIES[index % len(FAMILIES)]
    name = str(rng.choice(["pendulum", "planar_2r", "cart_pole"]))
    arm, B = rd.load(name), int(rng.integers(2, MOST + 1))
    duration, step = float(np.round(rng.uniform(0.2, 1.0), 3)), float(np.round(10 ** rng.uniform(-3.3, -2.3), 6))
    q0, v0 = rng.uniform(-1, 1, (B, arm.n)), rng.uniform(-2, 2, (B, arm.n))
    scale = np.diag(arm.M(q0[0]))  # so that forces fit the arm
    effects, swept = _effects(rng, family, arm, q0, scale, duration)
    method = str(rng.choice(EVENTS if family in ("rigid stops", "dry friction") else METHODS))
    options = {} if method == "DOP853" else {"step_s": step}
    setup = rd.Setup(
        rd.Plant(arm, [rd.effects.ViscousFriction(scale * rng.uniform(0.1, 1.0, arm.n)), *effects]), q0[0], v0[0],
        duration,
        _controller(rng, family, arm, q0[0], scale, duration), method,
        record_every_s=float(rng.choice([0.0, 0.02])), estimate_error=False, engine="compiled", **options,
    )  # fmt: skip
    swept |= {"viscous_friction.viscous": scale * rng.uniform(0.1, 1.0, (B, arm.n))}
    params = {key: np.broadcast_to(x, (B, arm.n)) for key, x in swept.items() if rng.random() < 0.5}
    return Batch(setup, q0, v0, params, f"{seed}/{index} {family}, {name}, {method}, h = {step:g} s, {B} runs")


def _effects(
    rng: np.random.Generator, family: str, arm: rd.Robot, q0: np.ndarray, scale: np.ndarray, duration: float
) -> tuple[list[rd.Effect], dict[str, np.ndarray]]:
    """Effects of a family, and coefficients that may differ from run to run."""
    B, n = q0.shape
    lower, upper = q0.min(0) - rng.uniform(0.05, 0.6, n), q0.max(0) + rng.uniform(0.05, 0.6, n)
    if family == "soft stops":
        stiffness = scale * 10 ** rng.uniform(2, 5)
        stops = rd.effects.joint_stops(lower, upper, stiffness, stiffness * rng.choice([0.0, 0.1]))
        return [*stops], {"joint_stops.upper": upper + rng.uniform(-0.02, 0.3, (B, n))}
    if family == "rigid stops":
        return [rd.effects.RigidStops(lower, upper, rng.uniform(0, 0.8))], {}
    if family == "dry friction":
        return [rd.effects.DryFriction(scale * rng.uniform(0.5, 5, n))], {
            "dry_friction.coulomb": scale * rng.uniform(0.5, 5, (B, n))
        }
    if family == "window":
        start = rng.uniform(0, duration / 2)
        force = scale.max() * rng.uniform(-5, 5, 6)
        stops = rd.effects.joint_stops(lower, upper, scale * 1e3, 0.0)
        return [
            rd.effects.ExternalWrench(arm.frame_names[-1], force, start_s=start, end_s=start + duration / 5),
            *stops,
        ], {}
    if family == "effort limit":
        limit = scale * rng.uniform(2, 20, n)
        return [rd.effects.EffortLimit(limit)], {"effort_limit.limit": limit * rng.uniform(0.5, 2, (B, n))}
    if family == "bristles":
        level = scale * rng.uniform(0.5, 3, n)
        bristles = rd.effects.LuGreFriction(100 * scale, 2 * scale, 0.1 * scale, level, 1.5 * level, 0.1)
        return [bristles], {"lugre_friction.bristle_stiffness": scale * rng.uniform(50, 200, (B, n))}
    stops = rd.effects.joint_stops(lower, upper, scale * 1e3, 0.0)
    return [*stops, rd.effects.EffortLimit(scale * rng.uniform(5, 50, n))], {}


def _controller(
    rng: np.random.Generator, family: str, arm: rd.Robot, q: np.ndarray, scale: np.ndarray, duration: float
) -> rd.control.Controller | None:
    """None, PD, PID within its limit, or a loop with delay and noise."""
    plan = rd.control.quintic(q, q + rng.uniform(-1, 1, arm.n), duration * rng.uniform(0.4, 1.2))
    kp, kd = rd.control.gains_from(scale, rng.uniform(3, 12), 0.7)
    if family == "sampled":
        law = rd.control.PD(plan, kp=kp, kd=kd, period_s=float(rng.choice([0.005, 0.01, 0.02])))
        measured, acts = float(rng.choice([0.0, 0.4, 1.2])), float(rng.choice([0.0, 0.5, 1.0]))
        return rd.control.Loop(
            law, position=rd.control.Noise(1e-4), velocity=rd.control.LowPass(30.0), measurement_delay_periods=measured,
            actuation_delay_periods=acts,
            noise_seed=int(rng.integers(99)),
        )  # fmt: skip
    if family == "effort limit" and rng.random() < 0.5:
        return rd.control.PID(plan, kp=kp, ki=2 * kp, kd=kd, effort_limit=scale * rng.uniform(2, 20, arm.n))
    return rd.control.PD(plan, kp=kp, kd=kd) if family == "effort limit" or rng.random() < 0.5 else None
