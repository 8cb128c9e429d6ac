"""Stiff joints of Panda-7, 0.1 rad off: springs and dampers in the joints, and a PD servo, with MuJoCo next to ours.

error = the largest of |q − q_ref| over samples each 0.1 ms, or each step, in the first 10 ms, and at the end

Springs of 1e8 N m/rad with dampers of 1e5 N m s/rad; a servo of 1e5 N m/rad with 1e3 N m s/rad. The reference is the
explicit method at 1e-12, whose steps stability bounds: h |λ| ≤ 6, with λ = −1.6e7 per second of the springs. MuJoCo has
springs, dampers and servos in C. Nothing else acts on either side: no limits, no dry friction, no noise.
"""

from __future__ import annotations

from importlib import import_module
from statistics import median
from typing import Any

import numpy as np

import robot_dyn as rd
from benchmarks.measure import READY, Effort, arms, row, seconds, table
from robot_dyn.accuracy.work_precision_diagram.peers.mujoco import mujoco_model

EARLY_S, SAMPLE_S = 0.01, 1e-4
STIFFNESS, DAMPING = 1e8, 1e5
KP, KD = 1e5, 1e3
INTEGRATORS = {"implicitfast": "mjINT_IMPLICITFAST", "discrete": "mjINT_DISCRETE"}  # discrete: since MuJoCo 3.13
STEPS = (1e-3, 1e-4, 1e-5)


def stiff(effort: Effort) -> None:
    """Errors, steps and times of a run of 1 s, by tolerance or step."""
    panda, mujoco = arms()["Panda-7"], import_module("mujoco")
    joints: Any = mujoco_model(mujoco, panda, damping=DAMPING, bare=True)
    joints.jnt_stiffness[:], joints.qpos_spring[:] = STIFFNESS, READY
    servo: Any = mujoco_model(mujoco, panda, (KP, KD), bare=True)
    effects = [rd.effects.ViscousFriction(DAMPING), rd.effects.Spring(STIFFNESS, READY)]
    law = rd.control.PD(rd.control.hold(READY), kp=KP, kd=KD)
    print("\nSprings and dampers in the joints")
    _errors(effort, rd.Plant(panda, effects), None, joints)
    print("\nA PD servo")
    _errors(effort, rd.Plant(panda), law, servo)


def _errors(effort: Effort, plant: rd.Plant, law: Any, model: Any) -> None:
    duration = 0.001 if effort.quick else 1.0
    options: dict[str, Any] = {
        "q0": READY + 0.1, "duration_s": duration, "record_every_s": SAMPLE_S, "controller": law,
        "estimate_error": False, "engine": "compiled",
    }  # fmt: skip
    reference = rd.simulate(plant, **options, method=rd.integrate.Adaptive("DOP853", 1e-12, 1e-12)).q
    table("what", "tolerance or step", "error to 10 ms, rad", "error at the end, rad", "steps", "time, ms")
    many = [("Rodas5P", tolerance) for tolerance in (1e-4, 1e-5, 1e-6, 1e-8, 1e-10)]
    for name, tolerance in [*many, ("DOP853", 1e-5), ("DOP853", 1e-8)]:
        method = rd.integrate.Adaptive(name, tolerance, tolerance)
        given: dict[str, Any] = options | {"method": method}
        times = [seconds(lambda: rd.simulate(plant, **given)) for _ in range(5 if name == "Rodas5P" else 1)]
        run = rd.simulate(plant, **given)
        _row(name, f"{tolerance:g}", run.q - reference, SAMPLE_S, run.statistics.steps, times)
    for name, option in INTEGRATORS.items():
        for h in STEPS[:1] if effort.quick else STEPS:
            times, q = [], reference
            for _ in range(5 if h > STEPS[-1] else 1):
                spent, q = _mujoco(model, option, h, duration)
                times.append(spent)
            each = max(h, SAMPLE_S)
            _row(
                f"MuJoCo {name}", f"{h:g} s", q - reference[:: round(each / SAMPLE_S)], each, round(duration / h), times
            )


def _row(name: str, setting: str, error: np.ndarray, each: float, steps: int, times: list[float]) -> None:
    apart = np.abs(error).max(axis=1)
    early = apart[: round(EARLY_S / each) + 1].max()
    row(name, setting, f"{early:.1e}", f"{apart[-1]:.1e}", steps, f"{1e3 * median(times):.1f}")


def _mujoco(model: Any, option: str, h: float, duration: float) -> tuple[float, np.ndarray]:
    """The time in [s], and samples of q, (m, n), each 0.1 ms, or each step if that is longer."""
    mujoco: Any = import_module("mujoco")
    model.opt.integrator, model.opt.timestep = getattr(mujoco.mjtIntegrator, option), h
    data, count = mujoco.MjData(model), round(max(h, SAMPLE_S) / h)
    data.qpos[:] = READY + 0.1
    if model.nu:
        data.ctrl[:] = READY
    samples = [data.qpos.copy()]

    def run() -> None:
        for _ in range(round(duration / h / count)):
            mujoco.mj_step(model, data, count)
            samples.append(data.qpos.copy())

    return seconds(run), np.array(samples)
