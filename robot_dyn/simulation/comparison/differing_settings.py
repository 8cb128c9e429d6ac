"""The settings in which two runs differ, by name, from the texts that they carry."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import final

import numpy as np

from robot_dyn.simulation.results.run_data import TrajectoryData

ABSENT = "—"
_NAMED = 36  # letters of a setting, or of its value, by which a run is named
_LONG = re.compile(r"-?\d+\.\d{4,}(?:e[-+]?\d+)?")
_UNIT = re.compile(r"^(-?[\d.]+(?:e[-+]?\d+)?) [^,]*$")  # of a number alone
_TEXTS = {"frame": "frame of the control", "right_angles": "right angles, in machine code", "versions": "versions"}


@final
@dataclass(frozen=True)
class DifferingSetting:
    """A setting, by name, and its value in each of two runs; "—" where it has none."""

    name: str
    a: str
    b: str


def differing_settings(a: TrajectoryData, b: TrajectoryData) -> tuple[DifferingSetting, ...]:
    """What differs in the settings of two runs, in their start, in the file of the robot and in versions.

    Numbers are shortened to six digits where these differ. Of runs that carry no settings, what acted and the method
    are compared.
    """
    known = [_settings(run) for run in (a, b)]
    if None in known:
        known = [_of_old_run(run) for run in (a, b)]
    first, second = ({**(each or {}), **_texts(run)} for each, run in zip(known, (a, b), strict=True))
    names = dict.fromkeys([*first, *second])
    return tuple(_pair(name, first, second) for name in names if first.get(name) != second.get(name))


def run_names(*runs: TrajectoryData) -> tuple[str, ...]:
    """Return names of runs: their robots, if these differ; else their files, or settings that differ; else numbers.

    One or two settings name them; of more, one does, and "…" says that there are others. All differ from each other.
    """
    if len(runs) == 1:
        return (runs[0].about.get("robot", "run"),)
    return next(names for names in _names(runs) if len(set(names)) == len(runs))


def _names(runs: tuple[TrajectoryData, ...]) -> Iterator[tuple[str, ...]]:
    """Yield names of several runs, the best first; the last ones differ."""
    yield tuple(run.about.get("robot", "run") for run in runs)
    if all("file" in run.about for run in runs):
        stems = ((Path(run.about["file"]).stem, run.about.get("run")) for run in runs)
        yield tuple(" run ".join(filter(None, parts)) for parts in stems)
    pairs = [{x.name: x for x in differing_settings(runs[0], run)} for run in runs[1:]]
    first = {name: setting.a for pair in pairs for name, setting in pair.items()}
    values = {name: [a, *(pair[name].b if name in pair else a for pair in pairs)] for name, a in first.items()}
    short = {name: of for name, of in values.items() if max(map(len, (name, *of))) <= _NAMED}
    if len(values) == len(short) == 2:
        last = {name: name.rpartition(".")[2] for name in short}  # with units and paths two do not fit a legend
        called = last if len(set(last.values())) == 2 else {name: name for name in short}
        both = ([_by(called[name], _UNIT.sub(r"\1", x)) for x in of] for name, of in short.items())
        yield tuple(map(", ".join, zip(*both, strict=True)))
    for name, of in short.items():
        yield tuple(f"{_by(name, value)}{', …' * (len(values) > 1)}" for value in of)
    yield tuple(f"run {number}" for number in range(1, len(runs) + 1))


def _by(name: str, value: str) -> str:
    """Return a name of a run by a setting and its value."""
    return {ABSENT: f"without {name}", "acts": name}.get(value, f"{name} {value}")


def unknown_settings(a: TrajectoryData, b: TrajectoryData) -> tuple[str, ...]:
    """What is not known of the settings of two runs, in sentences."""
    notes = []
    if None in (_settings(a), _settings(b)):
        notes.append("coefficients, control and reference: a run carries no settings, so only what acted is compared")
    if code := {run.statistics.user_code for run in (a, b)} - {""}:
        notes.append(f"what user-defined code holds beside its numbers: {', '.join(sorted(code))}")
    return tuple(notes)


def _settings(run: TrajectoryData) -> dict[str, str] | None:
    """Those that a run carries; None if it carries none that can be read."""
    try:
        settings = json.loads(run.about["settings"])
    except (KeyError, ValueError, RecursionError):
        return None
    is_text = isinstance(settings, dict) and all(isinstance(value, str) for value in settings.values())
    return settings if is_text else None


def _of_old_run(run: TrajectoryData) -> dict[str, str]:
    """What acted, edits and method."""
    acted = dict.fromkeys(run.acting or (), "acts")
    step = {"step": f"{run.statistics.step_s!r} s"} if run.statistics.step_s else {}
    return acted | {"edits": run.about.get("edits", ""), "method": run.statistics.method} | step


def _texts(run: TrajectoryData) -> dict[str, str]:
    """Start, accuracy, file of the robot, versions."""
    start = {f"start {key}": ", ".join(map(repr, getattr(run, key)[0].tolist())) for key in ("q", "v")}
    urdf = run.about.get("urdf")
    file = {} if urdf is None else {"file of the robot": f"SHA-256 {hashlib.sha256(urdf.encode()).hexdigest()[:12]}"}
    asked = {} if run.accuracy is None else {"accuracy": repr(float(run.accuracy.requested))}
    texts = {label: run.about[key] for key, label in _TEXTS.items() if key in run.about}
    return (start if run.t[0] == 0 else {}) | asked | file | texts


def _pair(name: str, first: Mapping[str, str], second: Mapping[str, str]) -> DifferingSetting:
    values = first.get(name, ABSENT), second.get(name, ABSENT)
    short = tuple(_LONG.sub(lambda at: f"{np.float64(at[0]):.6g}", value) for value in values)
    return DifferingSetting(name, *(short if short[0] != short[1] else values))
