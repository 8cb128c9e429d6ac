"""Steps with error control for any `System`, in Python, by the same functions that simulations use."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from enum import Enum
from typing import Any, cast, final

import numpy as np
from numpy.typing import ArrayLike

from robot_dyn.foundations.arithmetic import Array, Scalar
from robot_dyn.foundations.errors import OverflowedError, RobotDynError, is_mistake
from robot_dyn.foundations.values import copied
from robot_dyn.integrate.differences import Rate
from robot_dyn.integrate.integrator import RightSide, States, System
from robot_dyn.integrate.primitives import between
from robot_dyn.integrate.step_control import ControlledStepper, StepControl, chosen_step, first_step

_NO_PARAMETERS = np.zeros(0)
Stop = Callable[[float, Array], float]


class Status(Enum):
    """Status at the end of a run."""

    FINISHED = "finished"
    STOPPED = "stopped"
    FAILED = "failed"
    INTERRUPTED = "interrupted"


class _NotFiniteError(Exception):
    """Internal: the rate or its Jacobian is not finite where a step needs it."""


@final
class Steps:
    """The steps of a run, computed one at a time: an iterator over (t, y, piece) with the polynomial of each step.

    Attributes:
        t, y: Current time and state.
        evaluations: Number of evaluations of the rate so far.
        status: Status at the end of the run, after the last step.
        message: The status in a sentence, with time and remedy if the run failed.
    """

    def __init__(
        self,
        stepper: ControlledStepper,
        control: StepControl,
        system: System,
        stop: Stop | None,
        t0: float,
        y0: Array,
        t1: float,
    ) -> None:
        self.t, self.y, self.evaluations = t0, y0, 0
        self.status, self.message = Status.FINISHED, ""
        self._stepper, self._first_control, self._end, self._stop = stepper, control, t1, stop
        self._choose = chosen_step(stepper.step, stepper.error)
        counted = System(self._counted(system.rate), system.n, system.widths, system.exact)

        def rate(t: float, x: Array, p: Array, run_parameters: Array, out: Array) -> None:
            out[:, 0] = counted.rate(t, x[:, 0].copy())

        def jacobian(t: float, x: Array, p: Array, run_parameters: Array, out: Array) -> None:
            out[:, :, 0] = counted.derivatives(t, x[:, 0].copy(), t1)

        self._f = RightSide(rate, jacobian)

    def _counted(self, rate: Rate) -> Rate:
        def counted(t: Scalar, y: Array) -> Array:
            self.evaluations += y.size // y.shape[-1]
            try:
                return rate(t, y)
            except OverflowedError:  # a trial step was too long; a shorter one is tried
                return np.full_like(y, np.nan)

        return counted

    def __iter__(self) -> Iterator[tuple[float, Array, StepInterpolant]]:
        stepper, t, y = self._stepper, self.t, self.y[:, None].copy()
        self._control = copied(self._first_control)  # a second iteration also starts with a first step
        failed = np.zeros(1, np.int64)
        x = States(y=y, after=np.empty_like(y), p=_NO_PARAMETERS, run_parameters=_NO_PARAMETERS, failed=failed)
        try:
            with np.errstate(all="ignore"):
                stepper.begin(self._f, stepper.coefficients, stepper.work, t, x)
            while t != self._end:
                with np.errstate(all="ignore"):  # overflow in a trial step shortens it, or ends the run with a status
                    if not np.isfinite(stepper.work.K[0]).all():
                        raise _NotFiniteError
                    piece = self._step(t, x)
                    if piece is None:
                        self._fail("the step became smaller than the spacing of floats")
                        return
                    t = float(self._control.end[0])
                    stopped = self._take(piece, t, y[:, 0])
                yield self.t, self.y, piece
                if stopped:
                    self.status, self.message = Status.STOPPED, f"stopped at t = {self.t}"
                    return
        except _NotFiniteError:
            self._fail("the rate is not finite")
        except RobotDynError as error:
            if is_mistake(error):
                raise
            self.status, self.message = Status.FAILED, f"{error}, at t = {self.t}"
        else:
            self.message = f"finished at t = {self.t}"

    def _step(self, t: float, x: States) -> StepInterpolant | None:
        """Advance x.y by a step from t and return its polynomial; None if the step would be too short."""
        stepper, control, end = self._stepper, self._control, self._end
        coefficients, work = stepper.coefficients, stepper.work
        if control.next_h[0] == 0:
            first_step(self._f, work, control, t, end, x)
        _, taken = self._choose(self._f, coefficients, work, control, t, end, x)
        if not taken:
            return None
        h = control.h[0]
        stepper.accept(self._f, coefficients, work, t, h, x)
        stepper.dense(self._f, coefficients, work, t, h, x)
        piece = StepInterpolant(t, h, x.y.copy(), work.F.copy())
        x.y[...] = x.after
        work.K[0] = work.last
        return piece

    def _fail(self, reason: str) -> None:
        where = f"{reason} at t = {self.t}, max |y| = {np.abs(self.y).max():.3g}"
        self.status, self.message = Status.FAILED, f"{where}; y grows without bound, or tolerances are too tight"

    def _take(self, piece: StepInterpolant, t: float, y: Array) -> bool:
        """Advance to t, or to an earlier sign change of `stop`; return True if the run stops."""
        stopped = False
        if self._stop is not None:
            before, after = self._stop(self.t, self.y), self._stop(t, y.copy())
            stopped = bool(before * after < 0 or (after == 0 and before != 0))
            if stopped and after != 0:
                t = self._crossing(piece, self.t, t)
                y = piece(t)
        self.t, self.y = t, y.copy()
        return stopped

    def _crossing(self, piece: StepInterpolant, t0: float, t1: float) -> float:
        from scipy.optimize import brentq

        stop, root = cast(Any, self._stop), cast(Any, brentq)
        # the polynomial matches the states at the ends only up to rounding, on which the sign must not depend
        ends = {t0: stop(t0, self.y), t1: -stop(t0, self.y)}
        t = float(root(lambda t: ends.get(t) or stop(t, piece(t)), t0, t1, xtol=4e-16 * max(1, abs(t1))))
        return t if t != t0 else float(np.nextafter(t0, t1))  # times must increase


@final
class StepInterpolant:
    """The polynomial of a step: y (m,) or (m, k) at times within it."""

    def __init__(self, t: float, h: float, y: Array, F: Array) -> None:
        self.t, self.h, self.y, self.F = t, h, y, F

    def __call__(self, t: ArrayLike) -> Array:
        theta = (np.asarray(t) - self.t) / self.h
        out = np.empty((len(self.y), theta.size))
        for i, fraction in enumerate(theta.flat):
            between(self.y, self.F, fraction, out[:, i : i + 1])
        return out[:, 0] if theta.ndim == 0 else out
