"""Build a run: its equations as interpreted or compiled functions, driven by one of the two time loops.

run = make_run(setup, equation, compiled_equation);   recording = run.record()
"""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from math import inf
from typing import TYPE_CHECKING, cast

import numpy as np

from robot_dyn.simulation.dynamics.loop_state import Functions
from robot_dyn.simulation.dynamics.state_equation import StateEquation
from robot_dyn.simulation.engine.interpreted import in_modes, interpreted
from robot_dyn.simulation.events.modes import alone, places
from robot_dyn.simulation.events.payload_events import PayloadEvents
from robot_dyn.simulation.observation.observer import Observer
from robot_dyn.simulation.run.event_run import EventRun
from robot_dyn.simulation.run.fixed_step import FixedStep
from robot_dyn.simulation.run.watch import Watch
from robot_dyn.simulation.setup.schedule import mesh
from robot_dyn.simulation.setup.setup import Setup

if TYPE_CHECKING:
    from robot_dyn.simulation.engine.machine_code import CompiledStateEquation


def make_run(
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
    """Return the run of a setup, or a companion run for the error estimate.

    Args:
        setup: The setup to run.
        equation: State equation of the setup.
        compiled_equation: The same equation as machine code; None for the interpreted engine.
        pace: Step length, as a multiple of the step of the setup; or the times at which steps end, in [s].
        on_progress: Called with the time reached.
        observer: Called at each step.
        samples: Whether samples are kept.
        most: Number of evaluations after which the run stops with `TooLong`.
        thresholds: Whether steps end at the thresholds of the effects.
        chooses: Whether the run stops with `Stiff` or `Accumulation` where another method should be used instead.
    """
    payloads = PayloadEvents(equation)
    watch = Watch(setup, payloads.equation)

    def functions_of(of: StateEquation) -> tuple[Functions, np.ndarray]:
        if compiled_equation is None and of.impulses and setup.finds_events:
            return in_modes(of, watch), np.zeros(3 * of.plant.dynamics.n)
        if compiled_equation is None:
            return interpreted(of, watch), np.zeros(0)
        functions = (
            compiled_equation.in_python if compiled_equation.loop is None else compiled_equation.functions.addresses
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
            watch, payloads, functions_of, ends, of_mode, loop, on_progress, observer, in_python, samples, most,
            thresholds, chooses,
        )  # fmt: skip
    return FixedStep(watch, payloads, functions_of, cast(Fraction, pace), loop, on_progress, observer)


def _numbers(compiled_equation: CompiledStateEquation, equation: StateEquation) -> np.ndarray:
    """Parameters of the compiled code for an equation with other values, cached for the latest compiled equation."""
    latest = equation.cache.get(_numbers)
    if latest is None or latest[0] is not compiled_equation:
        latest = equation.cache[_numbers] = compiled_equation, compiled_equation.parameters_of(equation)
    return latest[1]
