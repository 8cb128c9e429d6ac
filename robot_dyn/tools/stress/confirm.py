"""Runs that confirm a limit of stability: from near an equilibrium, 0.98 of it stays and 1.02 of it goes.

growth = max ‖√M_ii δq_i‖ in the second half of the run / ‖√M_ii δq_i‖ at its start
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import final

import numpy as np

from robot_dyn import Setup, Trajectory, simulate
from robot_dyn.report import Budget
from robot_dyn.simulation import Ending

WITHIN, BEYOND = 0.98, 1.02  # of a limit
MOST = 1e3  # by which a push may grow within a limit, as the advisor counts it
LEFT = 10.0  # a run whose push grows by more, of itself and of what it does within the limit, has left
PUSH = 1e-6  # of the start, in [rad] or [m] of the joint of median inertia
RATE = 1e3  # [1/s]: that times as much in [rad/s] or [m/s] at most, as motions that are faster move less
LEAST = 0.3  # of the true error: an estimate below misleads


def pushed(setup: Setup, matrix: np.ndarray, seed: int) -> Setup:
    """The setup with its start moved off the equilibrium: along what grows fastest, and a little along all positions.

    Args:
        setup: At an equilibrium.
        matrix: Of (q, v, ...) from a step or tick to the next: its largest eigenvalue is of what grows fastest.
        seed: Of the other positions.
    """
    n = len(setup.q0)
    units = np.sqrt(np.diagonal(setup.plant.dynamics.M(setup.q0)))
    values, modes = np.linalg.eig(matrix)
    mode = np.real(modes[:, np.argmax(np.abs(values))])
    q, v = mode[:n] * units, mode[n : 2 * n] * units
    size = PUSH * np.median(units) / max(np.linalg.norm(q), np.linalg.norm(v) / RATE)
    others = np.random.default_rng(seed).normal(size=n)
    q = size * (q + 0.1 * np.linalg.norm(q) * others / np.linalg.norm(others))
    return replace(setup, q0=setup.q0 + q / units, v0=setup.v0 + size * v / units)


@final
@dataclass(frozen=True)
class PushedRun:
    """What a run from near an equilibrium did, and what it reports about itself.

    Attributes:
        growth: As above; inf if the run ended before its time.
        misleads: Whether it has left an equilibrium that the motion does not leave, and reports nothing of it.
        description: Both as text.
    """

    growth: float
    misleads: bool
    description: str

    @property
    def stays(self) -> bool:
        """Whether it stays near the equilibrium."""
        return self.growth < MOST

    def leaves(self, within: PushedRun) -> bool:
        """Whether it leaves the equilibrium, and a run within the limit does not."""
        return self.growth > LEFT * max(within.growth, 1.0)


def run_from_near(setup: Setup, at: np.ndarray, budget: Budget, numerical: bool = False) -> PushedRun:
    """Run a setup and look how far it goes from an equilibrium.

    Args:
        setup: From near the equilibrium.
        at: The equilibrium, (n,).
        budget: Of the run.
        numerical: Whether only errors of the method can make it go, so that its error estimate is looked at.

    Raises:
        OvertimeError: If the budget ends.
    """
    run = simulate(replace(setup, estimate_error=numerical), on_progress=budget.check)
    units = np.sqrt(np.diagonal(setup.plant.dynamics.M(at)))
    with np.errstate(over="ignore"):  # a run that diverged may be off by inf
        off = np.linalg.norm((run.q - at) * units, axis=1)
    late = off[run.t >= run.t[-1] / 2]
    finished = run.outcome.ending is Ending.FINISHED and bool(np.isfinite(late).all())
    growth = float(late.max() / np.linalg.norm((setup.q0 - at) * units)) if finished else float("inf")
    how = f"{run.outcome.ending} at {run.outcome.t:.3g} s" if not finished else f"the push grew {growth:.2g}-fold"
    said = says(run)
    silent = numerical and finished and growth > LEFT and not said and not _estimates(run, at)
    return PushedRun(growth, silent, f"{how}{f' ({said})' if said else ''}")


def says(run: Trajectory) -> str:
    """What a run says against itself, or of what it met; empty if its summary is clean."""
    description = [str(kind).replace("_", " ") for kind in dict.fromkeys(each.kind for each in run.remarks)]
    if run.error is not None and run.error.note:
        until = run.error.until_s
        description.append(f"error told up to {until:.3g} s only" if until else "no error told")
    if "does not close" in run.summary:
        description.append("the ledger does not close")
    return ", ".join(description)


def _estimates(run: Trajectory, at: np.ndarray) -> bool:
    """Whether the error estimate admits that the run is off by as much as it is."""
    return run.error is not None and run.error.largest >= LEAST * float(np.abs(run.q - at).max())
