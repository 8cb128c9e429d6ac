"""What accuracy costs in time: free swing of Panda-7 over 1 s, all methods beside SciPy, MuJoCo, Drake and heyoka.

It is `rd.accuracy.work_precision`; a whole call of `rd.simulate`, with all that it checks, watches and tells,
stands beside it.
"""

from __future__ import annotations

from dataclasses import replace
from statistics import median
from typing import Any

import robot_dyn as rd
from benchmarks.measure import READY, Effort, arms, row, seconds, table

TARGETS = (1e-6, 1e-8, 1e-10)


def precision(effort: Effort) -> None:
    """A table of the time that each takes to an error, and the diagram of all."""
    setup = rd.Setup(rd.Plant(arms()["Panda-7"]), READY, engine="compiled", estimate_error=False)
    quick: Any = {"methods": ["DOP853", "RK4"], "budget_s": 2.0, "repeats": 1} if effort.quick else {"budget_s": 120.0}
    result = rd.accuracy.work_precision(setup, **quick)
    table("what", *(f"to {x:g}, ms" for x in TARGETS), *(f"over DOP853, {x:g}" for x in TARGETS))
    base = [result.ladders[0].price(x) for x in TARGETS]
    for ladder in result.ladders:
        prices = [ladder.price(x) for x in TARGETS]
        times = [
            "—" if p is None else f"({1e3 * p.value:.3g})" if p.extrapolated else f"{1e3 * p.value:.3f}" for p in prices
        ]
        ratios = [
            "—" if p is None or b is None else f"{p.value / b.value:.1f}" for p, b in zip(prices, base, strict=True)
        ]
        row(ladder.name, *times, *ratios)
    row("whole call of simulate, DOP853", *(f"{1e3 * x:.3f}" for x in whole(setup, effort)), *["—"] * len(TARGETS))
    print("\n( ) extrapolated by the order.", result.sentence)
    if (picture := effort.picture("precision")) is not None:
        result.save(picture)


def whole(setup: rd.Setup, effort: Effort) -> list[float]:
    """Median times of warm calls of simulate, in [s], with a tolerance of a tenth of each target."""
    found = []
    for target in TARGETS:
        with_method = replace(
            setup, method=rd.integrate.Adaptive(rtol=target / 10, atol=target / 10), record_every_s=1.0
        )
        times = [seconds(lambda: rd.simulate(with_method)) for _ in range(effort.repeats + 1)]
        found.append(median(times[1:]))
    return found
