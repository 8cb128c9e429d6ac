"""Why runs diverged, where an unstable sampled loop explains it: ρ(Φ)^(t/T) > 1e3 at the end t of a run.

Shorter steps follow the growth of such a loop more closely, and do not end it: the advice is then that on the loop.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from math import log

from robot_dyn.simulation.dynamics.stability import periods
from robot_dyn.simulation.observation.remarks import Kind, Remark, lines
from robot_dyn.simulation.run.outcome import Ending, Outcome
from robot_dyn.simulation.setup.setup import Setup

_EXPLAINS = 1e3  # growth of deviations


def explained(outcome: Outcome, setup: Setup, remarks: Iterable[Remark]) -> Outcome:
    """The outcome of a run; if it diverged and a remark on its loop explains it, with that as advice."""
    if outcome.ending is not Ending.DIVERGED or setup.controller is None:
        return outcome
    for remark in remarks:
        if remark.kind is Kind.UNSTABLE:
            elapsed = periods(outcome.t, setup.controller.period_s)
            if elapsed * log(remark.value) > log(_EXPLAINS):
                return replace(outcome, advice=lines([remark])[0])
    return outcome
