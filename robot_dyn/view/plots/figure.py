"""Drawing of panels: rows of cells with curves, by one renderer, in inches.

Nothing global is set: no pyplot, no rcParams, so that figures can be drawn in any thread and beside other figures.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from textwrap import wrap
from typing import TYPE_CHECKING, Any, final

import numpy as np

from robot_dyn.simulation.observation.remarks import lines
from robot_dyn.simulation.results.trajectory import Trajectory
from robot_dyn.simulation.run.outcome import Ending
from robot_dyn.view.rests import Rest
from robot_dyn.view.series import extremes

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_WILD = 1e3  # times its usual size: what grew beyond it while a run diverged needs a logarithm
_LINE, _WIDE = 0.15, 160  # height of a line of text in [inch], its letters
_ACROSS = 6  # entries of a legend beside each other
NEAR = 0.2  # of its effort limit: a torque that stays below is drawn without it
_MOST_MARKS = 200  # in a cell
_LARGEST = 8e307  # on an axis: Matplotlib takes the difference of its ends
_PIXELS = 1000  # across a cell; of the samples that fall on one, the least and the largest are drawn
THEMES: dict[str, dict[str, Any]] = {  # colours of Okabe and Ito, distinguishable for the colour-blind, by contrast
    "light": {"paper": "#ffffff", "ink": "#1a1a1a", "grid": "#dddddd", "veil": "#eeeeee"}
    | {"lines": ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#000000", "#e69f00", "#56b4e9")},
    "dark": {"paper": "#14171c", "ink": "#e6e6e6", "grid": "#363b44", "veil": "#262b33"}
    | {"lines": ("#56b4e9", "#e69f00", "#00b886", "#cc79a7", "#ffffff", "#f0e442", "#ff7f2a")},
}
_DASHES = ("-", (0, (4, 2)), (0, (1, 1.2)), (0, (6, 2, 1, 2)))
_STOP = 1  # colour of a rest at a stop
DESIRED, _LIMIT = (1, 1), (1, 1)  # colour and dashes of desired values, and of limits


@final
@dataclass(frozen=True, eq=False)
class Curve:
    """y over x, both (m,); `style` numbers its colour and its dashes."""

    label: str
    x: np.ndarray
    y: np.ndarray
    style: tuple[int, int] = (0, 0)


@final
@dataclass(frozen=True)
class Cell:
    """One pair of axes; `limit` is drawn at ±limit, `marks` as dotted lines, what lies after `until` is veiled.

    `rests` are shaded, those at a stop in colour.

    Without `x` it is that of the row below.
    """

    title: str
    x: str
    y: str
    curves: tuple[Curve, ...]
    log: bool = False
    limit: float = np.inf
    until: float = np.inf
    note: str = ""
    marks: tuple[float, ...] = ()
    rests: tuple[Rest, ...] = ()


@final
@dataclass(frozen=True)
class Panel:
    """Rows of cells under a heading; each row is `height` high, in [inch]."""

    heading: str
    rows: tuple[tuple[Cell, ...], ...]
    height: float = 1.25


def draw(panels: list[Panel], run: Trajectory, theme: Mapping[str, Any]) -> Figure:
    """The panels from top to bottom, all lengths in [inch]: sizes do not depend on how much is shown."""
    from matplotlib.figure import Figure

    width, left, right, head = 11.0, 0.9, 0.2, 0.5
    end = run.outcome
    title = f"{run.about.get('robot', 'run')}: {end.ending} at t = {end.t:g} s, {run.statistics.method}"
    remarks = [part for line in lines(run.remarks) for part in wrap(line, _WIDE)]
    opening = [(line, theme["ink"]) for line in (title, end.advice) if line]
    opening += [(line, theme["lines"][1]) for line in remarks]
    tall = (
        0.3
        + _LINE * len(opening)
        + sum(head + sum(p.height + _above(row) + _below(row) for row in p.rows) for p in panels)
    )
    figure = Figure(figsize=(width, tall), facecolor=theme["paper"])
    ink = {"color": theme["ink"], "parse_math": False}
    y = tall - 0.15 - _LINE * len(opening)
    for k, (line, colour) in enumerate(opening, start=1):
        at = 0.15 / width, (tall - 0.15 - _LINE * k) / tall
        figure.text(*at, drawable(_short(line, _WIDE)), fontsize=9, **ink | {"color": colour})
    for panel in panels:
        y -= head
        top = y / tall + 0.15 / tall
        figure.text(0.15 / width, top, drawable(panel.heading), fontsize=11, weight="bold", **ink)
        for cells in panel.rows:
            wide = width / len(panel.rows[0])
            y -= _above(cells) + panel.height
            for k, cell in enumerate(cells):
                box = (wide * k + left) / width, y / tall, (wide - left - right) / width, panel.height / tall
                axes = figure.add_axes(box)
                title = drawable(_short(cell.title, int(wide / 0.08) - len(cell.note)) + cell.note)
                axes.set_title(title, loc="left", x=-0.75 / (wide - left - right), fontsize=8, **ink)
                _fill(axes, cell, theme, run.outcome.ending is Ending.DIVERGED)
                axes.yaxis.set_label_coords(-0.6 / (wide - left - right), 0.5)  # one line, however long the numbers
                if len(panel.rows[0]) == 1:
                    _legend(axes, axes, theme, (1.0, 1.0))
                elif cell is panel.rows[0][0]:  # one legend for all cells of a grid, beside the heading
                    _legend(figure, axes, theme, (1 - right / width, top))
            y -= _below(cells)
    return figure


def _above(cells: tuple[Cell, ...]) -> float:
    """Room for the titles of a row, and for the lines of its legend, in [inch]."""
    lines = -(-len(cells[0].curves) // _ACROSS)
    return 0.3 + 0.15 * (lines - 1) if cells[0].title else 0.02


def _below(cells: tuple[Cell, ...]) -> float:
    """Room for the numbers and the name of the x axis, in [inch]."""
    return 0.5 if cells[0].x else 0.12


def _legend(owner: Any, axes: Any, theme: Mapping[str, Any], corner: tuple[float, float]) -> None:
    """A legend above that corner of the axes or figure; none for a single curve."""
    lines = [line for line in axes.lines if not line.get_label().startswith("_")]
    if len(lines) < 2:
        return
    style = {"ncols": _ACROSS, "frameon": False, "fontsize": 8, "borderpad": 0, "borderaxespad": 0.2}
    legend = owner.legend(handles=lines, loc="lower right", bbox_to_anchor=corner, handlelength=2.5, **style)
    for label in legend.get_texts():
        label.set(color=theme["ink"], parse_math=False)


def _fill(axes: Any, cell: Cell, theme: Mapping[str, Any], diverged: bool) -> None:
    """The curves, limits and scales of a cell. All colours are given to the axes: later ticks take them from there."""
    colours, ink = theme["lines"], {"color": theme["ink"], "parse_math": False, "fontsize": 8}
    framed(axes, theme, 7)
    axes.tick_params(labelbottom=bool(cell.x))
    axes.set_xlabel(cell.x, labelpad=2, **ink)
    axes.set_ylabel(cell.y, **ink)
    curves = [replace(curve, x=_shown(curve.x), y=_shown(curve.y)) for curve in cell.curves]
    log = cell.log and any(np.any(curve.y > 0) for curve in curves)  # of zeros alone there is no logarithm
    for curve in curves:
        x, y = curve.x, np.where(curve.y > 0, curve.y, np.nan) if log else curve.y
        at, (hue, dash) = _thinned(x, y), curve.style
        shape = {"marker": "o", "markersize": 4} if len(x) == 1 else {"linestyle": _DASHES[dash % len(_DASHES)]}
        style = {"color": colours[hue % len(colours)], "linewidth": 1.3, "rasterized": len(at) > 20_000} | shape
        axes.plot(x[at], y[at], label=drawable(_short(curve.label, 30)), **style)
    for level in (-cell.limit, cell.limit) if np.isfinite(cell.limit) else ():
        dashed = {"color": colours[_LIMIT[0]], "linestyle": _DASHES[_LIMIT[1]], "linewidth": 1}
        axes.axhline(level, label="_limit", **dashed)
    axes.vlines(
        cell.marks[:_MOST_MARKS], 0, 1, transform=axes.get_xaxis_transform(), color=theme["ink"], linewidth=0.6,
        linestyle=":", label="_events",
    )  # fmt: skip
    for each in cell.rests:
        shade = {"color": colours[_STOP], "alpha": 0.25} if each.at_stop else {"color": theme["grid"]}
        axes.axvspan(each.start, each.end, linewidth=0, zorder=0.5, label="_rest", **shade)
    if np.isfinite(cell.until):
        axes.axvspan(cell.until, curves[0].x[-1], color=theme["veil"], zorder=0.5, label="_not resolved")
    _scale(axes, "y", np.concatenate([curve.y for curve in curves]), cell.limit, diverged, log)
    begin, end = curves[0].x[[0, -1]]
    if cell.x.startswith("q"):
        _scale(axes, "x", curves[0].x, np.inf, diverged, False)
    else:
        _scale(axes, "x", np.array([begin, end]), np.inf, False, False)
        axes.set_xlim(begin, end if end > begin else begin + 1)


def framed(axes: Any, theme: Mapping[str, Any], size: float) -> None:
    """Axes in the colours of a theme, with a grid below and ticks of that size."""
    axes.set_facecolor(theme["paper"])
    axes.grid(color=theme["grid"], linewidth=0.6)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
    axes.spines[["bottom", "left"]].set_color(theme["ink"])
    axes.tick_params(which="both", colors=theme["ink"], labelsize=size)


def _shown(z: np.ndarray) -> np.ndarray:
    """Return the numbers, nan beyond the range of an axis."""
    return np.where(np.abs(z) < _LARGEST, z, np.nan)


def _scale(axes: Any, side: str, z: np.ndarray, limit: float, diverged: bool, log: bool) -> None:
    """Bounds that show all that is finite; ± the limit too, unless the curve would be flat between such far lines."""
    from matplotlib.ticker import FixedLocator, FuncFormatter, LogLocator, MaxNLocator, NullLocator

    axis = getattr(axes, f"{side}axis")
    z = z[np.isfinite(z) & (z > 0)] if log else z[np.isfinite(z)]
    size = np.abs(z[z != 0]) if np.any(z) else np.ones(1)
    low, high = (float(z.min()), float(z.max())) if len(z) else (-1.0, 1.0)
    if log:
        axes.set_yscale("log")
        bounds = (
            10.0 ** max(np.floor(np.log10(np.quantile(z, 0.01, method="lower"))), -307),
            10.0 ** min(np.ceil(np.log10(high) + 0.01), 308),
        )
        axis.set_major_locator(LogLocator(numticks=6))
    elif diverged and size.max() > _WILD * (usual := np.quantile(size, 0.25, method="lower")):
        getattr(axes, f"set_{side}scale")("symlog", linthresh=usual)  # what led to the end is as legible as the end
        bounds = 2 * min(low, 0.0), 2 * max(high, 0.0)
        powers = 10.0 ** np.linspace(np.log10(usual), np.log10(size.max()), 4).round()[1:]
        axis.set_major_locator(FixedLocator([0.0, *powers, *-powers]))
    else:
        if np.any(z) and size.max() >= NEAR * limit:
            low, high = min(low, -limit), max(high, limit)
        middle = low / 2 + high / 2
        half = max(high / 2 - low / 2, 5e-4 * abs(middle)) or 1.0  # noise on a constant stays noise
        bounds = middle - 1.08 * half, middle + 1.08 * half
        axis.set_major_locator(MaxNLocator(nbins=4, steps=[1, 2, 2.5, 5, 10]))
    axis.set_minor_locator(NullLocator())
    axis.set_major_formatter(
        FuncFormatter(
            lambda x, _: f"{x:.5g}".replace("e+0", "e").replace("e-0", "e-").replace("e+", "e").replace("-", "−")
        )
    )
    getattr(axes, f"set_{side}lim")(*np.clip(bounds, -_LARGEST, _LARGEST))


def _thinned(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Which samples to draw of a long run: of each pixel's the least and the largest, so no peak is lost."""
    every = np.arange(len(y))
    if len(y) <= 4 * _PIXELS:
        return every
    if np.all(x[1:] >= x[:-1]):
        column = ((x - x[0]) * (_PIXELS / (x[-1] - x[0] or 1.0))).astype(int)
        return extremes(y[:, None], np.flatnonzero(np.diff(column, prepend=-1, append=-1)))
    moved = np.zeros(len(y), dtype=bool)
    for z in (x, y):
        size = np.abs(z[np.isfinite(z) & (z != 0)])
        if len(size):  # of a run that diverged, what came before is as large in the picture
            pixel = min(size.max(), _WILD * np.quantile(size, 0.25, method="lower")) / _PIXELS
            moved |= np.diff(np.round(z / pixel), prepend=np.nan) != 0
    moved[[0, -1]] = True
    return every[moved]


def _short(name: str, most: int) -> str:
    """A name cut in its middle: those of one robot differ at their ends."""
    return name if len(name) <= most else f"{name[: most // 2]}…{name[len(name) - (most - 1) // 2 :]}"


def drawable(name: str) -> str:
    """The text with what the font lacks spelled by its code point.

    Otherwise all of it would be the same empty box.
    """
    from matplotlib.font_manager import FontProperties, findfont, get_font

    font = get_font(findfont(FontProperties()))
    return "".join(c if font.get_char_index(ord(c)) else f"\\u{ord(c):04x}" for c in name)
