"""A run made ready: its equations as functions, interpreted or machine code, in one of the two time loops.

run = prepared(setup, equation, machine);   record = run.record()
"""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from math import inf
from typing import TYPE_CHECKING, cast

import numpy as np

from robot_dyn.simulation.dynamics.loop_state import Functions
from robot_dyn.simulation.dynamics.state_equation import StateEquation
from robot_dyn.simulation.events.modes import alone, places
from robot_dyn.simulation.events.transfers import Transfers
from robot_dyn.simulation.observation.observer import Observer
from robot_dyn.simulation.run.event_run import EventRun
from robot_dyn.simulation.run.fixed_step import FixedStep
from robot_dyn.simulation.run.state_functions import in_modes, interpreted
from robot_dyn.simulation.run.watch import Watch
from robot_dyn.simulation.setup.schedule import mesh
from robot_dyn.simulation.setup.setup import Setup

if TYPE_CHECKING:
    from robot_dyn.simulation.compiled.machine import Machine


def prepared(
    setup: Setup,
    equation: StateEquation,
    machine: Machine | None,
    pace: Fraction | np.ndarray = Fraction(1),
    on_progress: Callable[[float], object] | None = None,
    observer: Observer | None = None,
    samples: bool = True,
    most: float = inf,
    thresholds: bool = True,
    chooses: bool = False,
) -> EventRun | FixedStep:
    """The run of a setup, or of a companion.

    Args:
        setup: What to run.
        equation: Its state equation.
        machine: That equation as machine code; None for the interpreted engine.
        pace: Length of steps, in steps of the setup; or times at which steps end, in [s].
        on_progress: Called with the time reached.
        observer: Sees each step.
        samples: Whether samples are kept.
        most: Evaluations after which it gives up with a TooLongError.
        thresholds: Whether steps end at the thresholds of the effects.
        chooses: Whether it gives up with a StiffError where another method is to make the run.
    """
    transfers = Transfers(equation)
    watch = Watch(setup, transfers.equation)

    def made(of: StateEquation) -> tuple[Functions, np.ndarray]:
        if machine is None and of.impulses and setup.finds_events:
            return in_modes(of, watch), np.zeros(3 * of.plant.dynamics.n)
        if machine is None:
            return interpreted(of, watch), np.zeros(0)
        functions = machine.in_python if machine.loop is None else machine.equations.functions
        return functions, machine.parameters if of is equation else _numbers(machine, of)

    loop, in_python = (None, None) if machine is None else (machine.advance(), machine.in_python)
    if setup.finds_events:
        ends = pace if isinstance(pace, np.ndarray) else None
        if not setup.integrator.controls_error:
            ends = mesh(setup.segments, cast(Fraction, pace))
        first = equation.plant.dynamics.n * equation.sampled
        plant = equation.plant
        of_mode = alone(plant.dynamics.n, first) if machine is None else places(machine.known, plant.effects, first)
        return EventRun(
            watch, transfers, made, ends, of_mode, loop, on_progress, observer, in_python, samples, most, thresholds,
            chooses,
        )  # fmt: skip
    return FixedStep(watch, transfers, made, cast(Fraction, pace), loop, on_progress, observer)


def _numbers(machine: Machine, equation: StateEquation) -> np.ndarray:
    """The parameters of machine code for an equation of other numbers, which keeps those of the latest machine."""
    latest = equation.known.get(_numbers)
    if latest is None or latest[0] is not machine:
        latest = equation.known[_numbers] = machine, machine.of(equation)
    return latest[1]
