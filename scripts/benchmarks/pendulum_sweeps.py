"""Statistics of sweeps of a pendulum: how often 95 % intervals hold the numbers of its closed form.

    q(T) = 2 arcsin(k cd(ω₀ T, k)),  k = sin(q₀/2),  ω₀² = 3 g/(2 l)    a rod released at rest

For 0 < q₀ < 2.5 rad and T below a quarter of the period it grows with q₀, so that quantiles of q(T) are those of q₀
taken through it. The mass varies too, and is without effect.

Source: Whittaker, A treatise on the analytical dynamics of particles and rigid bodies, 1937, §44.
"""

from __future__ import annotations

import tempfile
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from scipy.integrate import quad
from scipy.special import ellipj

from benchmarks.measure import Effort, row, table
from robot_dyn.tools import sweeps as sw

LOW, HIGH, T, G = 0.4, 1.6, 0.25, 9.80665
LEVELS, EVENTS = (0.5, 0.9, 0.99), (0.01, 0.1)
SCENE = f"""
robot = "pendulum"
duration_s = {T}
method = "RK4"
step_s = 0.0025
start = {{q = {{pivot = 1.0}}}}
effect = [{{kind = "gravity"}}]
"""


def end(q0: float) -> float:
    """q(T)."""
    k = np.sin(q0 / 2)
    _, cn, dn, _ = ellipj(np.sqrt(1.5 * G) * T, k**2)
    return float(2 * np.arcsin(k * cn / dn))


def at(p: float) -> float:
    """The quantile of q(T)."""
    return end(LOW + p * (HIGH - LOW))


def held(scene: Path, design: str, runs: int, seed: int) -> list[bool]:
    """Whether each interval holds the closed form: the mean, quantiles, probabilities."""
    vary: dict[str, Any] = {
        "q0": sw.uniform(low=[LOW], high=[HIGH]),
        "mass_scale": sw.uniform(low=0.5, high=2.0),
    }
    plan = sw.Sweep(str(scene), runs, vary, {"end": sw.final("q", "pivot")}, seed=seed, design=design)
    with tempfile.TemporaryDirectory() as out:
        done = sw.run(plan, f"{out}/out", chunk=runs, threads=1)
        mean = quad(at, 0, 1, epsabs=1e-12)[0]
        found = [(done.mean("end"), mean)]
        found += zip(done.quantiles("end", LEVELS), map(at, LEVELS), strict=True)
        found += [(done.probability(f"end > {at(1 - P)!r}"), P) for P in EVENTS]
    return [each.low <= true <= each.high for each, true in found]


def pendulum(effort: Effort) -> None:
    """Coverage of each design, of whole sweeps by `sw.run`."""
    seeds, runs = (2, 64) if effort.quick else (500, 512)
    print(f"\npendulum, coverage in %, {seeds} sweeps of {runs} runs a design")
    table("design", "mean", *(f"q{p:g}" for p in LEVELS), *(f"P={P:g}" for P in EVENTS))
    with tempfile.TemporaryDirectory() as folder:
        scene = Path(folder) / "scene.toml"
        scene.write_text(SCENE)
        for design in ("random", "sobol", "halton", "latin"):
            of_seeds = np.array(list(map(partial(held, scene, design, runs), range(seeds))))
            row(design, *(f"{100 * x:.1f}" for x in of_seeds.mean(axis=0)))
