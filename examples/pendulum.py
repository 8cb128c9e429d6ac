"""Falling pendulum: its period against the elliptic integral.

    I q̈ = −m g (l/2) sin q,    T = 4 √(2 l / (3 g)) K(sin²(q₀/2))    for a rod, I = m l²/3, let go at rest from q₀

K is the complete elliptic integral of the first kind; for a small swing K → π/2.

Run: python examples/pendulum.py
"""

from __future__ import annotations

import numpy as np
from scipy.special import ellipk

import robot_dyn as rd

length = 1.0  # l of the rod of urdf/pendulum.urdf, in [m]
g = -rd.STANDARD_GRAVITY[2]  # [m/s²]
q0 = 2.0  # from hanging down, in [rad]
periods = 10

pendulum = rd.load("pendulum")
plant = rd.Plant(pendulum)

small_swing = np.sqrt(2 * length / (3 * g))
T = 4 * small_swing * ellipk(np.sin(q0 / 2) ** 2)

trajectory = rd.simulate(
    plant,
    q0=[q0],
    v0=[0.0],
    duration_s=periods * T,
    method="DP8",
    step_s=0.01,
)
print(trajectory.summary)

# After whole periods it should be back at q₀, at rest. If it moves, it is late or early by v/a.
late = trajectory.v[-1, 0] / trajectory.a[-1, 0]
measured = T - late / periods
print(f"period of a small swing: {2 * np.pi * small_swing:.12f} s")
print(f"elliptic integral:       {T:.12f} s")
print(f"simulated:               {measured:.12f} s")
print(f"difference of periods: {abs(measured - T):.1e} s")
