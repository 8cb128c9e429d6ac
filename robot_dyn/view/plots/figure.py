"""Cells of a figure: one pair of axes each, with curves, limits, marks and scales, in the style of a figure.

Nothing global is set: no pyplot, no rcParams, so that figures can be drawn in any thread and beside other figures.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any, final

import numpy as np

from robot_dyn.foundations.display import drawable
from robot_dyn.view.rests import Rest
from robot_dyn.view.series import thinned

_WILD = 1e3  # times its usual size: what grew beyond it while a run diverged needs a logarithm
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
_GREYS = {"paper": "#ffffff", "ink": "#000000", "grid": "#e4e4e4", "veil": "#eeeeee"} | {  # black first: by lightness
    "lines": ("#000000", "#d55e00", "#0072b2", "#8c8c8c", "#009e73", "#e69f00", "#56b4e9")
}
_DASHES = ("-", (0, (4, 2)), (0, (1, 1.2)), (0, (6, 2, 1, 2)))
_STOP = 1  # colour of a rest at a stop
DESIRED = 1, 1  # colour and dashes of desired values


@final
@dataclass(frozen=True, eq=False)
class Style:
    """How a figure is drawn.

    Attributes:
        colours: Of paper, ink, grid and lines, as in `THEMES`.
        heading, text, small: Sizes of headings, of titles, and of labels and numbers, in [pt].
        line: Width of a curve, in [pt].
        titled: Whether it is headed by what it shows.
    """

    colours: Mapping[str, Any]
    heading: float = 9.0
    text: float = 8.0
    small: float = 7.5
    line: float = 1.2
    titled: bool = True

    @property
    def ink(self) -> dict[str, Any]:
        """How text is written."""
        return {"color": self.colours["ink"], "parse_math": False}


PAPER = Style(_GREYS, heading=8.0, small=7.5, line=0.8, titled=False)
"""For a page of a paper: black and dashes first, thin lines, no title, since its caption is text."""


@final
@dataclass(frozen=True, eq=False)
class Curve:
    """y over x, both (m,); `style` numbers its colour and its dashes."""

    label: str
    x: np.ndarray
    y: np.ndarray
    style: tuple[int, int] = (0, 0)


@dataclass(frozen=True, eq=False)
class Axes:
    """What stands on one pair of axes.

    Attributes:
        title: Text above them.
        x, y: Names of the axes, with their units; without `x` it is that of the row below.
        note: Small text beside the title.
    """

    title: str
    x: str
    y: str
    note: str = field(default="", kw_only=True)

    def fill(self, axes: Any, style: Style, diverged: bool) -> None:
        """Draw on axes of Matplotlib; `diverged` says that values may have grown without bound."""
        raise NotImplementedError


@final
@dataclass(frozen=True, eq=False)
class Cell(Axes):
    """Curves; `limit` is drawn at ±limit, `marks` as dotted lines, what lies after `until` is veiled.

    `rests` are shaded, those at a stop in colour.
    """

    curves: tuple[Curve, ...]
    log: bool = False
    limit: float = np.inf
    until: float = np.inf
    marks: tuple[float, ...] = ()
    rests: tuple[Rest, ...] = ()

    def fill(self, axes: Any, style: Style, diverged: bool) -> None:
        """The curves, limits and scales."""
        theme, colours = style.colours, style.colours["lines"]
        named(axes, self, style)
        curves = [replace(curve, x=_shown(curve.x), y=_shown(curve.y)) for curve in self.curves]
        log = self.log and any(np.any(curve.y > 0) for curve in curves)  # of zeros alone there is no logarithm
        for curve in curves:
            x, y = curve.x, np.where(curve.y > 0, curve.y, np.nan) if log else curve.y
            at, (hue, dash) = _thinned(x, y), curve.style
            shape = (
                {"marker": "o", "markersize": 3.5}
                if np.isfinite(y).sum() == 1
                else {"linestyle": _DASHES[dash % len(_DASHES)]}
            )
            drawn = {"color": colours[hue % len(colours)], "linewidth": style.line, "rasterized": len(at) > 20_000}
            axes.plot(x[at], y[at], label=drawable(shortened(curve.label, 30)), **drawn | shape)
        for level in (-self.limit, self.limit) if np.isfinite(self.limit) else ():
            axes.axhline(level, label="_limit", color=theme["ink"], alpha=0.7, linestyle=_DASHES[3], linewidth=0.6)
        axes.vlines(
            self.marks[:_MOST_MARKS], 0, 1, transform=axes.get_xaxis_transform(), color=theme["ink"], linewidth=0.6,
            linestyle=":", label="_events",
        )  # fmt: skip
        for each in self.rests:
            shade = {"color": colours[_STOP], "alpha": 0.25} if each.at_stop else {"color": theme["grid"]}
            axes.axvspan(each.start, each.end, linewidth=0, zorder=0.5, label="_rest", **shade)
        if np.isfinite(self.until):
            axes.axvspan(self.until, curves[0].x[-1], color=theme["veil"], zorder=0.5, label="_not resolved")
        scale(axes, "y", np.concatenate([curve.y for curve in curves]), self.limit, diverged, log)
        begin, end = curves[0].x[[0, -1]]
        if self.x.startswith("q"):
            scale(axes, "x", curves[0].x, np.inf, diverged, False)
        else:
            scale(axes, "x", np.array([begin, end]), np.inf, False, False)
            axes.set_xlim(begin, end if end > begin else begin + 1)


def named(axes: Any, cell: Axes, style: Style) -> None:
    """Axes with their names. All colours are given to the axes: later ticks take them from there."""
    framed(axes, style.colours, style.small - 0.5)
    axes.tick_params(labelbottom=bool(cell.x), length=2, pad=2)
    axes.set_xlabel(drawable(cell.x), labelpad=1, fontsize=style.small, **style.ink)
    axes.set_ylabel(drawable(cell.y), fontsize=style.small, **style.ink)


def framed(axes: Any, theme: Mapping[str, Any], size: float) -> None:
    """Axes in the colours of a theme, with a grid below and ticks of that size."""
    axes.set_facecolor(theme["paper"])
    axes.grid(color=theme["grid"], linewidth=0.5)
    axes.set_axisbelow(True)
    axes.spines[["top", "right"]].set_visible(False)
    axes.spines[["bottom", "left"]].set_color(theme["ink"])
    axes.tick_params(which="both", colors=theme["ink"], labelsize=size)


def _shown(z: np.ndarray) -> np.ndarray:
    """Return the numbers, nan beyond the range of an axis."""
    return np.where(np.abs(z) < _LARGEST, z, np.nan)


def scale(axes: Any, side: str, z: np.ndarray, limit: float, diverged: bool, log: bool) -> None:
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
        steps = [1, 2, 5, 10] if _small(bounds) else [1, 2, 2.5, 5, 10]  # −1.5e−3 would reach into the label
        axis.set_major_locator(MaxNLocator(nbins=4, steps=steps))
    axis.set_minor_locator(NullLocator())
    axis.set_major_formatter(FuncFormatter(lambda x, _: _tick(x, _small(bounds))))
    getattr(axes, f"set_{side}lim")(*np.clip(bounds, -_LARGEST, _LARGEST))


def _small(bounds: tuple[float, float]) -> bool:
    """Whether numbers at an axis are shorter as powers of ten: 5e−4 in place of 0.0005."""
    return max(map(abs, bounds)) < 0.01


def _tick(x: float, small: bool) -> str:
    """A number at an axis."""
    if small and x:
        mantissa, exponent = f"{x:.4e}".split("e")
        return f"{float(mantissa):g}e{int(exponent)}".replace("-", "−")
    return f"{x:.5g}".replace("e+0", "e").replace("e-0", "e-").replace("e+", "e").replace("-", "−")


def _thinned(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Which samples to draw of a long run: of each pixel's the least and the largest, so no peak is lost."""
    if len(y) <= 4 * _PIXELS or np.all(x[1:] >= x[:-1]):
        return thinned(y[:, None], _PIXELS)
    moved = np.zeros(len(y), dtype=bool)
    for z in (x, y):
        size = np.abs(z[np.isfinite(z) & (z != 0)])
        if len(size):  # of a run that diverged, what came before is as large in the picture
            pixel = min(size.max(), _WILD * np.quantile(size, 0.25, method="lower")) / _PIXELS
            moved |= np.diff(np.round(z / pixel), prepend=np.nan) != 0
    moved[[0, -1]] = True
    return np.flatnonzero(moved)


def shortened(name: str, most: int) -> str:
    """A name cut in its middle: those of one robot differ at their ends."""
    return name if len(name) <= most else f"{name[: most // 2]}…{name[len(name) - (most - 1) // 2 :]}"
