"""Six digits of q over 1 s of free swing of Panda-7 on both sides: without limits, with far ones, and with the file's.

error = the largest |q − q_ref| over joints, at the end

With limits, robot_dyn has `RigidStops` of restitution 0 and MuJoCo its limit constraints, by default soft. Far limits
are 100 rad away, so that they are checked and never reached. Each method has the coarsest step or tolerance of a ladder
whose error without limits is below 1e-6 rad. There is no friction and no noise. Times are the lowest of calls that take
turns: compare ratios.
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import Any

import numpy as np

import robot_dyn as rd
from benchmarks.measure import READY, Effort, arms, lowest, row, table
from robot_dyn.accuracy.work_precision_diagram.peers.mujoco import mujoco_model

TARGET, DURATION_S, FAR = 1e-6, 1.0, 100.0
STEPS = (1e-2, 5e-3, 2e-3, 1e-3, 5e-4, 2e-4)
TOLERANCES = (1e-4, 1e-5, 1e-6, 1e-7, 1e-8)
LIMITS = ("none", "far", "of the file")
Swing = Callable[[str, float], np.ndarray]  # q at the end, with limits and a step or tolerance


def limits(effort: Effort) -> None:
    """Errors and times of each method by limits."""
    panda = arms()["Panda-7"]
    stops = {
        "none": [],
        "far": [rd.effects.RigidStops(-FAR, FAR)],
        "of the file": [rd.effects.RigidStops("urdf", "urdf")],
    }
    plants = {name: rd.Plant(panda, effects) for name, effects in stops.items()}
    options: dict[str, Any] = {
        "duration_s": DURATION_S, "record_every_s": DURATION_S, "estimate_error": False, "engine": "compiled",
    }  # fmt: skip

    def ours(limit: str, **method: Any) -> rd.Trajectory:
        return rd.simulate(plants[limit], READY, **options, **method)

    exact = {limit: ours(limit, method=rd.integrate.Adaptive("DOP853", 1e-13, 1e-13)) for limit in LIMITS}
    print(f"\n{len(exact['of the file'].events)} events at the limits of the file")
    methods: dict[str, tuple[tuple[float, ...], Swing]] = {
        "robot_dyn, DOP853": (TOLERANCES, lambda limit, tol: ours(limit, rtol=tol, atol=tol, method="DOP853").q[-1]),
        "robot_dyn, RK4": (STEPS, lambda limit, h: ours(limit, method="RK4", step_s=h).q[-1]),
        "MuJoCo, RK4": (STEPS, _mujoco(panda)),
    }

    def error(swing: Swing, limit: str, setting: float) -> float:
        return float(np.abs(swing(limit, setting) - exact[limit].q[-1]).max())

    chosen = {
        name: next((x for x in settings if error(swing, "none", x) <= TARGET), settings[-1])
        for name, (settings, swing) in methods.items()
    }
    calls = {
        f"{name}, {limit}": lambda name=name, limit=limit: methods[name][1](limit, chosen[name])
        for name in methods
        for limit in LIMITS
    }
    times = lowest(calls, effort, 1)
    table("what", "tolerance or step", "limits", "error, rad", "time, ms", "over none", "MuJoCo over it")
    for name, setting in chosen.items():
        for limit in LIMITS:
            time, none, theirs = (
                times[f"{x}, {y}"] for x, y in ((name, limit), (name, "none"), ("MuJoCo, RK4", limit))
            )
            found = error(methods[name][1], limit, setting)
            ratios = f"{time / none:.2f}", f"{theirs / time:.1f}"
            row(name, f"{setting:g}", limit, f"{found:.1e}", f"{time / 1e3:.3f}", *ratios)


def _mujoco(panda: rd.Robot) -> Swing:
    mujoco: Any = import_module("mujoco")
    model: Any = mujoco_model(mujoco, panda)
    ranges = {"far": (-FAR, FAR), "of the file": (panda.lower, panda.upper)}

    def swing(limit: str, h: float) -> np.ndarray:
        model.jnt_limited[:], model.opt.timestep = limit in ranges, h
        if limit in ranges:
            model.jnt_range[:, 0], model.jnt_range[:, 1] = ranges[limit]
        data = mujoco.MjData(model)
        data.qpos[:] = READY
        mujoco.mj_step(model, data, round(DURATION_S / h))
        return data.qpos.copy()

    return swing
