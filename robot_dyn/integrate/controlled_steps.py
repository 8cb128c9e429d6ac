"""Steps of controlled error for any System, in Python: as those of a run, and with the same functions."""

from __future__ import annotations

from typing import Any, final

import numpy as np

from robot_dyn.arithmetic import Array
from robot_dyn.integrate.integrator import RightSide, System
from robot_dyn.integrate.primitives import between
from robot_dyn.integrate.step_control import At, Choice, ControlledStepper, chosen_step, first_step

_NONE = np.zeros(0)


@final
class ControlledSteps:
    """The steps of a method from t to its end, one at a time.

    Args:
        stepper: The method.
        control: Its choice of steps.
        system: The equation y' = f(t, y).
        t: Where it starts.
        y: State there, (m,).
        end: Where it ends.

    Attributes:
        t: Time reached.
        status: "running", "finished" or "failed".
    """

    def __init__(
        self, stepper: ControlledStepper, control: Array, system: System, t: float, y: Array, end: float
    ) -> None:
        self.t, self.status = t, "running"
        self._stepper, self._control, self._end = stepper, control, end
        self._choose = chosen_step(stepper.step, stepper.error)
        self._now, self._after, self._lost = y[:, None].copy(), np.empty((len(y), 1)), np.zeros(1, np.int64)
        self._last: Any = None

        def rate(t: Any, x: Array, p: Any, own: Any, out: Array) -> None:
            out[:, 0] = system.rate(t, x[:, 0].copy())

        def jacobian(t: Any, x: Array, p: Any, own: Any, out: Array) -> None:
            out[:, :, 0] = system.derivatives(t, x[:, 0].copy(), end)

        self._f = RightSide(rate, jacobian)
        stepper.begin(self._f, stepper.coefficients, t, self._now, _NONE, _NONE, stepper.work)

    @property
    def y(self) -> Array:
        """State reached, (m,)."""
        return self._now[:, 0].copy()

    @property
    def f(self) -> Array:
        """Its rate, (m,)."""
        return self._stepper.work.K[0][:, 0].copy()

    def step(self) -> None:
        """The next step."""
        of, y, after, control = self._stepper, self._now, self._after, self._control
        if control[At.NEXT] == 0:
            first_step(self._f, self.t, self._end, y, _NONE, _NONE, after, of.work, control)
        here = self._f, of.coefficients, self.t
        _, found = self._choose(
            *here, self._end, y, _NONE, _NONE, after, of.work, self._lost, control, _NONE
        )  # fmt: skip
        if found != Choice.TAKEN:
            self.status = "failed"
            return
        h = control[At.TAKEN]
        of.accept(*here, h, y, _NONE, _NONE, after, of.work)
        of.dense(*here, h, y, _NONE, _NONE, after, of.work)
        self._last = _Between(self.t, h, y.copy(), of.work.F.copy())
        y[...] = after
        of.work.K[0] = of.work.last
        self.t = float(control[At.END])
        if self.t == self._end:
            self.status = "finished"

    def dense_output(self) -> Any:
        """Y between the ends of the last step, a function of times (...,)."""
        return self._last


@final
class _Between:
    """Y (m,) or (m, k) at times within a step."""

    def __init__(self, t: float, h: float, y: Array, F: Array) -> None:
        self.t, self.h, self.y, self.F = t, h, y, F

    def __call__(self, t: Any) -> Array:
        theta = (np.asarray(t) - self.t) / self.h
        out = np.empty((len(self.y), theta.size))
        for i, each in enumerate(theta.flat):
            between(self.y, self.F, each, out[:, i : i + 1])
        return out[:, 0] if theta.ndim == 0 else out
