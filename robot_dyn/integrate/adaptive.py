"""Methods with step-size control, ‖local error / (atol + rtol |y|)‖ ≤ 1: DOP853 and Rodas5P.

[Hairer, Nørsett, Wanner, Solving Ordinary Differential Equations I, 2nd ed., 1993, II.4–II.6 and II.10; Hairer, Wanner,
II, 2nd ed., 1996, IV.8]
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from math import inf
from types import MappingProxyType
from typing import ClassVar, final

import numpy as np
from numpy.typing import ArrayLike

from robot_dyn.foundations.arithmetic import Array
from robot_dyn.foundations.errors import QueryError
from robot_dyn.foundations.validate import choice, function, instance, number, numbers, rows
from robot_dyn.integrate import dop853
from robot_dyn.integrate.controlled_steps import Status, StepInterpolant, Steps
from robot_dyn.integrate.integrator import System
from robot_dyn.integrate.rosenbrock import RODAS5P_FIXED
from robot_dyn.integrate.step_control import ControlledStepper, initial_control

EXPLICIT, STIFF, AUTO = "DOP853", "Rodas5P", "auto"
ADAPTIVE = (EXPLICIT, STIFF, AUTO)
MIN_RTOL = 100 * np.finfo(float).eps  # SciPy's bound; below it rounding dominates the local error


@final
@dataclass(frozen=True, eq=False)
class Solution:
    """The solution y from t0 to the end of the run, with dense output by the interpolation of the method.

    Attributes:
        times: Ends of the steps, shape (k,); the first is t0.
        states: y at these times, shape (k, m).
        evaluations: Number of evaluations of the rate, including those for Jacobians and dense output.
        status: Status at the end of the run.
        message: The status in a sentence, with time and remedy if the run failed.
    """

    times: np.ndarray
    states: np.ndarray
    evaluations: int
    status: Status
    message: str
    _pieces: tuple[StepInterpolant, ...] = field(repr=False)

    def __post_init__(self) -> None:
        self.times.setflags(write=False)
        self.states.setflags(write=False)

    def __call__(self, t: ArrayLike) -> np.ndarray:
        """Return the states (..., m) at the times t, shape (...,).

        Raises:
            QueryError: If a time is not within the run.
        """
        t = rows("t", t)
        low, high = sorted((self.times[0], self.times[-1]))
        if not np.all((t >= low) & (t <= high)):
            raise QueryError(f"t must be within the run, from {low} to {high}")
        if not (self._pieces and t.size):
            return np.broadcast_to(self.states[0], (*t.shape, self.states.shape[1])).copy()
        from scipy.integrate import OdeSolution

        return OdeSolution(self.times, self._pieces)(t.ravel()).T.reshape(*t.shape, -1)


@final
@dataclass(frozen=True)
class Adaptive:
    """An integrator with step-size control and dense output, in float64.

    Tolerances bound the local error of a step. The global error may be larger, depending on the stability of the
    system.

    Attributes:
        method: DOP853 (explicit, order 8), Rodas5P (linearly implicit, order 5, L-stable), or auto: a simulation
            starts with DOP853, and continues with Rodas5P if stability limits the steps.
        rtol: Relative tolerance, at least 2.3e-14.
        atol: Absolute tolerance, in the unit of y, not negative.
        max_step_s: Longest step, in [s].

    Raises:
        QueryError: If an option is not allowed.
    """

    method: str = "DOP853"
    rtol: float = 1e-10
    atol: float = 1e-12
    max_step_s: float = inf
    canonical: ClassVar[bool] = False
    controls_error: ClassVar[bool] = True
    plain: ClassVar[bool] = True
    evaluations_per_step: ClassVar[int | None] = None
    nonsmooth: ClassVar[bool] = False

    @property
    def needs_jacobian(self) -> bool:
        """True if steps need ∂f/∂y."""
        return self.method == STIFF

    @property
    def name(self) -> str:
        """Name of the method, as in scene files."""
        return self.method

    def with_tolerances(self, factor: float, longest_s: float) -> Adaptive:
        """Return a copy with tolerances multiplied by a factor, and steps of at most `longest_s`."""
        factor = number("factor", factor, above=0)
        return replace(self, rtol=self.rtol * factor, atol=self.atol * factor, max_step_s=longest_s)

    def __post_init__(self) -> None:
        choice("adaptive method", self.method, ADAPTIVE)
        values = {
            "rtol": number("rtol", self.rtol),
            "atol": number("atol", self.atol, least=0),
            "max_step_s": number("max_step_s", self.max_step_s, above=0, infinite=True),
        }
        if not MIN_RTOL < values["rtol"] < 1:
            raise QueryError(f"rtol must be between {MIN_RTOL:.3g} and 1, got {self.rtol!r}")
        for name, value in values.items():
            object.__setattr__(self, name, value)

    def solve(
        self,
        system: System,
        t0: float,
        y0: Array,
        t1: float,
        stop: Callable[[float, Array], float] | None = None,
    ) -> Solution:
        """Integrate from t0 to t1.

        Args:
            system: The equation y' = f(t, y).
            t0: Initial time.
            y0: Initial state, shape (m,), float64. Balls, longdouble and batches are not supported.
            t1: Final time; less than t0 to integrate backwards.
            stop: Optional function of (t, y); the run stops where it first changes sign.

        Returns:
            The solution up to the end of the run. If the run fails, it contains the steps before, with status FAILED.

        Raises:
            QueryError: If y0, t0 or t1 is not valid, or the method is auto.
        """
        steps = self.steps(system, t0, y0, t1, stop)
        times, states, pieces = [steps.t], [steps.y], []
        try:
            for t, y, piece in steps:
                times.append(t)
                states.append(y)
                pieces.append(piece)
        except KeyboardInterrupt:
            steps.status, steps.message = Status.INTERRUPTED, f"interrupted at t = {times[-1]}"
        return Solution(
            np.array(times), np.array(states), steps.evaluations, steps.status, steps.message, tuple(pieces)
        )

    def steps(
        self, system: System, t0: float, y0: Array, t1: float, stop: Callable[[float, Array], float] | None = None
    ) -> Steps:
        """Return an iterator over the steps from t0 to t1; see `solve` for arguments and errors."""
        instance("system", system, System, "give a System(rate, n)")
        if self.method == AUTO:
            raise QueryError(f"method: {AUTO!r} is for simulations only; use {EXPLICIT!r} or {STIFF!r}")
        t0, t1, y0 = number("t0", t0), number("t1", t1), _initial_state(y0)
        if t0 == t1:
            raise QueryError(f"t0 and t1 must differ, got {t0} twice")
        function("stop", stop, "(t, y)")
        m = len(y0)
        stepper = STEPPERS[self.method](m, m, m)
        control = initial_control(stepper.error_order, self.rtol, self.atol, self.max_step_s)
        return Steps(stepper, control, system, stop, t0, y0, t1)


# Factories of steppers, by method: functions of (entries of the state, rows of the rate, entries with error control).
STEPPERS: Mapping[str, Callable[[int, int, int], ControlledStepper]] = MappingProxyType(
    {EXPLICIT: dop853.stepper, STIFF: RODAS5P_FIXED.controlled, AUTO: dop853.stepper}
)


def _initial_state(y0: Array) -> np.ndarray:
    if getattr(y0, "dtype", None) in (object, np.longdouble):
        raise QueryError(f"y0 must be float64 of shape (m,), got {y0.dtype}: adaptive methods support float64 only")
    return np.array(numbers("y0", y0, ("m",)))
