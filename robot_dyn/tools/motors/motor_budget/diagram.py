"""Diagram of a motor budget: used fraction of each limit, rms torque by cause, torque of each joint over time."""

from __future__ import annotations

from math import inf
from typing import TYPE_CHECKING, Any

import numpy as np

from robot_dyn.foundations import drawable
from robot_dyn.queries import of_joint
from robot_dyn.report import Colours, ResultError, ink, key, legend, sheet, styled
from robot_dyn.tools.motors.motor_budget.joint_budget import KINDS, JointBudget
from robot_dyn.tools.motors.motor_budget.result import MotorBudget
from robot_dyn.view import NEAR, shortened

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_WIDE, _ROW, _CELL, _AROUND = 13.0, 0.42, 2.3, 1.9  # [inch]
_ACROSS, _MOST = 3, 64  # joints in a row; joints of a figure
_LETTERS = 24  # in the name of a joint next to its bars
_BAR = 0.27
_SHADES = {
    "peak": 1.0,
    "continuous": 0.72,
    "speed": 0.46,
    "line": 0.3,
    "brake": 0.18,
    "bearing": 0.1,
}  # shades of ink for bars; colours mark causes


def draw(result: MotorBudget, theme: str = "light") -> Figure:
    """The figure.

    Raises:
        ResultError: If there are too many joints.
    """
    if not 0 < len(result.joints) <= _MOST:
        raise ResultError(f"a budget of {len(result.joints)} joints cannot be drawn, up to {_MOST} can")
    rows, above = -(-len(result.joints) // _ACROSS), _ROW * len(result.joints) + 0.5
    height = above + _CELL * rows + _AROUND
    figure, colours = sheet(_WIDE, height, result.sentence, f"Limits: {result.limits}; {result.resolution}.", theme)
    whole = figure.add_gridspec(2, 1, height_ratios=(above, _CELL * rows))
    bars, grid = whole[0].subgridspec(1, 2), whole[1].subgridspec(rows, _ACROSS)
    _used(figure.add_subplot(bars[0]), result, colours)
    _by_cause(figure.add_subplot(bars[1]), result, colours)
    for i, joint in enumerate(result.joints):
        _over_time(figure.add_subplot(grid[divmod(i, _ACROSS)]), result, i, joint, colours)
    legend(figure, _handles(result, colours), colours)
    return figure.figure


def _names(result: MotorBudget) -> list[str]:
    return [drawable(shortened(joint.joint, _LETTERS)) for joint in result.joints]


def _used(axes: Any, result: MotorBudget, colours: Colours) -> None:
    styled(axes, colours, "", "Used of each limit [%]")
    most = 100.0
    for place, joint in enumerate(result.joints):
        for k, (kind, share) in enumerate(joint.shares.items()):
            if not share:
                continue
            most = max(most, 100 * share)
            y = place + (k - (len(joint.shares) - 1) / 2) * _BAR * 3 / max(3, len(joint.shares))
            axes.barh(y, 100 * share, 2.7 * _BAR / max(3, len(joint.shares)), color=colours["ink"], alpha=_SHADES[kind])
            axes.text(100 * share, y, f" {100 * share:.3g}", va="center", fontsize=6.5, **ink(colours))
    axes.axvline(100, color=colours["ink"], linewidth=1.0, linestyle="--")
    axes.set_xlim(0, 1.08 * most)
    _named(axes, _names(result), colours)


def _by_cause(axes: Any, result: MotorBudget, colours: Colours) -> None:
    styled(axes, colours, "", "By cause: parts of the rms torque [%]")
    low, high = 0.0, 100.0
    for place, joint in enumerate(result.joints):
        ends = {True: 0.0, False: 0.0}
        for k, part in enumerate(joint.of_rms.values()):
            share = 100 * part / joint.rms if joint.rms else 0.0
            start = ends[share > 0]
            ends[share > 0] = start + share
            axes.barh(place, share, 0.6, left=start, color=_colour(colours, k))
        low, high = min(low, ends[False]), max(high, ends[True])
    axes.axvline(0, color=colours["ink"], linewidth=0.8)
    axes.set_xlim(1.05 * low, 1.02 * high)
    _named(axes, [""] * len(result.joints), colours)


def _named(axes: Any, names: list[str], colours: Colours) -> None:
    axes.set_yticks(range(len(names)), names)
    axes.tick_params(axis="y", length=0)
    for label in axes.get_yticklabels():
        label.set(color=colours["ink"], fontsize=8, parse_math=False)
    axes.set_ylim(len(names) - 0.5, -0.5)
    axes.grid(visible=False, axis="y")


def _over_time(axes: Any, result: MotorBudget, i: int, joint: JointBudget, colours: Colours) -> None:
    split, unit = result.demand.split, of_joint("N m", joint.type)
    rows = np.arange(len(split.t)) if result.demand.cells is None else np.flatnonzero(result.demand.weights == 0)
    limit = f" of {joint.peak_limit:.4g}" if joint.peak_limit < inf else ""
    title = f"{shortened(joint.joint, _LETTERS)}: {joint.peak:.4g}{limit} {unit}"
    styled(axes, colours, "t [s]", drawable(title), f"τ [{unit}]")
    for k, torque in enumerate(split.torques.values()):
        if not torque[rows, i].any():
            continue
        axes.plot(split.t[rows], torque[rows, i], color=_colour(colours, k), linewidth=0.9)
    axes.plot(split.t[rows], split.tau[rows, i], color=colours["ink"], linewidth=1.5)
    row = int(np.abs(split.tau[:, i]).argmax())
    axes.plot(split.t[row], split.tau[row, i], "o", color=colours["ink"], markersize=4)
    if _is_near(joint):
        for side in (1, -1):
            axes.axhline(side * joint.peak_limit, color=colours["ink"], linewidth=0.9, linestyle="--")
    axes.margins(x=0.01)


def _colour(colours: Colours, k: int) -> str:
    """Return the colour of cause k, from the colours of the theme without the colour of the total."""
    hues = [colours["lines"][j] for j in (1, 2, 3, 5, 6)]
    return hues[k % len(hues)]


def _is_near(joint: JointBudget) -> bool:
    """Return True if the limit of the peak torque is drawn."""
    return joint.peak >= NEAR * joint.peak_limit


def _handles(result: MotorBudget, colours: Colours) -> list[Any]:
    """Return the entries of the legend: only things that the figure has."""
    joints = result.joints
    acting = [name for name, torque in result.demand.split.torques.items() if torque.any()]
    causes = [(k, name) for k, name in enumerate(joints[0].of_rms) if name in acting]
    kinds = [kind for kind in _SHADES if any(joint.shares.get(kind) for joint in joints)]
    dashed = [key("± peak torque, where it is near", colours["ink"], linestyle="--", linewidth=0.9)]
    return [
        key("τ, and its peak", colours["ink"], marker="o", markersize=4),
        *(key(drawable(name), _colour(colours, k)) for k, name in causes),
        *(dashed if any(map(_is_near, joints)) else []),
        *(key(f"used of {KINDS[kind]}", colours["ink"], linewidth=5, alpha=_SHADES[kind]) for kind in kinds),
    ]
