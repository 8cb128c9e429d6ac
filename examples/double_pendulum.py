"""Double pendulum: two bars that fall freely from the horizontal, and a neighbour that starts a hair away.

    M(q) q̈ + C(q, v) v + N(q) = 0,    E = ½ vᵀ M(q) v + V(q) is constant

Energy tells that the equation was solved; how fast neighbours part tells how long the solution can be believed.

Run: python examples/double_pendulum.py
"""

from __future__ import annotations

import numpy as np

import robot_dyn as rd

apart = 1e-6  # between the neighbours at the start, in [rad]

arm = rd.load("planar_2r")


def fall(q0):
    """Let go at q0, at rest."""
    return rd.simulate(
        rd.Plant(arm),
        q0=q0,
        v0=[0.0, 0.0],
        duration_s=10.0,
        method="DP8",
        step_s=0.005,  # with shorter ones the error is that of rounding, which the motion magnifies
        record_every_s=0.01,
    )


trajectory = fall([0.0, 0.0])
print(trajectory.summary)

E, K = trajectory.ledger.energy, trajectory.ledger.kinetic
print(f"energy drifts by {np.ptp(E):.1e} J while up to {K.max():.3f} J are kinetic")

neighbour = fall([apart, 0.0])
distance = np.abs(trajectory.q - neighbour.q).max(axis=1)
print(f"neighbours {apart:g} rad apart at the start:")
for t in (2.0, 4.0, 6.0, 8.0, 10.0):
    print(f"  after {t:4.1f} s: {distance[np.isclose(trajectory.t, t)][0]:.1e} rad")
