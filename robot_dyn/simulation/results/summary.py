"""The summary of a run: outcome, effects, energy ledger, error, remarks, tracking, cost."""

from __future__ import annotations

import json

import numpy as np

from robot_dyn.foundations.errors import escaped
from robot_dyn.queries.units import joint_units
from robot_dyn.simulation.dynamics.event import Occurrence
from robot_dyn.simulation.observation.remarks import remark_lines as lines_of
from robot_dyn.simulation.results.ledger import largest
from robot_dyn.simulation.results.provenance import about_the_robot, joint_types
from robot_dyn.simulation.results.run_data import RunData, TrajectoryData
from robot_dyn.simulation.run.outcome import Ending

_LISTED = 3  # events in a summary
_SHORTER = 0.98  # of the requested step; the summary explains a shorter mean step
_NOTICED = 0.01  # [s]: shorter times are left out


def summary(run: TrajectoryData) -> str:
    """Return a few lines: outcome, effects, ledger, error, tracking, cost."""
    s, ledger, unit = run.statistics, run.ledger, joint_units("q", joint_types(run))
    opening = f"{run.outcome.ending} at t = {run.outcome.t:g} s, {len(run.t)} samples"
    part = f"{ledger.closure:.1e} of the energy exchanged" if ledger.exchanges else "no energy exchanged"
    residual = f"residual {largest(np.abs(ledger.residual)):.2e} J, {part}"
    lines = [
        opening + _after(run.outcome.text),
        *([] if run.acting is None else [f"effects: {', '.join(run.acting) or 'none'}"]),
        *([f"right angles, in machine code: {run.metadata['right_angles']}"] if "right_angles" in run.metadata else []),
        *([f"bits of machine code: {run.metadata['bits']}"] if "bits" in run.metadata else []),
        f"energy ledger: {residual}" + _after(run.leak) if ledger.is_recorded else "energy ledger: was not recorded",
        f"error of q [{unit}]: {run.error or _not_estimated(run)}",
        *about_the_robot(run),
    ]
    lines += [] if run.accuracy is None else [f"accuracy: {run.accuracy}"]
    lines += ["between samples: not observed"] if run.extremes is None else []
    lines += [f"events: {_events_text(run.events)}"] if run.events else []
    lines += [line for line in lines_of(run.remarks) if line != run.outcome.text]
    if run.rms_tracking_error is not None:
        lines.append(f"{of_tracking(run, run.desired is None)}: {run.rms_tracking_error:.3e} rms")
    step = f"step {s.step_s:.4g} s{_shortened(run)}, " if s.step_s else ""
    lines.append(f"{s.method}: {step}{s.steps} steps, {s.evaluations} evaluations, {s.engine}")
    if s.user_code and s.companion_runs:
        lines.append(
            f"error estimate: {s.companion_evaluations} evaluations in {s.companion_runs} companion runs, which"
            f" call {s.user_code} as well; estimate_error=False leaves them out"
        )
    parts = (
        ("compile", s.compile_s),
        ("run", s.wall_s),
        ("error estimate", s.companions_s),
        ("samples", s.samples_s),
    )
    lines.append(
        "time: " + ", ".join(f"{name} {spent:.2g} s" for name, spent in parts if spent >= _NOTICED or name == "run")
    )
    return "\n".join(map(escaped, lines))


def _shortened(run: TrajectoryData) -> str:
    """Return the requested step, if the steps taken are shorter by more than 2 % on average; else empty."""
    try:
        requested = float(json.loads(run.metadata["settings"])["step"].removesuffix(" s"))
    except (KeyError, TypeError, ValueError, AttributeError):  # an adaptive method, or a file without settings
        return ""
    if not run.statistics.step_s < _SHORTER * requested:
        return ""
    return f" (step_s = {requested:g} s, shortened to end at samples, ticks, switches and events)"


def of_tracking(run: RunData, of_frame: bool) -> str:
    """Return the heading of a tracking error, with its unit."""
    quantity = "the frame [m]" if of_frame else f"q [{joint_units('q', joint_types(run))}]"
    return f"tracking error of {quantity}"


def _not_estimated(run: TrajectoryData) -> str:
    """Return the line for a run without an error estimate, with the reason."""
    if run.outcome.ending is Ending.STOPPED:
        return "not estimated (the run was stopped)"
    return f"not estimated ({'a run of rollouts' if 'run' in run.metadata else 'estimate_error is False'})"


def _events_text(events: tuple[Occurrence, ...]) -> str:
    """Return the first events and their times."""
    first = [f"{event.name} at {event.t:.4g} s" for event in events[:_LISTED]]
    return ", ".join(first) + (f", and {len(events) - _LISTED} more" if len(events) > _LISTED else "")


def _after(text: str) -> str:
    return f"; {text}" if text else ""
