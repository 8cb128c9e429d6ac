"""Logs of arms in closed loop, with noise of encoders and torques, friction and a delay of one tick."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

import robot_dyn as rd

TICK_S, DURATION_S = 4e-3, 16.0
VISCOUS, COULOMB = np.array([0.5, 0.3]), np.array([1.5, 0.8])
FILE = rd.load("planar_2r")
LINKS = {"bar_1": 1.2, "bar_2": 0.85}
LATE_S = -1.5 * TICK_S  # commands act one tick later, and are held for a tick


@cache
def reference() -> rd.control.PiecewisePolynomial:
    """Return a sum of sines from rest."""
    t, k = np.linspace(0.0, DURATION_S, 401), 2 * np.pi * np.arange(1, 7) / DURATION_S
    A = np.random.default_rng(1).normal(size=(2, 6, 2)) * 0.5
    A[1] -= A[1].mean(axis=0)
    A[0] -= np.outer(k, k @ A[0]) / (k @ k)
    sin, cos = np.sin(np.outer(t, k)), np.cos(np.outer(t, k))
    q, v = sin @ A[0] + cos @ A[1], (cos * k) @ A[0] - (sin * k) @ A[1]
    return rd.control.Samples(t, q, v, -(sin * k**2) @ A[0] - (cos * k**2) @ A[1])


def true_arm() -> rd.Robot:
    return FILE.with_(mass_scales=LINKS)


def friction(factor: float = 1.0) -> list[Any]:
    dry = rd.effects.RegularisedCoulombFriction(factor * COULOMB, velocity_scale=0.01)
    return [rd.effects.ViscousFriction(factor * VISCOUS), dry]


@cache
def log(seed: int = 0, true: rd.Robot | None = None) -> dict[str, Any]:
    """Return the log of one run; its arrays are read-only."""
    arm, along = true_arm() if true is None else true, reference()
    q0, v0, _ = along.at(0.0)
    inner = rd.control.FeedForward(FILE, along, kp=[60.0, 8.0], kd=[12.0, 1.5], period_s=TICK_S)
    loop = rd.control.Loop(
        *(inner, [rd.control.Noise(3e-5)], [rd.control.Differences(), rd.control.LowPass(150.0)]),
        actuation_delay_periods=1.0, noise_seed=seed,
    )  # fmt: skip
    run = rd.simulate(
        rd.Plant(arm, friction()), q0, v0, controller=loop, duration_s=DURATION_S, method="RK4", step_s=1e-3,
        record_every_s=TICK_S, estimate_error=False,
    )  # fmt: skip
    z, rng = run.controller_states, np.random.default_rng(seed)
    tau = z[:, loop.places["coming"]] + rng.normal(size=run.q.shape) * [0.3, 0.15]
    return {"t": run.t, "q": z[:, loop.places["velocity.0"]], "tau": tau}
