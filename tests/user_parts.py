"""Parts of plants as a user writes them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from robot_dyn.effects import Active


@dataclass(frozen=True, eq=False)
class Push(Active):
    """A torque of a formula of (t, q, v), which declares nothing."""

    formula: Callable[[Any, Any, Any], Any]

    def torque(self, dynamics: Any, t: Any, q: Any, v: Any) -> Any:
        return self.formula(t, q, v)


def counted() -> tuple[Push, list[float]]:
    """Return a constant push, and the times at which it was evaluated so far."""
    calls: list[float] = []
    return Push(lambda t, q, v: calls.append(t) or np.full(np.shape(v), 0.5)), calls
