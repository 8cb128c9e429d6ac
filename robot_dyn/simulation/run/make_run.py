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
from robot_dyn.simulation.events.payload_events import PayloadEvents
from robot_dyn.simulation.observation.observer import Observer
from robot_dyn.simulation.run.event_run import EventRun
from robot_dyn.simulation.run.fixed_step import FixedStep
from robot_dyn.simulation.run.state_functions import in_modes, interpreted
from robot_dyn.simulation.run.watch import Watch
from robot_dyn.simulation.setup.schedule import mesh
from robot_dyn.simulation.setup.setup import Setup

if TYPE_CHECKING:
    from robot_dyn.simulation.compiled.compiled_state_equation import CompiledStateEquation


def prepared(
    setup: Setup,
    equation: StateEquation,
    compiled_equation: CompiledStateEquation | None,
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
        compiled_equation: That equation as machine code; None for the interpreted engine.
        pace: Length of steps, in steps of the setup; or times at which steps end, in [s].
        on_progress: Called with the time reached.
        observer: Sees each step.
        samples: Whether samples are kept.
        most: Evaluations after which it gives up with a TooLongError.
        thresholds: Whether steps end at the thresholds of the effects.
        chooses: Whether it gives up with a StiffError where another method is to make the run.
    """
    transfers = PayloadEvents(equation)
    watch = Watch(setup, transfers.equation)

    def made(of: StateEquation) -> tuple[Functions, np.ndarray]:
        if compiled_equation is None and of.impulses and setup.finds_events:
            return in_modes(of, watch), np.zeros(3 * of.plant.dynamics.n)
        if compiled_equation is None:
            return interpreted(of, watch), np.zeros(0)
        functions = (
            compiled_equation.in_python if compiled_equation.loop is None else compiled_equation.equations.functions
        )
        return functions, compiled_equation.parameters if of is equation else _numbers(compiled_equation, of)

    loop, in_python = (
        (None, None) if compiled_equation is None else (compiled_equation.advance(), compiled_equation.in_python)
    )
    if setup.finds_events:
        ends = pace if isinstance(pace, np.ndarray) else None
        if not setup.integrator.controls_error:
            ends = mesh(setup.segments, cast(Fraction, pace))
        first = equation.plant.dynamics.n * equation.sampled
        plant = equation.plant
        of_mode = (
            alone(plant.dynamics.n, first)
            if compiled_equation is None
            else places(compiled_equation.known, plant.effects, first)
        )
        return EventRun(
            watch, transfers, made, ends, of_mode, loop, on_progress, observer, in_python, samples, most, thresholds,
            chooses,
        )  # fmt: skip
    return FixedStep(watch, transfers, made, cast(Fraction, pace), loop, on_progress, observer)


def _numbers(compiled_equation: CompiledStateEquation, equation: StateEquation) -> np.ndarray:
    """The parameters of machine code for an equation of other numbers, which keeps those of the latest machine."""
    latest = equation.computed.get(_numbers)
    if latest is None or latest[0] is not compiled_equation:
        latest = equation.computed[_numbers] = compiled_equation, compiled_equation.of(equation)
    return latest[1]
