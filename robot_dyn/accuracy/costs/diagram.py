"""What parts and algorithms cost, drawn: instructions of a step by part, and ratios of alternatives."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from robot_dyn.accuracy.costs.ab_comparison import ABComparison
from robot_dyn.accuracy.costs.cost import Cost
from robot_dyn.accuracy.costs.step_cost import EVERYTHING
from robot_dyn.foundations.display import drawable
from robot_dyn.queries.units import format_duration
from robot_dyn.report.figure import Colours, ResultError, ink, programs, sheet, styled

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_WIDTH, _HEIGHT, _ROW = 13.0, 2.3, 0.42  # [inch]
_BAR = 0.36
_TICKS = (0.2, 0.5, 1, 2, 5, 10, 20, 50, 100, 200, 500)


def draw(result: Cost, theme: str = "light") -> Figure:
    """The figure.

    Raises:
        ResultError: If nothing was counted.
    """
    if not result.alternatives:
        raise ResultError("nothing was counted, so there is nothing to draw; look at left_out")
    parts = _parts(result)
    others = [each for each in result.alternatives if each.group != "parts"]
    height = _HEIGHT + _ROW * max(len(parts), len(others))
    figure, colours = sheet(_WIDTH, height, result.sentence, _caption(result), theme)
    grid = figure.add_gridspec(1, 2)
    if parts:
        _draw_parts(figure.add_subplot(grid[0]), parts, colours)
    if others:
        _draw_ratios(figure.add_subplot(grid[1]), others, colours)
    return figure.figure


def _caption(result: Cost) -> str:
    versions = [of for each in result.alternatives for of in (each.first, each.second) if of.times]
    hollow = "" if all(each.repeatable for each in versions) else " Hollow: a time that did not repeat to 5 %."
    return (
        f"{result.robot}: {', '.join(result.acting) or 'no effects'}. Times of the processor: the least over turns."
        f"{hollow} {programs(result.environment, 'llvmlite', 'casadi')}."
    )


def _parts(result: Cost) -> list[tuple[str, int, str]]:
    """What a step is made of: names, instructions, and times as texts."""
    rows = []
    for pair in result.alternatives:
        if pair.group == "parts" and pair.what == EVERYTHING:
            rows.append(
                ("rigid bodies", pair.second.instructions, _time(pair.second.time_s if pair.second.times else None))
            )
        elif pair.group == "parts":
            time = ", within noise" if pair.within_noise else _time(pair.time_between_s)
            rows.append((pair.what, pair.added, time))
    return rows + ([("of several", result.shared, "")] if result.shared else [])


def _time(spent: float | None) -> str:
    return "" if spent is None else f", {'−' * (spent < 0)}{format_duration(abs(spent))}"


def _draw_parts(axes: Any, parts: list[tuple[str, int, str]], colours: Colours) -> None:
    styled(axes, colours, "instructions", "A step of RK4, by part: with it less without it")
    whole = sum(count for _, count, _ in parts) or 1
    places = range(len(parts))
    axes.barh(places, [count for _, count, _ in parts], 2 * _BAR, color=colours["lines"][0])
    for place, (_, count, time) in enumerate(parts):
        said = f" {count} ({100 * count / whole:.1f} %){time}".replace("-", "−")
        axes.text(max(count, 0), place, said, va="center", fontsize=8, **ink(colours))
    _named(axes, [name for name, _, _ in parts], colours)
    axes.set_xlim(min(0, *(count for _, count, _ in parts)), 1.7 * max(count for _, count, _ in parts) or 1)


def _draw_ratios(axes: Any, others: list[ABComparison], colours: Colours) -> None:
    from matplotlib.ticker import NullFormatter

    styled(axes, colours, "ratio, first / second", "Alternatives: instructions in blue, time in orange")
    ratios = [(each.instructions_ratio, each.time_ratio) for each in others]
    known = [x for pair in ratios for x in pair if x is not None and 0 < x < float("inf")] or [1.0]
    axes.set_xscale("log")
    axes.set_xticks(_TICKS, [f"{x:g}" for x in _TICKS])
    axes.xaxis.set_minor_formatter(NullFormatter())
    for k, colour in enumerate(colours["lines"][:2]):
        for place, pair in enumerate(ratios):
            x, y = pair[k], place + (k - 0.5) * _BAR
            if x is None or not 0 < x < float("inf"):
                continue
            hollow = k and not (others[place].first.repeatable and others[place].second.repeatable)
            axes.barh(y, x - 1, _BAR, left=1, edgecolor=colour, facecolor="none" if hollow else colour)
            axes.text(max(x, 1.0), y, f" {x:.2g}", va="center", fontsize=8, **ink(colours))
    axes.axvline(1, color=colours["ink"], linewidth=0.9)
    _named(axes, [f"{each.what}:\n{each.first.name} / {each.second.name}" for each in others], colours)
    axes.set_xlim(min(0.7, *(x / 1.2 for x in known)), 1.6 * max(2.0, *known))


def _named(axes: Any, names: list[str], colours: Colours) -> None:
    """Rows from above, by name."""
    axes.set_yticks(range(len(names)), [drawable(name) for name in names])
    axes.tick_params(axis="y", length=0)
    for label in axes.get_yticklabels():
        label.set(color=colours["ink"], fontsize=8, parse_math=False)
    axes.set_ylim(len(names) - 0.4, -0.6)
    axes.grid(visible=False, axis="y")
