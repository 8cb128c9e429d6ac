"""The energy of a long run: the double pendulum over 10⁶ steps, by methods that keep it and methods that do not.

residual = E − E(0);   its slope and the uncertainty of that, of the line through the means of blocks
"""

from __future__ import annotations

import numpy as np

import robot_dyn as rd
from benchmarks.measure import Effort, row, table

STEP_S = 5e-3
METHODS = ("GaussLegendre4", "RK4", "Euler")


def energy(effort: Effort) -> None:
    """Residual of the ledger after many steps."""
    steps = 2000 if effort.quick else 1_000_000
    print(f"\nDouble pendulum, {steps} steps of {STEP_S * 1e3:g} ms: energy E − E(0)")
    table("what", "until, s", "largest, J", "slope, W", "its uncertainty, W", "wall, s")
    for name in METHODS:
        run = rd.simulate(
            rd.load("planar_2r"), q0=[-1.0, 0.5], v0=[0.3, -0.2], duration_s=steps * STEP_S, step_s=STEP_S,
            method=name, record_every_s=max(1, steps // 20000) * STEP_S, estimate_error=False,
        )  # fmt: skip
        residual = run.ledger.residual
        known = np.isfinite(residual)
        rate, doubt = slope(run.t[known], residual[known])
        row(
            name, f"{run.outcome.t:g} ({run.outcome.ending})", f"{np.abs(residual[known]).max():.2e}", f"{rate:+.1e}",
            f"{doubt:.1e}", f"{run.statistics.wall_s:.0f}",
        )  # fmt: skip


def slope(t: np.ndarray, energy: np.ndarray, blocks: int = 20) -> tuple[float, float]:
    """Slope of the energy and its standard deviation, of the line through the means of blocks."""
    parts = np.array_split(np.arange(len(t)), blocks)
    x, y = (np.array([values[part].mean() for part in parts]) for values in (t, energy))
    away = x - x.mean()
    rate = away @ y / (away @ away)
    rest = y - y.mean() - rate * away
    return float(rate), float(np.sqrt(rest @ rest / (blocks - 2) / (away @ away)))
