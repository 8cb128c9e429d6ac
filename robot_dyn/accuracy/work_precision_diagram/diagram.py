"""Work-precision diagram: error over time and evaluations, energy residual, Pareto front, error of the reference."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from robot_dyn.accuracy.work_precision_diagram.method_under_test import INTERPRETED, Point, ToleranceLadder
from robot_dyn.accuracy.work_precision_diagram.work_precision import WorkPrecision, named, program_of
from robot_dyn.report.figure import Colours, ResultError, key, legend, programs, sheet, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure
    from matplotlib.gridspec import SubplotSpec

_LOOK = {  # theme colour and marker, by family: explicit, Gauss, stiff, adaptive
    "DOP853": (0, "o"), "Rodas5P": (3, "o"), "DP8": (6, "s"), "RK4": (1, "D"), "Midpoint": (5, "<"),
    "Euler": (5, "^"), "SemiImplicitEuler": (5, "v"), "GaussLegendre2": (2, "<"), "GaussLegendre4": (2, ">"),
    "GaussLegendre6": (2, "h"), "Rodas5PFixed": (3, "s"),
}  # fmt: skip
_PEERS = {
    "SciPy DOP853 + pin.aba": "x", "SciPy Radau + pin.aba": "+", "SciPy LSODA + pin.aba": "1", "MuJoCo RK4": "D",
    "MuJoCo Euler": "^", "MuJoCo implicitfast": "v", "MuJoCo discrete": "<", "Drake runge_kutta3": "P",
    "heyoka, Taylor": "*",
}  # fmt: skip
_MAX_ERROR = 3.0  # [rad] or [m]; larger errors are meaningless and not drawn
_MAX_METHODS, _SIX_DIGITS = 8, 1e-6  # in one panel; [rad] or [m]
_WIDTH, _HEIGHT = 13.0, 8.0  # [inch]
_DASHED = (0, (6, 3))  # line style
_LABELS = {  # axis labels, by attribute of a point
    "time_s": "time of the run [s]", "evaluations": "evaluations of the equation of motion", "steps": "steps",
    "error": "error of q", "energy": "residual",
}  # fmt: skip


def draw(result: WorkPrecision, theme: str = "light") -> Figure:
    """Draw the diagram.

    Raises:
        ResultError: If no run finished.
    """
    if not any(np.isfinite(p.error) for ladder in result.ladders for p in ladder.points):
        raise ResultError("nothing to draw: no run finished; see left_out")
    versions = programs(result.environment, "scipy", "mujoco", "drake", "heyoka")
    caption = "\n".join([*result.basis, versions])
    figure, colours = sheet(_WIDTH, _HEIGHT, result.sentence, caption, theme)
    grid = figure.add_gridspec(3, 2, width_ratios=(2.1, 1))
    first = [ladder for ladder in result.ladders if ladder.peer or (ladder.events and ladder.engine != INTERPRETED)]
    first = first if any(not ladder.peer for ladder in first) else list(result.ladders)
    first = most_precise(first, [ladder for ladder, _ in named(result, result.usual_digits)])
    ours = [ladder for ladder in first if not ladder.peer]
    slow = [ladder for ladder in result.ladders if ladder.engine == INTERPRETED and ladder not in first]
    names = {ladder.method for ladder in first}
    without = [x for x in result.ladders if not x.events and not x.peer and x.method in names]
    panel = partial(_panel, figure, result, colours)
    main = panel(grid[:, 0], first + without, "time_s", "Error over time: lower left is better", size=1.0)
    _front(main, result, colours)
    panel(grid[0, 1], first + without, "evaluations", "Error over evaluations")
    panel(grid[1, 1], ours, "error", "Energy residual, as a fraction of the energy exchanged", "energy")
    if slow:
        panel(grid[2, 1], slow, "time_s", "Error over time, interpreted")
    else:
        panel(grid[2, 1], ours, "steps", "Error over steps")
    _legend(figure, first + [x for x in slow if x.method not in names and _shown(x)], without, colours)
    return figure.figure


def most_precise(ladders: list[ToleranceLadder], always: Sequence[ToleranceLadder] = ()) -> list[ToleranceLadder]:
    """Return up to eight ladders, and those that are always drawn, in their original order.

    The fastest ladder of each program to six digits is chosen first, then the next fastest ones.
    """

    def time_to_six_digits(ladder: ToleranceLadder) -> float:
        price = ladder.price(_SIX_DIGITS)
        return np.inf if price is None else price.value

    by_time = sorted(ladders, key=time_to_six_digits)
    fastest = {program_of(ladder): ladder for ladder in reversed(by_time)}.values()
    chosen = sorted(by_time, key=lambda ladder: ladder not in fastest)[:_MAX_METHODS]
    return [ladder for ladder in ladders if ladder in chosen or ladder in always]


def _panel(
    figure: SubFigure,
    result: WorkPrecision,
    colours: Colours,
    cell: SubplotSpec,
    ladders: list[ToleranceLadder],
    x: str,
    title: str,
    y: str = "error",
    size: float = 0.6,
) -> Axes:
    """Draw quantity y over quantity x for the runs of ladders, on logarithmic scales.

    If y is the error, a line marks the error of the reference, and the range below it is shaded.
    """
    from matplotlib.ticker import LogFormatterSciNotation, NullFormatter

    axes, floor = figure.add_subplot(cell), result.reference.error
    axes.set(xscale="log", yscale="log")
    axes.xaxis.set_minor_formatter(LogFormatterSciNotation(minor_thresholds=(1.5, 0.5)))  # below 1.5 powers of ten
    axes.yaxis.set_minor_formatter(NullFormatter())
    labels = _LABELS | {"error": f"{_LABELS['error']} [{result.unit}]"}
    styled(axes, colours, labels[x], title, labels[y])
    for ladder in ladders:
        _curve(axes, ladder, colours, x, y, size)
    if y == "error":
        axes.set_ylim(floor / 10, _MAX_ERROR)
        axes.axhline(floor, color=colours["ink"], linestyle=_DASHED, linewidth=0.9)
        axes.axhspan(floor / 10, floor, color=colours["veil"], zorder=0.5)
    else:
        axes.set_xlim(_MAX_ERROR, floor / 3)
    return axes


def _shown(ladder: ToleranceLadder, x: str = "time_s", y: str = "error") -> list[Point]:
    """Return the runs of a ladder that are drawn."""
    return [p for p in ladder.points if p.error < _MAX_ERROR and getattr(p, x) and getattr(p, y) > 0]


def _curve(axes: Axes, ladder: ToleranceLadder, colours: Colours, x: str, y: str, size: float) -> None:
    """Draw the runs of a ladder, with hollow markers for an unresolved error or a time that does not repeat."""
    colour, marker = _look(ladder, colours)
    points = _shown(ladder, x, y)
    places = np.array([(getattr(p, x), getattr(p, y)) for p in points]).reshape(-1, 2)
    style = "--" if ladder.peer else "-" if ladder.events else ":"
    bold = 1.9 if ladder.method in ("DOP853", "Rodas5P") else 1.1
    axes.plot(*places.T, style, color=colour, linewidth=size * bold)
    filled = np.array([p.resolved and p.repeatable for p in points], bool)
    for some, face in ((places[filled], colour), (places[~filled], colours["paper"])):
        faced = {} if marker in "x+1" else {"facecolors": face}
        axes.scatter(*some.T, s=30 * size**2, marker=marker, color=colour, zorder=3, linewidths=0.9, **faced)


def _look(ladder: ToleranceLadder, colours: Colours) -> tuple[str, str]:
    if ladder.peer:
        return colours["ink"], _PEERS.get(ladder.method, ".")
    hue, marker = _LOOK.get(ladder.method, (4, "."))
    return colours["lines"][hue], marker


def _front(axes: Axes, result: WorkPrecision, colours: Colours) -> None:
    front = [(p.time_s, p.error) for _, p in result.front if p.error < _MAX_ERROR]
    if front:
        x, y = zip(*front, strict=True)
        axes.plot(x, y, color=colours["grid"], linewidth=9, solid_capstyle="round", solid_joinstyle="round", zorder=0.8)


def _legend(figure: SubFigure, first: list[ToleranceLadder], without: list[ToleranceLadder], colours: Colours) -> None:
    handles = []
    for ladder in first:
        colour, marker = _look(ladder, colours)
        order = "" if ladder.order is None else f"{ladder.order}"
        measured = f"{ladder.measured_order:.1f}" if ladder.measured_order is not None else "–"
        label = f"{ladder.name}: order {measured} ({order})" if order else ladder.name
        handles.append(key(label, colour, marker=marker, markersize=5, linestyle="--" if ladder.peer else "-"))
    handles.append(key("Pareto front", colours["grid"], linewidth=9))
    handles.append(key("error of the reference", colours["ink"], linestyle=_DASHED, linewidth=0.9))
    if without:
        handles.append(key("dotted: same method without events", colours["ink"], linestyle=":"))
    note = "measured order (nominal); hollow: below the reference error, or timing varied by over 5 %"
    legend(figure, handles, colours, note)
