"""What it costs that numbers are inputs of machine code, not constants: instructions, and time of an RK4 step.

ratio = with inputs / with constants: of the instructions of y', of one run, and of 64 runs in lock step
"""

from __future__ import annotations

from dataclasses import replace
from fractions import Fraction
from typing import Any

import numpy as np

import robot_dyn as rd
from benchmarks.measure import READY, Effort, arms, row, seconds, table
from robot_dyn.integrate.methods import method
from robot_dyn.model.right_angles import completed
from robot_dyn.simulation.compiled.cache import machine_code, machine_code_of_constants
from robot_dyn.simulation.compiled.machine_code import MachineCode
from robot_dyn.simulation.dynamics.state_equation import StateEquation
from robot_dyn.simulation.events.payload_events import PayloadEvents
from robot_dyn.simulation.rollouts.batch import Batch
from robot_dyn.simulation.rollouts.lock_step import LANES, Tiles
from robot_dyn.simulation.run.fixed_step import FixedStep
from robot_dyn.simulation.run.watch import Watch


def parameters(effort: Effort) -> None:
    """Scenes of Panda-7 whose numbers are gravity, a payload, gains and coefficients; and what another value costs."""
    arm = completed(arms()["Panda-7"])[0]
    held = arm.with_(payload=rd.Payload("panda_link8", 1.5, (0.01, 0.02, 0.1)))
    friction, goal = [rd.effects.ViscousFriction(0.5)], rd.control.quintic(READY, READY + 0.2, 1.0)
    scenes = {
        "free swing": (rd.Plant(arm), None),
        "free swing, payload": (rd.Plant(held), None),
        "PD, friction": (rd.Plant(arm, friction), rd.control.PD(goal, 100.0, 10.0)),
        "computed torque, friction": (rd.Plant(arm, friction), rd.control.ComputedTorque(arm, goal, 100.0, 20.0)),
    }
    table("what", "constants", "inputs", "ratio", "one run", "64 runs", "other values, ms")
    for name, (plant, controller) in list(scenes.items())[: 1 if effort.quick else None]:
        setup = rd.Setup(
            plant, READY, duration_s=0.02 if effort.quick else 1.0, controller=controller, integrator=method("rk4"),
            record_period_s=0.02, estimate_error=False, engine="compiled",
        )  # fmt: skip
        rd.simulate(setup)
        other = rd.Setup(
            rd.Plant(plant.dynamics.with_(gravity=(0.0, 0.0, -9.7)), plant.effects), READY, duration_s=0.02,  # pyright: ignore
            controller=controller and replace(controller, kp=90.0), estimate_error=False, engine="compiled",
        )  # fmt: skip
        again = seconds(lambda: rd.simulate(other))
        equation, rk4 = StateEquation(setup.plant, setup.controller), setup.integrator
        made = {
            "constants": machine_code_of_constants(equation, rk4),
            "inputs": machine_code(equation, rk4),
        }
        lanes = {
            "constants": machine_code_of_constants(equation, rk4, lanes=LANES),
            "inputs": machine_code(equation, rk4, lanes=LANES, extras=()),
        }
        counts = {kind: len(each.code.programs["rate"]) for kind, each in made.items()}
        alone = _ratio({kind: _one(setup, each) for kind, each in made.items()}, effort)
        many = _ratio({kind: _many(setup, each) for kind, each in lanes.items()}, effort)
        ratio = counts["inputs"] / counts["constants"]
        row(
            name, counts["constants"], counts["inputs"], f"{ratio:.3f}", f"{alone:.2f}", f"{many:.2f}",
            f"{1e3 * again:.0f}",
        )  # fmt: skip


def _one(setup: rd.Setup, made: MachineCode) -> Any:
    def run() -> float:
        watch, transfers = Watch(setup, made.compiled_form), PayloadEvents(made.compiled_form)
        return seconds(FixedStep(watch, transfers, made, Fraction(1)).record)

    return run


def _many(setup: rd.Setup, made: MachineCode) -> Any:
    starts = np.tile(READY, (8 * LANES, 1))

    def run() -> float:
        batch = Tiles(Batch(setup, starts, 0 * starts, {}, ("q",)), made)
        return seconds(lambda: batch.run(1))

    return run


def _ratio(runs: dict[str, Any], effort: Effort) -> float:
    """Median of inputs over constants; they take turns."""
    times: dict[str, list[float]] = {kind: [] for kind in runs}
    for _ in range(effort.repeats + 1):
        for kind, run in runs.items():
            times[kind].append(run())
    return float(np.median(times["inputs"][1:]) / np.median(times["constants"][1:]))
