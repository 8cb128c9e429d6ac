"""Cost of an RK4 step, with and without each part of a setup, for one run or many, with inputs or with constants.

instructions = 4 × instructions of y' = f(t, y), plus those of a tick if the control is sampled

Steps are so short that the state hardly changes. A sampled controller has a tick at every step.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from fractions import Fraction
from functools import partial
from time import process_time

import numpy as np

from robot_dyn.accuracy.costs.ab_comparison import ABComparison, Version
from robot_dyn.codegen.parameters import names_of
from robot_dyn.control.digital_loop.loop import Loop
from robot_dyn.effects.plant import Plant
from robot_dyn.foundations.coefficients import with_values
from robot_dyn.foundations.errors import RobotDynError
from robot_dyn.integrate.methods import method
from robot_dyn.model.robot import Robot
from robot_dyn.simulation.compiled.cache import machine_code, machine_code_of_constants
from robot_dyn.simulation.compiled.machine_code import MachineCode
from robot_dyn.simulation.dynamics.loop_state import Ended
from robot_dyn.simulation.dynamics.state_equation import StateEquation
from robot_dyn.simulation.rollouts.batch import Batch
from robot_dyn.simulation.rollouts.lock_step import LANES, Tiles
from robot_dyn.simulation.run.fixed_steps import FixedSteps
from robot_dyn.simulation.run.state import RunState
from robot_dyn.simulation.setup.segment_table import segment_table
from robot_dyn.simulation.setup.setup import Setup

RUNS = 4096  # number of runs that one thread advances together
PER_STEP, PER_RUN = "step of RK4", "step of RK4 and run"
EVERYTHING, NUMBERS, SIDE_BY_SIDE = "everything", "numbers of the setup", "runs"
_EVALUATIONS = 4  # evaluations of y' in a step of RK4
_IN_LANES = partial(machine_code, extras=())
_STEP_S, _STEPS, _STEPS_OF_MANY = 1e-7, 4000, 25


def parts(setup: Setup) -> Iterator[tuple[str, Setup]]:
    """Yield the name of each part and the setup without it: gravity, other edits, effects, loop and control.

    An edit that is removed from the plant is also removed from the models of the controller, because machine code
    computes common terms once.
    """
    plant, controller = setup.plant, setup.controller
    models = {} if controller is None else controller.models
    for name, dynamics in _edits(plant.dynamics).items():
        off = {key: without for key, model in models.items() if (without := _edits(model).get(name)) is not None}
        yield name, replace(setup, plant=Plant(dynamics, plant.effects), controller=with_values(controller, off))
    names = names_of(plant.effects)
    for name in dict.fromkeys(names):
        others = [effect for effect, own_name in zip(plant.effects, names, strict=True) if own_name != name]
        yield name, replace(setup, plant=Plant(plant.dynamics, others))
    if isinstance(controller, Loop):
        yield "loop", replace(setup, controller=controller.controller)
    if setup.controller is not None:
        yield "control", replace(setup, controller=None)


def _edits(dynamics: object) -> dict[str, Robot]:
    """Return, for each edit that has an effect, the robot without it, by the name of the edit."""
    robot = getattr(dynamics, "robot", dynamics)
    if not isinstance(robot, Robot):
        return {}
    edits = robot.edits
    without = {
        "gravity": replace(edits, gravity=(0.0, 0.0, 0.0)) if any(edits.gravity) else None,
        "payload": replace(edits, payloads=()) if edits.payloads else None,
        "armature": replace(edits, armature=()) if any(value for _, value in edits.armature) else None,
    }
    return {name: Robot(robot.description, others) for name, others in without.items() if others is not None}


def bare(setup: Setup) -> Setup:
    """Return the setup of the rigid bodies alone, without any part."""
    while setups := dict(parts(setup)):
        setup = next(iter(setups.values()))
    return setup


def pairs_of_parts(setup: Setup) -> Iterator[ABComparison]:
    """Yield comparisons of the complete step: first with the bare rigid bodies, then with each part removed.

    Raises:
        TraceError: If a part cannot be compiled; names it.
    """
    whole = one_run("on", setup)
    for name, without in ((EVERYTHING, bare(setup)), *parts(setup)):
        yield ABComparison("parts", name, PER_STEP, whole, one_run("off", without))


def numbers(setup: Setup) -> ABComparison:
    """Compare numbers as inputs of machine code with numbers as constants."""
    constants = one_run("constants", setup, machine_code_of_constants)
    return ABComparison("machine code", NUMBERS, PER_STEP, one_run("inputs", setup), constants)


def side_by_side(setup: Setup) -> ABComparison:
    """Compare one run with many runs together on one thread."""
    many = many_runs(f"{RUNS} side by side", setup)
    return ABComparison("machine code", SIDE_BY_SIDE, PER_RUN, one_run("one", setup), many)


def many_runs(name: str, setup: Setup, translate: Callable[..., MachineCode] = _IN_LANES) -> Version:
    """Return a version that measures many runs together, in seconds per step and run."""
    short = _short(setup, _STEPS_OF_MANY)
    code = translate(_equation(short), short.method, lanes=LANES)
    starts = np.tile(short.q0, (RUNS, 1)), np.tile(short.v0, (RUNS, 1))

    def run() -> float:
        batch = Tiles(Batch(short, *starts), code)
        began = process_time()
        batch.run(1)
        return (process_time() - began) / (RUNS * short.steps)

    return Version(name, instructions(code), run)


def one_run(name: str, setup: Setup, translate: Callable[..., MachineCode] = machine_code) -> Version:
    """Return a version that measures one run, in seconds per step."""
    short = _short(setup, _STEPS)
    code = translate(_equation(short), short.method)

    def run() -> float:
        state = RunState(short, replace(code, equation=code.compiled_form), segment_table(short), None)
        steps = FixedSteps(state, Fraction(1))
        state.position.budget[0] = np.iinfo(np.int64).max
        began = process_time()
        ended = steps.advance()
        spent = process_time() - began
        if ended is not Ended.DONE:
            raise RobotDynError(f"a run of {short.duration_s:g} s from the start diverges near {steps.time:g} s")
        return spent / short.steps

    return Version(name, instructions(code), run)


def instructions(code: MachineCode) -> int:
    """Return the number of instructions in a step, excluding those of the method itself."""
    programs = code.code.programs
    return _EVALUATIONS * len(programs["rate"]) + (len(programs["tick"]) if "tick" in programs else 0)


def _equation(setup: Setup) -> StateEquation:
    return StateEquation(setup.plant, setup.controller)


def _short(setup: Setup, steps: int) -> Setup:
    """Return the setup with short RK4 steps, `steps` of them; a sampled controller gets a tick at every step."""
    controller = setup.controller
    if controller is not None and controller.period_s:
        controller = controller.at_period(_STEP_S)
    duration = steps * _STEP_S
    return replace(
        setup, controller=controller, method=method("RK4"), step_s=_STEP_S, duration_s=duration,
        record_every_s=duration, estimate_error=False, accuracy=None, events=(), engine="compiled",
    )  # fmt: skip
