"""Steps with an action per lane against `rollouts`, and forward kinematics against the dynamics of a step.

ratio = t(Stepper) / t(rollouts), both in µs per RK4 step of a lane, on one thread
"""

from __future__ import annotations

from functools import partial

import numpy as np

import robot_dyn as rd
from benchmarks.measure import READY, Effort, alternate, panda, row, table
from robot_dyn.tools.step.action import action_of

STEP_S, LEVEL = 1e-3, 20.0  # effort limit in [N m], which a third of the torques exceed


def plant_and_torques(lanes: int) -> tuple[rd.Plant, np.ndarray, np.ndarray]:
    """Panda with friction and effort limits, starts and constant torques of each lane, (n, 7)."""
    plant = rd.Plant(panda(), [rd.effects.EffortLimit(LEVEL), rd.effects.ViscousFriction(1.0)])
    rng = np.random.default_rng(0)
    return plant, READY + 0.1 * rng.uniform(-1.0, 1.0, (lanes, 7)), LEVEL * rng.normal(size=(lanes, 7))


def steps(effort: Effort) -> None:
    """The same RK4 steps by a stepper, an action per period, and by one call of `rollouts` with the torque held."""
    table("lanes", "steps per action", "rollouts, µs", "Stepper, µs", "ratio", "2 threads, µs", "1 thread over 2")
    for lanes in (64, 128) if effort.quick else (512, 4096):
        count = 40 if effort.quick else 400_000 // lanes // 20 * 20
        plant, q, u = plant_and_torques(lanes)
        for substeps in (1, 20):
            period_s = substeps * STEP_S
            held = action_of(None, plant.dynamics.joint_names, period_s)
            setup = rd.Setup(
                plant, q[0], controller=held.controller, duration_s=count * STEP_S, record_every_s=count * STEP_S,
                step_s=STEP_S, method="RK4", estimate_error=False,
            )  # fmt: skip
            arms = [rd.tools.step.Stepper(plant, lanes, period_s=period_s, step_s=STEP_S, threads=x) for x in (1, 2)]

            def stepped(stepper: rd.tools.step.Stepper, q: np.ndarray = q, u: np.ndarray = u) -> np.ndarray:
                """Return the positions at the end."""
                state = stepper.reset(q)
                for _ in range(round(count * STEP_S / stepper.period_s)):
                    state = stepper.step(u)
                return state.q

            run = partial(rd.rollouts, setup, q, vary={held.parameter: u}, threads=1)
            ends = run().q
            assert ends is not None
            assert np.abs(ends[:, -1] - stepped(arms[0])).max() < 1e-6
            calls = {"rollouts": run, "one": partial(stepped, arms[0]), "two": partial(stepped, arms[1])}
            t = {side: time / (lanes * count) for side, time in alternate(calls, effort).items()}
            ratios = f"{t['one'] / t['rollouts']:.2f}", f"{t['two']:.4f}", f"{t['one'] / t['two']:.2f}"
            row(lanes, substeps, f"{t['rollouts']:.4f}", f"{t['one']:.4f}", *ratios)


def kinematics(effort: Effort) -> None:
    """Placement and Jacobian of the hand of 512 arms against four steps of them."""
    lanes = 64 if effort.quick else 512
    plant, q, u = plant_and_torques(lanes)
    arms, fast = rd.tools.step.Stepper(plant, lanes, period_s=4 * STEP_S, step_s=STEP_S), rd.compiled(panda())
    now = arms.reset(q)

    def four() -> None:
        arms.set_state(now)  # not measured alone: a copy
        arms.step(u)

    calls = {"four steps": four} | {
        name: partial(getattr(fast, name), q, "panda_hand_tcp") for name in ("placement", "jacobian")
    }
    t = alternate(calls, effort)
    table("what", "µs", "over four steps")
    for name, time in t.items():
        row(f"{name}, {lanes} arms", f"{time:.0f}", f"{time / t['four steps']:.2f}")
