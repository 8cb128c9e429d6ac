"""The state of a run in progress: the data of its time loop, the equation with the payloads it carries, its events."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar, final

import numpy as np

from robot_dyn.foundations.arithmetic import Array
from robot_dyn.foundations.values import cached
from robot_dyn.simulation.dynamics.event import Occurrence
from robot_dyn.simulation.dynamics.loop_state import LoopConfig, lanes_of, loop_config, start_position
from robot_dyn.simulation.dynamics.state_equation import StateEquation
from robot_dyn.simulation.engine.engine import Engine
from robot_dyn.simulation.events.payload_events import PayloadEvents
from robot_dyn.simulation.observation.observation import UNOBSERVED
from robot_dyn.simulation.observation.observer import Observer
from robot_dyn.simulation.run.recording import Loop, Records, records_of
from robot_dyn.simulation.run.watch import Watch
from robot_dyn.simulation.setup.segment_table import SegmentTable
from robot_dyn.simulation.setup.setup import Setup

T = TypeVar("T")


@final
class RunState:
    """The state of a run in progress, which its steps change.

    Args:
        setup: The setup.
        engine: The engine of its state equation.
        table: The segments, with the steps of the run.
        observer: Observer of each step, or None.

    Attributes:
        payloads: The payloads carried now.
        watch: Monitor of divergence; it has the equation with these payloads.
        functions, in_python: The functions of the equation, as the loop and as Python call them.
        loop: The data of the time loop.
        start: The state at the start, (m,).
        events: The events so far.
        stop: A first entry other than 0 ends the run after its current step, (1,).
    """

    loop: Loop

    def __init__(self, setup: Setup, engine: Engine, table: SegmentTable, observer: Observer | None) -> None:
        self.setup, self.engine, self.table, self.observer = setup, engine, table, observer
        self.payloads = PayloadEvents(engine.equation)
        self.watch = Watch(setup, self.payloads.equation)
        self.config = cached(setup, single_run_config)
        n, m = self.config.n, self.equation.size
        self.start = self.equation.start(setup.q0, setup.v0)
        self.functions, self.in_python, parameters = engine.evaluated(self.equation, self.watch)
        run_parameters = np.concatenate([np.full(self.config.held, np.nan), parameters])[:, None]
        self.lanes = lanes_of(self.equation, self.start[:, None], run_parameters, m + n + 2, table.parameters[0])
        self.lanes.energy[0], self.lanes.scale[0] = self.watch.energy, self.watch.scale
        self.position, self.stop = start_position(), np.zeros(1, np.int64)
        self.events: list[Occurrence] = []

    def allocate(self, config: LoopConfig, samples: int, shared: int, steps: int) -> None:
        """Set the settings of the loop and allocate its records: rows of samples, shared states and ends of steps."""
        n, m, observer = config.n, self.equation.size, self.observer
        columns, observation = (None, UNOBSERVED) if observer is None else (observer.columns, observer.observation)
        y, sampled = np.empty((samples, m, 1)), np.empty((samples, m + n + 2, 1))
        records = records_of((m, n), np.arange(m), y, sampled, shared, steps, columns, observation)
        self.config = config
        self.loop = Loop(self.table, self.lanes, records, config, self.position)

    def observed(self, advance: Callable[[], T]) -> T:
        """Return the result of a function that may take steps; the observer processes their columns if full."""
        if self.observer is None:
            return advance()
        self.position.column[0] = self.observer.filled
        result = advance()
        self.observer.filled = int(self.position.column[0])
        self.observer.process()
        return result

    @property
    def equation(self) -> StateEquation:
        """The state equation with the payloads carried now."""
        return self.watch.equation

    @property
    def records(self) -> Records:
        """The records of the loop."""
        return self.loop.records

    @property
    def segment(self) -> int:
        """The index of the segment."""
        return int(self.position.segment[0])

    @property
    def y(self) -> np.ndarray:
        """A copy of the state reached, (m,)."""
        return self.lanes.y[:, 0].copy()

    @property
    def held(self) -> Array | None:
        """The actuation in zero-order hold; None if the controller acts continuously."""
        return self.lanes.run_parameters[: self.config.held, 0] if self.config.held else None

    def set_parameters(self, parameters: np.ndarray) -> None:
        """Set the parameters of the functions, which follow the actuation in zero-order hold."""
        self.lanes.run_parameters[self.config.held :, 0] = parameters

    def tick(self) -> None:
        """Act as the controller at the start of the segment, by the interpreted equation."""
        s = self.segment
        self.lanes.y[:, 0], held = self.watch.tick(float(self.table.starts[s]), self.y)
        self.lanes.run_parameters[: self.config.held, 0] = held
        self.table.ticks[s] = 0

    def change_payload(self) -> list[Occurrence]:
        """Pick up or drop payloads at the start of the segment; return these events."""
        s = self.segment
        self.lanes.y[:, 0], happened = self.payloads.over(float(self.table.starts[s]), self.y)
        self.watch.equation = self.payloads.equation
        self.functions, self.in_python, parameters = self.engine.evaluated(self.equation, self.watch)
        self.set_parameters(parameters)
        self.table.payload_events[s] = 0
        return happened


def single_run_config(setup: Setup) -> LoopConfig:
    """Return the settings of the loop of a single run that shares no states."""
    return loop_config(setup.equation, alone=True)
