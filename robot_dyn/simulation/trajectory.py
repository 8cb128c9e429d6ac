"""The trajectory of a run: samples with names and units, what each effect did, how it ended, how far to trust it."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import StrEnum
from typing import final

import numpy as np

from robot_dyn.simulation.error import ErrorEstimate
from robot_dyn.simulation.ledger import Ledger, largest
from robot_dyn.simulation.remarks import Remark
from robot_dyn.simulation.remarks import lines as said

_OPEN = 1e-3  # part of the energy exchanged beyond which a residual is no rounding and no small error


class Ending(StrEnum):
    """How a run ended."""

    FINISHED = "finished"
    DIVERGED = "diverged"
    STOPPED = "stopped"


@final
@dataclass(frozen=True)
class Outcome:
    """How a run ended: `ending` at time `t` in [s], and `advice` for a reader."""

    ending: Ending
    t: float
    advice: str = ""


@final
@dataclass(frozen=True)
class Statistics:
    """What a run took.

    Attributes:
        method: Name of the integrator.
        step_s: Its step, or 0 if it chose its own.
        steps: Number of steps.
        evaluations: Evaluations of the equation of motion.
        wall_s: Time of the run itself.
        companions_s: Time of the companion runs of the error estimate.
        engine: Which loop ran, and why if another was possible.
    """

    method: str
    step_s: float
    steps: int
    evaluations: int
    wall_s: float
    companions_s: float = 0.0
    engine: str = "interpreted"


@final
@dataclass(frozen=True)
class Trajectory:
    """Samples of a run, m of them; arrays are (m,) or (m, n).

    Attributes:
        joint_names: Of the n joints.
        t: In [s].
        q, v, a: In [rad], [rad/s], [rad/s²] or [m], [m/s], [m/s²].
        tau: Actuation within its bounds, in [N m] or [N].
        power: Of the control and of each effect without a potential, by name, in [W].
        ledger: Energy and work.
        wanted: Positions of a joint reference, or None.
        deviation: q − q wanted, (m, n); or p − p wanted of a frame that follows a Cartesian reference, (m, 3) in [m];
            None without a reference.
        outcome: How it ended.
        statistics: What it took.
        error: Its estimated error; None if companions were switched off.
        about: Texts that make it whole: URDF, its path, edits, scene, versions; the frame under control, if one is.
        wrenches: External wrench by link, rows (t, force, torque), (k, 7), in base axes at its frame, in SI units:
            at the samples and at both sides of each switch.
        at_stop: Whether each joint bears on a stop, (m, n); None without stops.
        remarks: What was seen at every step that the samples need not show.
        extremes: The least and the largest of q, v and tau over all steps, (3, 2, n); None if it was not watched.
    """

    joint_names: tuple[str, ...]
    t: np.ndarray
    q: np.ndarray
    v: np.ndarray
    a: np.ndarray
    tau: np.ndarray
    power: dict[str, np.ndarray]
    ledger: Ledger
    wanted: np.ndarray | None
    deviation: np.ndarray | None
    outcome: Outcome
    statistics: Statistics
    error: ErrorEstimate | None = None
    about: dict[str, str] = field(default_factory=dict, repr=False)
    wrenches: dict[str, np.ndarray] = field(default_factory=dict)
    at_stop: np.ndarray | None = None
    remarks: tuple[Remark, ...] = ()
    extremes: np.ndarray | None = None

    @property
    def tracking_error(self) -> float | None:
        """Root mean square of the deviation over samples and joints or axes; None without a reference."""
        return None if self.deviation is None else float(np.sqrt(np.mean(self.deviation**2)))

    @property
    def summary(self) -> str:
        """A few lines: outcome, ledger, error, tracking, cost."""
        s, ledger = self.statistics, self.ledger
        opening = f"{self.outcome.ending} at t = {self.outcome.t:g} s, {len(self.t)} samples"
        residual = f"residual {largest(np.abs(ledger.residual)):.2e} J, {ledger.closure:.1e} of exchanged"
        leak = "it does not close: take a smaller step" if ledger.closure > _OPEN else ""
        lines = [
            opening + _after(self.outcome.advice),
            f"effects: {', '.join(self.power)}",
            f"energy ledger: {residual}" + _after(leak),
            f"error of q: {self.error or 'not estimated (companion runs are off)'}",
        ]
        lines += ["between samples: not watched"] if self.extremes is None else []
        lines += said(self.remarks)
        if self.tracking_error is not None:
            what = "the frame, m" if self.wanted is None else "q"
            lines.append(f"tracking error of {what}: {self.tracking_error:.3e} rms")
        step = f"step {s.step_s:.4g} s, " if s.step_s else ""
        lines.append(
            f"{s.method}: {step}{s.steps} steps, {s.evaluations} evaluations, {s.wall_s:.2f} s"
            + (f" and {s.companions_s:.2f} s for companions" if s.companions_s else "")
            + f", {s.engine}"
        )
        return "\n".join(lines)


def _after(text: str) -> str:
    return f"; {text}" if text else ""
