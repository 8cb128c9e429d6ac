"""Mass distribution of a rigid body: I = ∫ ρ r̂ᵀ r̂ dx about the centre of mass, and whether any body can have it.

A body exists exactly if m ≥ 0 and the principal moments are not negative and obey I₁ + I₂ ≥ I₃.
[Wensing, Kim, Slotine, Linear Matrix Inequalities for Physically Consistent Inertial Parameter Identification, 2018]
"""

from __future__ import annotations

from typing import Any

import numpy as np

_SLACK = 1e-9  # of the largest moment: printed digits
_LEVER_SLACK = 1e-12  # of m c²: rounding left behind by merging bodies


def implausibility(mass: float, com: Any, inertia: Any) -> str | None:
    """Why no body has this mass and rotational inertia about its centre of mass, or None if one has.

    Args:
        mass: In [kg].
        com: Centre of mass in the frame where bodies were merged, shape (3,), in [m].
        inertia: Symmetric, shape (3, 3), in [kg m²].
    """
    I1, I2, I3 = np.linalg.eigvalsh(inertia)
    slack = _SLACK * max(abs(I1), abs(I3)) + _LEVER_SLACK * abs(mass) * np.dot(com, com)
    moments = f"principal moments {I1:.3g}, {I2:.3g}, {I3:.3g} kg m²"
    if mass < 0:
        return f"its mass is {mass:.3g} kg"
    if -slack > I1:
        return f"its inertia is indefinite ({moments})"
    if I3 - slack > I1 + I2:
        return f"its inertia breaks the triangle inequality ({moments})"
    return None
