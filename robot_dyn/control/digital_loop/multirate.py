"""Two rates in one loop: u = u_fast(t_k) + u_slow(t_{rj}), j = ⌊k/r⌋: the slow part is updated every r-th tick.

[Franklin, Powell, Workman, Digital Control of Dynamic Systems, 3rd ed., 1998, ch. 11]
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from math import lcm
from typing import final

import numpy as np

from robot_dyn.control.controller import Controller, Nested, check_sampled, nested
from robot_dyn.foundations.arithmetic import Array
from robot_dyn.foundations.coefficients import with_values
from robot_dyn.foundations.errors import ControlError
from robot_dyn.foundations.threshold import smooth

_ROUNDED = 1e-9  # relative tolerance for a whole ratio of periods


@final
@dataclass(frozen=True, eq=False)
class Multirate(Controller):
    """The sum of two sampled controllers, where one period is an integer multiple of the other.

    For example, feedback every 1 ms plus a model torque every 10 ms: `Multirate(PD(…, 1e-3), PDGravity(…, 1e-2))`,
    the second with zero gains. The slow controller holds its torque between its ticks.

    Attributes:
        fast: The controller with the shorter period, which is also the period of the sum.
        slow: The controller with the longer period.

    Raises:
        ControlError: If either is continuous or a `Loop`, or the ratio of the periods is not a whole number.
    """

    fast: Controller
    slow: Controller
    period_s: float = field(init=False, default=0.0)
    ratio: int = field(init=False, default=1)

    thresholds = smooth  # of the torque, which is constant between ticks

    def __post_init__(self) -> None:
        for name in ("fast", "slow"):
            check_sampled(name, getattr(self, name))
        if self.fast.n != self.slow.n:
            raise ControlError(f"fast drives {self.fast.n} joints, slow {self.slow.n}; give controllers of one arm")
        ratio = self.slow.period_s / self.fast.period_s
        whole = round(min(ratio, 1e9))
        if whole < 1 or abs(ratio - whole) > _ROUNDED * ratio:
            raise ControlError(
                f"the period of slow, {self.slow.period_s:g} s, must be a whole number of those of fast,"
                f" {self.fast.period_s:g} s; change one of the two"
            )
        object.__setattr__(self, "ratio", whole)
        object.__setattr__(self, "period_s", self.fast.period_s)
        super().__post_init__()
        self._of_both  # noqa: B018  # cached while both have numeric values: a trace replaces them by symbols

    @cached_property
    def n(self) -> int:  # pyright: ignore[reportIncompatibleMethodOverride]
        """Number of driven joints."""
        return self.fast.n

    @property
    def term(self) -> str:  # pyright: ignore[reportIncompatibleVariableOverride]
        return f"{self.fast.term} + u_slow"

    @property
    def parts(self) -> tuple[Nested, ...]:
        return nested(self, "fast", "fast.") + nested(self, "slow", "slow.")

    @property
    def task_frame(self) -> str | None:
        return self.fast.task_frame

    @property
    def cycle(self) -> int:
        return lcm(self.fast.cycle, self.ratio * self.slow.cycle)

    @property
    def state_size(self) -> int:
        return self._of_both + (1 + self.n if self.period_s else 0)

    @cached_property
    def _of_fast(self) -> int:
        return self.fast.state_size

    @cached_property
    def _of_both(self) -> int:
        return self._of_fast + self.slow.state_size

    def torque(self, t: float, q: Array, v: Array, z: Array) -> Array:
        fast, slow = self._split(z)
        return self.fast.torque(t, q, v, fast) + self._slow(t, q, v, z, slow)

    def state_rate(self, t: float, q: Array, v: Array, z: Array) -> Array:
        fast, slow = self._split(z)
        return np.concatenate([self.fast.state_rate(t, q, v, fast), self.slow.state_rate(t, q, v, slow)])

    def next_state(self, t: float, q: Array, v: Array, z: Array) -> Array:
        fast, slow = self._split(z)
        count = z[self._of_both : self._of_both + 1]
        after = self.slow.next_state(t, q, v, slow)
        counted = np.where(count < self.ratio - 1.5, count + 1, 0 * count)
        return np.concatenate(
            [
                self.fast.next_state(t, q, v, fast), np.where(count < 0.5, after, slow),
                counted, self._slow(t, q, v, z, slow),
            ]
        )  # fmt: skip

    def _slow(self, t: float, q: Array, v: Array, z: Array, slow: Array) -> Array:
        """Torque of the slow part, updated only at its ticks."""
        if not self.period_s or z[self._of_both] < 0.5:
            return self.slow.torque(t, q, v, slow)
        return z[self._of_both + 1 :]

    def _split(self, z: Array) -> tuple[Array, Array]:
        """Split z into the states of the two parts."""
        return z[: self._of_fast], z[self._of_fast : self._of_both]

    def at_period(self, period_s: float) -> Multirate:
        parts = {"fast": self.fast.at_period(period_s), "slow": self.slow.at_period(self.ratio * period_s)}
        return with_values(self, {**parts, "period_s": period_s})

    def small_signal(self) -> Multirate:
        return with_values(self, {"fast": self.fast.small_signal(), "slow": self.slow.small_signal()})

    def settled(self, t: float, q: Array, v: Array, z: Array) -> Array:
        return np.concatenate([z, np.zeros(1 + self.n)])
