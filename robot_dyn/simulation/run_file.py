"""Run files: one .npz that holds a trajectory and all it came from, and a table of it as CSV.

Arrays keep their names; what is text (joint names, outcome, statistics, URDF, edits, scene, versions) is one JSON text.
"""

from __future__ import annotations

import csv
import io
import json
import zipfile
import zlib
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from robot_dyn.errors import RobotDynError
from robot_dyn.files import save, target
from robot_dyn.simulation.error import ErrorEstimate
from robot_dyn.simulation.ledger import Ledger
from robot_dyn.simulation.trajectory import Ending, Outcome, Statistics, Trajectory

FORMAT = 2
_SAMPLES = ("t", "q", "v", "a", "tau")
_OPTIONAL = ("wanted", "deviation", "at_stop")


_DAMAGE = (OSError, ValueError, KeyError, TypeError, EOFError, NotImplementedError, zipfile.BadZipFile, zlib.error)


class RunFileError(RobotDynError):
    """A run file that cannot be written or read."""


def save_run(trajectory: Trajectory, path: str | Path) -> Path:
    """Write a trajectory to `path` (.npz is added if it has no suffix), whole or not at all.

    Raises:
        RunFileError: If it cannot be written.
    """
    path = target(path, ".npz", RunFileError)
    arrays: dict[str, np.ndarray] = {name: getattr(trajectory, name) for name in _SAMPLES}
    arrays |= {"kinetic": trajectory.ledger.kinetic, "potential": trajectory.ledger.potential}
    arrays |= {f"work/{name}": work for name, work in trajectory.ledger.work.items()}
    arrays |= {f"power/{name}": power for name, power in trajectory.power.items()}
    arrays |= {f"wrench/{link}": wrench for link, wrench in trajectory.wrenches.items()}
    arrays |= {name: x for name in _OPTIONAL if (x := getattr(trajectory, name)) is not None}
    about: dict[str, Any] = {
        "format": FORMAT,
        "joint_names": trajectory.joint_names,
        "outcome": asdict(trajectory.outcome),
        "statistics": asdict(trajectory.statistics),
        "about": trajectory.about,
    }
    if trajectory.error is not None:
        arrays |= {"error/t": trajectory.error.t, "error/error": trajectory.error.error}
        about["error"] = {"resolved_until": trajectory.error.resolved_until, "note": trajectory.error.note}
    arrays["about"] = np.array(json.dumps(about))
    return save(path, lambda stream: np.savez_compressed(stream, **arrays), RunFileError)  # pyright: ignore[reportArgumentType]


def load_run(path: str | Path) -> Trajectory:
    """The trajectory of a run file.

    Raises:
        RunFileError: If it is missing, damaged, cut short or of another format.
    """
    try:
        with np.load(io.BytesIO(Path(path).read_bytes()), allow_pickle=False) as file:
            arrays = dict(file)
        about = json.loads(str(arrays["about"]))
        if about["format"] != FORMAT:
            raise RunFileError(
                f"{path}: has format {about['format']!r}, this version reads {FORMAT}; simulate again with this version"
            )
        return _consistent(_trajectory(arrays, about))
    except FileNotFoundError:
        raise RunFileError(f"{path}: there is no such file; write one with robot-dyn simulate … -o {path}") from None
    except _DAMAGE as error:
        raise RunFileError(f"{path}: is no whole run file ({type(error).__name__}); simulate again") from None
    except _InconsistentError as error:
        raise RunFileError(f"{path}: is no whole run file: {error}; simulate again") from None


def export_csv(trajectory: Trajectory, path: str | Path) -> Path:
    """Write the samples as a table, a row each, with names and units in the heading.

    Raises:
        RunFileError: If it cannot be written.
    """
    names = trajectory.joint_names
    heading = ["t [s]"]
    for key, unit in (("q", "rad or m"), ("v", "rad/s or m/s"), ("a", "rad/s² or m/s²"), ("tau", "N m or N")):
        heading += [f"{key} {name} [{unit}]" for name in names]
    heading += [f"power {name} [W]" for name in trajectory.power] + ["energy [J]", "residual [J]"]
    columns = [trajectory.t[:, None], trajectory.q, trajectory.v, trajectory.a, trajectory.tau]
    columns += [power[:, None] for power in trajectory.power.values()]
    columns += [trajectory.ledger.energy[:, None], trajectory.ledger.residual[:, None]]

    table = io.StringIO()
    csv.writer(table).writerows([heading, *np.hstack(columns).tolist()])
    return save(
        target(path, ".csv", RunFileError), lambda stream: stream.write(table.getvalue().encode()), RunFileError
    )


def _trajectory(arrays: dict[str, np.ndarray], about: dict[str, Any]) -> Trajectory:
    def group(prefix: str) -> dict[str, np.ndarray]:
        return {name.removeprefix(prefix): x for name, x in arrays.items() if name.startswith(prefix)}

    error = None
    if "error" in about:
        error = ErrorEstimate(arrays["error/t"], arrays["error/error"], **about["error"])
    outcome = about["outcome"]
    return Trajectory(
        joint_names=tuple(about["joint_names"]),
        **{name: arrays[name] for name in _SAMPLES},
        power=group("power/"),
        ledger=Ledger(arrays["kinetic"], arrays["potential"], group("work/")),
        wanted=arrays.get("wanted"),
        deviation=arrays.get("deviation"),
        at_stop=arrays.get("at_stop"),
        wrenches=group("wrench/"),
        outcome=Outcome(Ending(outcome["ending"]), outcome["t"], outcome["advice"]),
        statistics=Statistics(**about["statistics"]),
        error=error,
        about=about["about"],
    )


class _InconsistentError(Exception):
    """Internal: an array of a run does not fit the others."""


def _consistent(run: Trajectory) -> Trajectory:
    """The run, whose arrays fit together: lengths, kinds, order of time."""
    m, n = len(run.t), len(run.joint_names)
    ledger = {"kinetic": run.ledger.kinetic, "potential": run.ledger.potential} | run.ledger.work | run.power
    shapes = [(name, getattr(run, name), (m, n)) for name in ("q", "v", "a", "tau")]
    shapes += [("t", run.t, (m,)), *((name, column, (m,)) for name, column in ledger.items())]
    shapes += [(f"wrench on {link}", F, (len(F), 7)) for link, F in run.wrenches.items()]
    for name, array, columns in (("wanted", run.wanted, (n,)), ("deviation", run.deviation, (n, 3))):
        if array is not None:
            shapes.append((name, array, (m, array.shape[-1] if array.shape[-1:] and array.shape[-1] in columns else n)))
    for name, array, shape in shapes:
        if array.shape != shape or array.dtype != np.float64:
            raise _InconsistentError(f"{name} holds {array.dtype} {array.shape}, not float64 {shape}")
    if run.at_stop is not None and (run.at_stop.shape != (m, n) or run.at_stop.dtype != bool):
        raise _InconsistentError(f"at_stop holds {run.at_stop.dtype} {run.at_stop.shape}, not bool {(m, n)}")
    times = [run.t, *(F[:, 0] for F in run.wrenches.values())]
    if not all(np.isfinite(t).all() and (np.diff(t) >= 0).all() for t in times):
        raise _InconsistentError("its times are not finite, or do not grow")
    if not all(np.isfinite(F).all() for F in run.wrenches.values()):
        raise _InconsistentError("a wrench is not finite")
    texts: dict[Any, Any] = run.about
    if not isinstance(texts, dict) or not all(isinstance(text, str) for text in (*texts, *texts.values())):
        raise _InconsistentError("what it is about is no text")
    return run
