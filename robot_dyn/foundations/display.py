"""HTML of values for notebooks: tables and line plots as plain HTML and SVG, without scripts.

Text, axes and rules take the colour of the page (`currentColor`), so that they stand on light and on dark ones.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from html import escape
from math import floor, isfinite, log10
from typing import Any

import numpy as np

MOST_POINTS = 200  # of a curve: its least and largest values in each of half as many parts
_COLOURS = ("#4c8bf5", "#e8710a", "#1e9e55", "#d93a8f", "#9a6af0", "#b58900", "#00a3b4", "#8d6e63")
_WIDTH, _HEIGHT, _LEFT, _BELOW, _ABOVE = 370, 150, 58, 30, 8  # of a plot, in pixels: two stand side by side
_BAR, _LONGEST = 18, 32  # height of a bar in pixels, and letters of its name
_MOST_TICKS = 6  # of a logarithmic axis
_MOST_ROWS = 40  # of a table; a longer one scrolls
# more specific than the styles of notebooks, which align all cells at the right
_STYLE = (
    "<style>.robot-dyn{font:13px/1.45 system-ui,sans-serif;max-width:70em}"
    ".robot-dyn.robot-dyn table{border-collapse:collapse;font-size:inherit;margin:.5em 0;background:none;color:inherit}"
    ".robot-dyn.robot-dyn table th,.robot-dyn.robot-dyn table td{text-align:left;padding:.12em .8em .12em 0;border:0;"
    "background:none;color:inherit;vertical-align:top}"
    ".robot-dyn.robot-dyn table th{font-weight:600;border-bottom:1px solid}"
    ".robot-dyn.robot-dyn table .n{text-align:right;white-space:nowrap;font-variant-numeric:tabular-nums}"
    ".robot-dyn .l{max-height:32em;overflow:auto;border-bottom:1px solid}"
    ".robot-dyn .t{font-weight:600;font-size:1.08em}"
    "div.robot-dyn pre{font:inherit;font-size:12px;white-space:pre-wrap;word-break:normal;margin:.5em 0;padding:0;"
    "background:none;color:inherit;border:0}"
    ".robot-dyn .s{display:flex;flex-wrap:wrap;gap:.5em 1em}.robot-dyn svg{max-width:100%;height:auto}</style>"
)


def page(title: str, *parts: str) -> str:
    """A block of HTML with a title; the parts are HTML."""
    return f'<div class="robot-dyn">{_STYLE}<div class="t">{escape(title)}</div>{"".join(parts)}</div>'


def text(lines: str | Iterable[str]) -> str:
    """Lines of text as they are."""
    return f"<pre>{escape(lines if isinstance(lines, str) else chr(10).join(lines))}</pre>"


def table(heading: Sequence[str], rows: Iterable[Sequence[Any]], right: Collection[str] = ()) -> str:
    """A table; numbers and the columns `right` stand at the right, and what is None is left empty."""
    rows = list(rows)
    ends = {k for k, each in enumerate(heading) if each in right}
    numbers = ends | {k for row in rows for k, x in enumerate(row) if _is_number(x)}
    head = "".join(f"<th{' class=n' * (k in numbers)}>{escape(each)}</th>" for k, each in enumerate(heading))
    body = "".join(f"<tr>{''.join(_cell(x, k in ends) for k, x in enumerate(row))}</tr>" for row in rows)
    whole = f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"
    return whole if len(rows) <= _MOST_ROWS else f'<div class="l" tabindex="0">{whole}</div>'


def _cell(value: Any, right: bool) -> str:
    number = _is_number(value)
    shown = number_text(float(value)) if number else "" if value is None else str(value)
    return f"<td{' class=n' * (number or right)}>{escape(shown)}</td>"


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float | np.number) and not isinstance(value, bool)


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


def bars(label: str, rows: Mapping[str, Mapping[str, float]], causes: Sequence[str]) -> str:
    """Horizontal bars as SVG, one a row, each stacked from 0: what is positive to the right, the rest to the left.

    Args:
        label: What they are, with the unit.
        rows: Parts of each bar by cause, by the name of the bar; what is not finite is left out.
        causes: In the order of colours, of which the legend names those that occur.
    """
    parts = {name: {each: x for each, x in row.items() if x and isfinite(x)} for name, row in rows.items()}
    used = [each for each in causes if any(each in row for row in parts.values())]
    if not used:
        return ""
    low = min(sum(x for x in row.values() if x < 0) for row in parts.values())
    high = max(sum(x for x in row.values() if x > 0) for row in parts.values())
    left, wide = 7 * min(max(map(len, parts)), _LONGEST) + 8, _WIDTH - _LEFT
    colour = {each: _COLOURS[k % len(_COLOURS)] for k, each in enumerate(used)}

    def x(at: float) -> float:
        return left + wide * (at - low) / ((high - low) or 1.0)

    drawn = []
    for k, (name, row) in enumerate(parts.items()):
        ends = {True: 0.0, False: 0.0}
        drawn.append(f'<text x="{left - 6}" y="{_BAR * k + 12}" text-anchor="end">{escape(_short(name))}</text>')
        for cause in (each for each in used if each in row):
            start = ends[row[cause] > 0]
            ends[row[cause] > 0] = end = start + row[cause]
            drawn.append(
                f'<rect x="{min(x(start), x(end)):.1f}" y="{_BAR * k + 3}" width="{abs(x(end) - x(start)):.1f}"'
                f' height="{_BAR - 6}" fill="{colour[cause]}"><title>{escape(f"{name}, {cause}")}:'
                f" {number_text(row[cause])}</title></rect>"
            )
    below = _BAR * len(parts)
    drawn += [
        f'<path d="M{x(at):.1f} 0V{below}" stroke="currentColor" stroke-opacity="{0.7 if at == 0 else 0.18}"/>'
        f'<text x="{x(at):.1f}" y="{below + 13}" text-anchor="middle">{number_text(at)}</text>'
        for at in _ticks(low, high)
    ]
    drawn.append(f'<text x="{left}" y="{below + 28}">{escape(label)}</text>')
    return legend(used) + _svg(left + wide + 20, below + 32, "".join(drawn), label)


def levels(label: str, values: Mapping[str, float], limit: float) -> str:
    """Marks on a logarithmic axis as SVG, one a row, beside a limit, which is a dashed line.

    Args:
        label: What they are, with the unit.
        values: By the names of the rows; what is not finite and positive is left out.
        limit: Likewise.
    """
    known = {name: log10(x) for name, x in values.items() if isfinite(x) and x > 0}
    edges = [*known.values(), *([log10(limit)] if isfinite(limit) and limit > 0 else [])]
    if not known:
        return ""
    low, high = floor(min(edges)), max(floor(min(edges)) + 1, -floor(-max(edges)))
    left, wide, below = 7 * min(max(map(len, known)), _LONGEST) + 8, _WIDTH - _LEFT, _BAR * len(known)

    def x(at: float) -> float:
        return left + wide * (at - low) / (high - low)

    drawn = [
        f'<path d="M{x(at):.1f} 0V{below}" stroke="currentColor" stroke-opacity=".18"/>'
        f'<text x="{x(at):.1f}" y="{below + 13}" text-anchor="middle">{number_text(10.0**at)}</text>'
        for at in range(low, high + 1, -(-(high - low) // _MOST_TICKS))
    ]
    for k, (name, at) in enumerate(known.items()):
        drawn.append(
            f'<text x="{left - 6}" y="{_BAR * k + 13}" text-anchor="end">{escape(_short(name))}</text>'
            f'<path d="M{left} {_BAR * k + 9}H{x(at):.1f}" stroke="currentColor" stroke-opacity=".35"/>'
            f'<circle cx="{x(at):.1f}" cy="{_BAR * k + 9}" r="4" fill="{_COLOURS[0]}"><title>{escape(name)}:'
            f" {number_text(10.0**at)}</title></circle>"
        )
    if len(edges) > len(known):
        drawn.append(f'<path d="M{x(edges[-1]):.1f} 0V{below}" stroke="{_COLOURS[1]}" stroke-dasharray="4 2"/>')
    drawn.append(f'<text x="{left}" y="{below + 28}">{escape(label)}</text>')
    return _svg(left + wide + 24, below + 32, "".join(drawn), label)


def _short(name: str) -> str:
    return name if len(name) <= _LONGEST else f"{name[: _LONGEST - 1]}…"
