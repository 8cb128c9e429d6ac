"""Sensitivity of a figure to its parameters, as shares of its variance or as differences of its distribution.

    S_j = Var(E[y | x_j]) / Var(y)            first order: what x_j explains alone
    T_j = 1 − Var(E[y | x_k, k ≠ j]) / Var(y)  total: with all interactions of x_j
    PAWN_j = median over x_j of sup_y |F(y | x_j) − F(y)|

`saltelli` gives S and T and needs the design of that name; `given_data` gives S and PAWN of any other design. Total
indices cannot be computed from such runs.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, final

import numpy as np

from robot_dyn.foundations import Answer, Block, SweepError, Table, numbers
from robot_dyn.tools.sweeps.estimate import Estimate, text
from robot_dyn.tools.sweeps.replicates import Groups, groups_of, jackknife
from robot_dyn.tools.sweeps.statistics import check_figure, check_finished, check_level

_RANDOM_GROUPS = 16
_RUNS_OF_A_BIN, _MOST_BINS = 64, 32
_RUNS_OF_A_DEGREE, _MOST_DEGREE = 10, 12


@final
@dataclass(frozen=True, repr=False)
class Sensitivity(Answer):
    """Sensitivity of a figure to each parameter.

    Attributes:
        names: Of the parameters.
        first: First-order indices S.
        total: Total indices T; empty if the design gives none.
        pawn: PAWN indices; empty if they were not computed.
        pawn_noise: The PAWN index of a parameter without influence, of as many runs.
        n: Runs.
        failed: Runs without a finite value.
        method: How the indices were computed.
        figure: What is sensitive.
        given: As of `SweepResult.sensitivity`.
    """

    names: tuple[str, ...]
    first: tuple[Estimate, ...]
    total: tuple[Estimate, ...]
    pawn: tuple[float, ...]
    pawn_noise: float
    n: int
    failed: int
    method: str
    figure: str = ""
    given: str | None = None

    def blocks(self) -> Iterator[Block]:
        what = f"sensitivity{f' of {self.figure}' * bool(self.figure)}{f' given {self.given}' if self.given else ''}"
        yield f"{what}: {self.method}; {self.n} runs, {self.failed} without a value"
        columns: dict[str, list[str]] = {"parameter": list(self.names)}
        for index, estimates in (("first order", self.first), ("total", self.total)):
            if estimates:
                columns[index] = [text(each.estimate) for each in estimates]
                columns[f"{index}, {100 * estimates[0].level:g} %"] = [_interval(each) for each in estimates]
        if self.pawn:
            columns["PAWN"] = [text(x) for x in self.pawn]
        yield Table(tuple(columns), tuple(zip(*columns.values(), strict=True)))
        if self.pawn:
            yield (
                "PAWN: how far the distribution of the figure, given the parameter, is from that of all runs, 0 to 1;"
                f" {text(self.pawn_noise)} without influence. Total indices need design 'saltelli'"
            )


def saltelli(
    y: Any, names: Sequence[str], replicate: Any, level: float = 0.95, *, given: str | None = None
) -> Sensitivity:
    """First-order and total Sobol' indices from the runs of design "saltelli", in its order.

        S_j = mean f(B) (f(A_B^j) − f(A)) / V,    T_j = mean (f(A) − f(A_B^j))² / 2V

    Intervals: jackknife over the scramblings. A bootstrap of pairs would take them as independent.

    Args:
        y: The figure of each run, shape (N,).
        names: Of the d parameters.
        replicate: The scrambling of each run, shape (N,).
        level: Of the intervals.
        given: "finished" or "known" leaves out pairs of rows of which a run has no value.

    Raises:
        SweepError: If an argument has another form, or runs failed and `given` is None.

    Sources: Saltelli et al., Comput. Phys. Commun. 181, 2010, table 2 (b), (f); Jansen, ibid. 117, 1999.
    """
    y, level, names = check_figure(y), check_level(level), tuple(names)
    block = len(names) + 2
    if len(y) % block or not names:
        raise SweepError(f"of {len(names)} parameters a saltelli design has a multiple of {block} runs, got {len(y)}")
    finite = check_finished(y, "sensitivity", given)
    pairs = finite.reshape(-1, block).all(axis=1)
    groups = groups_of(replicate, len(y)).part(np.repeat(pairs, block) & (np.arange(len(y)) % block == 0))
    rows = y.reshape(-1, block)[pairs]
    _check_enough(rows[:, :2], groups)
    theta, low, high = jackknife(lambda mask: _indices(rows[mask]), groups, level)
    d, failed = len(names), int(np.sum(~finite))
    made = [
        Estimate(f"{kind} index of {name}", float(x), float(a), float(b), level, len(y), failed, "jackknife")
        for kind, *columns in zip(("first-order", "total"), theta, low, high, strict=True)
        for name, x, a, b in zip(names, *columns, strict=True)
    ]
    method = f"Sobol' indices (Saltelli 2010, Jansen), jackknife over {groups.count} scramblings"
    return Sensitivity(names, tuple(made[:d]), tuple(made[d:]), (), 0.0, len(y), failed, method, given=given)


def given_data(
    y: Any, x: Any, names: Sequence[str], level: float = 0.95, replicate: Any = None, *, given: str | None = None
) -> Sensitivity:
    """First-order indices by regression on each parameter, and PAWN indices, of the runs of any random design.

    S_j is the part of the variance that a least-squares fit explains: by Legendre polynomials P₁, …, P_J of the ranks
    of x_j, by a mean for each value where there are few. The jackknife over the scramblings, of independent runs over
    16 groups, takes off the part that chance explains, and gives the interval. A fit of finite degree explains too
    little: the upper end is higher by twice the difference from a fit of half the degree. Indices are cut to 0 … 1.

    Args:
        y: The figure of each run, shape (N,).
        x: The parameters, or their columns of the design, shape (N, d).
        names: Of the d parameters.
        level: Of the intervals.
        replicate: The scrambling of each run, shape (N,); None for independent runs.
        given: "finished" or "known" leaves out runs without a value.

    Raises:
        SweepError: If an argument has another form, or runs failed and `given` is None.

    Sources: Sudret, Global sensitivity analysis using polynomial chaos expansions, Reliab. Eng. Syst. Saf. 93, 2008;
    Pianosi, Wagener, A simple and efficient method for global sensitivity analysis based on cumulative distribution
    functions, Environ. Model. Softw. 67, 2015.
    """
    y, level, names = check_figure(y), check_level(level), tuple(names)
    x = numbers("x", x, ("N", "d"), error=SweepError)
    if x.shape != (len(y), len(names)) or not names:
        raise SweepError(f"x must have shape ({len(y)}, {len(names)}), a row a run and a column a name, got {x.shape}")
    finite = check_finished(y, "sensitivity", given)
    of = np.arange(len(y)) % _RANDOM_GROUPS if replicate is None else replicate
    groups = groups_of(of, len(y)).part(finite)
    y, x = y[finite], x[finite]
    _check_enough(y, groups)
    bins = np.column_stack([_bins(column) for column in x.T])
    degree = min(max(len(y) // _RUNS_OF_A_DEGREE, 2), _MOST_DEGREE)
    bases = [_basis(column, degree) for column in x.T]
    theta, low, high = jackknife(lambda mask: _explained(y[mask], [each[mask] for each in bases]), groups, level, True)
    coarse = [each[:, : degree // 2] if each.shape[1] == degree else each for each in bases]
    missed = _explained(y, bases) - _explained(y, coarse)  # of a basis that is not cut, 0
    theta, low, high = np.clip((theta, low, high + 2 * missed), 0.0, 1.0)
    n, failed = len(finite), int(np.sum(~finite))
    estimates = tuple(
        Estimate(f"first-order index of {name}", float(x), float(a), float(b), level, n, failed, "jackknife")
        for name, x, a, b in zip(names, theta, low, high, strict=True)
    )
    noise = _pawn(y, _bins(np.random.default_rng(0).random(len(y))))
    over = f"{groups.count} {'groups of runs' if replicate is None else 'scramblings'}"
    method = f"first order by fits of degree {degree}, jackknife over {over}; PAWN, median over {bins.max() + 1} bins"
    pawn = tuple(_pawn(y, each) for each in bins.T)
    return Sensitivity(names, estimates, (), pawn, noise, n, failed, method, given=given)


def _indices(rows: np.ndarray) -> np.ndarray:
    """S and T, shape (2, d), of rows (f(A), f(B), f(A_B^1), …), from which a mean is subtracted: it changes neither."""
    variance, centre = np.var(rows[:, :2]), np.mean(rows)
    A, B, AB = rows[:, :1] - centre, rows[:, 1:2] - centre, rows[:, 2:] - centre
    return np.array([np.mean(B * (AB - A), axis=0), np.mean((A - AB) ** 2, axis=0) / 2]) / variance


def _bins(x: np.ndarray) -> np.ndarray:
    """The bin of each run, 0, …, M − 1: equal values lie in one bin."""
    count = min(max(len(x) // _RUNS_OF_A_BIN, 2), _MOST_BINS)
    edges = np.quantile(x, np.arange(1, count) / count)
    return np.unique(np.searchsorted(edges, x, side="right"), return_inverse=True)[1]


def _basis(x: np.ndarray, degree: int) -> np.ndarray:
    """Functions of a parameter at its runs, (N, J), all of them with the mean 0 at least nearly."""
    values, of, counts = np.unique(x, return_inverse=True, return_counts=True)
    if len(values) <= degree + 1:  # a mean for each value
        return np.equal.outer(of, np.arange(1, len(values))).astype(float)
    ranks = np.cumsum(counts) - counts / 2  # of equal values the middle one
    return np.polynomial.legendre.legvander(2 * ranks[of] / len(x) - 1, degree)[:, 1:]


def _explained(y: np.ndarray, bases: list[np.ndarray]) -> np.ndarray:
    """The part of the variance of y that the functions of each parameter explain, (d,)."""
    y = y - y.mean()
    total = float(y @ y)
    parts = []
    for basis in bases:
        centred = basis - basis.mean(axis=0)
        left = y - centred @ np.linalg.lstsq(centred, y, rcond=None)[0]
        parts.append(1 - float(left @ left) / total if total else np.nan)
    return np.array(parts)


def _pawn(y: np.ndarray, bins: np.ndarray) -> float:
    """The median over bins of the Kolmogorov–Smirnov distance of y in a bin from all y."""
    order = np.argsort(y, kind="stable")
    ordered, bins = y[order], bins[order]
    last = np.append(ordered[1:] != ordered[:-1], True)  # of equal values: there both functions have jumped
    F = np.arange(1, len(y) + 1)[last] / len(y)
    distances = []
    for k in range(bins.max() + 1):
        inside = np.cumsum(bins == k)
        distances.append(np.max(np.abs(inside[last] / inside[-1] - F)))
    return float(np.median(distances))


def _check_enough(y: np.ndarray, groups: Groups) -> None:
    if groups.count < 3:
        raise SweepError(f"sensitivities need runs that finished of 3 scramblings or more, got {groups.count}")
    if not np.var(y) > 0:
        raise SweepError("the figure is the same in all runs: no parameter matters")


def _interval(each: Estimate) -> str:
    return f"{text(each.low)} … {text(each.high)}"
