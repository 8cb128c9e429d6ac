"""The report of a sweep as one HTML page, without scripts: distributions, failures over two parameters, worst runs."""

from __future__ import annotations

from collections.abc import Iterator
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from robot_dyn.foundations import FileKind, SweepError, html_of, inline, page, save, side_by_side, table, target, text
from robot_dyn.report import PAGE, ink, styled
from robot_dyn.tools.sweeps.export import inputs_of
from robot_dyn.tools.sweeps.plan.sweep import OUTCOMES, heading, is_scene
from robot_dyn.tools.sweeps.sensitivity import bins

if TYPE_CHECKING:
    from robot_dyn.tools.sweeps.result import SweepResult

_KIND = FileKind("a page", ".html", b"<!doctype html>")
_BINS, _CELLS, _MOST_CROSSES = 60, 24, 500
_WORST = 10
_PROBABILITIES = (0.05, 0.5, 0.95, 0.99)
_HEAD = (
    '<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><meta name="color-scheme" content="light dark">'
    "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src 'unsafe-inline'\">"
    "<title>{title}</title><style>body{{margin:1.5em auto;max-width:72em;padding:0 1em}}"
    "h2{{font:600 1em system-ui,sans-serif;margin:1.6em 0 .4em}}</style></head><body>\n{body}\n</body></html>\n"
)


def save_report(result: SweepResult, path: str | Path, force: bool) -> Path:
    """Write the page; SweepError if the sweep is not complete, or the page cannot be written."""
    path = target(path, _KIND, SweepError, inputs_of(result.folder, path), force)
    data = report(result).encode()
    return save(path, lambda stream: stream.write(data), SweepError)


def report(result: SweepResult) -> str:
    """The page."""
    x, columns = result.table("outcome", "reason", *result.sweep.columns, *result.sweep.figures), result.sweep.columns
    failed = x["outcome"] != OUTCOMES[0]
    parts = [*html_of(result.blocks())]
    parts += ["<h2>Failures</h2>", text(repr(result.probability("failed")))]
    if failed.any():
        some = np.flatnonzero(failed)[:_WORST].tolist()
        rows = [(i, str(x["outcome"][i]), str(x["reason"][i]), _repeat(result, i)) for i in some]
        parts.append(table(("first runs that failed", "outcome", "reason", "repeat it by"), rows))
    if failed.any() and len(columns) > 1:
        pair = strongest(failed, np.column_stack([x[name] for name in columns]))
        names = tuple(columns[k] for k in pair)
        headings = tuple(heading(result.sweep, each) for each in names)
        shown = f"Share of runs that failed over {names[0]} and {names[1]}, the two that it depends on most"
        parts.append(f"<p>{escape(shown)}; cells without runs are empty, each cross is a run that failed.</p>")
        parts.append(_failure_map(headings, [x[name] for name in names], failed))
    for name in result.sweep.figures:
        parts += _of_figure(result, name, x[name], failed)
    body = page(result.title, *parts)
    return _HEAD.format(title=escape(result.title), body=body)


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


def _of_figure(result: SweepResult, name: str, x: np.ndarray, failed: np.ndarray) -> Iterator[str]:
    """Distribution, quantiles and worst runs of a figure."""
    title = heading(result.sweep, name)
    yield f"<h2>{escape(title)}</h2>"
    finite = x[np.isfinite(x)]
    quantiles = result.quantiles(name, _PROBABILITIES, given="known" if (np.isnan(x) & ~failed).any() else None)
    rows = [(each.statistic, each.estimate, each.low, each.high) for each in quantiles]
    level = f"{100 * quantiles[0].level:g} % interval from"
    parts = [table(("", "estimate", level, "to"), rows), text(f"{quantiles[0].n} runs, {quantiles[0].failed} failed")]
    worst = [(i, float(x[i]), _repeat(result, i)) for i in result.worst(name, min(_WORST, len(x)), given="known")]
    yield side_by_side([*([_histogram(title, finite)] if len(finite) else []), f"<div>{''.join(parts)}</div>"])
    yield table(("worst runs that finished", title, "repeat it by"), worst)
    try:
        yield from html_of(result.sensitivity(name, given="known").blocks())
    except SweepError as none:  # of a grid, or of a figure that is the same in all runs
        yield text(f"no sensitivity: {none}")


def _repeat(result: SweepResult, run: int) -> str:
    """The line that repeats a run."""
    scene = result.sweep.source
    named = "" if is_scene(scene) else f", scene={scene!r}"  # a function is called only if it is named
    return f"sw.read({str(result.path)!r}{named}).run({run})"


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
