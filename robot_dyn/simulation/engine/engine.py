"""The protocol of the engines of a run: interpreted (`interpreted.py`) and machine code (`compiled/machine_code.py`).

engine = choose(setup);   run = Run(setup, engine);   recording = run.record()
"""

from __future__ import annotations

from collections.abc import Callable
from typing import ClassVar, NamedTuple, Protocol, TypeVar

import numpy as np

from robot_dyn.simulation.dynamics.loop_state import Functions
from robot_dyn.simulation.dynamics.state_equation import StateEquation
from robot_dyn.simulation.events.contact_mode import Places
from robot_dyn.simulation.setup.setup import Setup

Advance = Callable[..., int]
T = TypeVar("T")


class Watched(Protocol):
    """The monitor of a run, which turns errors of interpreted functions into its outcome; see `run.watch.Watch`."""

    setup: Setup

    def tick(self, t: float, y: np.ndarray) -> tuple[np.ndarray, np.ndarray | None]:
        """Return y with the next states of the controller, and the torque to hold; see `StateEquation.tick`."""
        ...

    def attempt(self, t: float, y: np.ndarray, compute: Callable[[], T]) -> T:
        """Return the result of `compute`; raise the error that ends the run if the equations cannot be evaluated."""
        ...


class Evaluated(NamedTuple):
    """A state equation as functions, see `Engine`.

    Attributes:
        functions: Functions for the time loop; addresses if the loop is machine code.
        in_python: The same functions as Python functions.
        numbers: Parameters of the functions, (P,); they follow the actuation in zero-order hold in `run_parameters`.
    """

    functions: Functions
    in_python: Functions
    numbers: np.ndarray


class Engine(Protocol):
    """An engine evaluates the state equation y' = f(t, y) of a run, in [rad], [m], [s], [kg], and takes its steps.

    Its functions are called as (t, y, p, run_parameters, out) and write into `out`. y is (m, 1); p are the numbers of
    a segment of the run; run_parameters (O, 1) are the torques in zero-order hold, then the parameters. With n joints:

        rate       y' and the actuation u                                     (m + n, 1)
        jacobian   ∂f/∂y_j for each j, then ∂f/∂t                             (m + 1, m, 1)
        energy     K and V, in [J]                                            (2, 1)
        sample     y', u, K and V                                             (m + n + 2, 1)
        tick       u in zero-order hold, then the states of the controller    (n + z, 1)
        bodies     M by rows, loads, loads of motors; see `StateEquation.bodies`            (n² + n + motors, 1)
        events     torques at limited parts, then user-defined events         (F, 1)
        step       a step in which velocities may jump; see `RightSide`, also for `after_step`

    Attributes:
        is_compiled: True for machine code. It uses right angles of the robot's file to all digits of float64, changes
            only its numbers for other coefficients, such as those of a mode, and runs in any number of threads.
    """

    is_compiled: ClassVar[bool]

    @property
    def equation(self) -> StateEquation:
        """The state equation of the setup."""
        ...

    @property
    def label(self) -> str:
        """The name of the engine in the summary of a run, with the reason for it."""
        ...

    @property
    def most_steps(self) -> float:
        """Number of steps after which the loop returns; 1 to return, and report progress, at each step."""
        ...

    @property
    def most_evaluations(self) -> float:
        """Number of evaluations after which the engine is chosen again."""
        ...

    def evaluated(self, equation: StateEquation, watch: Watched) -> Evaluated:
        """Return the functions of an equation that differs from that of the engine in coefficients or payloads.

        Args:
            equation: The state equation.
            watch: Monitor of the run, for interpreted functions.
        """
        ...

    def places(self) -> Places:
        """Return the places of the mode of held joints among the run parameters."""
        ...

    def loop(self) -> Advance | None:
        """Return the time loop of one run as machine code; None if the plain functions run."""
        ...

    def compiling_s(self) -> float:
        """Return the time that this thread has spent on loading and compiling loops so far, in [s]."""
        ...
