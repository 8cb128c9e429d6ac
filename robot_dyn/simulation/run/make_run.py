"""Build a run: the equations of an engine, driven by one of the two time loops.

run = make_run(setup, engine);   recording = run.record()
"""

from __future__ import annotations

from collections.abc import Callable
from fractions import Fraction
from math import inf
from typing import cast

import numpy as np

from robot_dyn.simulation.engine.engine import Engine
from robot_dyn.simulation.events.payload_events import PayloadEvents
from robot_dyn.simulation.observation.observer import Observer
from robot_dyn.simulation.run.event_run import EventRun
from robot_dyn.simulation.run.fixed_step import FixedStep
from robot_dyn.simulation.run.watch import Watch
from robot_dyn.simulation.setup.schedule import mesh
from robot_dyn.simulation.setup.setup import Setup


def make_run(
    setup: Setup,
    engine: Engine,
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
        engine: What evaluates its state equation.
        pace: Step length, as a multiple of the step of the setup; or the times at which steps end, in [s].
        on_progress: Called with the time reached.
        observer: Called at each step.
        samples: Whether samples are kept.
        most: Number of evaluations after which the run stops with `TooLong`.
        thresholds: Whether steps end at the thresholds of the effects.
        chooses: Whether the run stops with `Stiff` or `Accumulation` where another method should be used instead.
    """
    payloads = PayloadEvents(engine.equation)
    watch = Watch(setup, payloads.equation)
    if not setup.finds_events:
        return FixedStep(watch, payloads, engine, cast(Fraction, pace), on_progress, observer)
    ends = pace if isinstance(pace, np.ndarray) else None
    if not setup.integrator.controls_error:
        ends = mesh(setup.segments, cast(Fraction, pace))
    return EventRun(watch, payloads, engine, ends, on_progress, observer, samples, most, thresholds, chooses)
