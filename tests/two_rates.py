"""A controller of a user with two rates: PD at each tick, and a torque that is updated at each r-th one."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, final

import numpy as np

import robot_dyn as rd


@final
@dataclass(frozen=True, eq=False)
class TwoRates(rd.control.Controller):
    """u = PD + u_slow, with u_slow = PD_slow at each r-th tick and held between; z counts ticks and holds u_slow."""

    reference: rd.control.PiecewisePolynomial
    kp: Any = field(metadata=rd.effects.coefficient("N m/rad", minimum=0))
    kd: Any = field(metadata=rd.effects.coefficient("N m s/rad", minimum=0))
    slow_target: tuple[float, ...]
    slow_kp: Any = field(metadata=rd.effects.coefficient("N m/rad", minimum=0))
    slow_kd: Any = field(metadata=rd.effects.coefficient("N m s/rad", minimum=0))
    ratio: int
    period_s: float
    term = "kp (q_d − q) + kd (v_d − v) + u_slow"

    def thresholds(self) -> tuple[()]:
        return ()

    @property
    def n(self) -> int:
        return len(self.slow_target)

    @property
    def state_size(self) -> int:
        return 1 + self.n if self.period_s else 0

    @property
    def cycle(self) -> int:
        return self.ratio

    def _slow(self, q: Any, v: Any, z: Any) -> Any:
        computed = self.slow_kp * (np.array(self.slow_target) - q) - self.slow_kd * v
        return np.where(z[0] < 0.5, computed, z[1:]) if self.period_s else computed

    def torque(self, t: Any, q: Any, v: Any, z: Any) -> Any:
        q_d, v_d, _ = self.reference.at(t)
        return self.kp * (q_d - q) + self.kd * (v_d - v) + self._slow(q, v, z)

    def state_rate(self, t: Any, q: Any, v: Any, z: Any) -> Any:
        return 0 * z

    def next_state(self, t: Any, q: Any, v: Any, z: Any) -> Any:
        counted = np.where(z[:1] < self.ratio - 1.5, z[:1] + 1, 0 * z[:1])
        return np.concatenate([counted, self._slow(q, v, z)])

    def settled(self, t: Any, q: Any, v: Any, z: Any) -> Any:
        return np.zeros(1 + self.n)
