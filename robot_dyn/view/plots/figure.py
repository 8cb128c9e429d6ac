"""Cells of a figure: one pair of axes each, with curves, limits, marks and scales, in the style of the figure.

No global state is set, neither pyplot nor rcParams, so figures can be drawn in any thread and do not affect others.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, final

import numpy as np

from robot_dyn.foundations.display import drawable
from robot_dyn.view.rests import Rest
from robot_dyn.view.series import thinned

_WILD = 1e3  # times the usual size: values of a diverging run beyond it need a logarithmic scale
NEAR = 0.2  # fraction of the effort limit: for smaller torques the limit is not drawn
_MAX_MARKS = 200  # in a cell
_LARGEST = 8e307  # on an axis: Matplotlib takes the difference of its ends
_PIXELS = 1000  # across a cell
THEMES: dict[str, dict[str, Any]] = {  # colours of Okabe and Ito, distinguishable for the colour-blind, by contrast
    "light": {"paper": "#ffffff", "ink": "#1a1a1a", "grid": "#dddddd", "veil": "#eeeeee"}
    | {"lines": ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#000000", "#e69f00", "#56b4e9")},
    "dark": {"paper": "#14171c", "ink": "#e6e6e6", "grid": "#363b44", "veil": "#262b33"}
    | {"lines": ("#56b4e9", "#e69f00", "#00b886", "#cc79a7", "#ffffff", "#f0e442", "#ff7f2a")},
}
_GREYS = {"paper": "#ffffff", "ink": "#000000", "grid": "#e4e4e4", "veil": "#eeeeee"} | {  # black first: by lightness
    "lines": ("#000000", "#d55e00", "#0072b2", "#8c8c8c", "#009e73", "#e69f00", "#56b4e9")
}
_DASHES = ("-", (0, (4, 2)), (0, (1, 1.2)), (0, (6, 2, 1, 2)))
LOST = 1  # colour of diverged runs, and of rests at a stop
TIME = "t [s]"
DESIRED = 1, 1  # colour and dashes of desired values


@final
@dataclass(frozen=True, eq=False)
class Style:
    """Style of a figure.

    Attributes:
        colours: Colours of paper, ink, grid and lines, as in `THEMES`.
        heading, text, small: Sizes of headings, of titles, and of labels and numbers, in [pt].
        line: Width of a curve, in [pt].
        titled: True if the figure has a title.
    """

    colours: Mapping[str, Any]
    heading: float = 9.0
    text: float = 8.0
    small: float = 7.5
    line: float = 1.2
    titled: bool = True

    @property
    def ink(self) -> dict[str, Any]:
        """Options of text."""
        return {"color": self.colours["ink"], "parse_math": False}


PAPER = Style(_GREYS, heading=8.0, small=7.5, line=0.8, titled=False)
"""For papers: black and dashes first, thin lines, and no title, because papers have captions."""


@final
@dataclass(frozen=True, eq=False)
class Curve:
    """y over x, both (m,).

    Attributes:
        label: Name in the legend; names that begin with _ have no entry.
        style: Indices of its colour and its dashes.
        dots: True to draw points without a line.
        is_scaled: True if the axes are scaled to show it.
    """

    label: str
    x: np.ndarray
    y: np.ndarray
    style: tuple[int, int] = (0, 0)
    dots: bool = False
    is_scaled: bool = True


@dataclass(frozen=True, eq=False)
class Axes:
    """Contents of one pair of axes.

    Attributes:
        title: Text above them.
        x, y: Names of the axes, with their units.
        note: Text after the title.
        own_legend: True if the legend is below the title, because no other cell has the same curves.
    """

    title: str
    x: str
    y: str
    note: str = field(default="", kw_only=True)
    own_legend: bool = field(default=False, kw_only=True)

    def fill(self, axes: Any, style: Style, diverged: bool) -> None:
        """Draw on axes of Matplotlib; `diverged` is True if values may have grown without bound."""
        raise NotImplementedError


@final
@dataclass(frozen=True, eq=False)
class Cell(Axes):
    """Curves with limits, marks, rests and bands.

    Attributes:
        curves: Curves; over time unless `x` names another quantity.
        log: True if y has a logarithmic scale.
        limit: Limit, drawn at ±limit.
        until: Time after which the cell is shaded.
        marks: Times of events, drawn as dotted lines.
        rests: Intervals at rest, shaded; those at a stop in colour.
        bands: Label, lower and upper edge over the x of the first curve, and opacity.
        lost: x of runs that diverged, drawn as crosses at the upper edge.
    """

    curves: tuple[Curve, ...]
    log: bool = False
    limit: float = np.inf
    until: float = np.inf
    marks: tuple[float, ...] = ()
    rests: tuple[Rest, ...] = ()
    bands: tuple[tuple[str, np.ndarray, np.ndarray, float], ...] = ()
    lost: np.ndarray = field(default_factory=lambda: np.empty(0))

    def fill(self, axes: Any, style: Style, diverged: bool) -> None:
        """Draw the curves, limits and scales."""
        theme, colours = style.colours, style.colours["lines"]
        log = self.log and any(np.any(curve.y > 0) for curve in self.curves)
        for curve in self.curves:
            self._draw(curve, axes, style, log)
        first = self.curves[0].x
        for label, low, high, alpha in self.bands:
            axes.fill_between(first, low, high, color=colours[0], alpha=alpha, linewidth=0, label=label)
        for level in (-self.limit, self.limit) if np.isfinite(self.limit) else ():
            axes.axhline(level, label="_limit", color=theme["ink"], alpha=0.7, linestyle=_DASHES[3], linewidth=0.6)
        upright = {"transform": axes.get_xaxis_transform()}
        dotted = {"color": theme["ink"], "linewidth": 0.6, "linestyle": ":"}
        axes.vlines(self.marks[:_MAX_MARKS], 0, 1, label="_events", **dotted, **upright)
        for rest in self.rests:
            shade = {"color": colours[LOST], "alpha": 0.25} if rest.at_stop else {"color": theme["grid"]}
            axes.axvspan(rest.start, rest.end, linewidth=0, zorder=0.5, label="_rest", **shade)
        if np.isfinite(self.until):
            axes.axvspan(self.until, first[-1], color=theme["veil"], zorder=0.5, label="_not resolved")
        if len(self.lost):
            crosses = {"linestyle": "", "marker": "x", "markersize": 4, "color": colours[LOST], "clip_on": False}
            axes.plot(self.lost, np.ones(len(self.lost)), label=f"diverged ({len(self.lost)})", **crosses, **upright)
        edges = [edge for _, low, high, _ in self.bands for edge in (low, high)]
        y = np.concatenate([*edges, *(curve.y for curve in self.curves if curve.is_scaled)])
        if not np.isfinite(y).any():
            y = np.concatenate([curve.y for curve in self.curves])
        scale(axes, "y", y, self.limit, diverged, log)
        if self.x == TIME:
            begin, end = first[[0, -1]]
            scale(axes, "x", np.array([begin, end]), counts=False)
            axes.set_xlim(begin, end if end > begin else begin + 1)
        else:
            scale(axes, "x", np.concatenate([first, self.lost]), np.inf, diverged)

    @staticmethod
    def _draw(curve: Curve, axes: Any, style: Style, log: bool) -> None:
        """Draw a curve as a line, or as dots; a single point is a dot."""
        x, y = (np.where(np.abs(z) < _LARGEST, z, np.nan) for z in (curve.x, curve.y))
        y = np.where(y > 0, y, np.nan) if log else y
        if curve.dots or np.isfinite(y).sum() == 1:
            shape = {"marker": "o", "markersize": 3, "linestyle": ""}
        else:
            at = _thinned(x, y)
            x, y = x[at], y[at]
            shape = {"linestyle": _DASHES[curve.style[1] % len(_DASHES)]}
        hue = style.colours["lines"][curve.style[0] % len(style.colours["lines"])]
        width = style.line if curve.is_scaled else style.line / 2
        shape |= {"color": hue, "linewidth": width, "rasterized": len(y) > 20_000}
        axes.plot(x, y, label=drawable(shortened(curve.label, 30)), **shape)


def framed(axes: Any, theme: Mapping[str, Any], size: float) -> None:
    """Set the colours of axes from a theme, draw a grid below the curves, and set the size of tick labels."""
    axes.set_facecolor(theme["paper"])
    axes.grid(color=theme["grid"], linewidth=0.5)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
    axes.spines[["bottom", "left"]].set_color(theme["ink"])
    axes.tick_params(which="both", colors=theme["ink"], labelsize=size)
    axes.xaxis.get_offset_text().set(color=theme["ink"], size=size)


def scale(
    axes: Any,
    side: str,
    z: np.ndarray,
    limit: float = np.inf,
    diverged: bool = False,
    log: bool = False,
    counts: bool = True,
) -> None:
    """Set bounds that include all finite values, and as many tick labels as fit.

    Args:
        axes: Axes of Matplotlib.
        side: "x" or "y".
        z: Values.
        limit: Limit to include at ±limit, unless this would flatten the curve.
        diverged: True if values may have grown without bound.
        log: True if the scale is logarithmic.
        counts: True to label whole numbers only, if all values are whole numbers.
    """
    from matplotlib.ticker import FixedLocator, FuncFormatter, LogLocator, MaxNLocator, NullLocator, ScalarFormatter

    axis = getattr(axes, f"{side}axis")
    z = z[(np.abs(z) < _LARGEST) & (z > 0 if log else True)]
    size = np.abs(z[z != 0]) if np.any(z) else np.ones(1)
    low, high = (float(z.min()), float(z.max())) if len(z) else (-1.0, 1.0)
    if log and len(z):
        axes.set_yscale("log")
        bounds = (
            10.0 ** max(np.floor(np.log10(np.quantile(z, 0.01, method="lower"))), -307),
            10.0 ** min(np.ceil(np.log10(high) + 0.01), 308),
        )
        axis.set_major_locator(LogLocator())
    elif diverged and size.max() > _WILD * (usual := np.quantile(size, 0.25, method="lower")):
        getattr(axes, f"set_{side}scale")("symlog", linthresh=usual)  # small values before the end stay legible
        bounds = 2 * min(low, 0.0), 2 * max(high, 0.0)
        powers = 10.0 ** np.linspace(np.log10(usual), np.log10(size.max()), 4).round()[1:]
        axis.set_major_locator(FixedLocator([0.0, *powers, *-powers]))
    else:
        if np.any(z) and size.max() >= NEAR * limit:
            low, high = min(low, -limit), max(high, limit)
        middle = low / 2 + high / 2
        half = max(high / 2 - low / 2, 5e-4 * abs(middle)) or 1.0  # noise on a constant stays noise
        bounds = middle - 1.08 * half, middle + 1.08 * half
        whole = counts and high - low >= 1 and bool(np.all(z == np.round(z)))
        axis.set_major_locator(MaxNLocator("auto", steps=[1, 2, 5, 10], integer=whole))
    axis.set_minor_locator(NullLocator())
    axis.set_major_formatter(FuncFormatter(lambda x, _: _tick(x, max(map(abs, bounds)) < 0.01)))
    if side == "x" and axis.get_scale() == "linear":  # a common factor shortens the labels
        axis.set_major_formatter(ScalarFormatter(useOffset=False))
        axes.ticklabel_format(axis="x", scilimits=(-2, 5))
    getattr(axes, f"set_{side}lim")(*np.clip(bounds, -_LARGEST, _LARGEST))


def _tick(x: float, is_small: bool) -> str:
    """Return a tick label: such as 5e−4 if numbers are small, otherwise with up to five digits."""
    scientific = x and (is_small or not 1e-4 <= abs(x) < 1e5)
    if not scientific:
        return f"{x:.5g}".replace("-", "−")
    mantissa, exponent = f"{x:.4e}".split("e")
    return f"{float(mantissa):g}e{int(exponent)}".replace("-", "−")


def _thinned(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return the samples of a long curve to draw: the smallest and largest in each pixel of an increasing x.

    Where x reverses, as in a phase portrait, samples that reach another pixel are drawn.
    """
    if len(y) <= 4 * _PIXELS or np.all(x[1:] >= x[:-1]):
        return thinned(y[:, None], _PIXELS)
    moved = np.zeros(len(y), dtype=bool)
    for z in (x, y):
        size = np.abs(z[np.isfinite(z) & (z != 0)])
        if len(size):  # show the time before a divergence at its usual scale
            pixel = min(size.max(), _WILD * np.quantile(size, 0.25, method="lower")) / _PIXELS
            moved |= np.diff(np.round(z / pixel), prepend=np.nan) != 0
    moved[[0, -1]] = True
    return np.flatnonzero(moved)


def shortened(name: str, most: int) -> str:
    """Return a name shortened in the middle, because names of one robot differ at their ends."""
    return name if len(name) <= most else f"{name[: most // 2]}…{name[len(name) - (most - 1) // 2 :]}"
