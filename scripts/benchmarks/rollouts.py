"""Simulation against MuJoCo's C: the RK4 step of one run, and thousands of runs at once, without and with dry friction.

ratio = t(MuJoCo) / t(robot_dyn), both in µs per step
"""

from __future__ import annotations

from collections.abc import Callable
from importlib import import_module
from typing import Any

import numpy as np

import robot_dyn as rd
from benchmarks.measure import BATCH, READY, Effort, arms, row, seconds, stick_and_stop, table
from robot_dyn.accuracy.work_precision_diagram.peers.mujoco import STEP_S, mujoco_model

mujoco: Any = import_module("mujoco")
mujoco_rollout: Any = import_module("mujoco.rollout")

GAINS, DAMPING, THREADS = (100.0, 10.0), 0.5, 2
LEVEL = np.array([3.0, 6.0, 2.0, 4.0, 1.0, 0.8, 0.3])
LOWER, UPPER = READY - 0.15, READY + 0.25


def _second(call: Callable[[], object]) -> float:
    """Time in [s] of the second of two calls: the first one after other work may pay for pages of memory."""
    call()
    return seconds(call)


def one_step(effort: Effort) -> None:
    """An RK4 step in one run: MuJoCo's loop in C, and ours in machine code."""
    panda, steps = arms()["Panda-7"], 200 if effort.quick else 10_000
    model: Any = mujoco_model(mujoco, panda, bare=True)
    duration = steps * STEP_S
    setup = rd.Setup(
        rd.Plant(panda), READY, duration_s=duration, record_every_s=duration, estimate_error=False,
        engine="compiled", method="RK4",
    )  # fmt: skip
    theirs, ours = [], []
    rd.simulate(setup)
    for _ in range(effort.repeats):
        data = mujoco.MjData(model)
        data.qpos[:] = READY
        theirs.append(seconds(lambda: mujoco.mj_step(model, data, steps)) / steps)
        statistics = rd.simulate(setup).statistics
        ours.append(statistics.wall_s / statistics.steps)
    short, data = 100, mujoco.MjData(model)
    data.qpos[:] = READY
    mujoco.mj_step(model, data, short)
    apart = np.abs(rd.simulate(setup, duration_s=short * STEP_S).q[-1] - data.qpos).max()
    table("what", "MuJoCo, µs", "robot_dyn, µs", "ratio")
    a, b = 1e6 * np.median(theirs), 1e6 * np.median(ours)
    row("RK4 step, one run, Panda-7", f"{a:.2f}", f"{b:.3f}", f"{a / b:.1f}")
    print(f"\nAfter {short} steps their q differ by {apart:.0e} rad.")


def thousands(effort: Effort) -> None:
    """Runs of 1000 RK4 steps under PD and viscous friction on 2 threads; every q and v is recorded on both sides."""
    model: Any = mujoco_model(mujoco, arms()["Panda-7"], GAINS, DAMPING, bare=True)
    _side_by_side(effort, model, [], "RK4", "RK4 steps, PD and friction")


def sticking(effort: Effort) -> None:
    """The same with dry friction and rigid stops, e = 0, by time stepping; MuJoCo with its stiffest settings."""
    model: Any = mujoco_model(mujoco, arms()["Panda-7"], GAINS, DAMPING)
    stick_and_stop(mujoco, model, LEVEL, LOWER, UPPER, STEP_S)
    held = [rd.effects.DryFriction(LEVEL), rd.effects.RigidStops(LOWER, UPPER)]
    _side_by_side(effort, model, held, "MoreauJean", "steps, PD, dry friction and rigid stops")


def _side_by_side(effort: Effort, model: Any, held: list[Any], method: str, what: str) -> None:
    panda, runs, steps = arms()["Panda-7"], (128 if effort.quick else BATCH), (40 if effort.quick else 1000)
    goal, starts = READY + 0.2, READY + 0.1 * np.random.default_rng(0).uniform(-1, 1, size=(runs, 7))
    control = rd.control.PD(rd.control.hold(goal), kp=GAINS[0], kd=GAINS[1])
    plant = rd.Plant(panda, [rd.effects.ViscousFriction(DAMPING), *held])
    setup = rd.Setup(plant, READY, duration_s=steps * STEP_S, controller=control, method=method)
    first = np.zeros((runs, 1 + 14))
    first[:, 1:8] = starts
    command, state = np.broadcast_to(goal, (runs, steps, 7)).copy(), np.empty((runs, steps, 15))
    datas = [mujoco.MjData(model) for _ in range(THREADS)]
    theirs, ours, alone = [], [], []
    with mujoco_rollout.Rollout(nthread=THREADS) as pool:
        made = rd.rollouts(setup, starts, threads=THREADS)
        for _ in range(min(effort.repeats, 5)):
            theirs.append(_second(lambda: pool.rollout(model, datas, first, command, state=state)) / (runs * steps))
            for threads, times in ((THREADS, ours), (1, alone)):
                spent = _second(lambda threads=threads: rd.rollouts(setup, starts, threads=threads))
                times.append(spent / (runs * steps))
    a, b, c = (1e6 * np.median(times) for times in (theirs, ours, alone))
    table("what", "MuJoCo, µs", "robot_dyn, µs", "ratio", "robot_dyn, 1 thread, µs", "2 threads over 1")
    what = f"{runs} runs of {steps} {what}, {THREADS} threads, per step"
    row(what, f"{a:.2f}", f"{b:.4f}", f"{a / b:.1f}", f"{c:.4f}", f"{c / b:.2f}")
    assert made.q is not None
    apart = np.abs(made.q[:, 1:] - state[:, :, 1:8]).max()
    print(f"\nOver all runs and steps their q differ by {apart:.0e} rad.")
