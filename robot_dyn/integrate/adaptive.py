"""Methods that choose their steps, ‖local error / (atol + rtol |y|)‖ ≤ 1: DOP853 and Rosenbrock.

[Hairer, Nørsett, Wanner, Solving Ordinary Differential Equations I, 2nd ed., 1993, II.4–II.6 and II.10; Hairer, Wanner,
II, 2nd ed., 1996, IV.8]
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from enum import Enum
from math import inf
from types import MappingProxyType
from typing import Any, ClassVar, cast, final

import numpy as np

from robot_dyn.arithmetic import Array
from robot_dyn.errors import OverflowedError, QueryError, RobotDynError, is_mistake
from robot_dyn.integrate import dop853
from robot_dyn.integrate.controlled_steps import ControlledSteps
from robot_dyn.integrate.integrator import System
from robot_dyn.integrate.rosenbrock import ROSENBROCK_5
from robot_dyn.integrate.step_control import ControlledStepper, control_of
from robot_dyn.validate import choice, function, instance, number, numbers, rows

EXPLICIT, STIFF, AUTO = "DOP853", "Rosenbrock", "auto"
ADAPTIVE = (EXPLICIT, STIFF, AUTO)
LEAST_RTOL = 100 * np.finfo(float).eps  # SciPy's bound; below it rounding is taken for local error


class Status(Enum):
    """How a run ended."""

    FINISHED = "finished"
    STOPPED = "stopped"
    FAILED = "failed"
    INTERRUPTED = "interrupted"


@final
@dataclass(frozen=True, eq=False)
class Solution:
    """The course of y from t0 to where the run ended, at every time between by the method's own interpolation.

    Attributes:
        times: Ends of the steps, shape (k,), the first is t0.
        states: y there, shape (k, m).
        evaluations: Of the rate, those for Jacobians and interpolation included.
        status: How the run ended.
        message: The same in words, with time and remedy if it failed.
    """

    times: np.ndarray
    states: np.ndarray
    evaluations: int
    status: Status
    message: str
    _pieces: tuple[Any, ...] = field(repr=False)

    def __post_init__(self) -> None:
        self.times.setflags(write=False)
        self.states.setflags(write=False)

    def __call__(self, t: Any) -> np.ndarray:
        """State at the times t, shape (...,): shape (..., m).

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

    Tolerances bound the error of a step; that of the run is larger by what the system magnifies.

    Attributes:
        method: DOP853 (explicit, order 8), Rosenbrock (linearly implicit, order 5, L-stable), or auto: a simulation by
            DOP853 that is made by Rosenbrock if stability bounds its steps.
        rtol: Relative tolerance, 2.3e-14 at least.
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
        """Whether its steps ask for ∂f/∂y."""
        return self.method == STIFF

    @property
    def name(self) -> str:
        """As a scene file says it."""
        return self.method

    def with_tolerances(self, factor: float, longest_s: float) -> Adaptive:
        """The same with tolerances times a factor, and steps of at most `longest_s`."""
        factor = number("factor", factor, above=0)
        return replace(self, rtol=self.rtol * factor, atol=self.atol * factor, max_step_s=longest_s)

    def __post_init__(self) -> None:
        choice("adaptive method", self.method, ADAPTIVE)
        values = {
            "rtol": number("rtol", self.rtol),
            "atol": number("atol", self.atol, least=0),
            "max_step_s": number("max_step_s", self.max_step_s, above=0, infinite=True),
        }
        if not LEAST_RTOL < values["rtol"] < 1:
            raise QueryError(f"rtol must be between {LEAST_RTOL:.2g} and 1, got {self.rtol!r}")
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
            t0: Start.
            y0: State there, shape (m,), float64: balls and longdouble have no adaptive method, batches no common step.
            t1: End; earlier than t0 to go back.
            stop: A function of (t, y); the run stops where it first changes sign, if it is given.

        Returns:
            The solution up to where the run ended; a run that fails says so in its status and keeps what it has.

        Raises:
            QueryError: If y0, t0 or t1 is unfit, or the method is to be chosen.
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
        """The steps from t0 to t1, one at a time; arguments and errors as of `solve`."""
        instance("system", system, System, "give a System(rate, n)")
        if self.method == AUTO:
            raise QueryError(f"method: simulations choose one for {AUTO!r}; name {EXPLICIT!r} or {STIFF!r} here")
        t0, t1, y0 = number("t0", t0), number("t1", t1), _initial_state(y0)
        if t0 == t1:
            raise QueryError(f"t0 and t1 must differ, got {t0} twice")
        function("stop", stop, "(t, y)")
        return Steps(self, system, stop, t0, y0, t1)


class _NotFiniteError(Exception):
    """Internal: the rate or its Jacobian is not finite where the solver needs it."""


@final
class Steps:
    """The steps of a run as they are made: an iterator over (t, y, piece), the end of each and y between its ends.

    Attributes:
        t, y: Where the run is.
        evaluations: Of the rate so far.
        status: How the run ended, once the steps are spent.
        message: The same in words, with time and remedy if it failed.
    """

    def __init__(
        self, options: Adaptive, system: System, stop: Callable[[float, Array], float] | None,
        t0: float, y0: Array, t1: float,
    ) -> None:  # fmt: skip
        self.t, self.y, self.evaluations = t0, y0, 0
        self.status, self.message = Status.FINISHED, ""
        self._options, self._end, self._stop, self._counted = options, t1, stop, system.rate
        self._system = replace(system, rate=self._rate)

    def _rate(self, t: Any, y: Array) -> Array:
        self.evaluations += y.size // y.shape[-1]
        try:
            return self._counted(t, y)
        except OverflowedError:  # a trial step went too far; the solver tries a shorter one
            return np.full_like(y, np.nan)

    def __iter__(self) -> Iterator[tuple[float, Array, Any]]:
        solver = None
        try:
            while solver is None or solver.status == "running":
                with np.errstate(all="ignore"):  # overflow in a trial step shortens it, or ends the run with a status
                    solver = solver or self._solver()
                    if not np.isfinite(solver.f).all():
                        raise _NotFiniteError
                    solver.step()
                    if solver.status == "failed":
                        self._failed("the step became smaller than the spacing of floats")
                        return
                    stopped, piece = self._take(solver)
                yield self.t, self.y, piece
                if stopped:
                    self.status, self.message = Status.STOPPED, f"stopped at t = {self.t}"
                    return
        except _NotFiniteError:
            self._failed("the rate is not finite")
        except RobotDynError as error:
            if is_mistake(error):
                raise
            self.status, self.message = Status.FAILED, f"{error}, at t = {self.t}"
        else:
            self.message = f"finished at t = {self.t}"

    def _solver(self) -> ControlledSteps:
        options, m = self._options, len(self.y)
        stepper = STEPPERS[options.method](m, m, m)
        control = control_of(stepper, options.rtol, options.atol, options.max_step_s)
        return ControlledSteps(stepper, control, self._system, self.t, self.y, self._end)

    def _failed(self, what: str) -> None:
        where = f"{what} at t = {self.t}, max |y| = {np.abs(self.y).max():.3g}"
        self.status, self.message = Status.FAILED, f"{where}: y grows without bound, or tolerances are too tight"

    def _take(self, solver: Any) -> tuple[bool, Any]:
        """Take the step just made, up to where `stop` changes sign; tell whether it does, and give y between."""
        piece, t, y = solver.dense_output(), float(solver.t), solver.y
        stopped = False
        if self._stop is not None:
            before, after = self._stop(self.t, self.y), self._stop(t, y)
            stopped = bool(before * after < 0 or (after == 0 and before != 0))
            if stopped and after != 0:
                t = self._crossing(piece, self.t, t)
                y = piece(t)
        self.t, self.y = t, y.copy()
        return stopped, piece

    def _crossing(self, piece: Any, t0: float, t1: float) -> float:
        from scipy.optimize import brentq

        stop, root = cast(Any, self._stop), cast(Any, brentq)
        # the ends are states, which interpolation meets up to rounding: the sign must not depend on that
        ends = {t0: stop(t0, self.y), t1: -stop(t0, self.y)}
        t = float(root(lambda t: ends.get(t) or stop(t, piece(t)), t0, t1, xtol=4e-16 * max(1, abs(t1))))
        return t if t != t0 else float(np.nextafter(t0, t1))  # times ascend


# The methods of our own, ready for a loop: (entries of the state, rows of the rate, entries whose error counts).
STEPPERS: Mapping[str, Callable[[int, int, int], ControlledStepper]] = MappingProxyType(
    {EXPLICIT: dop853.stepper, STIFF: ROSENBROCK_5.controlled, AUTO: dop853.stepper}
)


def _initial_state(y0: Array) -> np.ndarray:
    if getattr(y0, "dtype", None) in (object, np.longdouble):
        raise QueryError(f"y0 must be float64 of shape (m,), got {y0.dtype}: adaptive methods work in float64 alone")
    return np.array(numbers("y0", y0, ("m",)))
