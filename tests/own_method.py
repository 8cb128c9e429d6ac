"""A method of a user: one whose step is Python alone, and reads the Jacobian of the system."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, final

import numpy as np

from robot_dyn.integrate import IntegrationError, Integrator, System


@final
@dataclass(frozen=True)
class OwnImplicit(Integrator):
    """Take one step of Newton's method on implicit Euler: y⁺ = y + h k with (1 − h J) k = f(t + h, y).

    R(z) = 1 / (1 − z), L-stable. [Hairer, Wanner, Solving Ordinary Differential Equations II, 2nd ed., 1996, IV.7]
    """

    name = "own_implicit"
    order = 1
    evaluations_per_step = None
    stiff = True
    needs_jacobian = True

    def step(self, system: System, t: Any, y: Any, h: Any) -> Any:
        W = np.eye(y.shape[-1]) - h * system.jacobian(t + h, y)
        try:
            k = np.linalg.solve(W, system.rate(t + h, y)[..., None])[..., 0]
        except np.linalg.LinAlgError:
            raise IntegrationError("1 − h J is singular: use a smaller step", t) from None
        return y + h * k
