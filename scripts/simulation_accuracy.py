"""How far a simulation can be trusted: RK4 on the Panda, the energy of a long run, and error estimates against errors.

References are runs of two methods whose distance is printed; MuJoCo's RK4 runs beside ours where it is installed.
"""

from __future__ import annotations

import argparse
from dataclasses import replace
from importlib import import_module
from typing import Any

import numpy as np
from benchmarks.mujoco_arm import mujoco_model

import robot_dyn as rd

TIGHT = rd.Adaptive(rtol=1e-13, atol=1e-14)
PANDA = rd.load("panda").with_(lock={"panda_finger_joint1": 0.0})
READY = np.array([0.3, 0.6, -0.4, -1.2, 0.5, 1.1, 0.2])
DOUBLE = rd.load("planar_2r")


def free_swing(duration: float) -> rd.Setup:
    """The Panda let go, RK4 at 1 ms."""
    return rd.Setup(rd.Plant(PANDA), q0=READY, v0=np.zeros(7), duration_s=duration, integrator="rk4", step_s=1e-3)


def end(run: rd.Trajectory) -> np.ndarray:
    """(q, v) at the end of a run."""
    return np.concatenate([run.q[-1], run.v[-1]])


def references(setup: rd.Setup) -> tuple[np.ndarray, float]:
    """The end of a run by DOP853 on Pinocchio's equations, and how far order 8 on our own Lagrangian ends from it."""
    quiet = replace(setup, estimate_error=False, record_period_s=setup.duration_s)
    by_tolerance = end(rd.simulate(quiet, integrator=TIGHT))
    own: Any = rd.Lagrangian(PANDA)
    by_steps = end(rd.simulate(replace(quiet, plant=rd.Plant(own)), integrator="order_8", step_s=2e-3))
    return by_tolerance, float(np.abs(by_steps - by_tolerance).max())


def mujoco_end(duration: float) -> tuple[np.ndarray, float] | None:
    """(q, v) at the end of MuJoCo's run and how far its M is from ours, relative; None where it is not installed."""
    try:
        mujoco: Any = import_module("mujoco")
    except ImportError:
        return None
    model = mujoco_model(mujoco, PANDA)
    names = tuple(model.joint(i).name for i in range(model.njnt))
    assert names == PANDA.joint_names
    assert not model.dof_damping.any() and not model.dof_frictionloss.any() and not model.dof_armature.any()
    data = mujoco.MjData(model)
    data.qpos[:] = READY
    mujoco.mj_forward(model, data)
    M, ours = np.zeros((model.nv, model.nv)), PANDA.M(READY)
    mujoco.mj_fullM(model, data, M)
    for _ in range(round(duration / model.opt.timestep)):
        mujoco.mj_step(model, data)
    return np.concatenate([data.qpos, data.qvel]), float(np.abs(M - ours).max() / np.abs(ours).max())


def panda(quick: bool) -> None:
    """RK4 at 1 ms on a free swing: state error against the reference."""
    print("## Panda, fingers locked, free swing, RK4 at 1 ms: largest error at the end\n")
    print("| s | of (q, v) | of q | estimated, of q | MuJoCo, of (q, v) | its M against ours | references differ by |")
    print("|--:|--:|--:|--:|--:|--:|--:|")
    for duration in (0.1, 0.2) if quick else (1.0, 2.0):
        setup = free_swing(duration)
        truth, doubt = references(setup)
        run, other = rd.simulate(setup), mujoco_end(duration)
        error = np.abs(end(run) - truth)
        beside = "not installed | " if other is None else f"{np.abs(other[0] - truth).max():.2e} | {other[1]:.0e}"
        print(
            f"| {duration:g} | {error.max():.2e} | {error[:7].max():.2e} | {estimated(run)} | {beside} | {doubt:.0e} |"
        )


def estimated(run: rd.Trajectory) -> str:
    """The error estimate of a run in a few words."""
    if run.error is None:
        return "none"
    note = "" if run.error.resolved_until == run.outcome.t else f", resolved to {run.error.resolved_until:g} s"
    return f"{run.error.final:.2e}{note}"


def slope(t: np.ndarray, energy: np.ndarray, blocks: int = 20) -> tuple[float, float]:
    """Slope of the energy and its standard deviation, of the line through the means of blocks."""
    parts = np.array_split(np.arange(len(t)), blocks)
    x, y = (np.array([values[part].mean() for part in parts]) for values in (t, energy))
    away = x - x.mean()
    rate = away @ y / (away @ away)
    rest = y - y.mean() - rate * away
    return float(rate), float(np.sqrt(rest @ rest / (blocks - 2) / (away @ away)))


def long_run(steps: int, step_s: float = 5e-3) -> None:
    """Energy of the double pendulum over many steps."""
    print(f"\n## Double pendulum, {steps} steps of {step_s * 1e3:g} ms: energy E − E(0)\n")
    print("| method | until, s | largest, J | slope, W | its uncertainty, W | slope / uncertainty | wall, s |")
    print("|---|--:|--:|--:|--:|--:|--:|")
    for name in ("gauss_4", "rk4", "explicit_euler"):
        run = rd.simulate(
            rd.Plant(DOUBLE), q0=[-1.0, 0.5], v0=[0.3, -0.2], duration_s=steps * step_s, step_s=step_s,
            integrator=rd.method(name), record_period_s=max(1, steps // 20000) * step_s, estimate_error=False,
        )  # fmt: skip
        residual = run.ledger.residual
        known = np.isfinite(residual)
        rate, doubt = slope(run.t[known], residual[known])
        print(
            f"| {name} | {run.outcome.t:g} ({run.outcome.ending}) | {np.abs(residual[known]).max():.2e} | {rate:+.1e}"
            f" | {doubt:.1e} | {rate / doubt:+.1f} | {run.statistics.wall_s:.0f} |",
            flush=True,
        )


def scenes() -> dict[str, rd.Setup]:
    """Five smooth scenes, for RK4."""
    reach = rd.quintic(READY, READY + np.array([0.4, -0.3, 0.5, 0.2, -0.6, 0.3, 0.4]), 0.5)
    control = rd.ComputedTorque(PANDA, reach, *rd.gains_from(1.0, 8.0, 0.9))
    friction, spring = rd.ViscousFriction([0.4, 0.2]), rd.Spring([30.0, 0.0], [0.2, 0.0])
    cart_pole = rd.Plant(rd.load("cart_pole"), [spring])
    return {
        "pendulum": rd.Setup(rd.Plant(rd.load("pendulum")), [2.5], [0.7], 2.0, integrator="rk4", step_s=4e-3),
        "planar_2r, friction": rd.Setup(
            rd.Plant(DOUBLE, [friction]), [0.4, -0.7], [0.3, 0.5], 1.0, integrator="rk4", step_s=5e-3
        ),
        "panda, free swing": replace(free_swing(1.0), step_s=2e-3),
        "panda, computed torque": rd.Setup(
            rd.Plant(PANDA), READY + 0.1, np.full(7, -0.2), 0.5, controller=control, integrator="rk4", step_s=5e-3
        ),
        "cart_pole, spring": rd.Setup(cart_pole, [0.1, 0.8], [0.3, -0.5], 1.0, integrator="rk4", step_s=5e-3),
    }


def estimates(quick: bool) -> None:
    """Error estimates beside true errors."""
    print("\n## Error of q: the run's own estimate beside the true error\n")
    print("| scene | step, ms | estimated | true | estimated / true | references differ by |")
    print("|---|--:|--:|--:|--:|--:|")
    for name, full in scenes().items():
        setup = replace(full, duration_s=0.4) if quick else full
        run = rd.simulate(setup)
        h = setup.step_s
        exact = rd.simulate(setup, integrator="order_8", step_s=h / 2, record_period_s=h, estimate_error=False)
        tight = rd.simulate(setup, integrator=TIGHT, estimate_error=False)
        error, doubt = np.abs(run.q - exact.q).max(), np.abs(tight.q[-1] - exact.q[-1]).max()
        ratio = run.error.final / error if run.error else np.nan
        print(f"| {name} | {h * 1e3:g} | {estimated(run)} | {error:.2e} | {ratio:.2f} | {doubt:.0e} |")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--quick", action="store_true", help="short runs: to see that it works, not for figures")
    parser.add_argument("--steps", type=int, help="of the long run: 10⁶ unless given; 2000 with --quick")
    parser.add_argument("--only", choices=["panda", "long", "estimates"], help="one table")
    options = parser.parse_args()
    if options.only in (None, "panda"):
        panda(options.quick)
    if options.only in (None, "estimates"):
        estimates(options.quick)
    if options.only in (None, "long"):
        long_run(options.steps or (2000 if options.quick else 1_000_000))
