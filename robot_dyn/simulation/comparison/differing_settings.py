"""The settings in which two runs differ, by name, from the texts of the runs."""

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
_NAMED = 36  # longest name of a setting, and longest value, in letters, that names a run
_LONG = re.compile(r"-?\d+\.\d{4,}(?:e[-+]?\d+)?")
_UNIT = re.compile(r"^(-?[\d.]+(?:e[-+]?\d+)?) [^,]*$")  # a single number with its unit
_TEXTS = {
    "frame": "frame of the control",
    "right_angles": "right angles, in machine code",
    "bits": "bits of machine code",
    "versions": "versions",
}


@final
@dataclass(frozen=True)
class DifferingSetting:
    """A setting that differs between two runs.

    Attributes:
        name: Name of the setting.
        a, b: Values in the two runs, as texts; "—" if a run has none.
    """

    name: str
    a: str
    b: str


def differing_settings(a: TrajectoryData, b: TrajectoryData) -> tuple[DifferingSetting, ...]:
    """Return the differences of two runs in their settings, start, robot file and versions.

    Numbers are shortened to six digits if these differ. Runs without settings are compared by the names of their
    effects and the method.
    """
    settings = [_settings(run) for run in (a, b)]
    if None in settings:
        settings = [_of_old_run(run) for run in (a, b)]
    first, second = ({**(values or {}), **_texts(run)} for values, run in zip(settings, (a, b), strict=True))
    names = dict.fromkeys([*first, *second])
    return tuple(_pair(name, first, second) for name in names if first.get(name) != second.get(name))


def values_by_run(first: TrajectoryData, *others: TrajectoryData) -> dict[str, list[str]]:
    """Return the settings in which runs differ from the first, each with its value in every run."""
    pairs = [{setting.name: setting for setting in differing_settings(first, other)} for other in others]
    of_first = {name: setting.a for pair in pairs for name, setting in pair.items()}
    return {name: [a, *(pair[name].b if name in pair else a for pair in pairs)] for name, a in of_first.items()}


def run_names(*runs: TrajectoryData) -> tuple[str, ...]:
    """Return distinct names of runs: robots if these differ; otherwise files, settings that differ, or numbers.

    One or two settings name the runs. If more differ, one names them, and "…" stands for the others.
    """
    if len(runs) == 1:
        return (runs[0].metadata.get("robot", "run"),)
    return next(names for names in _names(runs) if len(set(names)) == len(runs))


def _names(runs: tuple[TrajectoryData, ...]) -> Iterator[tuple[str, ...]]:
    """Yield names of several runs, the best first; the last ones are distinct."""
    yield tuple(run.metadata.get("robot", "run") for run in runs)
    if all("file" in run.metadata for run in runs):
        stems = ((Path(run.metadata["file"]).stem, run.metadata.get("run")) for run in runs)
        yield tuple(" run ".join(filter(None, parts)) for parts in stems)
    values = values_by_run(*runs)
    short = {name: by_run for name, by_run in values.items() if max(map(len, (name, *by_run))) <= _NAMED}
    if len(values) == len(short) == 2:
        last = {name: name.rpartition(".")[2] for name in short}  # with units and paths two do not fit a legend
        labels = last if len(set(last.values())) == 2 else {name: name for name in short}
        both = ([_by(labels[name], _UNIT.sub(r"\1", x)) for x in by_run] for name, by_run in short.items())
        yield tuple(map(", ".join, zip(*both, strict=True)))
    for name, by_run in short.items():
        yield tuple(f"{_by(name, value)}{', …' * (len(values) > 1)}" for value in by_run)
    yield tuple(f"run {number}" for number in range(1, len(runs) + 1))


def _by(name: str, value: str) -> str:
    """Return a name of a run by a setting and its value."""
    return {ABSENT: f"without {name}", "acts": name}.get(value, f"{name} {value}")


def unknown_settings(a: TrajectoryData, b: TrajectoryData) -> tuple[str, ...]:
    """Return the unknown settings of two runs, in sentences."""
    notes = []
    if None in (_settings(a), _settings(b)):
        notes.append(
            "coefficients, control and reference: a run contains no settings, so only the names of effects are compared"
        )
    if code := {run.statistics.user_code for run in (a, b)} - {""}:
        notes.append(f"data of user-defined code other than its numbers: {', '.join(sorted(code))}")
    return tuple(notes)


def _settings(run: TrajectoryData) -> dict[str, str] | None:
    """Return the settings of a run; None if it has none that can be read."""
    try:
        settings = json.loads(run.metadata["settings"])
    except (KeyError, ValueError, RecursionError):
        return None
    is_text = isinstance(settings, dict) and all(isinstance(value, str) for value in settings.values())
    return settings if is_text else None


def _of_old_run(run: TrajectoryData) -> dict[str, str]:
    """Return effects, edits and method."""
    acted = dict.fromkeys(run.acting or (), "acts")
    step = {"step": f"{run.statistics.step_s!r} s"} if run.statistics.step_s else {}
    return acted | {"edits": run.metadata.get("edits", ""), "method": run.statistics.method} | step


def _texts(run: TrajectoryData) -> dict[str, str]:
    """Return start, accuracy, file of the robot and versions."""
    start = {f"start {key}": ", ".join(map(repr, getattr(run, key)[0].tolist())) for key in ("q", "v")}
    urdf = run.metadata.get("urdf")
    file = {} if urdf is None else {"file of the robot": f"SHA-256 {hashlib.sha256(urdf.encode()).hexdigest()[:12]}"}
    accuracy = {} if run.accuracy is None else {"accuracy": repr(float(run.accuracy.requested))}
    texts = {label: run.metadata[key] for key, label in _TEXTS.items() if key in run.metadata}
    return (start if run.t[0] == 0 else {}) | accuracy | file | texts


def _pair(name: str, first: Mapping[str, str], second: Mapping[str, str]) -> DifferingSetting:
    values = first.get(name, ABSENT), second.get(name, ABSENT)
    short = tuple(_LONG.sub(lambda at: f"{np.float64(at[0]):.6g}", value) for value in values)
    return DifferingSetting(name, *(short if short[0] != short[1] else values))
