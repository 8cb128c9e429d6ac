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

from benchmarks.measure import Effort, lowest, row, table
from robot_dyn.tools.sweeps import designs, sensitivity, statistics

DESIGNS = ("random", "sobol", "halton", "latin")
DIMENSIONS = 3
SEEDS, RUNS = 400, (32, 64, 512, 4096)
LARGE = 512
LEVELS, THRESHOLD = (0.5, 0.9), 0.9  # p of quantiles; the event is a figure above its quantile of 0.9

Numbers = np.ndarray


@dataclass(frozen=True)
class Known:
    """A function of u, uniform in the unit cube, whose distribution is known.

    Attributes:
        value: Of each row; nan where the run fails.
        quantile: Its quantiles, those that fail as +∞; None where it has steps.
        mean: Of those that do not fail.
        smooth: Whether every sweep of 512 runs must have intervals.
    """

    value: Callable[[Numbers], Numbers]
    quantile: Callable[[float], float] | None
    mean: float
    smooth: bool = True


def normals(u: Numbers) -> Numbers:
    return ndtri(np.clip(u, 2.0**-54, 1 - 2.0**-53))


KNOWN = {
    "first coordinate": Known(lambda u: u[:, 0], lambda p: p, 0.5),
    "sum of normals": Known(lambda u: normals(u).sum(axis=1) / 3**0.5, lambda p: float(ndtri(p)), 0.0),
    "largest": Known(lambda u: u.max(axis=1), lambda p: p ** (1 / 3), 0.75),
    "chi-square": Known(lambda u: (normals(u) ** 2).sum(axis=1), lambda p: float(chdtri(3, 1 - p)), 3.0),
    "log-normal": Known(
        lambda u: np.exp(normals(u).sum(axis=1) / 3**0.5), lambda p: float(np.exp(ndtri(p))), e**0.5, False
    ),
    "0 or 1": Known(lambda u: (u[:, 0] < 0.48).astype(float), None, 0.48, False),
    "0 or 1, of two": Known(lambda u: (u[:, 0] + u[:, 1] < 0.5).astype(float), None, 0.125, False),
    "ten values": Known(lambda u: np.floor(10 * u[:, 0]), None, 4.5, False),
    "a choice, and a number": Known(lambda u: np.floor(4 * u[:, 0]) + u[:, 1], lambda p: 4 * p, 2.0, False),
    "1 of 20 fails": Known(lambda u: np.where(u[:, 2] < 0.05, np.nan, u[:, 0]), lambda p: p / 0.95, 0.5, False),
}


def one_seed(design: str, runs: int, seed: int) -> list[list[float]]:
    """Of every function and statistic whether the interval holds the known value, and its width; nan without one."""
    of = designs.design(design, runs, DIMENSIONS, seed)
    scrambling = None if of.independent else of.scrambling
    held: list[list[float]] = []

    def look(made: Any, true: float) -> None:
        held.append([float(made.low <= true <= made.high) if made.low == made.low else np.nan, made.high - made.low])

    for known in KNOWN.values():
        y = known.value(of.rows)
        finite, counted = np.isfinite(y), np.where(np.isnan(y), np.inf, y)
        look(statistics.mean(y[finite], scrambling=None if scrambling is None else scrambling[finite]), known.mean)
        if known.quantile is None:
            held += [[np.nan, np.nan]] * (len(LEVELS) + 1)
            continue
        for made, p in zip(statistics.quantiles(counted, LEVELS, scrambling=scrambling), LEVELS, strict=True):
            look(made, known.quantile(p))
        event = counted > known.quantile(THRESHOLD)
        look(statistics.probability(event, scrambling=scrambling), 1 - THRESHOLD)
    return held


def coverage(effort: Effort) -> None:
    """Coverage of 95 % intervals in %, and their median widths."""
    seeds, counts = (2, (64,)) if effort.quick else (SEEDS, RUNS)
    cases = [(design, runs) for runs in counts for design in DESIGNS]
    with ProcessPoolExecutor(1 if effort.quick else 2) as pool:
        found = {
            (design, runs): np.array(list(pool.map(partial(one_seed, design, runs), range(seeds), chunksize=20)))
            for design, runs in cases
        }
    with_intervals = min(
        np.isfinite(each[:, k, 0]).mean()
        for (_, runs), held in found.items()
        for each in [held.reshape(seeds, len(KNOWN), -1, 2)[..., 0]]
        for k, known in enumerate(KNOWN.values())
        if known.smooth and runs >= LARGE
    ) if not effort.quick else np.nan  # fmt: skip
    print(
        f"\nleast share of seeds with an interval of the mean, of smooth figures and {LARGE} runs: {with_intervals:.1%}"
    )
    columns = ["mean", *(f"q{p:g}" for p in LEVELS), f"P={1 - THRESHOLD:.1g}"]
    print(
        f"\n95 % intervals, seeds 0 to {seeds - 1}, {DIMENSIONS} dimensions: % of seeds whose interval holds the truth,"
    )
    print("in parentheses % of seeds in which an interval is given, where that is not all")
    table("figure", "N", "design", *columns)
    for k, name in enumerate(KNOWN):
        for runs, design in ((b, a) for a, b in cases):
            held = found[design, runs].reshape(seeds, len(KNOWN), len(columns), 2)[:, k, :, 0]
            row(name, runs, design, *map(_shown, held.T))


def _shown(held: Numbers) -> str:
    """Seeds that are not misled: the interval holds the truth, or there is none."""
    given = np.isfinite(held)
    if not given.any():
        return ""
    return f"{100 * (held[given].sum() + (~given).sum()) / len(held):.1f}" + f" ({100 * given.mean():.0f})" * (
        not given.all()
    )


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
    of = designs.design("saltelli", 16 * 5 * points, 3, seed)
    y = ishigami(of.rows)
    made = sensitivity.saltelli(y, np.isfinite(y), ("1", "2", "3"), of.scrambling)
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
    """Time to draw a design of some 1e6 rows of 7 dimensions."""
    table("design", "rows", "s")
    for name, runs in (
        ("random", 10**6),
        ("sobol", 2**20),
        ("halton", 10**6),
        ("latin", 10**6),
        ("saltelli", 9 * 2**17),
    ):
        count = 9 * 2**5 if effort.quick and name == "saltelli" else 2**10 if effort.quick else runs
        row(name, count, f"{lowest({name: partial(designs.design, name, count, 7, 1)}, effort, 1)[name] / 1e6:.2f}")
