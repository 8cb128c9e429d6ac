"""What it costs that numbers are inputs of machine code, not constants: instructions, and time of an RK4 step.

ratio = with inputs / with constants: of the instructions of y', of one run, and of runs in lock step
"""

from __future__ import annotations

from dataclasses import replace

import robot_dyn as rd
from benchmarks.measure import READY, Effort, arms, row, seconds, table
from robot_dyn.accuracy.costs.ab_comparison import ABComparison, take_turns
from robot_dyn.accuracy.costs.step_cost import PER_RUN, many_runs, numbers
from robot_dyn.model.right_angles import with_exact_right_angles
from robot_dyn.report.time_budget import Budget
from robot_dyn.simulation.compiled.cache import machine_code_of_constants


def parameters(effort: Effort) -> None:
    """Scenes of Panda-7 whose numbers are gravity, a payload, gains and coefficients; and what another value costs."""
    arm = with_exact_right_angles(arms()["Panda-7"])[0]
    held = arm.with_(payload=rd.Payload("panda_link8", 1.5, (0.01, 0.02, 0.1)))
    friction, goal = [rd.effects.ViscousFriction(0.5)], rd.control.quintic(READY, READY + 0.2, 1.0)
    scenes = {
        "free swing": (arm, [], None),
        "free swing, payload": (held, [], None),
        "PD, friction": (arm, friction, rd.control.PD(goal, kp=100.0, kd=10.0)),
        "computed torque, friction": (arm, friction, rd.control.ComputedTorque(arm, goal, kp=100.0, kd=20.0)),
    }
    table("what", "constants", "inputs", "ratio", "one run", "many runs", "other values, ms")
    for name, (robot, effects, controller) in list(scenes.items())[: 1 if effort.quick else None]:
        setup = rd.Setup(
            rd.Plant(robot, effects), READY, duration_s=0.02, controller=controller, estimate_error=False,
            engine="compiled",
        )  # fmt: skip
        rd.simulate(setup)
        lighter = rd.Plant(robot.with_(gravity=(0.0, 0.0, -9.7)), effects)
        other = replace(setup, plant=lighter, controller=controller and replace(controller, kp=90.0))
        again = seconds(lambda other=other: rd.simulate(other))
        constants = many_runs("constants", setup, machine_code_of_constants)
        many = ABComparison("machine code", "many runs", PER_RUN, many_runs("inputs", setup), constants)
        (one, many), _ = take_turns([numbers(setup), many], Budget(), effort.repeats)
        counts = (version.instructions // 4 for version in (one.second, one.first))
        ratios = (f"{one.instructions_ratio:.3f}", f"{one.time_ratio:.2f}", f"{many.time_ratio:.2f}")
        row(name, *counts, *ratios, f"{1e3 * again:.0f}")
