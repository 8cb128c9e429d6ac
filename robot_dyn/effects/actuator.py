"""What drives can do: |u| ≤ u_max."""

from __future__ import annotations

from dataclasses import dataclass, field
from math import inf
from typing import Any, final

import numpy as np

from robot_dyn.arithmetic import Array
from robot_dyn.coefficients import URDF, coefficient
from robot_dyn.effects.effect import Bound, Effect
from robot_dyn.errors import EffectError


@final
@dataclass(frozen=True, eq=False)
class EffortLimit(Bound):
    """The actuation is cut at the effort limits: −u_max ≤ u ≤ u_max.

    Attributes:
        limit: u_max, a scalar or (n,), inf for none, in [N m] or [N], not negative; "urdf" for those the file states,
            of which none may be 0.
    """

    limit: Any = field(
        metadata=coefficient("N m", symbol="u_max", least=0, infinite=True, elsewhere=inf, stated="effort_limit")
    )

    term = "|u| ≤ u_max"

    def on(self, dynamics: Any) -> Effect:
        made = super().on(dynamics)
        if self.limit is URDF:
            stated_efforts(dynamics)  # refuses limits of 0
        return made

    def actuation(self, u: Array) -> Array:
        return np.minimum(np.maximum(u, -self.limit), self.limit)


def stated_efforts(robot: Any) -> np.ndarray:
    """The effort limits that the file of a robot states, (n,), inf for none, in [N m] or [N].

    Raises:
        EffectError: If one is 0, which files state for an unknown limit: the joint would have no drive.
    """
    if names := [name for name, limit in zip(robot.joint_names, robot.effort_limit, strict=True) if limit == 0]:
        listed = ", ".join(map(repr, names[:6])) + (", …" if len(names) > 6 else "")
        raise EffectError(
            f"the file states an effort limit of 0 for {listed}, which would cut every torque of a controller there to"
            f" 0; give limits by joint, such as {{{names[0]!r}: 87.0}}: joints left out have none"
        )
    return robot.effort_limit
