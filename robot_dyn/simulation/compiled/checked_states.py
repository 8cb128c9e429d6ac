"""States at which machine code is compared with the interpreted equations before it is used."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from robot_dyn.simulation.dynamics.state_equation import StateEquation
from robot_dyn.simulation.run.make_run import make_run
from robot_dyn.simulation.run.outcome import Ending
from robot_dyn.simulation.run.recording import Path, Recording
from robot_dyn.simulation.setup.segment_table import segment_table
from robot_dyn.simulation.setup.setup import Setup

_RANDOM = 4
_FIRST_S, _MOST = 1.0, 2000  # [s] of a run that are interpreted first, and its evaluations, some 0.2 s
_ALONG, _AT_TIMES = 100, 100
_AGAIN = 4  # of either
_TRIES = 4  # of spans, each a tenth; then the start alone is left


class States(NamedTuple):
    """Times (k,), in [s], and states (k, m)."""

    t: np.ndarray
    y: np.ndarray


def random_states(setup: Setup, size: int) -> States:
    """Random states of that size at random segments of a run."""
    rng, table = np.random.default_rng(20), segment_table(setup)
    segments = rng.integers(len(table.counts) - 1, size=_RANDOM)
    return States(table.starts[segments] + table.lengths[segments], rng.normal(size=(_RANDOM, size)))


def states_of(setup: Setup) -> States:
    """States of the first second of a run, at their times and at random times of the whole run.

    They lie halfway between the ends of steps, where rates may have kinks. Those at other times are for code that does
    on symbols what it does on early times.
    """
    path = _first_second(setup)
    ends = np.unique(np.linspace(0, max(len(path.t) - 2, 0), _ALONG).astype(int))
    after = np.minimum(ends + 1, len(path.t) - 1)
    t, y = (path.t[ends] + path.t[after]) / 2, (path.y[ends] + path.y[after]) / 2
    times = np.random.default_rng(20).uniform(0.0, setup.duration_s, size=_AT_TIMES)
    return States(np.append(t, times), np.vstack([y, y[np.resize(np.arange(len(y)), _AT_TIMES)]]))


def some(states: States) -> States:
    """A few of these states, the first and the last among them."""
    rows = np.unique(np.linspace(0, len(states.t) - 1, 2 * _AGAIN).astype(int))
    return States(states.t[rows], states.y[rows])


def _first_second(setup: Setup) -> Path:
    """The first second of a run by the interpreted engine, or as much of it as takes few evaluations; or its start."""
    span = min(setup.duration_s, _FIRST_S)
    if not setup.integrator.controls_error:
        span = min(span, _MOST / (setup.integrator.evaluations_per_step or 1) * setup.taken_step_s)
    for _ in range(_TRIES):
        short = replace(
            setup, duration_s=span, record_period_s=0.0, estimate_error=False, accuracy=None, engine="interpreted"
        )
        equation = StateEquation(short.plant, short.controller, short.integrator.canonical, short.events)
        record = make_run(short, equation, None, samples=False, most=_MOST).run()
        if not isinstance(record, Recording):
            span /= 10
            continue
        if record.outcome.ending is Ending.STOPPED:
            raise KeyboardInterrupt
        return record.step_log
    equation = StateEquation(setup.plant, setup.controller, setup.integrator.canonical, setup.events)
    return Path(np.zeros(1, np.int64), np.zeros(1), equation.start(setup.q0, setup.v0)[None])
