"""The work-precision diagram: error over time and evaluations, energy residual, Pareto front, reference error."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from robot_dyn.accuracy.work_precision_diagram.tolerance_ladder import INTERPRETED, Point, ToleranceLadder
from robot_dyn.accuracy.work_precision_diagram.work_precision import WorkPrecision, program_of
from robot_dyn.report.figure import Colours, ResultError, key, legend, programs, sheet, styled

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_LOOK = {  # theme colour and marker, by family: explicit, Gauss, stiff, adaptive
    "DOP853": (0, "o"), "Rosenbrock": (3, "o"), "order_8": (6, "s"), "rk4": (1, "D"), "midpoint": (5, "<"),
    "explicit_euler": (5, "^"), "semi_implicit_euler": (5, "v"), "gauss_2": (2, "<"), "gauss_4": (2, ">"),
    "gauss_6": (2, "h"), "rosenbrock_5": (3, "s"),
}  # fmt: skip
_PEERS = {
    "SciPy DOP853 + pin.aba": "x", "SciPy Radau + pin.aba": "+", "SciPy LSODA + pin.aba": "1", "MuJoCo RK4": "D",
    "MuJoCo Euler": "^", "MuJoCo implicitfast": "v", "Drake runge_kutta3": "P", "heyoka, Taylor": "*",
}  # fmt: skip
_MOST_ERROR = 3.0  # [rad] or [m]; larger errors are meaningless and not drawn
_MOST_METHODS, _SIX_DIGITS = 8, 1e-6  # in one panel; [rad] or [m]
_WIDTH, _HEIGHT = 13.0, 8.0  # [inch]
_DASHED = (0, (6, 3))  # of a line


def draw(result: WorkPrecision, theme: str = "light") -> Figure:
    """Draw the diagram.

    Raises:
        ResultError: If no run finished.
    """
    if not any(np.isfinite(p.error) for each in result.ladders for p in each.points):
        raise ResultError("no run ended, so there is nothing to draw; look at left_out")
    figure, colours = sheet(_WIDTH, _HEIGHT, result.sentence, _caption(result), theme)
    grid = figure.add_gridspec(3, 2, width_ratios=(2.1, 1))
    first = [each for each in result.ladders if each.peer or (each.events and each.engine != INTERPRETED)]
    first = first if any(not each.peer for each in first) else list(result.ladders)
    first = most_precise(first)
    own = [each for each in first if not each.peer]
    slow = [each for each in result.ladders if each.engine == INTERPRETED and each not in first]
    names = {each.method for each in first}
    without = [each for each in result.ladders if not each.events and not each.peer and each.method in names]
    main = figure.add_subplot(grid[:, 0])
    _axes(main, result, colours, "time of the run [ms]", "Error over time: lower left is better")
    _front(main, result, colours)
    for each in first + without:
        _curve(main, each, colours, _ms, _error, 1.0 if each.events else 0.9, dashed=not each.events)
    times = [_ms(p) for each in first + without for p in _shown(each)]
    main.set(xlim=(min(times) / 1.5, max(times) * 1.5), ylim=(result.reference.error / 10, _MOST_ERROR))
    _believed(main, result, colours)
    _legend(figure, first, without, colours)
    small = [figure.add_subplot(grid[k, 1]) for k in range(3)]
    _axes(small[0], result, colours, "evaluations of the equation of motion", "Error over evaluations")
    for each in [each for each in first + without if any(p.evaluations for p in each.points)]:
        _curve(small[0], each, colours, lambda p: p.evaluations, _error, 0.6, dashed=not each.events)
    _axes(small[1], result, colours, "error of q", "Energy residual, as a part of what was exchanged")
    for each in own:
        _curve(small[1], each, colours, _error, lambda p: p.energy, 0.6)
    small[1].set_ylabel("residual")
    small[1].set_xlim(_MOST_ERROR, result.reference.error / 3)
    words = "Error over time, interpreted [ms]" if slow else "Error over steps"
    _axes(small[2], result, colours, "time [ms]" if slow else "steps", words)
    for each in slow or own:
        _curve(small[2], each, colours, _ms if slow else _steps, _error, 0.6)
    for axes in (small[0], small[2]):
        axes.set_ylim(result.reference.error / 10, _MOST_ERROR)
        _believed(axes, result, colours)
    return figure.figure


def most_precise(ladders: list[ToleranceLadder]) -> list[ToleranceLadder]:
    """Eight at most: of each program the one that reaches six digits soonest, then the next ones, in their order."""

    def soon(ladder: ToleranceLadder) -> float:
        price = ladder.price(_SIX_DIGITS)
        return np.inf if price is None else price.value

    by_time = sorted(ladders, key=soon)
    first = {program_of(each): each for each in reversed(by_time)}.values()
    chosen = [*first, *(each for each in by_time if not any(each is one for one in first))][:_MOST_METHODS]
    return [each for each in ladders if any(each is one for one in chosen)]


def _ms(p: Point) -> float:
    return 1e3 * p.time_s


def _error(p: Point) -> float:
    return p.error


def _steps(p: Point) -> float:
    return float(p.steps or np.nan)


def _caption(result: WorkPrecision) -> str:
    """The runs, and the reference for their errors."""
    of = result.reference
    cut = f" of {result.duration_s:g} s, where its references part" if of.parted_s is not None else ""
    return (
        f"{result.robot}: {', '.join(result.acting) or 'no effects'}; {of.horizon_s:g} s{cut}.  Error: largest"
        f" |q − q_ref| over joints and {of.records} records, in {result.unit}.\n"
        f"Reference: {of.methods[0]}, {of.error:.0e} {result.unit} from {of.methods[1]}: no error below that is"
        f" believed.  {programs(result.environment, 'scipy', 'mujoco', 'drake', 'heyoka')}."
    )


def _shown(ladder: ToleranceLadder) -> list[Point]:
    return [p for p in ladder.points if p.error < _MOST_ERROR]


def _axes(axes: Any, result: WorkPrecision, colours: Colours, x: str, title: str) -> None:
    from matplotlib.ticker import NullFormatter

    axes.set(xscale="log", yscale="log")
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.yaxis.set_minor_formatter(NullFormatter())
    styled(axes, colours, x, title, f"error of q [{result.unit}]")


def _curve(
    axes: Any, ladder: ToleranceLadder, colours: Colours, x: Callable[[Point], Any], y: Callable[[Point], float],
    size: float, dashed: bool = False,
) -> None:  # fmt: skip
    """Draw the runs of a ladder, with hollow markers for those without a believed error or a repeatable time."""
    colour, marker = _look(ladder, colours)
    points = [p for p in _shown(ladder) if y(p) > 0]
    style = "--" if ladder.peer else ":" if dashed else "-"
    bold = 1.9 if ladder.method in ("DOP853", "Rosenbrock") else 1.1
    xs, ys = [x(p) for p in points], [y(p) for p in points]
    axes.plot(xs, ys, style, color=colour, linewidth=size * bold)
    for measured, face in ((True, colour), (False, colours["paper"])):
        at = [k for k, p in enumerate(points) if (p.believed and p.repeatable) is measured]
        shape = {"marker": marker, "s": 30 * size**2, "color": colour, "zorder": 3, "linewidths": 0.9}
        faced = {} if marker in "x+1" else {"facecolors": face}
        axes.scatter([xs[k] for k in at], [ys[k] for k in at], **shape, **faced)


def _look(ladder: ToleranceLadder, colours: Colours) -> tuple[str, str]:
    if ladder.peer:
        return colours["ink"], _PEERS.get(ladder.method, ".")
    hue, marker = _LOOK.get(ladder.method, (4, "."))
    return colours["lines"][hue], marker


def _front(axes: Any, result: WorkPrecision, colours: Colours) -> None:
    front = [(1e3 * p.time_s, p.error) for _, p in result.front if p.error < _MOST_ERROR]
    if front:
        x, y = zip(*front, strict=True)
        axes.plot(x, y, color=colours["grid"], linewidth=9, solid_capstyle="round", solid_joinstyle="round", zorder=0.8)


def _believed(axes: Any, result: WorkPrecision, colours: Colours) -> None:
    """Draw the error of the reference as a line, and shade the range below it."""
    error = result.reference.error
    axes.axhline(error, color=colours["ink"], linestyle=_DASHED, linewidth=0.9)
    axes.axhspan(axes.get_ylim()[0], error, color=colours["veil"], zorder=0.5)


def _legend(figure: Any, first: list[ToleranceLadder], without: list[ToleranceLadder], colours: Colours) -> None:
    handles = []
    for each in first:
        colour, marker = _look(each, colours)
        order = "" if each.order is None else f"{each.order}"
        seen = f"{each.measured_order:.1f}" if each.measured_order is not None else "–"
        label = f"{each.name}: order {seen} ({order})" if order else each.name
        handles.append(key(label, colour, marker=marker, markersize=5, linestyle="--" if each.peer else "-"))
    handles.append(key("no run beats these (Pareto front)", colours["grid"], linewidth=9))
    handles.append(key("error of the reference: not believed below", colours["ink"], linestyle=_DASHED, linewidth=0.9))
    if without:
        handles.append(key("dotted: the same without events", colours["ink"], linestyle=":"))
    legend(
        figure, handles, colours, "measured order (nominal); hollow: not believed, or a time that did not repeat to 5 %"
    )
