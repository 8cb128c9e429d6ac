"""The settings in which two runs differ, by name, from the texts that they carry."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Iterable, Mapping
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
    """Names of runs: their robots, if these differ; else their files, or what differs in settings; else numbers.

    One or two settings name them; of more, one does, and "…" says that there are others. All differ from each other.
    """
    robots, files = ([run.about.get(key, "") for run in runs] for key in ("robot", "file"))
    if len(runs) == 1 or _all_differ(robots):
        return tuple(each or "run" for each in robots)
    stems = [
        " run ".join(filter(None, (Path(f).stem, run.about.get("run")))) for f, run in zip(files, runs, strict=True)
    ]
    if all(files) and _all_differ(stems):
        return tuple(stems)
    pairs = [differing_settings(runs[0], other) for other in runs[1:]]
    of_first = {each.name: each.a for pair in pairs for each in pair}
    values = {
        name: [a, *(next((each.b for each in pair if each.name == name), a) for pair in pairs)]
        for name, a in of_first.items()
    }
    short = {name: each for name, each in values.items() if max(map(len, (name, *each))) <= _NAMED}
    if len(values) == len(short) == 2:
        last = {name: name.rpartition(".")[2] for name in short}  # with units and paths two do not fit a legend
        called = last if _all_differ(last.values()) else {name: name for name in short}
        both = tuple(
            ", ".join(_by(called[name], _UNIT.sub(r"\1", each[k])) for name, each in short.items())
            for k in range(len(runs))
        )
        if _all_differ(both):
            return both
    others = ", …" if len(values) > 1 else ""
    for name, each in short.items():
        if _all_differ(each):
            return tuple(f"{_by(name, value)}{others}" for value in each)
    return tuple(f"run {number}" for number in range(1, len(runs) + 1))


def _by(name: str, value: str) -> str:
    """A run by a setting and its value."""
    return f"{'without ' if value == ABSENT else ''}{name}{_unless_absent(value)}"


def _all_differ(names: Iterable[str]) -> bool:
    names = list(names)
    return len(set(names)) == len(names)


def _unless_absent(value: str) -> str:
    return "" if value in (ABSENT, "acts") else f" {value}"


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
