"""Base classes of methods: a step h is a map y ↦ y⁺ that approximates the flow of y' = f(t, y).

The step of a `PlainMethod` is a plain function of arrays. The time loop calls it in Python or as machine code.

A method of order p has the error O(hᵖ⁺¹) in one step and O(hᵖ) after a fixed time. [Hairer, Nørsett, Wanner, Solving
Ordinary Differential Equations I, 2nd ed., 1993, II.3]
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar, NamedTuple, final

import numpy as np

from robot_dyn.foundations.arithmetic import Arithmetic, Array, Ball, Float, Scalar
from robot_dyn.foundations.errors import QueryError, RobotDynError
from robot_dyn.integrate.differences import Rate, by_state, by_time
from robot_dyn.integrate.primitives import evaluate

_FLOATS = {np.dtype(kind): Float(np.dtype(kind)) for kind in (np.float32, np.float64, np.longdouble)}
_BALL = Ball()  # in the precision of the caller's scope


class IntegrationError(RobotDynError):
    """A failure of a step, for example because its stage iteration does not converge.

    Attributes:
        t: Time at which the step starts.
    """

    def __init__(self, message: str, t: Scalar) -> None:
        super().__init__(message)
        self.t = t


@final
@dataclass(frozen=True, eq=False)
class System:
    """An ordinary differential equation y' = f(t, y).

    y is (q, v, w): n positions, n velocities (or momenta) and any number of quadratures, for example w' = power, which
    do not affect q and v. Only methods that treat positions and velocities differently use n.

    Attributes:
        rate: f(t, y), which returns a new array of the shape of y, (..., m); batch axes come first.
        n: Number of positions, 0 if y has no such parts.
        widths: Change of each entry of y over which the rate bends, (m,), positive, inf where it does not bend; None
            if unknown. Differences must use smaller changes.
        exact: Function of t and y (..., m) that returns ∂f/∂y_j for each j and then ∂f/∂t in a new array
            (m + 1, ..., m); None for differences.
    """

    rate: Rate
    n: int
    widths: Array | None = None
    exact: Rate | None = None

    def derivatives(self, t: Scalar, y: Array, end: Scalar) -> Array:
        """Return ∂f/∂y_j for each j, then ∂f/∂t, (m + 1, ..., m); differences in t stay between t and `end`."""
        if self.exact is not None:
            return self.exact(t, y)
        return np.concatenate([by_state(self.rate, t, y, self.widths), by_time(self.rate, t, y, end)[None]])

    def jacobian(self, t: Scalar, y: Array) -> Array:
        """Return ∂f/∂y, (..., m, m), including the quadratures."""
        columns = by_state(self.rate, t, y, self.widths) if self.exact is None else self.exact(t, y)[:-1]
        return np.moveaxis(columns, 0, -1)


class RightSide(NamedTuple):
    """The right-hand side of y' = f(t, y) for a step: functions of (t, y, p, run_parameters, out), see `evaluate`.

    Attributes:
        rate: y', (r, W).
        jacobian: ∂f/∂y_j in out[j] and ∂f/∂t in out[m], (m + 1, m, W); 0 unless the method needs it.
        step, after_step: The step of a method for velocities that jump, and y⁺ for its solution v⁺; 0 for others. See
            `time_stepping`.
    """

    rate: Any
    jacobian: Any = 0
    step: Any = 0
    after_step: Any = 0


class States(NamedTuple):
    """States of W runs in a step, and the parameters of their equation.

    Attributes:
        y: State at the start of the step, (m, W).
        after: State at the end of the step, (m, W); the step writes it.
        p: Parameters that all runs share, (P,).
        run_parameters: Parameters of each run, (O, W).
        failed: 1 for each run whose stages were not solved, otherwise 0, (W,); the step writes it.
    """

    y: Array
    after: Array
    p: Array
    run_parameters: Array
    failed: Array


class FixedStepper(NamedTuple):
    """A method prepared for a time loop, for states (m, W).

    Attributes:
        step: Plain function (f, coefficients, work, t, h, x) → evaluations. It writes y(t + h) into x.after; f has the
            functions of a `RightSide`, x the arrays of `States`.
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
    """A method for a single step of fixed size. It has no state, so runs can share it.

    Attributes:
        name: Name of the method, as in scene files.
        order: Order of convergence p, at the nodes h, 2 h, ….
        evaluations_per_step: Evaluations of the rate per step; None if the number depends on the state.
        canonical: True if the method is symplectic for a Hamiltonian system in (q, p), p = M v.
        stiff: True if the step is not limited by the fastest decay of the system.
        plain: True if the step is a plain function, as machine code and runs in lock step require.
        controls_error: True if the method chooses its steps, as `Adaptive` does.
        needs_jacobian: True if the step needs ∂f/∂y.
        nonsmooth: True if velocities may jump within a step, as at impacts; the method then solves a convex problem.
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
    def step(self, system: System, t: Scalar, y: Array, h: Scalar) -> Array:
        """Return the state at t + h.

        Args:
            system: The equation y' = f(t, y).
            t: Time, a number of the arithmetic of y or a float.
            y: State, shape (..., m), of floats or balls; the step is computed in this arithmetic.
            h: Step, in the unit of t; negative for a step backwards.

        Returns:
            A new array of the shape and arithmetic of y.

        Raises:
            IntegrationError: If the stages of an implicit method cannot be solved.
            QueryError: If the method does not support the arithmetic of y.
        """

    def stepper(
        self, kind: Arithmetic, m: int, n: int, rows: int, runs: int = 1, widths: Array | None = None
    ) -> FixedStepper:
        """Return the method prepared for a time loop.

        Args:
            kind: Arithmetic of the state.
            m: Number of entries of the state of a run.
            n: Number of positions among them.
            rows: Number of entries of a rate, m or more.
            runs: Number W of runs; 1 unless the method is `plain`.
            widths: Widths over which the rate bends, see `System`.
        """
        K, J = np.empty((1, rows, 1), kind.dtype), np.empty((m + 1, m, 1), kind.dtype)

        def step(f: RightSide, _: Any, work: Latest, t: Scalar, h: Scalar, x: States) -> int:
            evaluations = 0

            def rate_of_one(t: Scalar, y: Array) -> Array:
                nonlocal evaluations
                evaluations += 1
                evaluate(f.rate, t, y[:, None], x.p, x.run_parameters, K[0])
                return K[0, :m, 0].copy()

            def rate(t: Scalar, y: Array) -> Array:
                if y.ndim == 1:
                    return rate_of_one(t, y)
                return np.array([rate_of_one(t, row) for row in y.reshape(-1, m)]).reshape(y.shape)

            def derivatives(t: Scalar, y: Array) -> Array:
                evaluate(f.jacobian, t, y[:, None], x.p, x.run_parameters, J)
                return J[:, :, 0].copy()

            exact = derivatives if self.needs_jacobian else None
            x.after[:, 0] = self.step(System(rate, n, widths, exact), t, x.y[:, 0].copy(), h)
            return evaluations

        return FixedStepper(step, None, Latest(K))


class PlainMethod(Integrator):
    """A method whose step is the plain function of its `stepper`."""

    plain: ClassVar[bool] = True

    @abstractmethod
    def stepper(
        self, kind: Arithmetic, m: int, n: int, rows: int, runs: int = 1, widths: Array | None = None
    ) -> FixedStepper: ...

    def step(self, system: System, t: Scalar, y: Array, h: Scalar) -> Array:
        after, failed, _ = self.stepped(system, t, y, h)
        if failed.any():
            raise self.not_found(t, h)
        return after

    def stepped(self, system: System, t: Scalar, y: Array, h: Scalar) -> tuple[Array, Array, Any]:
        """Return the state at t + h, 1 for each run whose stages were not solved, (B,), and the work arrays."""
        m, kind = y.shape[-1], arithmetic_like(y)
        start, h = y.reshape(-1, m).T, kind.number(h)
        step, coefficients, work = self.stepper(kind, m, system.n, m, start.shape[1])
        after, failed = np.empty_like(start), np.zeros(start.shape[1], np.int64)

        def rate(t: Scalar, x: Array, p: Any, run_parameters: Any, out: Array) -> None:
            out[...] = system.rate(t, x.T.reshape(y.shape)).reshape(-1, m).T

        def jacobian(t: Scalar, x: Array, p: Any, run_parameters: Any, out: Array) -> None:
            derivatives = system.derivatives(t, x.T.reshape(y.shape), t + h)
            out[...] = np.moveaxis(derivatives.reshape(m + 1, -1, m), 1, 2)

        no_numbers = np.zeros(0)  # the system has its own
        x = States(y=start, after=after, p=no_numbers, run_parameters=no_numbers, failed=failed)
        step(RightSide(rate, jacobian), coefficients, work, t, h, x)
        return after.T.reshape(y.shape), failed, work

    def not_found(self, t: Scalar, h: Scalar) -> IntegrationError:
        """Return the error of a step whose stages are not solved."""
        return IntegrationError(
            f"{self.name}: the stage equations of the step from t = {float(t):.9g} to {float(t + h):.9g} could"
            " not be solved",
            t,
        )


def arithmetic_like(y: Array) -> Arithmetic:
    """Return the arithmetic of an array: that of its float dtype, or balls if its entries are objects.

    Raises:
        QueryError: If its entries are other numbers, such as integers.
    """
    if y.dtype == object:
        return _BALL
    if y.dtype not in _FLOATS:
        raise QueryError(
            f"y must consist of float32, float64, longdouble or balls, got {y.dtype}; convert it by y.astype(float)"
        )
    return _FLOATS[y.dtype]
