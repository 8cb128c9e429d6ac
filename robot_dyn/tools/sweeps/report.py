"""Drawings of a sweep's report: distributions, and failures over two parameters; one HTML page without scripts."""

from __future__ import annotations

from collections.abc import Iterable
from html import escape
from typing import Any

import numpy as np

from robot_dyn.foundations import Block, document, html_of, inline, page
from robot_dyn.report import PAGE, ink, styled
from robot_dyn.tools.sweeps.sensitivity import bins

_BINS, _CELLS, _MOST_CROSSES = 60, 24, 500


def sections_page(title: str, sections: Iterable[tuple[str, str, Iterable[Block]]]) -> str:
    """Return the page of sections; a section has a heading, a drawing, and texts and tables."""
    parts = (f"<h2>{escape(heading)}</h2>{drawing}{''.join(html_of(blocks))}" for heading, drawing, blocks in sections)
    return document(title, page(title, *parts))


def strongest(failed: np.ndarray, x: np.ndarray) -> tuple[int, int]:
    """Return the two columns of x, (N, d), with the smallest p-values of the chi-square test of failure over bins."""
    from scipy.stats import chi2_contingency

    scores: list[tuple[Any, Any]] = []
    for column in x.T:
        counts = np.array([np.bincount(bins(column), weights=weights) for weights in (failed, ~failed)])
        if counts.shape[1] > 1:
            statistic, p, freedom = map(float, tuple(chi2_contingency(counts))[:3])
        else:
            statistic, p, freedom = 0.0, 1.0, 1
        scores.append((p, -statistic / freedom))  # several strong columns may have a p-value of 0
    first, second = sorted(range(len(scores)), key=scores.__getitem__)[:2]
    return first, second


def histogram(name: str, x: np.ndarray) -> str:
    """The distribution of a figure, from its finite values."""
    figure, axes = _figure(4.6, 2.6)
    low, most, high = np.quantile(x, (0.0, 0.999, 1.0))
    high = most if high - most > most - low else high  # few values that are far off leave no room for the others
    bins = min(max(round(2 * len(x) ** (1 / 3)), 5), _BINS)
    axes.hist(x, bins, range=(low, high if high > low else low + 1.0), color=PAGE["lines"][1])
    axes.yaxis.get_major_locator().set_params(integer=True)
    beyond = int((x > high).sum())
    styled(axes, PAGE, name, f"{len(x)} runs that finished" + (f", {beyond} beyond the right end" if beyond else ""))
    axes.set_ylabel("runs", fontsize=8.5, **ink(PAGE))
    return inline(figure)


def failure_map(names: tuple[str, ...], x: list[np.ndarray], failed: np.ndarray) -> str:
    """The share of runs that failed in cells over two parameters."""
    figure, axes = _figure(5.6, 3.8)
    edges = [_edges(values) for values in x]
    count = np.histogram2d(*x, bins=edges)[0]
    of_failed = np.histogram2d(x[0][failed], x[1][failed], bins=edges)[0]
    share = np.where(count > 0, of_failed / np.maximum(count, 1), np.nan)
    mesh = axes.pcolormesh(*edges, share.T, vmin=0.0, vmax=1.0, cmap="viridis")
    some = np.flatnonzero(failed)[:_MOST_CROSSES]
    axes.plot(x[0][some], x[1][some], "x", color=PAGE["lines"][1], markersize=3)
    styled(axes, PAGE, names[0], "")
    axes.set_ylabel(names[1], fontsize=8.5, **ink(PAGE))
    bar = figure.colorbar(mesh, ax=axes)
    bar.solids.set_rasterized(False)  # a picture would not be shown
    bar.set_label("share that failed", fontsize=8.5, **ink(PAGE))
    bar.ax.tick_params(labelsize=8, colors=PAGE["ink"])
    return inline(figure)


def _edges(x: np.ndarray) -> np.ndarray:
    """Edges of cells: around each of a few values, else of one width."""
    values = np.unique(x)
    if len(values) > _CELLS:
        return np.linspace(values[0], values[-1], _CELLS + 1)
    if len(values) == 1:
        return values[0] + np.array([-0.5, 0.5])
    between = (values[1:] + values[:-1]) / 2
    return np.array([2 * values[0] - between[0], *between, 2 * values[-1] - between[-1]])


def _figure(width: float, height: float) -> tuple[Any, Any]:
    from robot_dyn.view import Figure

    figure = Figure(figsize=(width, height), facecolor=PAGE["paper"])
    return figure, figure.add_subplot()
