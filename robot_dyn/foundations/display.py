"""HTML of values for notebooks: tables as HTML and figures of Matplotlib as SVG, without scripts.

Text and axes have the colour of the page (`currentColor`), so that they are legible on light and on dark pages.
"""

from __future__ import annotations

import io
import re
from collections.abc import Collection, Iterable, Mapping, Sequence
from html import escape
from math import isfinite
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from matplotlib.figure import Figure


INK = "#010203"  # placeholder in figures for the text colour of the page
GRID = "#80808055"
MAX_JOINTS = 8  # largest number of joints whose curves are drawn
MAX_POINTS = 200  # per curve: longer ones keep the minimum and maximum of each of 100 parts
_COLOURS = ("#4c8bf5", "#e8710a", "#1e9e55", "#d93a8f", "#9a6af0", "#b58900", "#00a3b4", "#8d6e63")
_WIDE, _HIGH, _BAR = 3.9, 1.6, 0.2  # width and height of a plot and height of a bar, in [inch]; two plots fit in a row
_LONGEST = 32  # largest number of characters in the name of a row
_LARGEST, _MIN = 1e300, 1e-99  # bounds of linear and logarithmic axes: Matplotlib needs room beyond the ends
_MAX_ROWS = 40  # a longer table scrolls
_NARROW = 4  # largest number of columns that fit on a narrow page
_HEAD = (
    '<!doctype html>\n<html lang="en"><head><meta charset="utf-8"><meta name="color-scheme" content="light dark">'
    '<meta name="viewport" content="width=device-width">'
    "<meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src 'unsafe-inline'\">"
    "<title>{title}</title><style>body{{margin:1.5em auto;max-width:72em;padding:0 1em}}"
    "h2{{font:600 1em system-ui,sans-serif;margin:1.6em 0 .4em}}</style></head><body>\n{body}\n</body></html>\n"
)
# more specific than the styles of notebooks, which right-align all cells
_STYLE = (
    "<style>.robot-dyn{font:13px/1.45 system-ui,sans-serif;max-width:70em}"
    ".robot-dyn.robot-dyn table{border-collapse:collapse;font-size:inherit;margin:.5em 0;background:none;color:inherit}"
    ".robot-dyn.robot-dyn table th,.robot-dyn.robot-dyn table td{text-align:left;padding:.12em .8em .12em 0;border:0;"
    "background:none;color:inherit;vertical-align:top}"
    ".robot-dyn.robot-dyn table th{font-weight:600;border-bottom:1px solid}"
    ".robot-dyn.robot-dyn table .n{text-align:right;font-variant-numeric:tabular-nums}"
    ".robot-dyn.robot-dyn table td.n{white-space:nowrap}"
    "@media(max-width:34em){.robot-dyn.robot-dyn table td{overflow-wrap:anywhere}"  # a wide table: a block for each row
    ".robot-dyn.robot-dyn .w :is(table,tbody,tr){display:block}.robot-dyn.robot-dyn .w thead{display:none}"
    ".robot-dyn.robot-dyn .w tr{padding:.2em 0;border-bottom:1px solid #80808055}"
    ".robot-dyn.robot-dyn .w td{display:inline-block}"
    ".robot-dyn.robot-dyn .w td::before{content:attr(data-of)' ';opacity:.7}}"
    ".robot-dyn .l{max-height:32em;overflow:auto;border-bottom:1px solid}"
    ".robot-dyn .t{font-weight:600;font-size:1.08em}"
    "div.robot-dyn pre{font:inherit;font-size:12px;white-space:pre-wrap;word-break:normal;margin:.5em 0;padding:0;"
    "background:none;color:inherit;border:0}"
    ".robot-dyn .s{display:flex;flex-wrap:wrap;gap:.5em 1em}.robot-dyn svg{max-width:100%;height:auto}</style>"
)


def page(title: str, *parts: str) -> str:
    """Return a block of HTML with a title; the parts are HTML."""
    return f'<div class="robot-dyn">{_STYLE}<div class="t">{escape(title)}</div>{"".join(parts)}</div>'


def document(title: str, body: str) -> str:
    """Return an HTML document without scripts, with a body in HTML."""
    return _HEAD.format(title=escape(title), body=body)


def text(lines: str | Iterable[str]) -> str:
    """Return lines of preformatted text."""
    return f"<pre>{escape(lines if isinstance(lines, str) else chr(10).join(lines))}</pre>"


def grid(heading: Sequence[str], cells: Iterable[Sequence[str]], words: Collection[str]) -> str:
    """Return a table of texts; columns not listed in `words` are right-aligned.

    On a narrow page, each row of a table with more than 4 columns becomes a block of cells labelled by their headings.
    """
    kinds = ["" if name in words else " class=n" for name in heading]
    is_wide = len(heading) > _NARROW
    labels = [f' data-of="{escape(name)}"' if is_wide else "" for name in heading]
    head = "".join(f"<th{kind}>{escape(name)}</th>" for kind, name in zip(kinds, heading, strict=True))
    rows = [
        "".join(f"<td{kind}{label}>{escape(cell)}</td>" for kind, label, cell in zip(kinds, labels, row, strict=True))
        for row in cells
    ]
    body = "".join(f"<tr>{row}</tr>" for row in rows)
    whole = f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"
    look = " ".join(["l"] * (len(rows) > _MAX_ROWS) + ["w"] * is_wide)
    return f'<div class="{look}"{" tabindex=0" * ("l" in look)}>{whole}</div>' if look else whole


def side_by_side(parts: Iterable[str]) -> str:
    """Return blocks of HTML side by side, wrapped at the width of the page."""
    return f'<div class="s">{"".join(parts)}</div>'


def legend(names: Iterable[str]) -> str:
    """Return the names of curves in their colours."""
    return side_by_side(
        f'<span><span style="color:{_COLOURS[k % len(_COLOURS)]}">■</span> {escape(name)}</span>'
        for k, name in enumerate(names)
    )


def curves(title: str, summary: str, names: Iterable[str], plots: Sequence[str], more: int) -> str:
    """Return a block with a summary, plots of curves, and a note on the number of joints not drawn."""
    note = text(f"{more} more joints not drawn") if more else ""
    return page(title, text(summary), legend(names), side_by_side(plots), note)


def inline(figure: Figure, label: str = "") -> str:
    """Return a figure as SVG within a page of HTML; the colour INK becomes that of the page.

    Args:
        figure: The figure.
        label: Description for readers who cannot see the figure.
    """
    from matplotlib import rc_context

    stream = io.StringIO()
    with rc_context({"svg.fonttype": "none"}):  # text stays text, which can be searched and read aloud
        figure.savefig(stream, format="svg", bbox_inches="tight", pad_inches=0.05, metadata={"Date": None})
    svg = stream.getvalue()
    dropped = r'<!--.*?-->|<metadata>.*?</metadata>| xmlns:xlink="[^"]*"|xlink:(?=href)'
    svg = re.sub(dropped, "", svg[svg.index("<svg") + 4 :], flags=re.DOTALL)
    svg = f'<svg role="img" aria-label="{escape(label)}"{svg}' if label else f"<svg{svg}"
    svg = re.sub(r'translate\([^)]*\)| (?:d|x|y)="[^"]*"', lambda at: re.sub(r"(\.\d\d)\d+", r"\1", at[0]), svg)
    return re.sub(r"\s*\n\s*", "\n", svg.replace(INK, "currentColor").replace("*{", ".robot-dyn svg *{"))


def drawable(name: str) -> str:
    """Return a text with characters missing from the font of figures replaced by code points; line breaks are kept."""
    from matplotlib.font_manager import FontProperties, findfont, get_font

    font = get_font(findfont(FontProperties()))
    return "".join(c if c == "\n" or font.get_char_index(ord(c)) else f"\\u{ord(c):04x}" for c in name)


def _axes(label: str, height: float, names: Iterable[str] = ()) -> Any:
    """Return axes with a label on the x axis and the names of rows, if any, along the y axis."""
    from matplotlib.figure import Figure

    axes = Figure(figsize=(_WIDE, height), facecolor="none").add_subplot(facecolor="none")
    axes.set_xlabel(drawable(label), fontsize=8, color=INK, parse_math=False)
    axes.tick_params(which="both", labelsize=8, length=0, colors=INK)
    axes.grid(color=GRID)
    axes.spines[:].set_visible(False)
    if names:
        texts = [name if len(name) <= _LONGEST else f"{name[: _LONGEST - 1]}…" for name in map(drawable, names)]
        axes.set_yticks(range(len(texts)), texts, parse_math=False)
        axes.set_ylim(len(texts) - 0.5, -0.5)
    return axes


def plot(label: str, t: np.ndarray, columns: Mapping[str, np.ndarray]) -> str:
    """Draw curves over time.

    Args:
        label: Name of the quantity, with the unit.
        t: Times, (m,), in [s].
        columns: Curves, (m,), by name; non-finite values are omitted.
    """
    if not any(np.isfinite(x).any() for x in columns.values()):
        return ""
    axes = _axes(f"{label} over t [s]", _HIGH)
    axes.locator_params(axis="x", nbins=5)
    for k, x in enumerate(columns.values()):
        at = _extremes(x)
        y = np.clip(x[at], -_LARGEST, _LARGEST)
        axes.plot(t[at], y, color=_COLOURS[k % len(_COLOURS)], linewidth=1.2, gid=f"curve {k}")
    return inline(axes.figure, label)


def _extremes(values: np.ndarray) -> np.ndarray:
    """Return the indices of finite values; for many samples, those of the minimum and maximum of each part."""
    at = np.flatnonzero(np.isfinite(values))
    if len(at) <= MAX_POINTS:
        return at
    parts = np.array_split(at, MAX_POINTS // 2)
    return np.unique([part[which(values[part])] for part in parts for which in (np.argmin, np.argmax)])


def bars(label: str, rows: Mapping[str, Mapping[str, float]], causes: Sequence[str]) -> str:
    """Draw horizontal bars, one per row, stacked from 0: positive parts to the right, negative ones to the left.

    Args:
        label: Name of the quantity, with the unit.
        rows: Parts of each bar by cause, by the name of the bar; non-finite values are omitted.
        causes: Causes in the order of their colours; the legend lists those that occur.
    """
    parts = np.array([[row.get(cause, 0.0) for cause in causes] for row in rows.values()]).reshape(
        len(rows), len(causes)
    )
    parts = np.where(np.isfinite(parts), parts, 0.0)
    used = np.flatnonzero(parts.any(axis=0))
    if not len(used):
        return ""
    axes = _axes(label, _BAR * (len(rows) + 2), rows)
    ends = {True: np.zeros(len(rows)), False: np.zeros(len(rows))}
    for colour, k in zip(_COLOURS, used, strict=False):
        for positive, end in ends.items():
            part = np.where((parts[:, k] > 0) == positive, parts[:, k], 0.0)
            some = np.flatnonzero(part)
            axes.barh(some, part[some], 0.7, end[some], color=colour, gid="bar")
            end += part
    axes.axvline(0.0, color=INK, linewidth=0.8)
    return legend(causes[int(k)] for k in used) + inline(axes.figure, label)


def levels(label: str, values: Mapping[str, float], limit: float) -> str:
    """Draw marks on a logarithmic axis, one per row, and a limit as a dashed line.

    Args:
        label: Name of the quantity, with the unit.
        values: Values by the names of the rows; values that are not both finite and positive are omitted.
        limit: Limit in the unit of the values; omitted unless finite and positive.
    """
    positive = {name: min(max(x, _MIN), 1 / _MIN) for name, x in values.items() if isfinite(x) and x > 0}
    if not positive:
        return ""
    axes = _axes(label, _BAR * (len(positive) + 2), positive)
    axes.set_xscale("log")
    axes.plot(
        [*positive.values()], range(len(positive)), "o", color=_COLOURS[0], markersize=5, clip_on=False, gid="levels"
    )
    shown = [*positive.values()]
    if isfinite(limit) and limit > 0:
        axes.axvline(limit, color=_COLOURS[1], linestyle="--", clip_on=False)
        shown.append(limit)
    low, high = np.floor(np.log10(min(shown))), np.ceil(np.log10(max(shown)))  # at least two powers of ten
    axes.set_xlim(10.0**low, 10.0 ** max(high, low + 1))
    return inline(axes.figure, label)
