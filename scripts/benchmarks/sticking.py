"""Time stepping against the event-driven limit: Panda-7 driven against dry friction, and between rigid stops.

distance = the largest |q(t) − q_limit(t)| over joints and samples each 8 ms in 2 s

Beside `MoreauJean`, MuJoCo with frictionloss and limits: at its default settings, and at its stiffest, solref
(2 h, 1) and solimp 0.9999, which shrink with the step h. Drake has no dry friction of joints to compare with.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import Any

import numpy as np

import robot_dyn as rd
from benchmarks.measure import Effort, arms, row, stick_and_stop, table
from robot_dyn.accuracy.work_precision_diagram.peers.mujoco import mujoco_model

LEVELS, DAMPING, DURATION_S, SAMPLE_S = np.array([3, 6, 2, 4, 1, 0.8, 0.3]), 0.1, 2.0, 8e-3
LOWER, UPPER = np.array([-1, -1.2, -1, -2.5, -1, 0.6, -1]), np.array([1, 0.4, 1, -1, 1, 2.2, 1])
START = np.array([0, -0.5, 0.2, -1.9, 0.1, 1.4, 0.5])
AMPLITUDE, OMEGA = np.array([6, 10, 5, 8, 2, 1.5, 0.6]), np.array([4, 5, 6, 4.5, 7, 5.5, 8])
STEPS = (4e-3, 2e-3, 1e-3, 5e-4, 2.5e-4, 1.25e-4, 6.25e-5)
Drive = Callable[..., np.ndarray]


def sticking(effort: Effort) -> None:
    """Distances by step, of friction alone and with stops, restitution 0."""
    panda, steps = arms()["Panda-7"], STEPS[:2] if effort.quick else STEPS
    weight = 0.8 * panda.N(START)

    def drive(t: float, q: Any, v: Any) -> np.ndarray:
        return weight + AMPLITUDE * np.sin(OMEGA * t + 0.3)

    for what, stops in (("dry friction", []), ("dry friction and stops, e = 0", [rd.effects.RigidStops(LOWER, UPPER)])):
        plant = rd.Plant(panda, [rd.effects.ViscousFriction(DAMPING), rd.effects.DryFriction(LEVELS), *stops])
        options: dict[str, Any] = {
            "q0": START, "duration_s": DURATION_S, "controller": drive, "record_every_s": SAMPLE_S,
            "estimate_error": False,
        }  # fmt: skip
        limit = rd.simulate(plant, **options, engine="compiled", method=rd.integrate.Adaptive(rtol=1e-12, atol=1e-12))
        print(f"\n{what}: {len(limit.events)} events")
        table("h, s", *(f"{h:g}" for h in steps), "mean order")

        def ours(h: float, plant: rd.Plant = plant, options: dict[str, Any] = options) -> np.ndarray:
            return rd.simulate(plant, **options, method="MoreauJean", step_s=h).q

        _distances("MoreauJean", ours, steps, limit.q)
        for name, stiff in (("MuJoCo, stiffest", True), ("MuJoCo, default", False)):
            _distances(name, lambda h, stiff=stiff: _mujoco(panda, drive, h, stiff, bool(stops)), steps, limit.q)


def _distances(name: str, run: Callable[[float], np.ndarray], steps: tuple[float, ...], limit: np.ndarray) -> None:
    apart = [np.abs(run(h) - limit).max() for h in steps]
    order = np.log2(apart[0] / apart[-1]) / np.log2(steps[0] / steps[-1])
    row(name, *(f"{x:.2e}" for x in apart), f"{order:.2f}")


def _mujoco(panda: rd.Robot, drive: Drive, h: float, stiff: bool, stops: bool) -> np.ndarray:
    """Samples of q, (m, n), of Euler's method, whose damping is implicit."""
    mujoco: Any = import_module("mujoco")
    model = mujoco_model(mujoco, panda, damping=DAMPING)
    model.opt.timestep = h
    stick_and_stop(mujoco, model, LEVELS, *((LOWER, UPPER) if stops else (None, None)), h if stiff else 0.0)
    data, each = mujoco.MjData(model), round(SAMPLE_S / h)
    data.qpos[:], samples = START, [START]
    for k in range(round(DURATION_S / h)):
        data.qfrc_applied[:] = drive((k + 0.5) * h, None, None)
        mujoco.mj_step(model, data)
        if (k + 1) % each == 0:
            samples.append(data.qpos.copy())
    return np.array(samples)
