"""Companion runs of an error estimate."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from typing import final

import numpy as np

from robot_dyn.simulation.engine.engine import Engine
from robot_dyn.simulation.run.outcome import Ending
from robot_dyn.simulation.run.recording import Recording
from robot_dyn.simulation.run.run import Run
from robot_dyn.simulation.setup.setup import Setup


@final
@dataclass
class Runner:
    """A maker of companion runs, which counts them.

    Attributes:
        engine: The engine of the run whose error is estimated.
        on_progress: Called during companion runs with the time at which the run ended, or None.
        end: That time, in [s].
        evaluations: Evaluations of the equation of motion so far.
        runs: Number of companion runs so far.
    """

    engine: Engine
    on_progress: Callable[[float], object] | None = None
    end: float = 0.0
    evaluations: int = 0
    runs: int = 0

    def run(self, setup: Setup, pace: Fraction | np.ndarray = Fraction(1)) -> Recording:
        """Run a setup without samples.

        Args:
            setup: The setup of the run, or one that differs in its start or tolerance.
            pace: Length of steps, as a multiple of the step of the setup; or the times at which steps end, in [s].

        Raises:
            KeyboardInterrupt: If Ctrl-C stopped the run.
        """
        report = None if (on_progress := self.on_progress) is None else lambda _: on_progress(self.end)
        recording = Run(setup, self.engine, pace, on_progress=report, samples=False).record()
        if recording.outcome.ending is Ending.STOPPED:
            raise KeyboardInterrupt
        self.evaluations += recording.evaluations
        self.runs += 1
        return recording
