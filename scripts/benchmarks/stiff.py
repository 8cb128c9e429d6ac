"""Stiff joints: dampers of 1e5 N m s/rad and springs of 1e8 N m/rad together on each joint of Panda-7, 0.1 rad off.

error = the largest of |q − q_ref| over samples each 0.1 ms in the first 10 ms, and at the end

The reference is the explicit method at 1e-12, whose steps stability bounds: h |λ| ≤ 6, with λ = −1.6e7 per second.
"""

from __future__ import annotations

from statistics import median
from typing import Any

import numpy as np

import robot_dyn as rd
from benchmarks.measure import READY, Effort, arms, row, seconds, table

EARLY_S = 0.01


def stiff(effort: Effort) -> None:
    """Errors, steps and times of a run of 1 s, by tolerance."""
    plant = rd.Plant(arms()["Panda-7"], [rd.effects.ViscousFriction(1e5), rd.effects.Spring(1e8, READY)])
    options: dict[str, Any] = {
        "q0": READY + 0.1, "duration_s": 0.001 if effort.quick else 1.0, "record_every_s": 1e-4,
        "estimate_error": False, "engine": "compiled",
    }  # fmt: skip
    reference = rd.simulate(plant, **options, method=rd.integrate.Adaptive("DOP853", 1e-12, 1e-12))
    table("what", "tolerance", "error to 10 ms, rad", "error at the end, rad", "steps", "time, ms")
    many = [("Rodas5P", tolerance) for tolerance in (1e-4, 1e-5, 1e-6, 1e-8, 1e-10)]
    for name, tolerance in [*many, ("DOP853", 1e-5), ("DOP853", 1e-8)]:
        method = rd.integrate.Adaptive(name, tolerance, tolerance)
        given: dict[str, Any] = options | {"method": method}
        times = [seconds(lambda: rd.simulate(plant, **given)) for _ in range(5 if name == "Rodas5P" else 1)]
        run = rd.simulate(plant, **given)
        error = np.abs(run.q - reference.q).max(axis=1)
        early = error[run.t <= EARLY_S + 1e-9].max()
        ms = 1e3 * median(times)
        row(name, f"{tolerance:g}", f"{early:.1e}", f"{error[-1]:.1e}", run.statistics.steps, f"{ms:.1f}")
