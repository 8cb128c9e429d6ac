"""The energy ledger of a run: E(t) − E(0) = Σ W_k(t) + residual, with E = K + Σ potentials.

A residual near zero is necessary for a correct run, not sufficient: the error estimate measures the accuracy.
`diagnostics/imbalance.py` finds why a ledger does not close.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, final

import numpy as np

from robot_dyn.foundations.store import Layout
from robot_dyn.foundations.values import ReadOnly
from robot_dyn.simulation.results.doubts import Doubt
from robot_dyn.simulation.results.error_estimate import ErrorEstimate

_OPEN = 1e-3  # largest residual of a ledger that closes, relative to the energy exchanged
_ROUNDING = 1e-12  # fraction of the energies whose difference is the residual
# Residuals relative to the energy exchanged: over 150 random scenes they were at most 10 times the estimated error of
# q relative to the motion. A far larger one contradicts the estimate.
_CONTRADICTS = 100.0


@final
@dataclass(frozen=True, eq=False, repr=False)
class Ledger(ReadOnly):
    """Energy at the samples of a run, in [J]; arrays of shape (m,).

    Attributes:
        kinetic: K.
        potential: Potential energy of gravity and of the conservative effects.
        work: Work done up to each sample by the control and by each effect, by name.
        kinetic_peak: Largest known K between the samples.
        stored: Energy stored in effects with states, by name; their work includes it.
        cause: Reason why the ledger does not close; None if it closes, or if no reason was sought.
    """

    kinetic: Annotated[np.ndarray, Layout(("m",), absent=True)]
    potential: Annotated[np.ndarray, Layout(("m",), absent=True)]
    work: dict[str, Annotated[np.ndarray, Layout(("m",), absent=True)]]
    kinetic_peak: float = 0.0
    stored: dict[str, Annotated[np.ndarray, Layout(("m",))]] = field(default_factory=dict)
    cause: Doubt | None = None

    def __repr__(self) -> str:
        if not self.is_recorded:
            return "<Ledger: not recorded>"
        worst = f"largest residual {largest(np.abs(self.residual)):.2e} J of {self.exchanged:.3g} J exchanged"
        return f"<Ledger: {worst}; work of {', '.join(self.work) or 'nothing'}>"

    @property
    @np.errstate(all="ignore")
    def energy(self) -> np.ndarray:
        """E = K + Σ potentials."""
        return self.kinetic + self.potential

    @property
    @np.errstate(all="ignore")  # energies of a run that diverged may overflow
    def residual(self) -> np.ndarray:
        """E(t) − E(0) − Σ W_k(t): unexplained energy, the error of the run in energy."""
        return self.energy - self.energy[0] - sum(self.work.values(), start=np.zeros_like(self.kinetic))

    @property
    def is_recorded(self) -> bool:
        """True if it was recorded: energies or work of rollouts may be nan throughout."""
        return not np.isnan(self.residual).all()

    @property
    @np.errstate(all="ignore")
    def exchanged(self) -> float:
        """Energy exchanged: max K + Σ ∫ |P_k|, K over steps and samples, the integrals over the samples."""
        moved = sum(float(np.nansum(np.abs(np.diff(work)))) for work in self.work.values())
        return max(largest(self.kinetic), self.kinetic_peak) + moved

    @property
    def closes(self) -> bool:
        """True if the residual is at most a thousandth of the energy exchanged, or rounding."""
        return self.rounded or not self.closure > _OPEN

    @property
    def rounded(self) -> bool:
        """True if the residual is rounding: at most 1e-12 of the energies and the work that are added up."""
        return bool(largest(np.abs(self.residual)) <= self._rounding)

    @property
    def exchanges(self) -> bool:
        """True if energy was exchanged, beyond rounding of the energies."""
        return self.exchanged > self._rounding

    @property
    def _rounding(self) -> float:
        parts = (self.kinetic, self.potential, *self.work.values())
        return _ROUNDING * sum(largest(np.abs(part)) for part in parts if not np.isnan(part).all())

    @property
    def closure(self) -> float:
        """Largest residual relative to the energy exchanged; 0 if nothing moved."""
        return largest(np.abs(self.residual)) / self.exchanged if self.exchanged > 0 else 0.0


def largest(values: np.ndarray) -> float:
    """Return the largest value that is not nan; nan if all are, as in a run that ended before its first step."""
    numbers = values[~np.isnan(values)]
    return float(numbers.max()) if len(numbers) else float("nan")


def leak(ledger: Ledger, error: ErrorEstimate | None, q: np.ndarray) -> str:
    """Return the text of `Trajectory.leak`.

    Args:
        ledger: The ledger of a run.
        error: Estimated error of the run.
        q: Positions at its samples, (m, n).
    """
    if not ledger.closes:
        return f"it does not close: {ledger.cause or 'simulate it with its error estimate, which finds the cause'}"
    if ledger.rounded or error is None:
        return ""
    span = float(np.ptp(q, axis=0).max())
    if not span > 0 or ledger.closure <= _CONTRADICTS * max(error.largest / span, _ROUNDING):
        return ""
    doubt = "do not trust the estimate, " if ledger.cause is None or ledger.cause.is_of_steps else ""
    return (
        f"it does not close as well as the estimated error of q implies: {doubt}{ledger.cause or 'use a smaller step'}"
    )
