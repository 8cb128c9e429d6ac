"""HTML of values for notebooks: tables and line plots as plain HTML and SVG, without scripts.

Text, axes and rules take the colour of the page (`currentColor`), so that they stand on light and on dark ones.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from html import escape
from math import floor, isfinite, log10
from typing import Any

import numpy as np

MOST_POINTS = 200  # of a curve: its least and largest values in each of half as many parts
_COLOURS = ("#4c8bf5", "#e8710a", "#1e9e55", "#d93a8f", "#9a6af0", "#b58900", "#00a3b4", "#8d6e63")
_WIDTH, _HEIGHT, _LEFT, _BELOW, _ABOVE = 420, 150, 58, 30, 8  # of a plot, in pixels
_STYLE = (
    "<style>.robot-dyn{font:13px/1.45 system-ui,sans-serif;max-width:70em}"
    ".robot-dyn table{border-collapse:collapse;font-size:inherit;margin:.5em 0;background:none}"
    ".robot-dyn th,.robot-dyn td{text-align:left;padding:.12em .8em .12em 0;border:0;background:none;color:inherit;"
    "vertical-align:top}"
    ".robot-dyn th{font-weight:600;border-bottom:1px solid}"
    ".robot-dyn td.n{text-align:right;font-variant-numeric:tabular-nums}"
    ".robot-dyn .t{font-weight:600;font-size:1.08em}.robot-dyn pre{font-size:12px;white-space:pre-wrap;margin:.5em 0;"
    "background:none;color:inherit;padding:0;border:0}"
    ".robot-dyn .s{display:flex;flex-wrap:wrap;gap:.5em 1em}.robot-dyn svg{max-width:100%;height:auto}</style>"
)


def page(title: str, *parts: str) -> str:
    """A block of HTML with a title; the parts are HTML."""
    return f'<div class="robot-dyn">{_STYLE}<div class="t">{escape(title)}</div>{"".join(parts)}</div>'


def text(lines: str | Iterable[str]) -> str:
    """Lines of text as they are."""
    return f"<pre>{escape(lines if isinstance(lines, str) else chr(10).join(lines))}</pre>"


def table(heading: Sequence[str], rows: Iterable[Sequence[Any]]) -> str:
    """A table; numbers stand at the right, and what is None is left empty."""
    head = "".join(f"<th>{escape(each)}</th>" for each in heading)
    body = "".join(f"<tr>{''.join(map(_cell, row))}</tr>" for row in rows)
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"


def _cell(value: Any) -> str:
    number = isinstance(value, int | float | np.number) and not isinstance(value, bool)
    shown = number_text(float(value)) if number else "" if value is None else str(value)
    return f"<td{' class=n' * number}>{escape(shown)}</td>"


def number_text(value: float) -> str:
    """A number in four digits."""
    return f"{value:.4g}".replace("-", "−") if isfinite(value) else "∞" if value > 0 else "−∞" if value < 0 else "nan"


def side_by_side(parts: Iterable[str]) -> str:
    """Blocks of HTML side by side, as many as there is room for."""
    return f'<div class="s">{"".join(parts)}</div>'


def plot(label: str, t: np.ndarray, columns: Mapping[str, np.ndarray]) -> str:
    """Curves over time as SVG.

    Args:
        label: What they are, with the unit.
        t: Times, (m,), in [s].
        columns: Curves (m,) by name; what is not finite is left out.
    """
    finite = [x[np.isfinite(x)] for x in columns.values()]
    if not len(t) or not any(map(len, finite)):
        return ""
    low, high = min(x.min() for x in finite if len(x)), max(x.max() for x in finite if len(x))
    low, high = (low - 0.5, high + 0.5) if low == high else (low, high)
    ticks, times = _ticks(low, high), _ticks(float(t[0]), float(t[-1]))
    wide, high_px = _WIDTH - _LEFT - 8, _HEIGHT - _BELOW - _ABOVE

    def x(at: float) -> float:
        return _LEFT + wide * (at - t[0]) / ((t[-1] - t[0]) or 1.0)

    def y(at: float) -> float:
        return _ABOVE + high_px * (high - at) / (high - low)

    grid = "".join(
        f'<path d="M{_LEFT} {y(at):.1f}H{_WIDTH - 8}" stroke="currentColor" stroke-opacity=".18"/>'
        f'<text x="{_LEFT - 5}" y="{y(at) + 4:.1f}" text-anchor="end">{number_text(at)}</text>'
        for at in ticks
    )
    below = "".join(
        f'<text x="{x(at):.1f}" y="{_HEIGHT - _BELOW + 14}" text-anchor="middle">{number_text(at)}</text>'
        for at in times
    )
    curves = "".join(
        f'<polyline points="{_points(t, each, x, y)}" fill="none" stroke="{_COLOURS[k % len(_COLOURS)]}"'
        f' stroke-width="1.4"><title>{escape(name)}</title></polyline>'
        for k, (name, each) in enumerate(columns.items())
    )
    caption = f'<text x="{_LEFT}" y="{_HEIGHT - 2}">{escape(label)} over t [s]</text>'
    return _svg(_WIDTH, _HEIGHT, grid + below + curves + caption, label)


def legend(names: Iterable[str]) -> str:
    """The names of curves in their colours."""
    return side_by_side(
        f'<span><span style="color:{_COLOURS[k % len(_COLOURS)]}">■</span> {escape(name)}</span>'
        for k, name in enumerate(names)
    )


def _points(t: np.ndarray, values: np.ndarray, x: Any, y: Any) -> str:
    """Points of a curve; of many samples the least and the largest of each part."""
    keep = np.flatnonzero(np.isfinite(values))
    if len(keep) > MOST_POINTS:
        parts = np.array_split(keep, MOST_POINTS // 2)
        keep = np.unique([part[at(values[part])] for part in parts for at in (np.argmin, np.argmax)])
    return " ".join(f"{x(t[k]):.1f},{y(values[k]):.1f}" for k in keep)


def _ticks(low: float, high: float) -> list[float]:
    """At most six round numbers between two."""
    raw = (high - low) / 4 or 1.0
    size = 10.0 ** floor(log10(raw))
    step = next(size * factor for factor in (1, 2, 5, 10) if size * factor >= raw)
    return [k * step for k in range(int(np.ceil(low / step)), int(np.floor(high / step)) + 1)]


def _svg(width: float, height: float, drawn: str, label: str) -> str:
    return (
        f'<svg xmlns="http://www.w3.org/2000/svg" role="img" aria-label="{escape(label)}" width="{width}"'
        f' height="{height}" viewBox="0 0 {width} {height}" font-size="11" fill="currentColor">{drawn}</svg>'
    )
