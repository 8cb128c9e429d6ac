"""The energy ledger of a run: E(t) − E(0) = Σ W_k(t) + residual, with E = K + Σ potentials.

A residual near zero is necessary for a run to be right, not sufficient: the error estimate is the figure of accuracy.
Why one is not near zero is found by `imbalance`.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, final

import numpy as np

from robot_dyn.foundations.store import Layout
from robot_dyn.foundations.values import Value, read_only
from robot_dyn.simulation.results.error_estimate import ErrorEstimate

_OPEN = 1e-3  # a residual, as a part of the energy exchanged
_ROUNDING = 1e-12  # of the energies, whose differences are the residual
# Residuals, as parts of the energy exchanged. Over 150 random scenes they were at most 10 times the estimated error of
# q, as a part of the motion; one that is far larger contradicts the estimate.
_CONTRADICTS = 100.0


@final
@dataclass(frozen=True, eq=False, repr=False)
class Ledger(Value):
    """Energy at the samples of a run, in [J]; arrays of shape (m,).

    Attributes:
        kinetic: K.
        potential: Of gravity and of the conservative effects.
        work: Done up to each sample by the control and by each other effect, by name.
        kinetic_peak: Largest K between the samples that is known.
        stored: Of effects with states, by name: what these hold of the energy that their work took.
        cause: Why it does not close, and what to do; empty if it closes, or the cause was not looked for.
    """

    kinetic: Annotated[np.ndarray, Layout(("m",), absent=True)]
    potential: Annotated[np.ndarray, Layout(("m",), absent=True)]
    work: dict[str, Annotated[np.ndarray, Layout(("m",), absent=True)]]
    kinetic_peak: float = 0.0
    stored: dict[str, Annotated[np.ndarray, Layout(("m",))]] = field(default_factory=dict)
    cause: str = ""

    def __post_init__(self) -> None:
        read_only(self)

    def __repr__(self) -> str:
        if not self.known:
            return "<Ledger: not recorded>"
        worst = f"largest residual {largest(np.abs(self.residual)):.2e} J of {self.exchanged:.3g} J exchanged"
        return f"<Ledger: {worst}; work of {', '.join(self.work) or 'nothing'}>"

    @property
    @np.errstate(all="ignore")
    def energy(self) -> np.ndarray:
        """E = K + Σ potentials."""
        return self.kinetic + self.potential

    @property
    @np.errstate(all="ignore")  # a run that diverged may have energies that overflow
    def residual(self) -> np.ndarray:
        """E(t) − E(0) − Σ W_k(t): energy that nothing accounts for, the error of the run in energy."""
        return self.energy - self.energy[0] - sum(self.work.values(), start=np.zeros_like(self.kinetic))

    @property
    def known(self) -> bool:
        """Whether it was recorded: energies or work of rollouts may be nan throughout."""
        return not np.isnan(self.residual).all()

    @property
    @np.errstate(all="ignore")
    def exchanged(self) -> float:
        """Energy exchanged: max K + Σ ∫ |P_k|, K over steps and samples, the integrals over the samples."""
        moved = sum(float(np.nansum(np.abs(np.diff(work)))) for work in self.work.values())
        return max(largest(self.kinetic), self.kinetic_peak) + moved

    @property
    def closes(self) -> bool:
        """Whether at most a thousandth of the energy exchanged is unaccounted for, or rounding."""
        return self.rounded or not self.closure > _OPEN

    @property
    def rounded(self) -> bool:
        """Whether the residual is rounding: at most 1e-12 of the energies and the work that are added up."""
        return bool(largest(np.abs(self.residual)) <= self._rounding)

    @property
    def exchanges(self) -> bool:
        """Whether energy was exchanged, beyond rounding of the energies."""
        return self.exchanged > self._rounding

    @property
    def _rounding(self) -> float:
        parts = (self.kinetic, self.potential, *self.work.values())
        return _ROUNDING * sum(largest(np.abs(part)) for part in parts if not np.isnan(part).all())

    @property
    def closure(self) -> float:
        """Largest residual, as a part of the energy exchanged; 0 if nothing moved."""
        return largest(np.abs(self.residual)) / self.exchanged if self.exchanged > 0 else 0.0


def largest(values: np.ndarray) -> float:
    """The largest that is known; nan if none is, as in a run that ended before its first step."""
    known = values[~np.isnan(values)]
    return float(known.max()) if len(known) else float("nan")


def leak(ledger: Ledger, error: ErrorEstimate | None, q: np.ndarray) -> str:
    """The text of `Trajectory.leak`, from the ledger, the estimated error and the samples q (m, n) of a run."""
    if not ledger.closes:
        return f"it does not close: {ledger.cause or 'simulate it with its error estimate, which finds the cause'}"
    if ledger.rounded or error is None:
        return ""
    span = float(np.ptp(q, axis=0).max())
    if not span > 0 or ledger.closure <= _CONTRADICTS * max(error.largest / span, _ROUNDING):
        return ""
    why = ledger.cause or "do not trust the estimate, take a smaller step"
    return f"it does not close as well as the estimated error of q implies: {why}"
