"""Base classes of methods: a step h is a map y ↦ y⁺ that approximates the flow of y' = f(t, y).

The step of a `PlainMethod` is a plain function of arrays, which the time loop calls as it is or as machine code.

A method of order p errs by O(hᵖ⁺¹) in one step and by O(hᵖ) after a fixed time. [Hairer, Nørsett, Wanner, Solving
Ordinary Differential Equations I, 2nd ed., 1993, II.3]
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple, final

import numpy as np

from robot_dyn.foundations.arithmetic import Arithmetic, Array, Ball, Float
from robot_dyn.foundations.errors import QueryError, RobotDynError
from robot_dyn.integrate.differences import by_state, by_time
from robot_dyn.integrate.primitives import evaluate

_FLOATS = {np.dtype(kind): Float(np.dtype(kind)) for kind in (np.float32, np.float64, np.longdouble)}
_BALL = Ball()  # in the precision of the caller's scope


class IntegrationError(RobotDynError):
    """A step that fails, such as one whose stage iteration does not converge.

    Attributes:
        t: Time at which the step starts.
    """

    def __init__(self, message: str, t: Any) -> None:
        super().__init__(message)
        self.t = t


@final
@dataclass(frozen=True, eq=False)
class System:
    """An ordinary differential equation y' = f(t, y).

    y is (q, v, w): n positions, n velocities (or momenta) and any number of quadratures, w' = power, say, which do not
    act on q and v. Only methods that treat positions and velocities differently read n.

    Attributes:
        rate: f(t, y), a fresh array of the shape of y, (..., m); batch axes come first.
        n: Number of positions, 0 if y has no such parts.
        widths: Change of each entry of y over which the rate bends, (m,), positive, inf where it does not; None if
            unknown. A difference quotient over a larger change is not a derivative.
        exact: ∂f/∂y_j for each j and then ∂f/∂t, a fresh array (m + 1, ..., m) of t and y (..., m); None for
            differences.
    """

    rate: Callable[[Any, Array], Array]
    n: int
    widths: Array | None = None
    exact: Callable[[Any, Array], Array] | None = None

    def derivatives(self, t: Any, y: Array, end: Any) -> Array:
        """∂f/∂y_j for each j, then ∂f/∂t, (m + 1, ..., m); the latter, by differences, from times between t and end."""
        if self.exact is not None:
            return self.exact(t, y)
        return np.concatenate([by_state(self.rate, t, y, self.widths), by_time(self.rate, t, y, end)[None]])

    def jacobian(self, t: Any, y: Array) -> Array:
        """∂f/∂y, (..., m, m); quadratures are entries like the others."""
        columns = by_state(self.rate, t, y, self.widths) if self.exact is None else self.exact(t, y)[:-1]
        return np.moveaxis(columns, 0, -1)


class RightSide(NamedTuple):
    """f of y' = f(t, y) as a step calls it: functions of (t, y, p, run_parameters, out), as of `evaluate`.

    Attributes:
        rate: y', (r, W).
        jacobian: ∂f/∂y_j in out[j] and ∂f/∂t in out[m], (m + 1, m, W); 0 unless the method needs it.
        step, after_step: Of a method for velocities that jump; 0 for others. See `time_stepping`.
    """

    rate: Any
    jacobian: Any = 0
    step: Any = 0
    after_step: Any = 0


class States(NamedTuple):
    """W runs in a step, and the numbers that their equation depends on.

    Attributes:
        y: State at the start of the step, (m, W).
        after: State at its end, (m, W); the step writes it.
        p: Numbers that all runs share, (P,).
        run_parameters: Numbers of each run, (O, W).
        failed: 1 for each run whose stages the step did not find, else 0, (W,); the step writes it.
    """

    y: Array
    after: Array
    p: Array
    run_parameters: Array
    failed: Array


class Stepper(NamedTuple):
    """A method prepared for a time loop, for states (m, W).

    Attributes:
        step: The plain function (f, coefficients, work, t, h, x) → evaluations. It writes y(t + h) into x.after; f has
            the functions of a `RightSide`, x the arrays of `States`.
        coefficients: Numbers of the method.
        work: Arrays of the method; work.K[-1], (r, W), is the latest rate.
    """

    step: Callable[..., int]
    coefficients: Any
    work: Any


class Latest(NamedTuple):
    """The latest rate, (1, r, W)."""

    K: Array


class Integrator(ABC):
    """A method for one step of given size. A value without state: two runs share nothing.

    Attributes:
        name: Its name in scene files.
        order: Order of convergence p, at the nodes h, 2 h, ….
        evaluations_per_step: Of the rate in a step, or None where it depends on the state.
        canonical: Whether it keeps the structure of a Hamiltonian system, given in (q, p), p = M v.
        stiff: Whether its step is not bounded by the fastest decay of the system.
        plain: Whether its step is a plain function, which machine code and runs in lock step take.
        controls_error: Whether it chooses its steps, as `Adaptive` does.
        needs_jacobian: Whether its step needs ∂f/∂y.
        nonsmooth: Whether velocities may jump within its step, as at impacts; it then needs a convex problem.
    """

    name: str
    order: int
    evaluations_per_step: int | None
    canonical: ClassVar[bool] = False
    stiff: ClassVar[bool] = False
    plain: ClassVar[bool] = False
    controls_error: ClassVar[bool] = False
    needs_jacobian: ClassVar[bool] = False
    nonsmooth: ClassVar[bool] = False

    @abstractmethod
    def step(self, system: System, t: Any, y: Array, h: Any) -> Array:
        """The state at t + h.

        Args:
            system: The equation y' = f(t, y).
            t: Time, a number of the arithmetic of y or a float.
            y: State, shape (..., m), of floats or balls; the step runs in its arithmetic.
            h: Step, in the unit of t. Negative for a step back.

        Returns:
            A fresh array of the shape and arithmetic of y.

        Raises:
            IntegrationError: If the stages of an implicit method cannot be solved for.
            QueryError: If the method does not support the arithmetic of y.
        """

    def stepper(
        self, kind: Arithmetic, m: int, n: int, rows: int, runs: int = 1, widths: Array | None = None
    ) -> Stepper:
        """Return the method prepared for a time loop.

        Args:
            kind: Arithmetic of the state.
            m: Entries of the state of a run.
            n: Number of positions among them.
            rows: Entries of a rate, m or more.
            runs: W; 1 unless the method is `plain`.
            widths: As of `System`.
        """
        K, J = np.empty((1, rows, 1), kind.dtype), np.empty((m + 1, m, 1), kind.dtype)

        def step(f: RightSide, _: Any, work: Latest, t: Any, h: Any, x: States) -> int:
            evaluations = 0

            def rate_of_one(t: Any, y: Array) -> Array:
                nonlocal evaluations
                evaluations += 1
                evaluate(f.rate, t, y[:, None], x.p, x.run_parameters, K[0])
                return K[0, :m, 0].copy()

            def rate(t: Any, y: Array) -> Array:
                if y.ndim == 1:
                    return rate_of_one(t, y)
                return np.array([rate_of_one(t, row) for row in y.reshape(-1, m)]).reshape(y.shape)

            def derivatives(t: Any, y: Array) -> Array:
                evaluate(f.jacobian, t, y[:, None], x.p, x.run_parameters, J)
                return J[:, :, 0].copy()

            exact = derivatives if self.needs_jacobian else None
            x.after[:, 0] = self.step(System(rate, n, widths, exact), t, x.y[:, 0].copy(), h)
            return evaluations

        return Stepper(step, None, Latest(K))


class PlainMethod(Integrator):
    """A method whose step is a plain function, that of its `stepper`."""

    plain: ClassVar[bool] = True

    @abstractmethod
    def stepper(
        self, kind: Arithmetic, m: int, n: int, rows: int, runs: int = 1, widths: Array | None = None
    ) -> Stepper: ...

    def step(self, system: System, t: Any, y: Array, h: Any) -> Array:
        after, failed, _ = self.stepped(system, t, y, h)
        if failed.any():
            raise self.not_found(t, h)
        return after

    def stepped(self, system: System, t: Any, y: Array, h: Any) -> tuple[Array, Array, Any]:
        """Return a step, 1 for each run whose stages were not found, (B,), and the arrays of the stepper."""
        m, kind = y.shape[-1], arithmetic_like(y)
        start, h = y.reshape(-1, m).T, kind.number(h)
        step, coefficients, work = self.stepper(kind, m, system.n, m, start.shape[1])
        after, failed = np.empty_like(start), np.zeros(start.shape[1], np.int64)

        def rate(t: Any, x: Array, p: Any, run_parameters: Any, out: Array) -> None:
            out[...] = system.rate(t, x.T.reshape(y.shape)).reshape(-1, m).T

        def jacobian(t: Any, x: Array, p: Any, run_parameters: Any, out: Array) -> None:
            derivatives = system.derivatives(t, x.T.reshape(y.shape), t + h)
            out[...] = np.moveaxis(derivatives.reshape(m + 1, -1, m), 1, 2)

        no_numbers = np.zeros(0)  # the system has its own
        x = States(y=start, after=after, p=no_numbers, run_parameters=no_numbers, failed=failed)
        step(RightSide(rate, jacobian), coefficients, work, t, h, x)
        return after.T.reshape(y.shape), failed, work

    def not_found(self, t: Any, h: Any) -> IntegrationError:
        """The error of a step whose stages are not found."""
        return IntegrationError(f"{self.name}: the stages of the step {float(h)} at t = {float(t)} are not found", t)


def arithmetic_like(y: Array) -> Arithmetic:
    """Return the arithmetic of an array: that of its float dtype, or balls if it holds objects.

    Raises:
        QueryError: If it holds other numbers, such as integers.
    """
    if y.dtype == object:
        return _BALL
    if y.dtype not in _FLOATS:
        raise QueryError(
            f"y must hold float32, float64, longdouble or balls, got {y.dtype}: convert it, as y.astype(float)"
        )
    return _FLOATS[y.dtype]
