"""What drives can do: |u| ≤ u_max."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, final

import numpy as np

from robot_dyn.arithmetic import Array
from robot_dyn.effects.effect import Bound, number
from robot_dyn.errors import EffectError


@final
@dataclass(frozen=True, eq=False)
class EffortLimit(Bound):
    """The actuation is cut at the effort limits: −u_max ≤ u ≤ u_max.

    Attributes:
        limit: u_max, a scalar or (n,), inf for none, in [N m] or [N], not negative.
    """

    limit: Any

    def __post_init__(self) -> None:
        limit = number("limit", self.limit, infinite=True)
        if isinstance(limit, np.ndarray) and (limit < 0).any():
            raise EffectError(f"limit must not be negative, got {self.limit!r}")
        object.__setattr__(self, "limit", limit)

    def actuation(self, u: Array) -> Array:
        return np.minimum(np.maximum(u, -self.limit), self.limit)
