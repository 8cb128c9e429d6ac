"""Diagram of a certificate: digits over time of a query, a panel for each quantity, from typical to worst states."""

from __future__ import annotations

from typing import TYPE_CHECKING

from robot_dyn.accuracy.certificate.certify import DECIMALS, Certificate, CountedDigits
from robot_dyn.foundations.display import drawable
from robot_dyn.report.figure import Colours, ResultError, key, legend, sheet, styled

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_WIDTH, _HEIGHT = 15.0, 5.2  # [inch]
_TOP = 21.0  # digits


def draw(result: Certificate, theme: str = "light") -> Figure:
    """Draw the diagram.

    Raises:
        ResultError: If no digits were counted.
    """
    if not result.digits:
        raise ResultError("nothing to draw: no digits were counted; see left_out")
    figure, colours = sheet(_WIDTH, _HEIGHT, result.sentence, _caption(result), theme)
    hues = {name: colours["lines"][k % len(colours["lines"])] for k, name in enumerate(result.implementations)}
    panels = figure.subplots(1, len(result.quantities), squeeze=False)[0]
    for k, (quantity, axes) in enumerate(zip(result.quantities, panels, strict=True)):
        axes.set(xscale="log", ylim=(0, _TOP), yticks=range(0, 21, 5))
        styled(axes, colours, "time of a query [µs]", quantity.replace("_", " "), "" if k else "digits")
        for count in result.digits:
            if count.quantity == quantity:
                _draw_count(axes, count, hues[count.implementation], colours)
        axes.axhline(result.decimals[quantity], color=colours["ink"], linewidth=0.9, linestyle=(0, (6, 3)))
    handles = [key(drawable(name), hue, marker="o", linewidth=3) for name, hue in hues.items()]
    handles.append(key(DECIMALS, colours["ink"], linestyle="--"))
    has_hollow = not all(count.repeatable for count in result.digits)
    legend(figure, handles, colours, "hollow: timing varied by over 5 %" if has_hollow else "")
    return figure.figure


def _caption(result: Certificate) -> str:
    """Return an explanation of the marks, with sample count, precision, condition number and processor."""
    samples = max(count.samples for count in result.digits)
    return (
        f"{result.robot}: bars from the median of {samples} random states to the worst state found; tick: worst random"
        f" state. Errors against balls of {result.bits} bits. κ of M up to {result.condition.searched:.3g}."
        f" {result.environment['processor']}."
    )


def _draw_count(axes: Axes, count: CountedDigits, colour: str, colours: Colours) -> None:
    """Draw the range of digits of one implementation at its time."""
    t = 1e6 * count.time_s
    axes.plot([t, t], [count.searched, count.typical], color=colour, linewidth=3, solid_capstyle="butt")
    axes.plot([t], [count.random], marker="_", color=colour, markersize=11, markeredgewidth=1.5)
    face = colour if count.repeatable else colours["paper"]
    axes.plot([t], [count.searched], marker="o", color=colour, markersize=5, markerfacecolor=face)
    if count.at_state is not None:
        axes.plot([t], [count.at_state], marker="x", color=colours["ink"], markersize=6)
