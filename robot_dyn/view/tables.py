"""Tables of runs: their differing settings, their cost, and the cost of one digit more or fewer."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

from robot_dyn.queries.units import format_duration, joint_units
from robot_dyn.simulation.comparison.difference import comparable
from robot_dyn.simulation.comparison.differing_settings import values_by_run
from robot_dyn.simulation.results.provenance import joint_types
from robot_dyn.simulation.results.run_data import TrajectoryData

_NONE = "–"
_MAX_SETTINGS = 60


def settings_table(named: Sequence[tuple[str, TrajectoryData]]) -> dict[str, Any]:
    """Return the settings in which runs differ from the first; no rows if the robots differ."""
    first, *others = (run for _, run in named)
    if any(not comparable(first, other) for other in others):
        return {"runs": [], "rows": []}
    rows = [[name, *values] for name, values in values_by_run(first, *others).items()]
    return {"runs": [name for name, _ in named], "rows": rows[:_MAX_SETTINGS]}


def cost_table(named: Sequence[tuple[str, TrajectoryData]]) -> dict[str, Any]:
    """Return the names of the runs, and rows with a heading and one text per run; empty rows are omitted."""
    columns = [dict(_rows(run)) for _, run in named]
    headings = dict.fromkeys(heading for column in columns for heading in column)
    rows = [[heading, *(column.get(heading, _NONE) for column in columns)] for heading in headings]
    return {"runs": [name for name, _ in named], "rows": rows}


def _rows(run: TrajectoryData) -> Iterator[tuple[str, str]]:
    s, unit = run.statistics, joint_units("q", joint_types(run))
    yield "method", f"{s.method}, step {s.step_s:.4g} s" if s.step_s else s.method
    yield "engine", s.engine
    yield "steps", str(s.steps)
    yield "evaluations", str(s.evaluations)
    yield f"estimated error of q [{unit}]", "not estimated" if run.error is None else str(run.error)
    yield "time of the loop", format_duration(s.wall_s)
    if s.companion_evaluations:
        yield "error estimate", f"{s.companion_evaluations} evaluations, {format_duration(s.companions_s)}"
    if run.accuracy is not None:
        yield from _accuracy(run)


def _accuracy(run: TrajectoryData) -> Iterator[tuple[str, str]]:
    """Yield the requested accuracy and the cost of one digit more or fewer; assume time proportional to evaluations."""
    accuracy = run.accuracy
    assert accuracy is not None
    at = f", at rtol {accuracy.rtol:.1e}" if accuracy.rtol else ""
    yield "requested accuracy", f"{accuracy.requested:.1e}{at}"
    yield "pilots and check", f"{accuracy.pilots} and {accuracy.check} evaluations"
    for name, evaluations in (("a digit more", accuracy.digit_more), ("a digit less", accuracy.digit_less)):
        part = evaluations / max(accuracy.run, 1)
        yield name, f"about {evaluations:.0f} evaluations, {format_duration(part * run.statistics.wall_s)}"
