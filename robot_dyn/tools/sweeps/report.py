"""The report of a sweep as one HTML page, without scripts: distributions, failures over two parameters, worst runs."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from html import escape
from typing import Any, final

import numpy as np

from robot_dyn.foundations import Answer, FileKind, html_of, inline, page, side_by_side, text
from robot_dyn.foundations import table as html_table
from robot_dyn.report import PAGE, ink, styled
from robot_dyn.tools.sweeps.estimate import Estimate
from robot_dyn.tools.sweeps.estimate import text as number
from robot_dyn.tools.sweeps.folder.rows import FINISHED
from robot_dyn.tools.sweeps.sensitivity import Sensitivity, bins

KIND = FileKind("a page", ".html", b"<!doctype html>")
_BINS, _CELLS, _MOST_CROSSES = 60, 24, 500
WORST = 10
PROBABILITIES = (0.05, 0.5, 0.95, 0.99)
_HEAD = (
    '<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><meta name="color-scheme" content="light dark">'
    "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src 'unsafe-inline'\">"
    "<title>{title}</title><style>body{{margin:1.5em auto;max-width:72em;padding:0 1em}}"
    "h2{{font:600 1em system-ui,sans-serif;margin:1.6em 0 .4em}}</style></head><body>\n{body}\n</body></html>\n"
)


@final
@dataclass(frozen=True)
class FigureReport:
    """What a report shows of a figure.

    Attributes:
        heading: Its name with its unit.
        values: Of all runs, (N,).
        quantiles: Of `PROBABILITIES`.
        worst: Numbers of runs with the largest values.
        sensitivity: To varied parameters; a text if there is none.
    """

    heading: str
    values: np.ndarray
    quantiles: tuple[Estimate, ...]
    worst: tuple[int, ...]
    sensitivity: Sensitivity | str


def report(
    result: Answer, failure: Estimate, table: Mapping[str, np.ndarray], varied: Mapping[str, str],
    figures: Iterable[FigureReport], repeat: str,
) -> str:  # fmt: skip
    """The page.

    Args:
        result: Whose title and blocks are shown.
        failure: Probability of a failure.
        table: Columns of all runs.
        varied: Headings of varied parameters, by column.
        figures: Parts on figures, in their order.
        repeat: Python that repeats a run, without its number.
    """
    failed = table["outcome"] != FINISHED
    parts = [*html_of(result.blocks()), "<h2>Failures</h2>", text(repr(failure))]
    if failed.any():
        some = np.flatnonzero(failed)[:WORST].tolist()
        rows = [(i, str(table["outcome"][i]), str(table["reason"][i]), f"{repeat}({i})") for i in some]
        parts.append(html_table(("first runs that failed", "outcome", "reason", "repeat it by"), rows))
    if failed.any() and len(varied) > 1:
        names = tuple(varied)
        first, second = (names[k] for k in strongest(failed, np.column_stack([table[name] for name in names])))
        shown = f"Share of runs that failed over {first} and {second}, the two that it depends on most"
        parts.append(f"<p>{escape(shown)}; cells without runs are empty, each cross is a run that failed.</p>")
        parts.append(_failure_map((varied[first], varied[second]), [table[first], table[second]], failed))
    for figure in figures:
        parts += _of_figure(figure, repeat)
    return _HEAD.format(title=escape(result.title), body=page(result.title, *parts))


def strongest(failed: np.ndarray, x: np.ndarray) -> tuple[int, int]:
    """The two columns of x (N, d) on which failure depends most: least p-values of the chi-square test over bins."""
    from scipy.stats import chi2_contingency

    found: list[tuple[Any, Any]] = []
    for column in x.T:
        counts = np.array([np.bincount(bins(column), weights=each) for each in (failed, ~failed)])
        if counts.shape[1] > 1:
            statistic, p, freedom = map(float, tuple(chi2_contingency(counts))[:3])
        else:
            statistic, p, freedom = 0.0, 1.0, 1
        found.append((p, -statistic / freedom))  # many strong ones have a p-value of 0
    first, second = sorted(range(len(found)), key=found.__getitem__)[:2]
    return first, second


def _of_figure(figure: FigureReport, repeat: str) -> Iterator[str]:
    """Distribution, quantiles and worst runs of a figure."""
    yield f"<h2>{escape(figure.heading)}</h2>"
    first, finite = figure.quantiles[0], figure.values[np.isfinite(figure.values)]
    rows = [(each.statistic, *map(number, (each.estimate, each.low, each.high))) for each in figure.quantiles]
    level = f"{100 * first.level:g} % interval from"
    columns = ("estimate", level, "to")
    parts = [html_table(("", *columns), rows, right=columns), text(f"{first.n} runs, {first.failed} failed")]
    worst = [(i, float(figure.values[i]), f"{repeat}({i})") for i in figure.worst]
    yield side_by_side([*([_histogram(figure.heading, finite)] if len(finite) else []), f"<div>{''.join(parts)}</div>"])
    yield html_table(("worst runs that finished", figure.heading, "repeat it by"), worst)
    if isinstance(figure.sensitivity, str):
        yield text(f"no sensitivity: {figure.sensitivity}")
    else:
        yield from html_of(figure.sensitivity.blocks())


def _histogram(name: str, x: np.ndarray) -> str:
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


def _failure_map(names: tuple[str, ...], x: list[np.ndarray], failed: np.ndarray) -> str:
    """The share of runs that failed in cells over two parameters."""
    figure, axes = _figure(5.6, 3.8)
    edges = [_edges(each) for each in x]
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
    if len(values) <= _CELLS:
        between = (values[1:] + values[:-1]) / 2
        return (
            np.array([2 * values[0] - between[0], *between, 2 * values[-1] - between[-1]])
            if len(between)
            else (values[0] + np.array([-0.5, 0.5]))
        )
    return np.linspace(values[0], values[-1], _CELLS + 1)


def _figure(width: float, height: float) -> tuple[Any, Any]:
    from robot_dyn.view import Figure

    figure = Figure(figsize=(width, height), facecolor=PAGE["paper"])
    return figure, figure.add_subplot()
