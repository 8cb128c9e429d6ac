"""Error estimates of runs beside their true errors, on five smooth scenes by RK4.

The truth is order 8 with half the step; how far DOP853 at 1e-13 ends from it is printed.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

import robot_dyn as rd
from benchmarks.measure import READY, Effort, arms, row, table

TIGHT = rd.integrate.Adaptive(rtol=1e-13, atol=1e-14)


def scenes() -> dict[str, rd.Setup]:
    """Five smooth scenes, for RK4."""
    panda, double, rk4 = arms()["Panda-7"], rd.load("planar_2r"), rd.integrate.method("RK4")
    reach = rd.control.quintic(READY, READY + np.array([0.4, -0.3, 0.5, 0.2, -0.6, 0.3, 0.4]), 0.5)
    control = rd.control.ComputedTorque(panda, reach, bandwidth_rad_s=8.0, damping_ratio=0.9)
    friction, spring = rd.effects.ViscousFriction([0.4, 0.2]), rd.effects.Spring([30.0, 0.0], [0.2, 0.0])
    return {
        "pendulum": rd.Setup(rd.Plant(rd.load("pendulum")), [2.5], [0.7], duration_s=2.0, method=rk4, step_s=4e-3),
        "planar_2r, friction": rd.Setup(
            rd.Plant(double, [friction]), [0.4, -0.7], [0.3, 0.5], duration_s=1.0, method=rk4, step_s=5e-3
        ),
        "panda, free swing": rd.Setup(rd.Plant(panda), READY, None, duration_s=1.0, method=rk4, step_s=2e-3),
        "panda, computed torque": rd.Setup(
            rd.Plant(panda), READY + 0.1, np.full(7, -0.2), duration_s=0.5, controller=control, method=rk4, step_s=5e-3
        ),
        "cart_pole, spring": rd.Setup(
            rd.Plant(rd.load("cart_pole"), [spring]), [0.1, 0.8], [0.3, -0.5], duration_s=1.0, method=rk4, step_s=5e-3
        ),
    }  # fmt: skip


def estimates(effort: Effort) -> None:
    """A table of estimates and true errors."""
    table("what", "step, ms", "estimated", "true", "estimated / true", "references differ by")
    for name, full in scenes().items():
        setup = replace(full, duration_s=0.4) if effort.quick else full
        run, h = rd.simulate(setup), setup.nominal_step_s
        exact = rd.simulate(setup, method="DP8", step_s=h / 2, record_every_s=h, estimate_error=False)
        tight = rd.simulate(setup, method=TIGHT, estimate_error=False)
        error, doubt = np.abs(run.q - exact.q).max(), np.abs(tight.q[-1] - exact.q[-1]).max()
        assert run.error is not None
        largest = run.error.largest
        row(name, f"{h * 1e3:g}", f"{largest:.2e}", f"{error:.2e}", f"{largest / error:.2f}", f"{doubt:.0e}")
