"""Statistics of sweeps on functions with known answers: how often intervals hold these, how wide they are; costs."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import partial
from math import e, pi
from typing import Any

import numpy as np
from scipy.special import chdtri, ndtri
from scipy.stats import binom

from benchmarks.measure import Effort, lowest, printed, row, table
from robot_dyn.tools.sweeps import designs, sensitivity, statistics

DESIGNS = ("random", "sobol", "halton", "latin")
DIMENSIONS = 3
LEVELS, EVENTS = (0.5, 0.9, 0.99), (0.001, 0.01, 0.1)  # p of quantiles; probabilities of events
SEEDS, RUNS = 4000, 4096

Numbers = np.ndarray


@dataclass(frozen=True)
class Known:
    """A function of u, uniform in the unit cube, whose distribution is known: its quantiles and its mean."""

    value: Callable[[Numbers], Numbers]
    quantile: Callable[[float], float]
    mean: float


def normals(u: Numbers) -> Numbers:
    return ndtri(np.clip(u, 2.0**-54, 1 - 2.0**-53))


KNOWN = {
    "first coordinate": Known(lambda u: u[:, 0], lambda p: p, 0.5),
    "sum of normals": Known(lambda u: normals(u).sum(axis=1) / 3**0.5, lambda p: float(ndtri(p)), 0.0),
    "largest": Known(lambda u: u.max(axis=1), lambda p: p ** (1 / 3), 0.75),
    "chi-square": Known(lambda u: (normals(u) ** 2).sum(axis=1), lambda p: float(chdtri(3, 1 - p)), 3.0),
    "log-normal": Known(lambda u: np.exp(normals(u).sum(axis=1) / 3**0.5), lambda p: float(np.exp(ndtri(p))), e**0.5),
}


def one_seed(design: str, seed: int, runs: int) -> list[tuple[bool, float]]:
    """Of every function and statistic whether the interval holds the known value, and its width."""
    of = designs.design(design, runs, DIMENSIONS, seed)
    u, replicate = of.rows(0, runs), None if of.independent else of.replicate_of(np.arange(runs))
    held: list[tuple[bool, float]] = []

    def look(made: Any, true: float) -> None:
        held.append((made.low <= true <= made.high, made.high - made.low))

    for known in KNOWN.values():
        y = known.value(u)
        look(statistics.mean(y, replicate=replicate), known.mean)
        for made, p in zip(statistics.quantiles(y, LEVELS, replicate=replicate), LEVELS, strict=True):
            look(made, known.quantile(p))
        for P in EVENTS:
            look(statistics.probability(y > known.quantile(1 - P), replicate=replicate), P)
    return held


def some_seeds(design: str, runs: int, seeds: range) -> Numbers:
    """Shape (seeds, functions, statistics, 2)."""
    made = np.array([one_seed(design, seed, runs) for seed in seeds], float)
    return made.reshape(len(seeds), len(KNOWN), -1, 2)


def coverage(effort: Effort) -> None:
    """Coverage of 95 % intervals and their median widths, of all designs side by side."""
    seeds, runs = (1, 64) if effort.quick else (SEEDS, RUNS)
    parts = [range(seeds)[k::40] for k in range(min(40, seeds))]
    with ProcessPoolExecutor(1 if effort.quick else 2) as pool:
        found = {design: np.concatenate(list(pool.map(partial(some_seeds, design, runs), parts))) for design in DESIGNS}
    columns = ["mean", *(f"q{p:g}" for p in LEVELS), *(f"P={P:g}" for P in EVENTS)]
    for what, digits, of in (("coverage in %", ".1f", coverage_of), ("median width", ".3g", width_of)):
        print(f"\n{what}, {seeds} seeds of {runs} runs in {DIMENSIONS} dimensions, 95 % intervals")
        table("what", "design", *columns)
        for k, name in enumerate(KNOWN):
            for design in DESIGNS:
                row(name, design, *(f"{x:{digits}}" for x in of(found[design][:, k])))


def coverage_of(held: Numbers) -> Numbers:
    return 100 * held[:, :, 0].mean(axis=0)


def width_of(held: Numbers) -> Numbers:
    return np.median(held[:, :, 1], axis=0)


def exact_coverage(effort: Effort) -> None:
    """Coverage of Clopper–Pearson and of binomial ranks as sums over the binomial distribution: no random numbers."""
    counts = (20,) if effort.quick else (100, 1000, 4096)
    table("what", "N", "p", "coverage in %")
    for n in counts:
        ends = np.array([statistics.clopper_pearson(k, n, 0.95) for k in range(n + 1)])
        grid = np.linspace(0.0005, 0.9995, 1000)
        held = [100 * float(binom.pmf(np.flatnonzero((ends[:, 0] <= p) & (p <= ends[:, 1])), n, p).sum()) for p in grid]
        row("Clopper–Pearson, lowest of 1000 p", n, f"{grid[np.argmin(held)]:.4f}", f"{min(held):.2f}")
        for p in LEVELS:
            low, high = statistics.ranks(n, p, 0.95)
            within = 100 * float(binom.cdf(high - 1, n, p) - binom.cdf(low - 1, n, p))
            row("order statistics", n, p, f"{within:.2f}")


def ishigami(u: Numbers) -> Numbers:
    x = pi * (2 * u - 1)
    return np.sin(x[:, 0]) + 7 * np.sin(x[:, 1]) ** 2 + 0.1 * x[:, 2] ** 4 * np.sin(x[:, 0])


def ishigami_indices() -> tuple[Numbers, Numbers]:
    """First-order and total indices in closed form. Source: Ishigami, Homma, ISUMA 1990."""
    a, b = 7.0, 0.1
    V1, V2, V13 = (1 + b * pi**4 / 5) ** 2 / 2, a**2 / 8, b**2 * pi**8 * (1 / 18 - 1 / 50)
    V = V1 + V2 + V13
    return np.array([V1, V2, 0.0]) / V, np.array([V1 + V13, V2, V13]) / V


def indices_of_a_seed(points: int, seed: int) -> list[tuple[bool, float, float]]:
    design = designs.design("saltelli", 16 * 5 * points, 3, seed)
    made = sensitivity.saltelli(
        ishigami(design.rows(0, design.runs)), "123", design.replicate_of(np.arange(design.runs))
    )
    true = np.concatenate(ishigami_indices())
    return [
        (each.low <= x <= each.high, each.high - each.low, each.estimate)
        for each, x in zip((*made.first, *made.total), true, strict=True)
    ]


def indices(effort: Effort) -> None:
    """Sobol' indices of Ishigami's function."""
    seeds, points = (2, 16) if effort.quick else (1000, 64)
    with ProcessPoolExecutor(1 if effort.quick else 2) as pool:
        found = np.array(list(pool.map(partial(indices_of_a_seed, points), range(seeds), chunksize=10)), float)
    print(f"\nIshigami, {seeds} seeds of {80 * points} runs")
    table("what", "closed form", "mean estimate", "coverage in %", "median width")
    names = [f"{kind}{j}" for kind in "ST" for j in (1, 2, 3)]
    for name, true, each in zip(names, np.concatenate(ishigami_indices()), found.transpose(1, 0, 2), strict=True):
        held, width, estimate = each.T
        row(name, f"{true:.4f}", f"{estimate.mean():.4f}", f"{100 * held.mean():.1f}", f"{np.median(width):.4f}")


def costs(effort: Effort) -> None:
    """Time of 1024 rows at the beginning and at row 1e8, and memory of planning 1e8 runs, over the import."""
    print("\n2^30 runs of 7 dimensions (saltelli: 9 · 2^26); lowest times of 1024 rows")
    table("what", "at 0, ms", "at 1e8, ms", "ratio")
    for name in (*DESIGNS, "saltelli"):
        design = designs.design(name, 9 * 2**26 if name == "saltelli" else 2**30, 7, 1)
        calls = {str(start): partial(design.rows, start, start + 1024) for start in (0, 10**8)}
        design.rows(0, 16)
        first, late = (x / 1e3 for x in lowest(calls, effort, 1).values())
        row(name, f"{first:.3f}", f"{late:.3f}", f"{late / first:.2f}")
    table("what", "runs", "s", "MB over the import")
    for name, runs in (
        ("random", 10**8),
        ("sobol", 2**27),
        ("halton", 10**8),
        ("latin", 10**8),
        ("saltelli", 9 * 2**24),
    ):
        row(name, runs, *(f"{x:.2f}" for x in printed(_PLAN, name, str(runs))))


_PLAN = """
import resource, sys, time
import numpy, scipy.stats
from robot_dyn.tools.sweeps import designs
def peak(): return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
before, began = peak(), time.perf_counter()
design = designs.design(sys.argv[1], int(sys.argv[2]), 7, 1)
design.rows(0, 1024), design.rows(design.runs - 1024, design.runs)
print(time.perf_counter() - began, peak() - before)
"""
