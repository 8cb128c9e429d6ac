"""Diagram of costs: instructions of a step by part, and ratios of alternatives."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from robot_dyn.accuracy.costs.ab_comparison import ABComparison
from robot_dyn.accuracy.costs.cost import Cost
from robot_dyn.accuracy.costs.step_cost import EVERYTHING
from robot_dyn.foundations.display import drawable
from robot_dyn.queries.units import format_duration
from robot_dyn.report.figure import Colours, ResultError, ink, programs, sheet, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_WIDTH, _HEIGHT, _ROW = 13.0, 2.3, 0.42  # [inch]
_BAR = 0.36
_TICKS = (0.2, 0.5, 1, 2, 5, 10, 20, 50, 100, 200, 500)


def draw(result: Cost, theme: str = "light") -> Figure:
    """Draw the figure.

    Raises:
        ResultError: If nothing was counted.
    """
    if not result.alternatives:
        raise ResultError("nothing to draw: nothing was counted; see left_out")
    parts = _parts(result)
    others = [pair for pair in result.alternatives if pair.group != "parts"]
    height = _HEIGHT + _ROW * max(len(parts), len(others))
    figure, colours = sheet(_WIDTH, height, result.sentence, _caption(result), theme)
    grid = figure.add_gridspec(1, 2)
    if parts:
        _draw_parts(figure.add_subplot(grid[0]), parts, colours)
    if others:
        _draw_ratios(figure.add_subplot(grid[1]), others, colours)
    return figure.figure


def _caption(result: Cost) -> str:
    versions = [version for pair in result.alternatives for version in (pair.first, pair.second) if version.times]
    hollow = "" if all(version.repeatable for version in versions) else " Hollow: timing varied by over 5 %."
    return (
        f"{result.robot}: {', '.join(result.acting) or 'no effects'}. Times: shortest processor time over turns."
        f"{hollow} {programs(result.environment, 'llvmlite', 'casadi')}."
    )


def _parts(result: Cost) -> list[tuple[str, int, str]]:
    """Return the parts of a step: names, instructions, and times as text."""
    rows = []
    for pair in result.alternatives:
        if pair.group == "parts" and pair.name == EVERYTHING:
            rows.append(
                ("rigid bodies", pair.second.instructions, _time(pair.second.time_s if pair.second.times else None))
            )
        elif pair.group == "parts":
            time = ", within noise" if pair.within_noise else _time(pair.time_between_s)
            rows.append((pair.name, pair.added, time))
    return rows + ([("shared by several", result.shared, "")] if result.shared else [])


def _time(spent: float | None) -> str:
    return "" if spent is None else f", {'−' * (spent < 0)}{format_duration(abs(spent))}"


def _draw_parts(axes: Axes, parts: list[tuple[str, int, str]], colours: Colours) -> None:
    styled(axes, colours, "instructions", "A step of RK4, by part: with it minus without it")
    names, counts, times = zip(*parts, strict=True)
    whole = sum(counts) or 1
    axes.barh(range(len(parts)), counts, 2 * _BAR, color=colours["lines"][0])
    for place, (n, time) in enumerate(zip(counts, times, strict=True)):  # right of 0: the names are on the left
        label = f" {n} ({100 * n / whole:.1f} %){time}".replace("-", "−")
        axes.text(max(n, 0), place, label, va="center", fontsize=8, **ink(colours))
    _label_rows(axes, names, colours)
    axes.set_xlim(min(0, *counts), 1.7 * max(counts) or 1)


def _draw_ratios(axes: Axes, others: list[ABComparison], colours: Colours) -> None:
    from matplotlib.ticker import NullFormatter

    styled(axes, colours, "ratio, first / second", "Alternatives: instructions in blue, time in orange")
    ratios = np.array([(pair.instructions_ratio, pair.time_ratio) for pair in others], float)
    ratios[~(np.isfinite(ratios) & (ratios > 0))] = np.nan
    axes.set_xscale("log")
    axes.set_xticks(_TICKS, [f"{x:g}" for x in _TICKS])
    axes.xaxis.set_minor_formatter(NullFormatter())
    for k, colour in enumerate(colours["lines"][:2]):
        is_hollow = [k and not (pair.first.repeatable and pair.second.repeatable) for pair in others]
        faces, places = ["none" if x else colour for x in is_hollow], np.arange(len(others)) + (k - 0.5) * _BAR
        axes.barh(places, ratios[:, k] - 1, _BAR, left=1, edgecolor=colour, color=faces)
        for x, y in zip(ratios[:, k], places, strict=True):
            if np.isfinite(x):
                axes.text(max(x, 1), y, f" {x:.2g}", va="center", fontsize=8, **ink(colours))
    axes.axvline(1, color=colours["ink"], linewidth=0.9)
    _label_rows(axes, [f"{pair.name}:\n{pair.first.name} / {pair.second.name}" for pair in others], colours)
    smallest, largest = (np.nanmin(ratios, initial=1.0), np.nanmax(ratios, initial=2.0))
    axes.set_xlim(min(0.7, smallest / 1.2), 1.6 * largest)


def _label_rows(axes: Axes, names: Sequence[str], colours: Colours) -> None:
    """Label the rows by name, from top to bottom."""
    axes.set_yticks(range(len(names)), [drawable(name) for name in names])
    axes.tick_params(axis="y", length=0)
    for label in axes.get_yticklabels():
        label.set(color=colours["ink"], fontsize=8, parse_math=False)
    axes.set_ylim(len(names) - 0.4, -0.6)
    axes.grid(visible=False, axis="y")
