"""Sensitivity of a figure to each parameter.

    S_j = Var(E[y | x_j]) / Var(y)             first order: what x_j explains alone
    T_j = 1 − Var(E[y | x_k, k ≠ j]) / Var(y)  total: with all interactions of x_j
    ρ_j = Spearman's rank correlation of y and x_j: only the monotone part
    PAWN_j = median over x_j of sup_y |F(y | x_j) − F(y)|

Design "saltelli" gives S and T, by SALib; other designs give ρ and PAWN of the varying values.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any, final

import numpy as np

from robot_dyn.foundations import Answer, Block, SweepError, Table, needs
from robot_dyn.tools.sweeps.statistics import Estimate, check_level, student_quantile, text

_RUNS_OF_A_BIN, _MOST_BINS = 64, 32
_LEAST_SCRAMBLINGS = 3


@final
@dataclass(frozen=True, repr=False)
class Sensitivity(Answer):
    """Sensitivity of a figure to each parameter.

    Attributes:
        names: Names of the parameters.
        first: First-order indices S, for design "saltelli"; else empty.
        total: Total indices T, for design "saltelli"; else empty.
        rank_correlation: Spearman's ρ, for other designs; it measures only the monotone part. Empty for "saltelli".
        pawn: PAWN indices, for other designs; empty for "saltelli".
        pawn_noise: The PAWN index of a parameter without influence, for the same number of runs.
        n: Number of runs.
        failed: Number of failed runs.
        method: Method of computation, in words.
        left_out: Number of omitted blocks of design "saltelli", because a run has no value.
        figure: Name of the figure.
        condition: Condition on runs; see `SweepResult.sensitivity`.
    """

    names: tuple[str, ...]
    first: tuple[Estimate, ...] = ()
    total: tuple[Estimate, ...] = ()
    rank_correlation: tuple[float, ...] = ()
    pawn: tuple[float, ...] = ()
    pawn_noise: float = 0.0
    n: int = 0
    failed: int = 0
    method: str = ""
    left_out: int = 0
    figure: str = ""
    condition: str | None = None

    def blocks(self) -> Iterator[Block]:
        condition = f" given {self.condition}" if self.condition else ""
        title = f"sensitivity{f' of {self.figure}' * bool(self.figure)}{condition}"
        yield f"{title}: {self.method}; {self.n} runs, {self.failed} failed"
        columns: dict[str, list[str]] = {"parameter": list(self.names)}
        for index, estimates in (("first order", self.first), ("total", self.total)):
            if estimates:
                columns[index] = [text(x.estimate) for x in estimates]
                columns[f"{index}, {100 * estimates[0].level:g} %"] = [
                    f"{text(x.low)} … {text(x.high)}" for x in estimates
                ]
        if self.pawn:
            columns["rank correlation (monotone part only)"] = [text(x) for x in self.rank_correlation]
            columns["PAWN"] = [text(x) for x in self.pawn]
        yield Table(tuple(columns), tuple(zip(*columns.values(), strict=True)), right=tuple(columns)[1:])
        if self.pawn:
            yield (
                "PAWN: distance of the figure's distribution, given the parameter, from that of all runs, 0 to 1;"
                f" {text(self.pawn_noise)} without influence. Shares of variance need design 'saltelli'"
            )


def saltelli(
    y: np.ndarray,
    known: np.ndarray,
    names: tuple[str, ...],
    scrambling: np.ndarray,
    level: float = 0.95,
    *,
    failed: int = 0,
) -> Sensitivity:
    """Compute first-order and total Sobol' indices from the runs of design "saltelli", in its order, by SALib.

    Intervals use the jackknife over scramblings, s² = (R − 1)/R Σ (θ_(r) − mean θ_(r))², with Student's t of R − 1
    degrees of freedom. A bootstrap of blocks would treat them as independent.

    Args:
        y: The figure of each run, shape (N,).
        known: True for runs with a value, shape (N,); blocks with a failed run are omitted.
        names: Names of the d parameters.
        scrambling: The scrambling of each run, shape (N,).
        level: Confidence level of the intervals.
        failed: Number of failed runs.

    Raises:
        SweepError: If the level is not between 0 and 1, too few scramblings are left, or the figure does not vary.
    """
    analyze = needs("SALib.analyze.sobol", extra="sweeps").analyze
    level, block = check_level(level), len(names) + 2
    whole = known.reshape(-1, block).all(axis=1)
    rows, group = y.reshape(-1, block)[whole], scrambling.reshape(-1, block)[whole, 0]
    left = np.unique(group)
    if len(left) < _LEAST_SCRAMBLINGS:
        raise SweepError(f"sensitivities need runs of {_LEAST_SCRAMBLINGS} scramblings or more, got {len(left)}")
    _check_varies(rows)
    problem = {"num_vars": len(names), "names": list(names), "bounds": [[0.0, 1.0]] * len(names)}

    def indices(some: np.ndarray) -> np.ndarray:
        result = analyze(problem, some.ravel(), calc_second_order=False, num_resamples=2, seed=1)
        return np.array([result["S1"], result["ST"]])

    theta, without = indices(rows), np.array([indices(rows[group != r]) for r in left])
    half = student_quantile(level, len(left) - 1) * np.sqrt((len(left) - 1) * without.var(axis=0))
    left_out = int((~whole).sum())
    stated = partial(Estimate, level=level, n=len(y), failed=failed, method="SALib")
    estimates = [
        stated(f"{kind} index of {name}", float(x), float(x - h), float(x + h))
        for kind, row, halves in zip(("first-order", "total"), theta, half, strict=True)
        for name, x, h in zip(names, row, halves, strict=True)
    ]
    method = f"Sobol' indices by SALib, jackknife over {len(left)} scramblings"
    if left_out:
        method += f", without {left_out} blocks of {block} runs in which one has no value"
    first, total = tuple(estimates[: len(names)]), tuple(estimates[len(names) :])
    return Sensitivity(names, first, total, n=len(y), failed=failed, method=method, left_out=left_out)


def by_values(y: np.ndarray, x: np.ndarray, names: tuple[str, ...], *, failed: int = 0) -> Sensitivity:
    """Compute Spearman's rank correlation and PAWN indices of the varying values, from the runs of any design.

    Args:
        y: The figure of each run that has one, shape (N,).
        x: The values of the parameters, shape (N, d).
        names: Names of the d parameters.
        failed: Number of failed runs.

    Raises:
        SweepError: If the figure does not vary.

    Source: Pianosi, Wagener, A simple and efficient method for global sensitivity analysis based on cumulative
    distribution functions, Environ. Model. Softw. 67, 2015.
    """
    from scipy.stats import spearmanr

    _check_varies(y)
    rank: Any = spearmanr
    correlation = tuple(float(rank(column, y)[0]) if np.ptp(column) > 0 else 0.0 for column in x.T)
    binned = [bins(column) for column in x.T]
    noise = _pawn(y, bins(np.random.default_rng(0).random(len(y))))
    method = "Spearman's rank correlation; PAWN, median over values, or over up to 32 bins of them"
    pawn = tuple(_pawn(y, bins_of_column) for bins_of_column in binned)
    return Sensitivity(
        names, rank_correlation=correlation, pawn=pawn, pawn_noise=noise, n=len(y), failed=failed, method=method
    )


def bins(x: np.ndarray) -> np.ndarray:
    """Return the bin of each run, 0, …, M − 1: one bin per value if there are few, else bins of equal size."""
    values, index = np.unique(x, return_inverse=True)
    count = min(max(len(x) // _RUNS_OF_A_BIN, 2), _MOST_BINS)
    if len(values) <= max(count, len(x) // 8):
        return index
    edges = np.quantile(x, np.arange(1, count) / count)
    return np.unique(np.searchsorted(edges, x, side="right"), return_inverse=True)[1]


def _pawn(y: np.ndarray, bins: np.ndarray) -> float:
    """Return the median over bins of the Kolmogorov–Smirnov distance of y in a bin from all y."""
    from scipy.stats import ks_2samp

    distance: Any = ks_2samp
    return float(np.median([distance(y[bins == k], y, method="asymp")[0] for k in range(bins.max() + 1)]))


def _check_varies(y: np.ndarray) -> None:
    if not np.ptp(y) > 0:
        raise SweepError("the figure is the same in all runs: no parameter matters")
