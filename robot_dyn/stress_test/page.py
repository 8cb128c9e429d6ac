"""The page of a stress test: one HTML file without scripts, with the lines that repeat each finding."""

from __future__ import annotations

from base64 import b64encode
from collections.abc import Iterable, Iterator
from hashlib import sha256
from html import escape
from math import isfinite
from pathlib import Path

from robot_dyn import files
from robot_dyn.errors import RobotDynError
from robot_dyn.stress_test.finding import Judged, Limit, Worst
from robot_dyn.stress_test.result import Stress
from robot_dyn.validate import instance

REPORT = files.Kind("a page", ".html", b"<!DOCTYPE html>")
_POLICY = "default-src 'none'; base-uri 'none'; form-action 'none'; style-src 'sha256-{}'"

WORST = ("quantity", "joint", "typical", "worst random", "searched", "at few digits", "note")
LIMITS = ("of", "what", "joint", "limit", "at 0.98", "at 1.02", "")
RUNS = ("run", "duration", "estimated", "true", "known to", "says", "")


class ReportError(RobotDynError):
    """A report that cannot be written."""


def save_stress(result: Stress, path: str | Path) -> Path:
    """Write the report as one HTML page, with the lines to paste that repeat each finding; .html if it has no suffix.

    Another page under that name is replaced; any other file is not.

    Args:
        result: Of `stress`.
        path: Where to.

    Raises:
        QueryError: If an argument is wrong.
        ReportError: If it cannot be written.
    """
    instance("result", result, Stress, "give that of rd.stress")
    to = files.target(path, REPORT, ReportError)
    return files.save(to, lambda stream: stream.write(page(result).encode("utf-8")), ReportError)


def page(result: Stress) -> str:
    """The HTML text."""
    style = (Path(__file__).parent / "page.css").read_text(encoding="utf-8")
    policy = _POLICY.format(b64encode(sha256(style.encode()).digest()).decode())
    title = escape(f"{result.robot}: what breaks first")
    return (
        f'<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n<meta name="viewport" content="width='
        f'device-width, initial-scale=1">\n<meta http-equiv="Content-Security-Policy" content="{escape(policy)}">\n'
        f"<title>{title}</title>\n<style>{style}</style>\n</head>\n<body>\n"
        + "".join(_body(result))
        + "</body>\n</html>\n"
    )


def _body(result: Stress) -> Iterator[str]:
    yield f"<h1>{escape(result.robot)}: what breaks first</h1>\n<p>{escape(result.sentence)}</p>\n"
    yield from (f'<p class="fails">failure: {escape(each)}</p>\n' for each in result.failures)
    yield "<h2>Worst configurations</h2>\n"
    yield f"<p>searched for from {result.samples} random states within the limits of the file</p>\n"
    yield from _section(result, WORST, result.worst)
    yield "<h2>Limits</h2>\n<p>from linearisation and closed forms; runs at 0.98 and 1.02 of each</p>\n"
    yield from _section(result, LIMITS, result.limits)
    yield "<h2>Random runs</h2>\n<p>estimated errors of q in rad or m, held against better runs</p>\n"
    yield from _section(result, RUNS, result.runs)
    if result.out_of_time:
        yield f"<h2>Not looked at for lack of time</h2>\n<ul>{_items(result.out_of_time)}</ul>\n"
    if result.left_out:
        yield f"<h2>Left out</h2>\n<ul>{_items(result.left_out)}</ul>\n"
    versions = ", ".join(f"{name} {value}" for name, value in result.environment.items())
    yield f"<footer>seed {result.seed}; {result.spent_s:.0f} s; {escape(versions)}</footer>\n"


def _items(words: Iterable[str]) -> str:
    return "".join(f"<li>{escape(each)}</li>" for each in words)


def _section(result: Stress, headings: tuple[str, ...], findings: Iterable[Worst | Limit | Judged]) -> Iterator[str]:
    """A table, and the lines of each of its rows."""
    findings = tuple(findings)
    if not findings:
        yield "<p>none; see below what was left out</p>\n"
        return
    yield '<div class="table"><table><tr>' + "".join(f"<th>{each}</th>" for each in headings) + "</tr>\n"
    for each in findings:
        fails = ' class="fails"' if is_failure(each) else ""
        yield f"<tr{fails}>" + "".join(_cell(text) for text in cells(each)) + "</tr>\n"
    yield "</table></div>\n"
    for each in findings:
        if each.python:
            yield f"<details><summary>{escape(named(each))}</summary>\n<pre>{escape(result.python(each))}</pre>\n"
            if command := getattr(each, "command", ""):
                yield f"<pre>robot-dyn {escape(command)}</pre>\n"
            yield "</details>\n"


def _cell(text: str) -> str:
    return f"<td{' class=words' if len(text) > 20 else ''}>{escape(text)}</td>"


def is_failure(each: Worst | Limit | Judged) -> bool:
    """Whether the library fails at it."""
    return (isinstance(each, Limit) and each.confirmed is False) or (isinstance(each, Judged) and each.misleads)


def named(each: Worst | Limit | Judged) -> str:
    """A finding in a few words."""
    if isinstance(each, Worst):
        return f"{each.what}{f' of {each.joint}' if each.joint else ''}: {figure(each.minimal)} {each.unit}".rstrip()
    if isinstance(each, Limit):
        return f"{each.of}, {each.what}: {_limit(each)}"
    return each.what


def cells(each: Worst | Limit | Judged) -> tuple[str, ...]:
    """The row of a finding, for people."""
    if isinstance(each, Worst):
        unit = f" {each.unit}" if each.unit else ""
        searched = figure(each.searched) + ("" if each.found else " (none worse)")
        sizes = (figure(each.typical), figure(each.random), searched, figure(each.minimal) + unit)
        return (each.what, each.joint, *sizes, each.note)
    if isinstance(each, Limit):
        verdict = {True: "confirmed", False: "REFUTED", None: ""}[each.confirmed]
        return (each.of, each.what, each.joint, _limit(each), each.within, each.beyond, verdict)
    errors = (figure(each.estimated, "–"), figure(each.true, "–"), figure(each.unsure, "–"))
    return (each.what, f"{each.duration_s:g} s", *errors, each.said, "MISLEADS" if each.misleads else "")


def _limit(each: Limit) -> str:
    return f"{each.value:.4g} {each.unit}" if isfinite(each.value) else "none"


def figure(x: float, none: str = "none") -> str:
    """A number in four digits."""
    return f"{x:.4g}" if isfinite(x) else none
