"""The diagram of a certificate: digits over time, a panel for each quantity, from typical states to the worst found."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from robot_dyn.accuracy.certificate.certify import DECIMALS, Certificate, Held
from robot_dyn.foundations.display import drawable
from robot_dyn.report.figure import Colours, ResultError, key, legend, sheet, styled

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_WIDTH, _HEIGHT = 15.0, 5.2  # [inch]
_TOP = 21.0  # digits


def draw(result: Certificate, theme: str = "light") -> Figure:
    """The diagram.

    Raises:
        ResultError: If no digits were counted.
    """
    if not result.digits:
        raise ResultError("no digits were counted, so there is nothing to draw; look at left_out")
    figure, colours = sheet(_WIDTH, _HEIGHT, result.sentence, _caption(result), theme)
    hues = {name: colours["lines"][k % len(colours["lines"])] for k, name in enumerate(result.implementations)}
    every = figure.subplots(1, len(result.quantities), squeeze=False)[0]
    for k, (quantity, axes) in enumerate(zip(result.quantities, every, strict=True)):
        axes.set(xscale="log", ylim=(0, _TOP), yticks=range(0, 21, 5))
        styled(axes, colours, "time of a query [µs]", quantity.replace("_", " "), "" if k else "digits")
        for each in result.digits:
            if each.quantity == quantity:
                _mark(axes, each, hues[each.implementation], colours)
        axes.axhline(result.decimals[quantity], color=colours["ink"], linewidth=0.9, linestyle=(0, (6, 3)))
    handles = [key(drawable(name), hue, marker="o", linewidth=3) for name, hue in hues.items()]
    handles.append(key(DECIMALS, colours["ink"], linestyle="--"))
    hollow = not all(each.repeatable for each in result.digits)
    legend(figure, handles, colours, "hollow: a time that did not repeat to 5 %" if hollow else "")
    return figure.figure


def _caption(result: Certificate) -> str:
    """What is drawn."""
    samples = max(each.samples for each in result.digits)
    return (
        f"{result.robot}: bars from the median of {samples} random states to the worst state found, a tick at the worst"
        f" random one; errors against balls of {result.bits} bits. κ of M up to {result.condition.searched:.3g}."
        f" {result.environment['processor']}."
    )


def _mark(axes: Any, each: Held, colour: str, colours: Colours) -> None:
    """One implementation: the range of its digits at its time."""
    t = 1e6 * each.time_s
    axes.plot([t, t], [each.searched, each.typical], color=colour, linewidth=3, solid_capstyle="butt")
    axes.plot([t], [each.random], marker="_", color=colour, markersize=11, markeredgewidth=1.5)
    face = colour if each.repeatable else colours["paper"]
    axes.plot([t], [each.searched], marker="o", color=colour, markersize=5, markerfacecolor=face)
    if each.given is not None:
        axes.plot([t], [each.given], marker="x", color=colours["ink"], markersize=6)
